"""The slow part of an instrument's noise: what no admissible input explains and is forgotten in 0.1 to 3 s.

One component of all runs, as means over blocks of `noise_block_s`:

    y = X·β + v + w,    v Ornstein-Uhlenbeck of time constant τ and variance ρ·σ_w²,    w white

The likelihood is that of the innovations, profiled over β and σ_w. Columns of X are taken of many candidates
and from tones, those of the most surprising likelihood ratio first, each fitted together with τ and ρ: a
drift, a step or an effect is explained by its own column, of which v would have to imitate each value. What
is left is the slow part, its variance by restricted likelihood, which allows for the numbers fitted
(Patterson & Thompson 1971; Harville 1977).

**Candidates.** The inputs are those that families are made of (`gap.compare.inputs`). Noise is cleaned of
them column by column, so each is given in few simple forms: itself, half waves over its range, its reversals
and plays.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.linalg import block_diag, helmert

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.compiled.core import FLOATS, INTS, OUT_FLOATS, core_function
from gcode2krl.gap.compare.inputs import Admissible
from gcode2krl.gap.compare.interpolation import rms
from gcode2krl.gap.compare.trace import Trace
from gcode2krl.gap.noise.nuisance import Nuisance
from gcode2krl.gap.noise.short import innovation_gains, innovations
from gcode2krl.gap.thresholds import THRESHOLDS

_block_sums = core_function("gap_block_sums", FLOATS, INTS, OUT_FLOATS)


def sums_between(values: Floats, edges: Ints) -> Floats:
    """Return the sums (b, c) of values (n, c) from each edge (b + 1,) to the next, row after row.

    `np.add.reduceat` takes several times as long where columns are many.
    """
    sums = np.zeros((len(edges) - 1, values.shape[1]))
    if sums.size:
        _block_sums(np.ascontiguousarray(values, dtype=np.float64), edges, sums)
    return sums


_PLACE_WAVES, _ANGLE_WAVES = 4, 3
"""Half waves over the range of a coordinate or of a joint."""
_BENDS = (3.0, 10.0)
"""How soon an odd function of a torque is full, as shares of its range."""
_SETTLES_S = (1.0, 3.0, 10.0)
_STILL = 1e-9
"""A coordinate of less range does not move."""


def explaining_columns(traces: Sequence[Trace]) -> Iterator[list[Floats]]:
    """Yield for each component columns (n, c) of each trace, alike in all traces."""
    inputs = [Admissible(trace) for trace in traces]
    parts = [
        [np.column_stack([*_of_motion(each)]) for each in inputs],
        _waves([each.position_mm for each in inputs], _PLACE_WAVES),
        _waves([each.q_rad for each in inputs], _ANGLE_WAVES),
    ]
    if any(each.presses for each in inputs):
        parts.append([np.column_stack([*_of_force(each)]) for each in inputs])
    if len({each.temperature_C.shape[1] for each in inputs}) == 1:
        parts.append([each.temperature_C for each in inputs])
    shared = [np.column_stack(own) for own in zip(*parts, strict=True)]
    for j in range(traces[0].shape[1]):
        yield [
            np.column_stack([common, *_of_component(inputs_of_trace, j)])
            for inputs_of_trace, common in zip(inputs, shared, strict=True)
        ]


def _of_motion(inputs: Admissible) -> Iterator[Floats]:
    """Yield what any component may follow: place, angles, their rates and reversals, spindle, the start."""
    rates, velocity = inputs.rate_rad_s, inputs.velocity_mm_s
    yield from (inputs.position_mm, inputs.q_rad, rates, np.abs(rates), inputs.acceleration_rad_s2)
    yield from (inputs.directions, velocity, inputs.acceleration_mm_s2)
    yield from (np.linalg.norm(velocity, axis=1), inputs.travel_mm, inputs.spindle)
    # what settles after each start, alike in all runs
    yield np.exp(-inputs.since_start_s[:, None] / np.array(_SETTLES_S))


def _of_force(inputs: Admissible) -> Iterator[Floats]:
    """Yield the force, the same by place, and what grows with the metres cut."""
    force, position = inputs.force_N, inputs.position_mm
    yield from (force, np.linalg.norm(force, axis=1))
    yield (force[:, :, None] * position[:, None, :]).reshape(len(force), -1)
    yield from (force * inputs.cut_m[:, None], inputs.cut_m)


def _of_component(inputs: Admissible, component: int) -> Iterator[Floats]:
    """Yield what this component may follow in a way of its own: a joint its load, a tip its tool and arm."""
    trace = inputs.trace
    column = trace.columns[component]
    if trace.link.of_joints:
        torque = inputs.torque_Nm[:, column]
        yield _odd(torque)
        yield inputs.torque_with_memory(column)
        yield inputs.reversals(column)
        return
    # a constant vector that turns with the tool, as seen along this axis
    yield inputs.tool_axes[:, column % 3]
    if trace.link.of_tip:
        yield inputs.jacobian[:, column]
        yield inputs.jacobian[:, column] * inputs.torque_Nm
        yield inputs.jacobian[:, column] * inputs.directions
    else:
        yield trace.rate[:, component]
        yield inputs.with_memory[component]


def _odd(values: Floats) -> Floats:
    """Return odd functions (n, 3) of values (n,), straight and bent."""
    most = max(float(np.abs(values).max(initial=0.0)), _STILL)
    return np.stack([values, *(np.tanh(bend * values / most) for bend in _BENDS)], axis=1)


def _waves(tables: Sequence[Floats], count: int) -> list[Floats]:
    """Return half waves (n, w) of the columns of tables (n, c) over their range in all traces."""
    low = np.min([each.min(axis=0) for each in tables], axis=0)
    reach = np.max([each.max(axis=0) for each in tables], axis=0) - low
    moving = reach > _STILL
    orders = np.pi * np.arange(1, count + 1)
    scaled = [(each[:, moving] - low[moving]) / reach[moving] for each in tables]
    return [np.cos(each[:, :, None] * orders).reshape(len(each), -1) for each in scaled]


_LIMITS = THRESHOLDS.noise
_TIME_CONSTANTS_S = (0.1, 0.17, 0.3, 0.55, 1.0, 1.7, 3.0)
_RATIOS = tuple(float(x) for x in 10.0 ** np.arange(-1.0, 3.01, 0.25))
"""ρ, the variance of the slow part over that of a block's mean of the short one."""
_SHORT_KEPT = (0.0, 0.15, 0.33)
"""What a short part may keep from block to block: memories up to 45 ms are not slow."""
_COARSE = ((1, 2), (1, 6), (3, 3), (3, 8), (5, 5), (5, 10))
"""Indices of τ and ρ; where no slow part of these does better than a short one, none is looked for."""
_FLOOR_SHARE = 0.5
"""Block means that vary by less of the short part's least rms are part of that."""
_PADDED = 4
"""Finer than the frequencies of a run, between which a tone would hide."""
_LEAST_CYCLES = 1.5
"""Of a tone in the longest run: fewer are a drift."""
_RANK = 1e-9


