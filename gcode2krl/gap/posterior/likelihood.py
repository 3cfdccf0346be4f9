"""The likelihood of a link's data, and its refits; model and symbols are those of `gcode2krl.gap.posterior`.

**Mismatch is counted once.** Nuisance of the form of an effect gives way while the effect is in the model.
Two columns of one form share a deviation in any way: a clock that is 3.07 ms late was fitted as 0.90 ms of
the effect and 2.17 ms of nuisance, each of which looks usual. Of nuisance that all runs share the column
goes. Of nuisance that each run has for itself what is common to all runs goes, their mean; how the runs
differ from it stays. So the effect's number is the whole deviation.

Several shared columns may have the form only together: the lag of one servo is no clock, the same lag of all
six is one. With N the shared columns and P the projection onto the span of the effect's signature, the
directions b that imitate it are eigenvectors of Nᵀ·P·N·b = λ·(NᵀN + I)·b with λ near 1; these go, and all
that is orthogonal to them stays. What they may add is allowed on top of the effect's own bound.
"""

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType

import numpy as np
from scipy import linalg

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.effects import Applied
from gcode2krl.effects.parameter import Role
from gcode2krl.errors import Gcode2KrlError
from gcode2krl.gap.compare.trace import Trace, stretches_of, stretches_of_all
from gcode2krl.gap.noise.nuisance import Candidates, Nuisance, NuisanceDesign
from gcode2krl.gap.noise.short import Noise
from gcode2krl.gap.posterior.gram import (
    MOST,
    SignatureGram,
    SplitColumns,
    UsedColumns,
    boxed,
    cluster_scores,
    gain_inflation,
    solve,
)
from gcode2krl.gap.posterior.least_squares import (
    Damped,
    Fitted,
    Numbers,
    attempted,
    derivative,
    gauss_newton,
    pattern_search,
)
from gcode2krl.gap.thresholds import THRESHOLDS

Key = tuple[str, str | None]
"""Name and target of an effect."""

NO_COUNTS: Mapping[str, float] = MappingProxyType({})
_LEFT = 1e-6
"""A direction of which a projection leaves less is gone already."""


@dataclass(frozen=True, eq=False)
class CountedOnce:
    """Which nuisance of a design gives way to which effects."""

    design: NuisanceDesign
    alike: Mapping[Key, Bools] = field(default_factory=dict)
    """Effect -> which coefficients (m,) are of the form of its signature."""
    together: Mapping[Key, Floats] = field(default_factory=dict)
    """Effect -> orthonormal directions (m, d) of shared coefficients that together have its form."""
    allowed: Mapping[Key, float] = field(default_factory=dict)
    """Effect -> its size, in typical ones, that these directions may make within their bounds."""

    @cached_property
    def _possible(self) -> bool:
        """Tell whether any nuisance is of the form of an effect."""
        of_effects = (each.block for items in self.design.nuisance for each in items)
        return bool(self.alike or self.together) or any(block is not None for block in of_effects)

    def gone(self, applied: Applied) -> Bools:
        """Return which coefficients (m,) are of the form of an effect."""
        none = np.zeros(self.design.width, dtype=np.bool_)
        return self._own(applied) | self.alike.get(applied.key, none)

    def kept(self, applied: Iterable[Applied], clocks: bool = False) -> Floats | None:
        """Return the projection (m, m) of b onto what is left of it beside effects; None where all is.

        ``clocks``: beside those of them that are clocks.
        """
        gone = np.zeros(self.design.width, dtype=np.bool_)
        together: list[Floats] = []
        for effect in applied if self._possible else ():
            if effect.effect.is_clock or not clocks:
                gone |= self.gone(effect)
            if not clocks and effect.key in self.together:
                together.append(self.together[effect.key])
        if not gone.any() and not together:
            return None
        return _beside(self._projection(gone), together)

    def allowed_sizes(self, applied: Applied) -> float:
        """Return the size of an effect, in typical ones, that usual sizes of others together may make."""
        return self.allowed.get(applied.key, 0.0)

    def _own(self, applied: Applied) -> Bools:
        """Return which coefficients (m,) are the usual size of an effect at its own target and counts."""
        names = {p.name for p in applied.effect.parameters if p.role is Role.COUNT}
        return self.own_of(applied.key, {name: applied[name] for name in names})

    def own_of(self, key: Key, counts: Mapping[str, float] = NO_COUNTS) -> Bools:
        """Return which coefficients (m,) are the usual size of an effect at its target, of some counts."""

        def is_own(item: Nuisance) -> bool:
            block = item.block
            return (
                block is not None
                and block.key == key
                and all(block.shape.get(name, value) == value for name, value in counts.items())
            )

        return self._where(is_own)

    @property
    def straight(self) -> Bools:
        """(m,) all but what an effect does beyond the first order of its size."""
        return ~self._where(lambda item: item.bent)

    def _where(self, asked: Callable[[Nuisance], bool]) -> Bools:
        """Return which coefficients (m,) are of nuisance of which something is true."""
        where = np.zeros(self.design.width, dtype=np.bool_)
        for items, places in zip(self.design.nuisance, self.design.places, strict=True):
            widths = [each.columns.shape[2] for each in items]
            where[places] |= np.repeat([asked(each) for each in items], widths).astype(np.bool_)
        return where

    def _projection(self, gone: Bools) -> Floats:
        """Return the projection (m, m): shared coefficients away, others less their mean over the runs."""
        projection = np.diag(1.0 - gone)
        for places in self.design.of_runs:
            if gone[places].any():
                projection[np.ix_(places, places)] = np.eye(len(places)) - 1.0 / len(places)
        return projection


