"""Families: on what a gap depends, before what it is called; their evidence.

**Hypotheses.** A family is a *place* (the tip, a joint, the force) and an *input* of the link (time in the
run, own torque, force by place, …: `effects.dependence.Dependence`). It says that what is left of a link is a
function of that input at that place, of whatever form:

    r = B·w + T·δ + N·b + e,    w ~ N(0, a²·Λ),    δ ~ N(0, prior_sizes²·I),    b ~ N(0, I) within its bounds

with r the whitened residual, T the tangents of the effects that are in the model, N nuisance (all as in
`gcode2krl.gap.posterior`), and B the columns of the functions: hats over the range of the input, whose
covariance Λ has a length scale; low polynomials of place; play operators of several widths; harmonics. Rows
are whitened first and then averaged over blocks of time, which keeps the power of all that is slower.

**Evidence.** With <., .> the inner products under the inverse covariance of T·δ + N·b + e, G = <B, B> and g =
<B, r>,

    log p(r | a, Λ) - log p(r | nothing) = -½·log det(I + a²·Λ·G) + ½·gᵀ·(G + (a²·Λ)⁻¹)⁻¹·g

the mean of whose exponential over a grid of amplitudes a and length scales is the evidence of the family.
Nuisance at its bounds is held there: the second term is then half the fall of chi2 with bounded b.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lu_factor, lu_solve
from scipy.sparse import csr_array

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.effects.dependence import Dependence
from gcode2krl.gap.compare.interpolation import usual_step_s
from gcode2krl.gap.compare.trace import Trace, stretches_of_all
from gcode2krl.gap.components import Place
from gcode2krl.gap.noise.slow import sums_between
from gcode2krl.gap.posterior.gram import SplitColumns, UsedColumns, boxed, gain_inflation
from gcode2krl.gap.posterior.likelihood import Likelihood
from gcode2krl.gap.thresholds import THRESHOLDS


class Rows:
    """Blocks of the whitened values of all traces, component after component.

    A block is the sum of its values over the root of their number: white noise of unit variance stays that.
    """

    def __init__(self, likelihood: Likelihood) -> None:
        self.likelihood, self.traces = likelihood, likelihood.traces
        self.starts = [_block_starts(trace) for trace in self.traces]
        """First rows of the blocks of each trace."""
        stretches = self._of_values(stretches_of_all(self.traces))
        self.members = _members(stretches)
        """(g, v) 1 where a block belongs to a stretch of time."""
        self.components: Ints = self._of_values(
            np.concatenate([np.repeat(np.arange(k), n) for n, k in (trace.shape for trace in self.traces)])
        )
        """(v,) the component of each block."""
        counts = [trace.shape[1] * len(at) for trace, at in zip(self.traces, self.starts, strict=True)]
        self.runs: Ints = np.repeat(np.arange(len(counts)), counts)
        """(v,) the number of each block's trace."""
        self.nuisance = self._nuisance()
        """(v, m) N."""

    def __len__(self) -> int:
        return len(self.components)

    @property
    def step_s(self) -> float:
        """Return the time between blocks."""
        return usual_step_s(self.traces[0].time_s[self.starts[0]])

    def of(self, columns: Sequence[Floats], component: int | None = None) -> Floats:
        """Return columns (k, n, c) of each trace whitened and in blocks, (v, c).

        With ``component`` they are (1, n, c) of that one, and so are the blocks.
        """
        used = range(len(self.likelihood.noise)) if component is None else (component,)
        blocks = [
            self._blocks(number, j, values)
            for number, of_trace in enumerate(columns)
            for j, values in zip(used, of_trace, strict=True)
        ]
        return np.concatenate(blocks)

    def _nuisance(self) -> SplitColumns:
        columns = [
            UsedColumns(self._in_blocks(number, used.values), used.at)
            for number, of_trace in enumerate(self.likelihood.whitened_nuisance)
            for used in of_trace
        ]
        return SplitColumns.of_parts(columns, self.likelihood.design.width)

    def _blocks(self, number: int, component: int, values: Floats) -> Floats:
        """Return the blocks of columns (n, c) of one trace; what is zero stays zero."""
        used = np.asarray(values.any(axis=0))
        if used.all():
            return self._averaged(number, component, values)
        blocks = np.zeros((len(self.starts[number]), len(used)))
        if used.any():
            blocks[:, used] = self._averaged(number, component, values[:, used])
        return blocks

    def _averaged(self, number: int, component: int, values: Floats) -> Floats:
        return self._in_blocks(number, self.likelihood.white(number, component, values))

    def _in_blocks(self, number: int, white: Floats) -> Floats:
        starts = self.starts[number]
        if len(starts) == len(white):
            return white
        edges = np.append(starts, len(white))
        return sums_between(white, edges) / np.sqrt(np.diff(edges))[:, None]

    def _of_values(self, numbers: Ints) -> Ints:
        """Return the number (v,) of each block's first value."""
        ends = np.cumsum([trace.measured.size for trace in self.traces])[:-1]
        parts = []
        for trace, starts, of_trace in zip(self.traces, self.starts, np.split(numbers, ends), strict=True):
            n, k = trace.shape
            parts.append(of_trace.reshape(k, n)[:, starts].ravel())
        return np.concatenate(parts)