@dataclass(frozen=True)
class SlowPart:
    """An Ornstein-Uhlenbeck process: its time constant and rms."""

    time_constant_s: float
    sigma: float


@dataclass(frozen=True, eq=False)
class BlockMeans:
    """One component of all runs, as means over blocks of time."""

    values: Floats
    """(n,)"""
    segments: Ints
    """(s, 2) blocks without a gap"""
    known: Floats
    """(n, p) what is never noise: constants and trends of each run, normal mismatch"""
    candidates: Floats
    """(n, c) what may be at work"""
    runs: tuple[tuple[int, int], ...]
    """Of each run or contrast, its first block and the one behind its last"""


_Part = tuple[int, int]
"""Indices of τ and ρ of a slow part."""


@dataclass(frozen=True)
class _Peak:
    """Where a likelihood is largest: the slow parts, and -2 log likelihood."""

    parts: tuple[_Part, ...]
    cost: float
    variance: float
    """σ_w²."""


def slow_parts_of(means: BlockMeans, floor: float = 0.0) -> tuple[SlowPart, ...]:
    """Return the slow parts of a component, none where the data need none.

    ``floor``: the least rms of its short noise; what moves by less is none.
    """
    basis = _basis(means.known)
    if len(means.values) < _LIMITS.noise_least_rows or _seen(means, basis) <= _FLOOR_SHARE * floor:
        return ()
    fit = _Learnt(means)
    if not any(fit.needs_slow(basis, fit.peak(basis, (part,)), 0.0) for part in _COARSE):
        return ()
    peak = fit.best(basis)
    if not fit.needs_slow(basis, peak):
        return ()
    seen = _seen(means, basis)
    basis, peak = _explained(fit, basis, peak)
    if not fit.needs_slow(basis, peak):
        return ()
    second = fit.best(basis, others=peak.parts)
    if peak.cost - second.cost > _LIMITS.noise_second_gain:
        # of two parts the first is found anew beside the second
        peak = fit.best(basis, others=second.parts[1:], start=second.parts[0])
    peak = fit.longest(basis, peak)
    sigmas = np.sqrt([_RATIOS[ratio] * peak.variance for _, ratio in peak.parts])
    sigmas *= min(1.0, _LIMITS.noise_most_seen * seen / float(np.linalg.norm(sigmas)))
    return tuple(
        SlowPart(_TIME_CONSTANTS_S[tau], sigma)
        for (tau, _), sigma in zip(peak.parts, sigmas.tolist(), strict=True)
    )