def _beside(projection: Floats, together: list[Floats]) -> Floats:
    """Return a projection (m, m) less what it leaves of some directions (m, d)."""
    remaining = [projection @ directions for directions in together]
    if not remaining:
        return projection
    basis, sizes, _ = np.linalg.svd(np.concatenate(remaining, axis=1), full_matrices=False)
    basis = basis[:, sizes > _LEFT]
    less: Floats = projection - basis @ basis.T
    return less


def once_among(
    design: NuisanceDesign,
    candidates: Candidates,
    signatures: SignatureGram,
    bounded: Collection[Key] = (),
) -> CountedOnce:
    """Return which nuisance has the form of which candidates: what these span of it.

    Each run's own column by column; what is shared also together, for the effects with a bound, as only these
    are compared with one.
    """
    once = CountedOnce(design)
    alike: dict[Key, Bools] = {}
    together: dict[Key, Floats] = {}
    allowed: dict[Key, float] = {}
    for column in candidates.columns:
        block = column.block
        alike[block.key] = alike.get(block.key, False) | _spanned(column.index, signatures, design)
        if column.width and block.key in bounded and block.key not in together:
            others = once.straight & ~once.own_of(block.key)
            directions, sizes = _imitating(column.index, signatures, design, others)
            if directions.shape[1]:
                together[block.key], allowed[block.key] = directions, sizes
    return CountedOnce(design, {key: mask for key, mask in alike.items() if mask.any()}, together, allowed)


def _spanned(index: np.ndarray, signatures: SignatureGram, design: NuisanceDesign) -> Bools:
    """Return which coefficients (m,) of the runs' own nuisance some signatures span in every run."""
    share = np.zeros(design.width)
    for total, places in zip(signatures.totals, signatures.places, strict=True):
        inner, cross = total[np.ix_(index, index)], total[index][:, signatures.signatures :]
        whole = np.diag(total)[signatures.signatures :]
        explained = np.sum(cross * solve(inner, cross), axis=0)
        share[places] = explained / np.maximum(whole, 1e-300)
    spanned = np.zeros(design.width, dtype=np.bool_)
    for places in design.of_runs:
        spanned[places] = bool(np.all(share[places] >= THRESHOLDS.posterior.same_form))
    return spanned


def _imitating(
    index: np.ndarray, signatures: SignatureGram, design: NuisanceDesign, others: Bools
) -> tuple[Floats, float]:
    """Return directions (m, d) of shared nuisance that some signatures span, and the size they may make."""
    at = np.flatnonzero(others[: design.shared])
    inner = np.zeros((len(index), len(index)))
    cross, gram = np.zeros((len(index), design.width)), np.zeros((design.width, design.width))
    for total, places in zip(signatures.totals, signatures.places, strict=True):
        inner += total[np.ix_(index, index)]
        cross[:, places] += total[index][:, signatures.signatures :]
        gram[np.ix_(places, places)] += total[signatures.signatures :, signatures.signatures :]
    if not len(at):
        return np.zeros((design.width, 0)), 0.0
    made = solve(inner, cross[:, at])
    shares, vectors = linalg.eigh(cross[:, at].T @ made, gram[np.ix_(at, at)] + np.eye(len(at)))
    imitating = vectors[:, shares >= THRESHOLDS.posterior.same_form]
    directions = np.zeros((design.width, imitating.shape[1]))
    directions[at] = np.linalg.qr(imitating)[0]
    within = MOST / np.maximum(np.abs(imitating).max(axis=0, initial=0.0), 1e-300)
    return directions, float(np.abs(made[0] @ imitating * within).sum())