def _block_starts(trace: Trace) -> Ints:
    """Return the first rows of blocks; none reaches over a gap of the data."""
    step_s = usual_step_s(trace.time_s)
    length = max(1, int(1.0 / (THRESHOLDS.posterior.rows_hz * step_s) + 1e-6))
    return np.concatenate([np.arange(first, last, length) for first, last in trace.segments])


def _members(stretches: Ints) -> csr_array:
    names, at = np.unique(stretches, return_inverse=True)
    return csr_array((np.ones(len(at)), (at, np.arange(len(at)))), shape=(len(names), len(at)))


_PRIOR = THRESHOLDS.posterior.prior_sizes**-2
_LEAST_SAYING = 3
"""Components: fewer cannot outvote one that has an effect."""
_MEDIAN_VARIANCE = float(np.pi / 2.0)
"""Of a median of normal values, over that of their mean (Kenney & Keeping 1962)."""
_MOVED_BY = (0.05, 0.95)
"""Shares of a run by which its residual is moved."""
_KNOWN = 0.1
"""Of the variance before any data, the most that is left of what a component knows."""


@dataclass(frozen=True, eq=False)
class View:
    """Blocks of r (v,) with some effects in the model, of their tangents T (v, t) and of N (v, m)."""

    residual: Floats
    tangents: Floats
    nuisance: SplitColumns
    members: csr_array
    """(g, v) 1 where a block belongs to a stretch of time."""
    components: Ints
    """(v,) the component of each block."""
    runs: Ints
    """(v,) the number of the run of each block."""
    kept: tuple[int, ...] | None = None
    """Which of the link's nuisance are in N; None: all."""

    @classmethod
    def of(cls, rows: Rows, residuals: Sequence[Floats], tangents: Sequence[Floats]) -> "View":
        """Return the view of residuals (n, k) with tangents (k, n, t) of the effects in the model."""
        residual = rows.of([each.T[:, :, None] for each in residuals])[:, 0]
        return cls(residual, rows.of(tangents), rows.nuisance, rows.members, rows.components, rows.runs)

    def beside(self, residual: Floats, tangents: Floats) -> "View":
        """Return the view of the same rows with another residual (v,) and other tangents (v, t)."""
        return replace(self, residual=residual, tangents=tangents)

    @cached_property
    def _of_component(self) -> dict[int | None, "View"]:
        return {None: self}

    def at(self, component: int | None) -> "View":
        """Return the view of one component alone; clocks, which couple joints, are what the others say.

        One joint alone would take an effect of its own, a lag, for the clock of all.
        """
        if component is not None and component not in self._of_component:
            said, deviation = self._said_beside(component)
            known = self._used(component) & ~np.isnan(said)
            alone = self._of_rows(component, self._used(component) & ~known)
            columns = self._of_rows(component, known).fixed.dense
            unsure = columns * (deviation[known] * _PRIOR**0.5)  # tangents have that wide prior
            self._of_component[component] = replace(
                alone,
                residual=alone.residual - columns @ said[known],
                tangents=np.concatenate([alone.tangents, unsure], axis=1),
            )
        return self._of_component[component]

    def _used(self, component: int) -> Bools:
        """Return which of T and N (t + m,) are not zero in a component."""
        return self.fixed.used(self.components == component)

    def _of_rows(self, component: int, columns: Bools) -> "View":
        """Return the view of a component's rows with some of T and N (t + m,)."""
        rows, t = self.components == component, self.tangents.shape[1]
        return View(
            self.residual[rows],
            self.tangents[np.ix_(rows, columns[:t])],
            self.nuisance.of(rows, columns[t:]),
            self.members[:, np.flatnonzero(rows)],
            self.components[rows],
            self.runs[rows],
            tuple(np.flatnonzero(columns[t:]).tolist()),
        )

    @cached_property
    def _said(self) -> tuple[Floats, Floats]:
        """(k, t + m) what each component alone says of δ and b, and how sure; nan of what it hardly knows."""
        said = np.full((int(self.components.max()) + 1, self.fixed.shape[1]), np.nan)
        deviation = said.copy()
        for component in range(len(said)):
            used = self._used(component)
            alone = self._of_rows(component, used)
            variance = np.diag(alone.solved(np.eye(int(used.sum()))))
            is_known = variance * alone._precision < _KNOWN  # of the variance before any data
            said[component, used] = np.where(is_known, alone.solved(alone.cross), np.nan)
            deviation[component, used] = np.where(is_known, variance**0.5, np.nan)
        return said, deviation

    def _said_beside(self, component: int) -> tuple[Floats, Floats]:
        """Return the middle one (t + m,) of what the others say, and its deviation; nan where few do.

        One with an effect of its own is outvoted. A lag of each joint's own, within its bounds, lets each say
        another clock: the middle one is as unsure as they are.
        """
        said, deviation = (np.delete(each, component, axis=0) for each in self._said)
        count = np.sum(~np.isnan(said), axis=0)
        many = count >= _LEAST_SAYING
        middle, unsure = np.full(said.shape[1], np.nan), np.full(said.shape[1], np.nan)
        middle[many] = np.nanmedian(said[:, many], axis=0)
        unsure[many] = np.nanmedian(deviation[:, many], axis=0) * (_MEDIAN_VARIANCE / count[many]) ** 0.5
        return middle, unsure

    @cached_property
    def fixed(self) -> SplitColumns:
        """(v, t + m) F: T and N."""
        return replace(self.nuisance, whole=self.tangents)

    @cached_property
    def _precision(self) -> Floats:
        """(t + m,) of the priors of δ and b."""
        precision: Floats = np.r_[np.full(self.tangents.shape[1], _PRIOR), np.ones(self.nuisance.shape[1])]
        return precision

    @cached_property
    def _normal(self) -> Floats:
        """(t + m) squared: H = Fᵀ·F with the priors."""
        return self.fixed.gram + np.diag(self._precision)

    @cached_property
    def _factors(self) -> tuple[Floats, Ints]:
        factors: tuple[Floats, Ints] = lu_factor(self._normal)
        return factors

    def solved(self, right: Floats) -> Floats:
        """Return H⁻¹ times right sides (t + m, …)."""
        return np.asarray(lu_solve(self._factors, right), dtype=np.float64) if len(right) else right

    @cached_property
    def cross(self) -> Floats:
        """(t + m,) Fᵀ·r."""
        return self.residual @ self.fixed

    @cached_property
    def projected(self) -> Floats:
        """(v,) r without what unbounded tangents and nuisance explain."""
        return self.residual - self.fixed @ self.solved(self.cross)

    def without_fixed(self, columns: Floats) -> Floats:
        """Return columns (v, c) without what tangents and nuisance explain of them."""
        return columns - self.fixed @ self.solved((columns.T @ self.fixed).T)

    def by_stretch(self, values: Floats) -> csr_array:
        """Return what sums columns, times values (v,), over each stretch of time, (g, v)."""
        at = self.members.indices
        return csr_array((self.members.data * values[at], at, self.members.indptr), shape=self.members.shape)

    @cached_property
    def fixed_scores(self) -> Floats:
        """(g, t + m) sums over stretches of F times the projected residual."""
        sums: Floats = self.by_stretch(self.projected) @ self.fixed
        return sums

    @cached_property
    def moved(self) -> Floats:
        """(moves, v) the projected residual, each run's moved in time, around its end, and of either sign.

        The noise of a tracker or a force sensor knows no moment of the command: so moved it is as probable.
        """
        generator = np.random.default_rng(0)
        runs = int(self.runs.max(initial=0)) + 1
        moves = THRESHOLDS.posterior.moves
        shares = generator.uniform(*_MOVED_BY, (moves, runs))
        signs = np.where(generator.random((moves, runs)) < 0.5, -1.0, 1.0)
        moved = np.empty((moves, len(self.projected)))
        begins = np.flatnonzero(np.diff(self.runs, prepend=-1) | np.diff(self.components, prepend=-1))
        for first, last in zip(begins, [*begins[1:], len(self.runs)], strict=True):
            residual, run = self.projected[first:last], self.runs[first]
            by = np.round(shares[:, run] * len(residual)).astype(np.int64)
            # all components of a run together: what moves them at once does so then, too
            moved[:, first:last] = (
                signs[:, [run]] * residual[(np.arange(len(residual)) - by[:, None]) % len(residual)]
            )
        return moved

    @cached_property
    def moved_cross(self) -> Floats:
        """(moves, t + m) Fᵀ times each."""
        return self.moved @ self.fixed

    @cached_property
    def chi2(self) -> float:
        """Chi2 of the blocks, nuisance within its bounds."""
        width = self.fixed.shape[1]
        return self.bounded(np.zeros((0, 0)), np.zeros((0, width)), np.zeros(0))[0]

    def bounded(self, gram: Floats, fixed: Floats, scores: Floats) -> tuple[float, Floats]:
        """Return chi2 with the weights of columns B of unit variance at their best, and these (c,).

        Of the columns Bᵀ·B (c, c), Bᵀ·F (c, t + m) and Bᵀ·r (c,). Nuisance stays within its bounds.
        """
        t, c = self.tangents.shape[1], len(gram)
        free = np.zeros((t + c, t + c))
        free[:t, :t], free[:t, t:] = self._normal[:t, :t], fixed[:, :t].T
        free[t:, :t], free[t:, t:] = fixed[:, :t], gram + np.eye(c)
        right = np.zeros((t + c, 1 + len(self._normal) - t))
        right[:t, 0], right[:t, 1:] = self.cross[:t], self._normal[:t, t:]
        right[t:, 0], right[t:, 1:] = scores, fixed[:, t:]
        half = np.linalg.solve(free, right) if t + c else right
        cost = self._normal[t:, t:] - right[:, 1:].T @ half[:, 1:]
        pull = self.cross[t:] - right[:, 1:].T @ half[:, 0]
        b = boxed(cost, pull)
        unexplained = float(self.residual @ self.residual - right[:, 0] @ half[:, 0])
        chi2 = unexplained - 2.0 * float(b @ pull) + float(b @ cost @ b)
        return chi2, (half[:, 0] - half[:, 1:] @ b)[t:]