def _seen(means: BlockMeans, basis: Floats) -> float:
    """Return the rms of the data beside a basis: slow noise is never more, however few its waves."""
    unexplained = means.values - basis @ (basis.T @ means.values)
    return rms(unexplained)


def _explained(fit: "_Learnt", basis: Floats, peak: _Peak) -> tuple[Floats, _Peak]:
    """Return a basis with all that explains more than slow noise would, and the likelihood beside it."""
    for _ in range(_LIMITS.noise_most_explained):
        trials = [_Tried.of(fit, basis, columns, peak) for columns in fit.promising(basis, peak)]
        trial = max(trials, key=lambda each: each.surprise, default=None)
        if trial is None or trial.surprise < _LIMITS.noise_explained:
            break
        basis = _basis(np.column_stack([basis, trial.columns]))
        peak = fit.best(basis, start=_start(trial.peak))
        if not peak.parts:
            break
    return basis, peak


@dataclass(frozen=True, eq=False)
class _Filter:
    """The filter of one model of block means."""

    a: Floats
    slow: list[tuple[float, float]]
    gains: Floats
    variances: Floats
    log_determinant: float

    @classmethod
    def of(cls, segments: Ints, kept: float, slow: list[tuple[float, float]]) -> "_Filter":
        """Return the filter of a short part that keeps a share from block to block, and of slow ones."""
        a, lengths = np.array([kept]), segments[:, 1] - segments[:, 0]
        gains, variances = innovation_gains(a, 1.0, slow, int(lengths.max()))
        sums = np.concatenate([[0.0], np.cumsum(np.log(variances))])
        settled = np.minimum(lengths, len(variances))
        logs = sums[settled] + (lengths - settled) * float(np.log(variances[-1]))
        return cls(a, slow, gains, variances, float(logs.sum()))

    def applied(self, columns: Floats, segments: Ints) -> Floats:
        """Return columns (n, c) as innovations."""
        return innovations(columns, segments, self.a, self.slow, self.gains, self.variances)


@dataclass(frozen=True, eq=False)
class _White:
    """Innovations (n, p + 1) of a basis and of the data, and what the likelihood takes of them."""

    columns: Floats
    gram: Floats
    determinant: float
    """Log of that of the basis' part of the Gram matrix."""

    @classmethod
    def of(cls, columns: Floats) -> "_White":
        gram = columns.T @ columns
        return cls(columns, gram, float(np.linalg.slogdet(gram[:-1, :-1])[1]))