STEP_SHARE = 0.02
"""Differences are over this share of a typical size: within the linear range of effects, above rounding."""


class Likelihood:
    """Whitened data of all traces, with b at its best within its bounds.

    Vectors (v,) hold the values of all traces, component after component; marginal residuals (v + m,) hold
    L⁻¹·(r - N·b) and behind it b, so that their squared length is chi2.
    """

    def __init__(
        self, traces: Sequence[Trace], nuisance: Sequence[Sequence[Nuisance]], noise: Sequence[Noise]
    ) -> None:
        self.traces, self.noise = tuple(traces), tuple(noise)
        self.design = NuisanceDesign.of(nuisance)
        self._sure = [_sure(trace, own, self.noise) for trace, own in zip(self.traces, nuisance, strict=True)]
        """(k, n) of each trace"""
        self.once = CountedOnce(self.design)
        self._normal = np.eye(self.design.width)
        for used in (each for own in self.whitened_nuisance for each in own):
            self._normal[np.ix_(used.at, used.at)] += used.values.T @ used.values

    @cached_property
    def whitened_nuisance(self) -> list[list[UsedColumns]]:
        """Of each trace and component."""
        return [
            [
                self._used(number, j, columns, self.design.places[number])
                for j, columns in enumerate(self.design.columns(number, trace))
            ]
            for number, trace in enumerate(self.traces)
        ]

    def put_away(self) -> "Likelihood":
        """Return the likelihood of a link that is judged: its large columns are made again if asked for."""
        other = copy(self)
        other.__dict__.pop("whitened_nuisance", None)  # what `cached_property` keeps, if it is there
        return other

    def counting(self, once: CountedOnce) -> "Likelihood":
        """Return the likelihood in which more nuisance gives way to effects of the same form."""
        other = copy(self)
        other.once = once
        return other

    # Data and models as vectors

    def white(self, number: int, component: int, columns: Floats) -> Floats:
        """Return L⁻¹ times columns (n, c) of a component of a trace, by its number."""
        white = self.noise[component].whiten(columns, self.traces[number].segments)
        sure = self._sure[number]
        return white if sure is None else white * sure[component, :, None]

    def _whitened(self, number: int, columns: Floats) -> Floats:
        """Return L⁻¹ times columns (k, n, c) of a trace, (k·n, c)."""
        return np.concatenate([self.white(number, j, own) for j, own in enumerate(columns)])

    def whiten(self, values: Sequence[Floats]) -> Floats:
        """Return L⁻¹ times values (n, k) of all traces, (v,)."""
        columns = [value.T[:, :, None] for value in values]
        return np.concatenate([self._whitened(number, own)[:, 0] for number, own in enumerate(columns)])

    @cached_property
    def clusters(self) -> Ints:
        """(v,) the stretch of time of each value."""
        return stretches_of_all(self.traces)

    def _split(self, vectors: Floats) -> list[Floats]:
        """Return the rows of vectors (v, …) that belong to each trace."""
        ends = np.cumsum([trace.measured.size for trace in self.traces])
        return np.split(vectors, ends[:-1])

    def _used(self, number: int, component: int, columns: Floats, places: Ints) -> UsedColumns:
        """Return the columns (n, c) of a component that are not zero, whitened, and their places of (c,)."""
        used = np.flatnonzero(columns.any(axis=0))
        return UsedColumns(self.white(number, component, columns[:, used]), np.asarray(places)[used])

    # Nuisance

    def _projections(self, whitened: Floats) -> Floats:
        """Return Nᵀ·y (m, …) of whitened vectors (v, …)."""
        sums = np.zeros((self.design.width, *whitened.shape[1:]))
        for of_trace, columns in zip(self._split(whitened), self.whitened_nuisance, strict=True):
            for values, used in zip(np.split(of_trace, len(columns)), columns, strict=True):
                sums[used.at] += used.values.T @ values
        return sums

    def _explained(self, b: Floats) -> Floats:
        """Return L⁻¹·N·b (v, …)."""
        return np.concatenate([used.values @ b[used.at] for own in self.whitened_nuisance for used in own])

    def nuisance_of(self, whitened: Floats, applied: Sequence[Applied] = ()) -> Floats:
        """Return b (m,), within its bounds, that fits a whitened vector (v,) best beside some effects."""
        return self._nuisance(self._projections(whitened), applied)

    def _nuisance(self, projections: Floats, applied: Sequence[Applied]) -> Floats:
        """Return b (m,) of a vector by its projections Nᵀ·y (m,)."""
        kept, normal = self.once.kept(applied), self._normal
        if kept is None:
            return boxed(normal, projections)
        return kept @ boxed(_kept_normal(kept, normal), kept @ projections)

    def marginal(self, whitened: Floats, applied: Sequence[Applied] = ()) -> Floats:
        """Return the marginal residual (v + m,) of a whitened vector."""
        b = self.nuisance_of(whitened, applied)
        return np.concatenate([whitened - self._explained(b), b])

    def projected(self, whitened: Floats, applied: Sequence[Applied] = ()) -> Floats:
        """Return the marginal residuals (v + m, c) of vectors (v, c) for unbounded nuisance.

        Nuisance of the form of an effect stays in, as what the effect's number is unsure by; but that of a
        clock, which runs show by how they differ.
        """
        kept, normal = self.once.kept(applied, clocks=True), self._normal
        projections = self._projections(whitened)
        if kept is not None:
            normal, projections = _kept_normal(kept, normal), kept @ projections
        b = np.asarray(np.linalg.solve(normal, projections), dtype=np.float64)
        return np.concatenate([whitened - self._explained(b if kept is None else kept @ b), b])

    def own_alike(self, applied: Applied) -> bool:
        """Tell whether nuisance that each run has for itself is of the form of an effect."""
        return bool(self.once.gone(applied)[self.design.shared :].any())

    @property
    def split_nuisance(self) -> SplitColumns:
        """(v, m) N, whitened."""
        columns = [used for own in self.whitened_nuisance for used in own]
        return SplitColumns.of_parts(columns, self.design.width)

    def own_nuisance(self, applied: Applied) -> SplitColumns:
        """Return the whitened columns (v, m) of the runs' own nuisance but for that of an effect's form."""
        kept = ~self.once.gone(applied)
        kept[: self.design.shared] = False
        return self.split_nuisance.of(np.ones(len(self.clusters), dtype=np.bool_), kept)

    # Effects

    def residual(self, applied: Sequence[Applied]) -> Floats:
        """Return the marginal residual (v + m,) with some effects."""
        whitened = self.whiten([trace.measured - trace.sample(applied) for trace in self.traces])
        return self.marginal(whitened, applied)

    def chi2(self, applied: Sequence[Applied]) -> float:
        """Return chi2 with some effects, by inner products: N is as large as all the data."""
        y = self.whiten([trace.measured - trace.sample(applied) for trace in self.traces])
        projections = self._projections(y)
        b = self._nuisance(projections, applied)
        return float(y @ y - 2.0 * b @ projections + b @ self._normal @ b)

    def tangents(self, numbers: Numbers, x: Floats, without: Collection[int] = ()) -> list[Floats]:
        """Return ∂f/∂θ (k, n, p) of each trace, in typical sizes, of all effects but some."""
        moving = numbers.without(without)
        shapes = [trace.shape for trace in self.traces]

        def model(at: Floats) -> Floats:
            applied = numbers.applied(at)
            return np.concatenate([trace.sample(applied).T.ravel() for trace in self.traces])

        slopes = derivative(model, x, model(x), numbers.box.steps(x, STEP_SHARE), moving)
        slopes = slopes * numbers.box.scale[moving]
        return [own.reshape(k, n, -1) for own, (n, k) in zip(self._split(slopes), shapes, strict=True)]

    def jacobian(self, numbers: Numbers, x: Floats, bounded: bool = True) -> Floats:
        """Return the derivative (v + m, p) of the marginal residual, in typical sizes.

        ``bounded``: nuisance at its bounds stays there. If not, its uncertainty is part of that of θ.
        """
        if bounded:

            def residual(at: Floats) -> Floats:
                return self.residual(numbers.applied(at))

            steps = numbers.box.steps(x, STEP_SHARE)
            return derivative(residual, x, residual(x), steps) * numbers.box.scale
        slopes = [self._whitened(number, own) for number, own in enumerate(self.tangents(numbers, x))]
        return self.projected(-np.concatenate(slopes), numbers.applied(x))

    def scores(self, jacobian: Floats, residual: Floats) -> Floats:
        """Return White's scores (g, p) by stretches of time; rows of b belong to none."""
        rows = len(self.clusters)
        return cluster_scores(jacobian[:rows], residual[:rows], self.clusters)

    def gram(self, signatures: Sequence[Floats]) -> SignatureGram:
        """Return the fast view of signatures (k, n, s) of each trace."""
        width = signatures[0].shape[2]
        columns = [
            [self._used(number, j, values, np.arange(width)) for j, values in enumerate(signature)]
            for number, signature in enumerate(signatures)
        ]
        stretches = [stretches_of(trace) for trace in self.traces]
        return SignatureGram(columns, self.whitened_nuisance, width, self.design.places, stretches)

    def data(self, applied: Sequence[Applied], tangents: Sequence[Floats]) -> list[Floats]:
        """Return whitened [r, T] (k·n, 1 + t) of each trace with some effects, for `SignatureGram.beside`."""
        residuals = [(trace.measured - trace.sample(applied)).T[:, :, None] for trace in self.traces]
        return [
            self._whitened(number, np.concatenate([r, t], axis=2))
            for number, (r, t) in enumerate(zip(residuals, tangents, strict=True))
        ]