@dataclass(frozen=True, eq=False)
class Columns:
    """Whitened columns (v, c) in blocks, for views of the same rows."""

    values: Floats
    _on_nuisance: dict[tuple[int, ...] | None, Floats] = field(default_factory=dict, init=False)

    def __len__(self) -> int:
        return int(self.values.shape[1])

    @cached_property
    def gram(self) -> Floats:
        """(c, c) Bᵀ·B."""
        return self.values.T @ self.values

    def on_nuisance(self, view: View) -> Floats:
        """Return Bᵀ·N (c, m); views that keep the same nuisance share it."""
        if view.kept not in self._on_nuisance:
            self._on_nuisance[view.kept] = self.values.T @ view.nuisance
        return self._on_nuisance[view.kept]


class Beside:
    """Columns beside the tangents and the nuisance F = [T, N] of a view: P = B - F·H⁻¹·Fᵀ·B."""

    def __init__(self, view: View, columns: Columns) -> None:
        self.view, self.columns = view, columns
        self.fixed: Floats = np.concatenate(
            [columns.values.T @ view.tangents, columns.on_nuisance(view)], axis=1
        )
        """(c, t + m) Bᵀ·F."""
        self.taken = view.solved(self.fixed.T)
        """(t + m, c) H⁻¹·Fᵀ·B."""
        self.on_residual: Floats = columns.values.T @ view.residual
        """(c,) Bᵀ·r."""

    @property
    def gram(self) -> Floats:
        """(c, c) Bᵀ·P."""
        return self.columns.gram - self.fixed @ self.taken

    @property
    def score(self) -> Floats:
        """(c,) Pᵀ·r."""
        return self.on_residual - self.taken.T @ self.view.cross

    @property
    def scores(self) -> Floats:
        """White's scores (g, c) of P by stretches of time."""
        view = self.view
        scores: Floats = (
            view.by_stretch(view.projected) @ self.columns.values - view.fixed_scores @ self.taken
        )
        return scores

    @property
    def moved_scores(self) -> Floats:
        """Return Pᵀ times the residuals that are moved in time (shifts, c)."""
        return self.view.moved @ self.columns.values - self.view.moved_cross @ self.taken

    def explained(self, weights: Floats) -> Floats:
        """Return P times weights (c,), (v,)."""
        return self.columns.values @ weights - self.view.fixed @ (self.taken @ weights)

    def scores_without(self, explained: Floats) -> Floats:
        """Return White's scores (g, c) with what is explained (v,) taken off the residual."""
        view = self.view
        by_stretch = view.by_stretch(view.projected - explained)
        scores: Floats = by_stretch @ self.columns.values - (by_stretch @ view.fixed) @ self.taken
        return scores


