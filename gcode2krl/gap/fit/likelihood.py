"""The likelihood of a link's data; the model and its symbols are in `gcode2krl.gap.fit`."""

from collections.abc import Sequence
from copy import copy
from functools import cached_property

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.effects import Applied
from gcode2krl.gap.beside.stretches import stretches_of, stretches_of_all
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.fit.box import boxed
from gcode2krl.gap.fit.clusters import cluster_scores
from gcode2krl.gap.fit.counted_once import CountedOnce
from gcode2krl.gap.fit.design import NuisanceDesign
from gcode2krl.gap.fit.fitted import Numbers
from gcode2krl.gap.fit.gram import SignatureGram, UsedColumns
from gcode2krl.gap.fit.least_squares import derivative
from gcode2krl.gap.fit.noise import Noise
from gcode2krl.gap.fit.nuisance import Nuisance
from gcode2krl.gap.fit.split_columns import SplitColumns

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
        self.whitened_nuisance = [
            [
                self._used(number, j, own, self.design.places[number])
                for j, own in enumerate(self.design.columns(number, trace))
            ]
            for number, trace in enumerate(self.traces)
        ]
        """Of each trace and component."""
        self.once = CountedOnce(self.design)
        self._normal = np.eye(self.design.width)
        for used in (each for own in self.whitened_nuisance for each in own):
            self._normal[np.ix_(used.at, used.at)] += used.values.T @ used.values

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
        for own, columns in zip(self._split(whitened), self.whitened_nuisance, strict=True):
            for values, used in zip(np.split(own, len(columns)), columns, strict=True):
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
        kept, normal = self._kept(applied), self._normal
        if kept is None:
            return boxed(normal, projections)
        free: Floats = kept @ boxed(_kept_normal(kept, normal), kept @ projections)
        return free

    def _kept(self, applied: Sequence[Applied]) -> Floats | None:
        """Return the projection (m, m) of b onto what is left of it beside effects of the same form."""
        return self.once.kept(applied)

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
        rest = self.whiten([trace.measured - trace.sample(applied) for trace in self.traces])
        return self.marginal(rest, applied)

    def chi2(self, applied: Sequence[Applied]) -> float:
        """Return chi2 with some effects, by inner products: N is as large as all the data."""
        y = self.whiten([trace.measured - trace.sample(applied) for trace in self.traces])
        projections = self._projections(y)
        b = self._nuisance(projections, applied)
        return float(y @ y - 2.0 * b @ projections + b @ self._normal @ b)

    def tangents(self, numbers: Numbers, x: Floats, without: int | None = None) -> list[Floats]:
        """Return ∂f/∂θ (k, n, p) of each trace, in typical sizes, of all effects but one."""
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

    def gram(self, signatures: Sequence[Floats]) -> "SignatureGram":
        """Return the fast view of signatures (k, n, s) of each trace."""
        width = signatures[0].shape[2]
        columns = [
            [self._used(number, j, values, np.arange(width)) for j, values in enumerate(own)]
            for number, own in enumerate(signatures)
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
    inner: Floats = kept @ (normal - identity) @ kept + identity
    return inner