def _sure(trace: Trace, nuisance: Sequence[Nuisance], noise: Sequence[Noise]) -> Floats | None:
    """Return what a row counts (k, n) beside what nuisance misses of it; None where that is nothing."""
    missed = [each.missed for each in nuisance if each.missed is not None]
    if not missed:
        return None
    sigma = np.array([each.short_sigma for each in noise])
    beyond = np.sum(np.square(missed), axis=0) / sigma**2
    sure: Floats = np.ascontiguousarray((1.0 + beyond).T ** -0.5)
    return sure if np.any(beyond) else None


def _kept_normal(kept: Floats, normal: Floats) -> Floats:
    """Return the normal matrix (m, m) of b where only a projection of it reaches the data."""
    identity = np.eye(len(normal))
    return kept @ (normal - identity) @ kept + identity


_MOST_STEPS = 12
"""Bounds the time; a fit ends earlier where chi2 settles."""
_MULTIPLES = (1.0, 0.5, 0.75, 1.25, 1.5, 2.0, 3.0)
"""Of the first order's size, which is small for an effect that saturates; the first order itself first."""
_FIRST_SEARCH_STEP = 0.3
"""In typical sizes."""
_SETTLED, _SETTLED_SHARE = 0.02, 1e-6
"""Falls of chi2, and shares of it, that move a number by far less than its deviation."""