AMPLITUDES = np.array(THRESHOLDS.posterior.amplitudes)
_RANK = 1e-9
"""Eigenvalues below this share of the largest hold rounding errors only."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """What a family says of a view."""

    place: Place
    on: Dependence
    nats: float
    """Log of its evidence over that of nothing, for independent rows."""
    gain: float
    """Fall of chi2 at the best amplitude."""
    inflation: float
    """By how much a gain varies more than white noise lets it."""
    flipped: Floats
    """(flips,) its log evidence where the signs of stretches are random, and ``unbounded`` with their own."""
    unbounded: float
    said: tuple[NDArray[np.float32], ...]
    """(n, k) what it says of each trace; k = 1 where it is of one component alone. A link has hundreds."""
    at: tuple[int, float] | None = None
    """Run number and time of a step, or -1 and the frequency in Hz of a tone."""
    stays: bool = True
    """A step is in later runs, too."""
    in_one: float = 0.0
    """Of its gain, the share of one stretch of time at most: a sample at a sharp corner may have it all."""

    @property
    def signal(self) -> tuple[Floats, ...]:
        """Return what it says of each trace, (n, k)."""
        return tuple(each.astype(np.float64) for each in self.said)

    @property
    def key(self) -> tuple[str, Dependence]:
        """Return where and on what."""
        return self.place.name, self.on

    @property
    def told(self) -> tuple[str, Dependence]:
        """Return the same as an answer tells it: a step is a form of what happens over time."""
        is_step = self.on is Dependence.RUN_TIME_STEP
        return self.place.name, Dependence.RUN_TIME if is_step else self.on


def evidence_of(
    view: View,
    place: Place,
    on: Dependence,
    raw: Sequence[Floats],
    columns: Columns,
    roots: Sequence[Floats],
    signs: Floats,
    at: tuple[int, float] | None = None,
    cost: float = 0.0,
) -> Evidence | None:
    """Return the evidence of columns with one of some covariances; None where nothing is observable.

    ``raw`` (k, n, c) of each trace are the same columns before they were whitened.
    ``signs`` (flips, g) of stretches; ``cost`` of the search for ``at``, in nats.
    """
    projected = Beside(view, columns)
    gram, score, scores = projected.gram, projected.score, projected.scores
    best: tuple[float, int, Floats, Floats] | None = None
    flips, owns = [], []
    for values, turned in _along_roots(gram, roots):
        log_evidences = log_evidence(values, turned.T @ score)
        flips.append(log_mean(log_evidence(values, signs @ (scores @ turned))))
        owns.append(log_mean(log_evidences))
        top = int(np.argmax(log_evidences))
        if best is None or log_evidences[top] > best[0]:
            best = (float(log_evidences[top]), top, values, turned)
    if best is None:
        return None
    _, top, values, turned = best
    own_weights = turned.T @ score / (values + AMPLITUDES[top] ** -2)
    explained = projected.explained(turned @ own_weights)
    scores_left = projected.scores_without(explained) @ turned
    fit = _bounded(projected, turned, values, top)
    inverse = np.diag(1.0 / (values + fit.amplitude**-2))
    return Evidence(
        place=place,
        on=on,
        nats=fit.nats - float(np.log(len(roots))) - cost,
        gain=max(fit.gain, 0.0),
        inflation=gain_inflation(inverse, scores_left, fitted=0),
        flipped=log_mean(np.array(flips).T) - cost,
        unbounded=float(log_mean(np.array(owns))) - cost,
        said=tuple((own @ (turned @ fit.weights)).T.astype(np.float32) for own in raw),
        at=at,
        in_one=_in_one(view, explained),
    )


def _along_roots(gram: Floats, roots: Sequence[Floats]) -> Iterator[tuple[Floats, Floats]]:
    """Yield for each root what of it can be observed: eigenvalues (c',) and directions (c, c')."""
    for root in roots:
        values, vectors = np.linalg.eigh(root.T @ gram @ root)
        used = values > _RANK * max(float(values[-1]), 1e-30) if len(values) else values > 0
        if used.any() and values[-1] > 1e-9:
            yield values[used], root @ vectors[:, used]


def moved_evidence(view: View, columns: Columns, roots: Sequence[Floats]) -> Floats:
    """Return the log evidence (moves,) of columns where each run's residual is moved in time."""
    projected = Beside(view, columns)
    scores = projected.moved_scores
    log_evidences = [
        log_mean(log_evidence(values, scores @ turned))
        for values, turned in _along_roots(projected.gram, roots)
    ]
    return log_mean(np.array(log_evidences).T) if log_evidences else np.full(len(scores), -np.inf)