class _Learnt:
    """The likelihood of block means, with what was computed of it."""

    def __init__(self, means: BlockMeans) -> None:
        self.means = means
        scale = np.sqrt(np.sum(means.candidates**2, axis=0))
        self.usable = np.flatnonzero(scale > _RANK * max(float(scale.max(initial=0.0)), 1e-300))
        self._filters: dict[tuple[tuple[_Part, ...], float], _Filter] = {}
        self._short: tuple[Floats, float] | None = None
        self._basis: Floats | None = None
        self._whites: dict[tuple[tuple[_Part, ...], float], _White] = {}

    def _filter(self, parts: tuple[_Part, ...], kept: float = 0.0) -> "_Filter":
        """Return the filter of a model whose short part has innovations of unit variance."""
        if (parts, kept) not in self._filters:
            slow = [
                (
                    float(np.exp(-_LIMITS.noise_block_s / _TIME_CONSTANTS_S[tau])),
                    float(np.sqrt(_RATIOS[ratio])),
                )
                for tau, ratio in parts
            ]
            self._filters[parts, kept] = _Filter.of(self.means.segments, kept, slow)
        return self._filters[parts, kept]

    def whitened(self, columns: Floats, parts: tuple[_Part, ...]) -> Floats:
        """Return columns (n, c) as the innovations of a model."""
        return self._filter(parts).applied(columns, self.means.segments)

    def peak(
        self, basis: Floats, parts: tuple[_Part, ...], kept: float = 0.0, more: Floats | None = None
    ) -> _Peak:
        """Return the restricted likelihood of a model, at its best β and σ_w.

        It is that of the data without what a basis (n, p) explains. ``more`` (n, q) explain too; likelihoods
        with and without them are of the same data.
        """
        white = self._white(basis, parts, kept)
        gram, width, determinant = white.gram, basis.shape[1], white.determinant
        if more is not None:
            filtered = self._filter(parts, kept).applied(more, self.means.segments)
            cross = filtered.T @ white.columns
            gram = np.block(
                [
                    [gram[:width, :width], cross[:, :width].T, gram[:width, width:]],
                    [cross[:, :width], filtered.T @ filtered, cross[:, width:]],
                    [gram[width:, :width], cross[:, width:].T, gram[width:, width:]],
                ]
            )
        information, cross = gram[:-1, :-1], gram[:-1, -1]
        ridge = _RANK * np.diag(np.diag(information))
        variance = max(float(gram[-1, -1] - cross @ np.linalg.solve(information + ridge, cross)), 1e-300)
        count = len(basis) - width
        cost = count * np.log(variance / count) + self._filter(parts, kept).log_determinant + determinant
        return _Peak(parts, float(cost), variance / count)

    def _white(self, basis: Floats, parts: tuple[_Part, ...], kept: float) -> "_White":
        """Return a basis and the data as innovations, once as long as no other basis is asked for."""
        if self._basis is not basis:
            self._basis, self._whites = basis, {}
        if (parts, kept) not in self._whites:
            columns = np.column_stack([basis, self.means.values])
            white = self._filter(parts, kept).applied(columns, self.means.segments)
            self._whites[parts, kept] = _White.of(white)
        return self._whites[parts, kept]

    def best(
        self,
        basis: Floats,
        others: tuple[_Part, ...] = (),
        start: _Part = (3, 8),
        more: Floats | None = None,
    ) -> _Peak:
        """Return the largest likelihood of one slow part beside others, by steps along τ and ρ."""
        seen: dict[tuple[_Part, ...], _Peak] = {}

        def at(*own: _Part) -> _Peak:
            if own not in seen:
                seen[own] = self.peak(basis, (*own, *others), more=more)
            return seen[own]

        here, step = at(start), 4
        while step:
            better = min((at(each) for each in _neighbours(here.parts[0], step)), key=lambda peak: peak.cost)
            if better.cost < here.cost:
                here = better
            else:
                step //= 2
        none = at()
        return here if here.cost < none.cost else none

    def longest(self, basis: Floats, peak: _Peak) -> _Peak:
        """Return the longest memory that is as likely as the best one.

        Data of few waves tell σ²/τ and hardly τ; a memory that is taken too short makes the rest a gap.
        """
        (tau, ratio), others = peak.parts[0], peak.parts[1:]
        longest = peak
        for longer in range(tau + 1, len(_TIME_CONSTANTS_S)):
            grown = 4.0 * np.log10(_TIME_CONSTANTS_S[longer] / _TIME_CONSTANTS_S[tau])
            at = min(ratio + round(float(grown)), len(_RATIOS) - 1)
            trial = self.peak(basis, ((longer, at), *others))
            if trial.cost < peak.cost + _LIMITS.noise_as_likely:
                longest = trial
        return longest

    def needs_slow(self, basis: Floats, peak: _Peak, gain: float = _LIMITS.noise_slow_gain) -> bool:
        """Tell whether a slow part does better than any short one."""
        if not peak.parts:
            return False
        if self._short is None or self._short[0] is not basis:
            self._short = basis, min(self.peak(basis, (), kept=kept).cost for kept in _SHORT_KEPT)
        return self._short[1] - peak.cost >= gain

    def promising(self, basis: Floats, peak: _Peak) -> Iterator[Floats]:
        """Yield the candidate and the tone of the largest gain, beside the slow part and without one."""
        numbers, tones = set(), set()
        for parts in {peak.parts, ()}:
            x = self._white(basis, parts, 0.0).columns
            known = np.linalg.qr(x[:, :-1])[0]
            y = x[:, -1] - known @ (known.T @ x[:, -1])
            numbers |= self._largest(known, y, parts)
            tones |= self._strongest(y)
        for number in numbers:
            yield self.means.candidates[:, [number]]
        for tone in tones:
            yield self._tone(tone)

    def _largest(self, basis: Floats, y: Floats, parts: tuple[_Part, ...]) -> set[int]:
        """Return the candidate of the largest gain for whitened data y (n,), beside a whitened basis."""
        if not len(self.usable):
            return set()
        columns = self.whitened(np.ascontiguousarray(self.means.candidates[:, self.usable]), parts)
        whole = np.sum(columns**2, axis=0)
        power_left = whole - np.sum((basis.T @ columns) ** 2, axis=0)
        gain = (columns.T @ y) ** 2 / np.maximum(power_left, 1e-300)
        gain[power_left < _LIMITS.noise_least_seen * whole] = 0.0
        return {int(self.usable[int(np.argmax(gain))])}

    def _strongest(self, y: Floats) -> set[float]:
        """Return the frequency, per block, at which whitened data (n,) have the most power over all runs.

        A tone stays one in the filter; its phase is each run's own.
        """
        runs = self.means.runs
        longest = max(last - first for first, last in runs)
        count = _PADDED * longest
        spectra = [np.abs(np.fft.rfft(y[first:last], count)) ** 2 / (last - first) for first, last in runs]
        power = np.sum(spectra, axis=0)
        lowest = int(np.ceil(_LEAST_CYCLES * _PADDED))
        return {(lowest + int(np.argmax(power[lowest:]))) / count} if len(power) > lowest else set()

    def _tone(self, per_block: float) -> Floats:
        """Return sine and cosine (n, 2r) of a frequency in each run."""
        columns = np.zeros((len(self.means.values), 2 * len(self.means.runs)))
        for number, (first, last) in enumerate(self.means.runs):
            angle = 2.0 * np.pi * per_block * np.arange(last - first)
            columns[first:last, 2 * number] = np.cos(angle)
            columns[first:last, 2 * number + 1] = np.sin(angle)
        return columns