def refit(
    likelihood: Likelihood, start: Sequence[Applied], steps: int = _MOST_STEPS, scan: bool = False
) -> Fitted:
    """Return the effects with the numbers of least chi2 within their plausible ranges.

    With ``scan`` the last effect begins at the best of some multiples of its size. Where the start cannot be
    simulated chi2 is infinite.
    """
    numbers = Numbers.of(start, likelihood.traces[0])
    x = numbers.start(start)

    def residual(at: Floats) -> Floats:
        return likelihood.residual(numbers.applied(at))

    if scan and len(x):
        x = _best_multiple(likelihood, numbers, x)
    try:
        least = gauss_newton(
            residual, x, numbers.box, Damped(numbers.box), _settled, most_steps=steps, step_share=STEP_SHARE
        )
    except Gcode2KrlError:  # there is no such tool, or no such path
        return Fitted(tuple(start), np.inf, numbers, x, np.zeros((len(x), len(x))))
    scale = numbers.box.scale
    information = least.jacobian.T @ least.jacobian * np.outer(scale, scale)
    return Fitted(numbers.applied(least.x), least.chi2, numbers, least.x, information)


def _settled(before: float, after: float) -> bool:
    return before - after < _SETTLED + _SETTLED_SHARE * after


def _best_multiple(likelihood: Likelihood, numbers: Numbers, x: Floats) -> Floats:
    """Return x with the numbers of the last effect at the best multiple; a signal may not be linear."""
    best, best_x = np.inf, x
    for factor in _MULTIPLES:
        trial = x.copy()
        trial[numbers.slices[-1]] *= factor
        trial = numbers.box.clipped(trial)
        r = attempted(lambda at: likelihood.residual(numbers.applied(at)), trial)
        if r is not None and float(r @ r) < best:
            best, best_x = float(r @ r), trial
    return best_x