def _in_one(view: View, explained: Floats) -> float:
    """Return the largest share of a stretch of time in the fall of chi2 by what is explained (v,)."""
    falls = view.members @ (explained * (2.0 * view.projected - explained))
    return float(np.clip(falls.max() / max(float(falls.sum()), 1e-30), 0.0, 1.0))


class _Fit(NamedTuple):
    """Columns at their best, nuisance within its bounds."""

    nats: float
    gain: float
    amplitude: float
    weights: Floats


def _bounded(projected: Beside, turned: Floats, values: Floats, top: int) -> _Fit:
    """Return the fit of columns, turned by (c, c'), whose inner products then have these eigenvalues (c',).

    The amplitude is searched upwards from that which is best with unbounded nuisance, which explains more.
    """
    view = projected.view
    gram, fixed = turned.T @ projected.columns.gram @ turned, turned.T @ projected.fixed
    score = turned.T @ projected.on_residual
    best = _Fit(-np.inf, 0.0, 1.0, np.zeros(len(values)))
    for a in AMPLITUDES[top:]:
        chi2, weights = view.bounded(a * a * gram, a * fixed, a * score)
        fall = view.chi2 - chi2
        nats = 0.5 * fall - 0.5 * float(np.sum(np.log1p(a * a * values)))
        if nats < best.nats:
            break
        best = _Fit(nats, fall, float(a), a * weights)
    return best._replace(nats=best.nats - float(np.log(len(AMPLITUDES))))


def log_evidence(values: Floats, scores: Floats) -> Floats:
    """Return the log evidence (…, a) of each amplitude from eigenvalues (c,) and scores (…, c) along them."""
    grown = AMPLITUDES[:, None] ** 2 * values
    fall = scores**2 @ (AMPLITUDES[:, None] ** 2 / (1.0 + grown)).T
    evidence: Floats = 0.5 * fall - 0.5 * np.log1p(grown).sum(axis=-1)
    return evidence


def log_mean(values: Floats) -> Floats:
    """Return the log of the mean of exp over the last axis."""
    most = values.max(axis=-1, keepdims=True)
    mean: Floats = most[..., 0] + np.log(np.mean(np.exp(values - most), axis=-1))
    return mean