@dataclass(frozen=True, eq=False)
class _Tried:
    """A fit beside some more columns, and how surprising its likelihood ratio is."""

    peak: _Peak
    columns: Floats
    surprise: float
    """-log of the probability of that ratio without them."""

    @classmethod
    def of(cls, fit: _Learnt, basis: Floats, columns: Floats, before: _Peak) -> "_Tried":
        """Return the fit of columns (n, q) beside a basis."""
        from scipy.special import chdtrc

        peak = fit.best(basis, start=_start(before), more=columns)
        ratio = max(before.cost - peak.cost, 0.0)
        return cls(peak, columns, float(-np.log(max(chdtrc(columns.shape[1], ratio), 1e-300))))


def _start(peak: _Peak) -> _Part:
    """Return where to look for the slow part next."""
    return peak.parts[0] if peak.parts else (3, 0)


def _neighbours(part: _Part, step: int) -> Iterator[_Part]:
    """Yield the indices of τ and ρ beside a place, within their ranges."""
    wide = max(1, step // 2)
    for tau, ratio in ((-wide, 0), (wide, 0), (0, -step), (0, step), (-wide, step), (wide, -step)):
        yield (
            min(max(part[0] + tau, 0), len(_TIME_CONSTANTS_S) - 1),
            min(max(part[1] + ratio, 0), len(_RATIOS) - 1),
        )


def _basis(columns: Floats) -> Floats:
    """Return an orthonormal basis of columns (n, p)."""
    scale = np.sqrt(np.maximum(np.sum(columns**2, axis=0), 1e-300))
    u, s, _ = np.linalg.svd(columns / scale, full_matrices=False)
    return u[:, s > 1e-6 * max(float(s.max(initial=0.0)), 1e-300)]


_FULL = 0.6
"""Of the usual rows of a block: one with fewer is left out."""
_STEP_SPACING_S, _MOST_STEPS = 0.25, 60
"""Between the times at which a run may have a step, and how many of a run are tried."""


@dataclass(frozen=True, eq=False)
class _Blocks:
    """The rows of one trace by blocks of time."""

    starts: Ints
    """(b,) first row of each block with rows"""
    counts: Floats
    kept: Bools
    numbers: Ints
    """(b,) the number of each block's time, from the start of the model"""

    @classmethod
    def of(cls, trace: Trace) -> "_Blocks":
        number = np.floor((trace.time_s - trace.inputs.time_s[0]) / _LIMITS.noise_block_s).astype(np.int64)
        starts = np.flatnonzero(np.concatenate([[True], np.diff(number) != 0]))
        counts = np.diff(np.append(starts, len(number))).astype(np.float64)
        return cls(starts, counts, counts >= _FULL * float(np.median(counts)), number[starts])

    def means(self, values: Floats) -> Floats:
        """Return the means (b, …) of values (n, …) over the blocks that are kept."""
        wide = values if values.ndim == 2 else values[:, None]
        sums = sums_between(wide, np.append(self.starts, len(values)))
        means: Floats = (sums / self.counts[:, None])[self.kept]
        return means if values.ndim == 2 else means[:, 0]


def block_means(
    traces: Sequence[Trace],
    residuals: Sequence[Floats],
    signatures: Sequence[Floats],
    nuisance: Sequence[Sequence[Nuisance]],
    repeats: bool,
) -> Iterator[BlockMeans]:
    """Yield the block means of each component of residuals (n, k).

    ``repeats``: the runs repeat one program; then of their orthonormal contrasts, without what they share.
    """
    blocks = [_Blocks.of(trace) for trace in traces]
    numbers = [each.numbers[each.kept] for each in blocks]
    for j, inputs in enumerate(explaining_columns(traces)):
        y = [each.means(rows[:, j]) for each, rows in zip(blocks, residuals, strict=True)]
        signed = [each.means(columns[j]) for each, columns in zip(blocks, signatures, strict=True)]
        usual = [
            starts.means(_joined([one.columns[j] for one in mismatch], len(trace.time_s)))
            for starts, mismatch, trace in zip(blocks, nuisance, traces, strict=True)
        ]
        known = _stacked([*zip(map(_trend, numbers), usual, strict=True)], nuisance)
        smooth = [each.means(own) for each, own in zip(blocks, inputs, strict=True)]
        yield _component(y, numbers, known, signed, smooth, repeats)


def _component(
    y: Sequence[Floats],
    numbers: Sequence[Ints],
    known: Floats,
    signatures: Sequence[Floats],
    smooth: Sequence[Floats],
    repeats: bool,
) -> BlockMeans:
    shared = np.column_stack([np.concatenate(signatures), np.concatenate(smooth)])
    candidates = np.column_stack([shared, block_diag(*map(_steps, numbers))])
    values, lengths = np.concatenate(y), [len(each) for each in numbers]
    if not repeats:
        return BlockMeans(values, _segments(numbers), known, candidates, _runs(lengths))
    common = numbers[0]
    for number in numbers[1:]:
        common = np.intersect1d(common, number)
    firsts = np.cumsum([0, *lengths[:-1]])
    rows = [first + np.flatnonzero(np.isin(own, common)) for first, own in zip(firsts, numbers, strict=True)]
    contrasts = helmert(len(rows))  # orthonormal

    def contrasted(columns: Floats) -> Floats:
        runs = np.stack([columns[at] for at in rows])
        return np.concatenate(list(np.tensordot(contrasts, runs, axes=1)))

    segments, runs = _segments([common] * len(contrasts)), _runs([len(common)] * len(contrasts))
    return BlockMeans(contrasted(values), segments, contrasted(known), contrasted(candidates), runs)


def _runs(lengths: Sequence[int]) -> tuple[tuple[int, int], ...]:
    ends = np.cumsum([0, *lengths]).tolist()
    return tuple(pairwise(ends))


def _segments(numbers: Sequence[Ints]) -> Ints:
    """Return (s, 2) the stretches of consecutive blocks, those of each run by themselves."""
    segments, first = [], 0
    for number in numbers:
        breaks = np.flatnonzero(np.diff(number) > 1) + 1
        edges = first + np.concatenate([[0], breaks, [len(number)]])
        segments += [(a, b) for a, b in pairwise(edges.tolist()) if b > a]
        first += len(number)
    return np.array(segments, dtype=np.int64).reshape(-1, 2)


def _joined(columns: Sequence[Floats], count: int) -> Floats:
    return np.concatenate([np.zeros((count, 0)), *columns], axis=1)


def _stacked(means: Sequence[tuple[Floats, Floats]], nuisance: Sequence[Sequence[Nuisance]]) -> Floats:
    """Return what is never noise: each run's constant and trend, and mismatch, that of machines shared."""
    trends = block_diag(*(trend for trend, _ in means))
    shared, single = [], []
    for (_, usual), items in zip(means, nuisance, strict=True):
        widths = [each.columns.shape[2] for each in items]
        is_shared = np.repeat([each.shared for each in items], widths).astype(bool)
        shared.append(usual[:, is_shared])
        single.append(usual[:, ~is_shared])
    alike = len({each.shape[1] for each in shared}) == 1
    together = np.concatenate(shared) if alike else block_diag(*shared)
    columns = np.column_stack([trends, together, block_diag(*single)])
    return columns[:, np.any(columns != 0.0, axis=0)]


def _trend(numbers: Ints) -> Floats:
    """Return a constant and a straight line (b, 2) over a run."""
    line = numbers - np.mean(numbers)
    return np.column_stack([np.ones(len(numbers)), line / max(float(np.abs(line).max(initial=0.0)), 1.0)])


def _steps(numbers: Ints) -> Floats:
    """Return steps (b, s) of a run at evenly spaced times."""
    seconds = (numbers[-1] - numbers[0]) * _LIMITS.noise_block_s
    count = int(min(_MOST_STEPS, seconds / _STEP_SPACING_S))
    at = np.linspace(numbers[0], numbers[-1], count + 2)[1:-1]
    return (numbers[:, None] >= at).astype(np.float64)