def searched(likelihood: Likelihood, others: Sequence[Applied], start: Applied) -> Applied:
    """Return the effect at the numbers of least chi2 nearby, without slopes.

    For effects that plan anew: a controller's times are whole cycles, and what is flat has no slope.
    """
    numbers = Numbers.of([start], likelihood.traces[0])

    def chi2(x: Floats) -> float:
        try:
            return likelihood.chi2((*others, *numbers.applied(x)))
        except Gcode2KrlError:
            return np.inf

    x = pattern_search(chi2, numbers.start([start]), numbers.box, _FIRST_SEARCH_STEP)
    return numbers.applied(x)[0]


_RANK = 1e-9
"""Directions with less than this share of the largest information are treated as unobserved."""


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """The residual (v,) of a fit and its derivative (v, p) by the numbers of one effect.

    Derivatives are in typical sizes; what the other effects explain of them is taken out.
    """

    residual: Floats
    jacobian: Floats
    information: Floats
    """(p, p) the prior's share included."""
    clusters: Ints
    """(v,) the stretch of time of each value."""

    def inflation(self) -> float:
        """Return by how much the gain of the effect varies more than white noise lets it, at least 1."""
        inverse = np.asarray(np.linalg.pinv(self.information, rcond=_RANK, hermitian=True), dtype=np.float64)
        scores = cluster_scores(self.jacobian, self.residual, self.clusters)
        return gain_inflation(inverse, scores, fitted=self.jacobian.shape[1])

    def left_out_gain(self, before: Floats, groups: int) -> float:
        """Return the fall of chi2 from the residual ``before`` on data that the numbers were not fitted to.

        Stretches in their order make groups in which the effect does as much: a run in air tells nothing of a
        force. Each is left out in turn; the numbers then are a step away from those of the fit. Infinite
        where there are fewer stretches than groups.
        """
        before = before[: len(self.residual)]
        names, at = np.unique(self.clusters, return_inverse=True)
        power = np.cumsum(np.bincount(at, weights=(before - self.residual) ** 2))
        if len(names) < groups or power[-1] <= 0.0:
            return math.inf
        group = np.minimum((groups * (power - power[0] / 2.0) / power[-1]).astype(int), groups - 1)[at]
        return self.gain_of_left_out(before, group)

    def gain_of_left_out(self, before: Floats, group: Ints) -> float:
        """Return the fall of chi2 from the residual ``before``, groups (v,) of values left out in turn."""
        before = before[: len(self.residual)]
        return sum(self._held_out_gain(before, group == number) for number in np.unique(group))

    def _held_out_gain(self, before: Floats, held: Bools) -> float:
        """Return the fall of chi2 on held rows, with the numbers fitted to the others."""
        step = np.linalg.lstsq(self.jacobian[~held], -self.residual[~held], rcond=_RANK)[0]
        residual = self.residual[held] + self.jacobian[held] @ step
        return float(before[held] @ before[held] - residual @ residual)


def sensitivity_of(likelihood: Likelihood, fitted: Fitted, effect: int) -> Sensitivity:
    """Return the sensitivity to one effect of a fit."""
    residual = likelihood.residual(fitted.applied)
    jacobian = likelihood.jacobian(fitted.numbers, fitted.x)
    of_effect = jacobian[:, fitted.numbers.slices[effect]]
    others = jacobian[:, fitted.numbers.without((effect,))]
    if others.shape[1]:
        of_effect = of_effect - others @ np.linalg.lstsq(others, of_effect, rcond=_RANK)[0]
    rows = len(likelihood.clusters)
    return Sensitivity(residual[:rows], of_effect[:rows], of_effect.T @ of_effect, likelihood.clusters)
