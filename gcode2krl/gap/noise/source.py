"""Where a link's noise is learnt: repeats of one program, or what is left of a run beside everything slow.

The noise of static poses is white, since each pose is measured by itself.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csc_array, identity

from gcode2krl.arrays import Floats, Ints
from gcode2krl.effects import Applied
from gcode2krl.gap.compare.interpolation import nearest_rows, resolution, rms, usual_deviation, usual_step_s
from gcode2krl.gap.compare.trace import Trace, is_repeat
from gcode2krl.gap.noise.nuisance import Nuisance
from gcode2krl.gap.noise.short import (
    Noise,
    Slow,
    at_most,
    drawn_noise,
    drawn_slow,
    fit,
    unbiased,
    white,
    without_lines,
)
from gcode2krl.gap.noise.slow import SlowPart, block_means, slow_parts_of
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.noise
_RIDGE, _HATS_RIDGE = 1e-6, 1e-9
"""Keep columns apart that are equal to rounding; of unit length each, or per row."""
_LEAST_RMS = 1e-9
"""So that exact data have a model at all."""
_EXACT = 1e-12
"""The floor of drawn noise: it has no decimals."""
_SLOW_DRAWS = 4
"""Of the slow part, whose lags are taken off the data's."""
_LEVEL_S, _LEVELS = 0.1, 5
"""Blocks whose medians are the level of a residual, and how many before and after."""
_FAR = 8.0
"""Robust deviations from it beyond which a row is of an event: heavy tails hardly go there."""
_ALIKE_SHARE = 0.5
"""Of six encoders, which must wander for that to be their noise."""


def noise_of(
    traces: Sequence[Trace],
    signatures: Sequence[Floats],
    nuisance: Sequence[Sequence[Nuisance]],
    applied: Sequence[Applied] = (),
) -> list[Noise]:
    """Return the noise of each component, beside effects that are known.

    From every run is taken what any effect or nuisance could explain of that run alone. If the runs repeat
    one program, what differs between them is noise, whatever its colour; else everything slower than half a
    second is taken out too, since it may be structure. What this takes of the noise itself is found by doing
    the same to drawn noise of the model (Efron's bootstrap bias).
    """
    source = _Source(
        tuple(traces),
        tuple(_Explained(*each) for each in zip(traces, signatures, nuisance, strict=True)),
        _repeats(traces),
    )
    stated = [trace.declared_sigma for trace in traces if trace.declared_sigma is not None]
    floors = [_floor(traces, stated, j) for j in range(traces[0].shape[1])]
    residuals = source.without_spikes([trace.measured - trace.sample(applied) for trace in traces])
    means = block_means(traces, residuals, signatures, nuisance, source.repeats is not None)
    slow = [
        _of_rows(slow_parts_of(blocks, floor), traces[0]) for blocks, floor in zip(means, floors, strict=True)
    ]
    if traces[0].is_shown_at_tip or _in_few_joints(traces[0], slow):
        slow = [()] * len(slow)
    generator = np.random.default_rng(0)
    slow_drawn = [
        [
            np.stack([_drawn(parts, len(trace.time_s), generator) for parts in slow], axis=1)
            for trace in traces
        ]
        for _ in range(_SLOW_DRAWS if any(slow) else 0)
    ]
    first = source.noise(residuals, floors, slow, slow_drawn)
    drawn = [
        np.stack([drawn_noise(noise, len(trace.time_s), generator) for noise in first], axis=1)
        for trace in traces
    ]
    again = source.noise(drawn, [_EXACT] * len(first), slow, slow_drawn)
    most = _LIMITS.noise_most_stated * min(stated, default=np.inf)
    learnt = [
        at_most(unbiased(noise, of_drawn, floor), most)
        for noise, of_drawn, floor in zip(first, again, floors, strict=True)
    ]
    if _in_few_joints(traces[0], [each.beyond for each in learnt]):
        return [replace(each, beyond=0.0) for each in learnt]
    return learnt


def _in_few_joints(trace: Trace, has: Sequence[object]) -> bool:
    """Tell whether few of six encoders have something: they are alike, so that it is the joint's."""
    return trace.of_six_encoders and sum(map(bool, has)) < _ALIKE_SHARE * len(has)


def _spikes(trace: Trace, residual: Floats) -> Floats:
    """Return what of a rest (n, k) is far from its level for a moment, beyond a bridge from row to row.

    The level lies between the medians of half a second before and after: it follows steps and whatever is
    slow.
    """
    time_s = trace.time_s
    length = max(1, round(_LEVEL_S / usual_step_s(time_s)))
    count = len(time_s) // length
    if count < 2 * _LEVELS:
        return np.zeros_like(residual)
    block = np.minimum(np.arange(len(time_s)) // length, count - 1)
    spikes = np.empty_like(residual)
    for j, values in enumerate(residual.T):
        medians = np.median(values[: count * length].reshape(count, length), axis=1)
        padded = np.pad(medians, _LEVELS, mode="edge")
        levels = np.median(np.lib.stride_tricks.sliding_window_view(padded, _LEVELS), axis=1)
        before, after = levels[:count], levels[_LEVELS + 1 :]
        low, high = np.minimum(before, after)[block], np.maximum(before, after)[block]
        off = values - np.clip(values, low, high)
        near = np.abs(off) <= _FAR * usual_deviation(values - medians[block])
        spikes[:, j] = values - np.interp(time_s, time_s[near], values[near])
    return spikes


def _of_rows(parts: Sequence[SlowPart], trace: Trace) -> tuple[Slow, ...]:
    """Return slow parts as processes of a trace's rows."""
    step_s = usual_step_s(trace.time_s)
    return tuple(Slow(float(np.exp(-step_s / part.time_constant_s)), part.sigma) for part in parts)


def _drawn(parts: Sequence[Slow], count: int, generator: np.random.Generator) -> Floats:
    return sum((drawn_slow(each, count, generator) for each in parts), np.zeros(count))


def _floor(traces: Sequence[Trace], stated: Sequence[float], component: int) -> float:
    """Return the least rms: the last decimal's, and what run.toml states."""
    decimals = max(resolution(trace.measured[:, component]) for trace in traces)
    return max(decimals, _LIMITS.noise_least_stated * max(stated, default=0.0), _LEAST_RMS)


class _Explained:
    """What is taken out of one trace before its noise is looked at."""

    def __init__(self, trace: Trace, signatures: Floats, nuisance: Sequence[Nuisance]) -> None:
        parts = [signatures, *(each.columns for each in nuisance)]
        width = sum(part.shape[2] for part in parts)
        self._columns = [list(_runs_of_columns(parts, j)) for j in range(trace.shape[1])]
        gram = np.zeros((width, width))
        for of_component in filter(None, self._columns):
            used = np.concatenate([np.arange(at.start, at.stop) for at, _ in of_component])
            columns = np.concatenate([run for _, run in of_component], axis=1)
            gram[np.ix_(used, used)] += columns.T @ columns
        self._kept = np.flatnonzero(np.diag(gram))
        self._scale = np.sqrt(np.diag(gram)[self._kept])
        self._gram = gram[np.ix_(self._kept, self._kept)] / np.outer(self._scale, self._scale)
        self._gram[np.diag_indices_from(self._gram)] += _RIDGE
        self._width = width
        t = trace.time_s
        count = max(2, round((t[-1] - t[0]) / _LIMITS.noise_slow_s) + 1)
        self._hats = _hats(t, np.linspace(t[0], t[-1], count))
        ridge = _HATS_RIDGE * len(t) * identity(count)
        self._hats_gram = csc_array(self._hats.T @ self._hats + ridge)

    def off(self, values: Floats) -> Floats:
        """Return values (n, k) without what effects and nuisance explain."""
        if not len(self._kept):
            return values
        sums = np.zeros(self._width)
        for j, of_component in enumerate(self._columns):
            for at, columns in of_component:
                sums[at] += columns.T @ values[:, j]
        weights = np.zeros(self._width)
        weights[self._kept] = np.linalg.solve(self._gram, sums[self._kept] / self._scale) / self._scale
        unexplained = values.copy()
        for j, of_component in enumerate(self._columns):
            for at, columns in of_component:
                unexplained[:, j] -= columns @ weights[at]
        return unexplained

    def fast(self, values: Floats) -> Floats:
        """Return values (n, k) without what is slower than half a second."""
        from scipy.sparse.linalg import splu

        quick: Floats = values - self._hats @ splu(self._hats_gram).solve(self._hats.T @ values)
        return quick


def _runs_of_columns(parts: Sequence[Floats], component: int) -> Iterator[tuple[slice, Floats]]:
    """Yield the columns (n, u) of parts (k, n, c) that are not zero in a component, and their places.

    Neighbours together, and none copied: most effects of a joint move it alone.
    """
    first = 0
    for part in parts:
        used = np.flatnonzero(part[component].any(axis=0))
        for run in np.split(used, np.flatnonzero(np.diff(used) > 1) + 1) if len(used) else ():
            a, b = int(run[0]), int(run[-1]) + 1
            yield slice(first + a, first + b), part[component][:, a:b]
        first += part.shape[2]


def _hats(time_s: Floats, knots_s: Floats) -> csc_array:
    """Return hats over time (n, knots), of which each row has two."""
    apart_s = knots_s[1] - knots_s[0]
    before = np.clip(np.searchsorted(knots_s, time_s, side="right") - 1, 0, len(knots_s) - 2)
    share = (time_s - knots_s[before]) / apart_s
    rows = np.arange(len(time_s))
    values, columns = np.concatenate([1.0 - share, share]), np.concatenate([before, before + 1])
    return csc_array((values, (np.tile(rows, 2), columns)), shape=(len(time_s), len(knots_s)))


@dataclass(frozen=True, eq=False)
class _Source:
    """Traces, what is taken out of each, and the rows of their repeats."""

    traces: tuple[Trace, ...]
    explained: tuple[_Explained, ...]
    repeats: list[Ints] | None

    def without_spikes(self, residuals: Sequence[Floats]) -> list[Floats]:
        """Return residuals (n, k) less what is far off for a moment and nothing explains: no noise is that.

        Before anything else, since means and tones would spread it over rows that are calm.
        """
        if not self.traces[0].link.has_instrument:
            return list(residuals)
        parts = zip(self.traces, self.explained, residuals, strict=True)
        return [each - _spikes(trace, explained.off(each)) for trace, explained, each in parts]

    def noise(
        self,
        values: Sequence[Floats],
        floors: Sequence[float],
        slow: Sequence[tuple[Slow, ...]],
        slow_drawn: Sequence[Sequence[Floats]],
    ) -> list[Noise]:
        """Return the model of each component of values (n, k) of all traces, beside the slow parts.

        ``slow_drawn`` are draws (n, k) of these for all traces; what is taken of the values is taken of them.
        """
        rests = self._rests(values)
        drawn = [self._rests(each) for each in slow_drawn]
        models = []
        for j, (floor, parts) in enumerate(zip(floors, slow, strict=True)):
            off = [own for each in drawn for own in self._component(each, j)] if parts else []
            # what is commanded has no instrument: where its model is off, at corners, it is so of all rows
            every_row = not self.traces[0].link.has_instrument
            short = fit(self._component(rests, j), floor, off, every_row=every_row)
            models.append(replace(short, slow=parts))
        return models

    def _rests(self, values: Sequence[Floats]) -> list[Floats]:
        """Return values (n, k) less all that is or may be structure."""
        rests = [each.off(value) for each, value in zip(self.explained, values, strict=True)]
        if self.repeats is None:
            rests = [each.fast(rest) for each, rest in zip(self.explained, rests, strict=True)]
        return rests

    def _component(self, rests: Sequence[Floats], j: int) -> list[tuple[Floats, Ints]]:
        """Return one component (n,) of each trace with its segments, less tones and repeats' mean."""
        values = [rest[:, j] for rest in rests]
        if self.repeats is None:
            pairs = zip(values, self.traces, strict=True)
            return [(without_lines(value), trace.segments) for value, trace in pairs]
        differences = _differences(values, self.repeats)
        return [(without_lines(value), self.traces[0].segments) for value in differences]


def are_repeats(traces: Sequence[Trace]) -> bool:
    """Tell whether runs repeat one program, so that their noise is what differs between them."""
    return len(traces) > 1 and all(is_repeat(trace, traces[0]) for trace in traces[1:])


def _repeats(traces: Sequence[Trace]) -> list[Ints] | None:
    """Return for each trace the rows that belong to the first one's; None where they are no repeats."""
    first = traces[0]
    if not are_repeats(traces):
        return None
    return [nearest_rows(trace.time_s, first.time_s) for trace in traces]


def _differences(values: Sequence[Floats], rows: Sequence[Ints]) -> Floats:
    """Return by how much runs (r, n) differ from their mean, with the variance that one of them has."""
    runs = np.stack([value[row] for value, row in zip(values, rows, strict=True)])
    differences: Floats = (runs - runs.mean(axis=0)) * np.sqrt(len(runs) / (len(runs) - 1.0))
    return differences


_RANK = 1e-6
"""Singular values below this share of the largest add nothing to what columns span."""
_SAME_POSE_RAD = 1e-4
"""Joints of one pose when the robot comes back to it."""
_SIGMAS = np.geomspace(1e-3, 1.0, 61)
"""Of the noise over the rms of the residual, at which the likelihood is looked at."""


def noise_of_poses(
    traces: Sequence[Trace], signatures: Sequence[Floats], nuisance: Sequence[Sequence[Nuisance]]
) -> list[Noise]:
    """Return the noise of each component: what ``run.toml`` states, else what poses visited again differ by.

    Else what no candidate explains: from the residual is taken what all signatures and nuisance together
    span, and its power is divided by the degrees of freedom that are left. With fewer than a third of them
    left, only what single signatures explain beyond chance is taken (`_few`).
    """
    stated = [trace.declared_sigma for trace in traces if trace.declared_sigma is not None]
    sigma = max(stated, default=0.0) or max(_learnt(traces, signatures, nuisance), _LEAST_RMS)
    return [white(sigma)] * traces[0].shape[1]


def revisits(traces: Sequence[Trace]) -> Floats:
    """Return by how much poses that the robot came back to differ from their mean (m, k).

    With the variance that one of them has. Of readings in a row, at which it stood, the first counts.
    """
    differences = [np.zeros((0, traces[0].shape[1]))]
    for trace in traces:
        q = trace.inputs.q_cmd_rad
        apart = np.abs(q[:, None] - q).max(axis=2) > _SAME_POSE_RAD
        came = np.append(True, apart[np.arange(1, len(q)), np.arange(len(q) - 1)])
        number = np.argmin(apart, axis=0)  # the first row of the same pose
        for pose in np.unique(number):
            at_pose = trace.residual[came & (number == pose)]
            if len(at_pose) > 1:
                differences.append(
                    (at_pose - at_pose.mean(axis=0)) * np.sqrt(len(at_pose) / (len(at_pose) - 1.0))
                )
    return np.concatenate(differences)


def is_revisited(traces: Sequence[Trace]) -> bool:
    """Tell whether the robot came back to so many poses that their noise is known."""
    return len(revisits(traces)) >= _LIMITS.poses_least_again


def _learnt(
    traces: Sequence[Trace], signatures: Sequence[Floats], nuisance: Sequence[Sequence[Nuisance]]
) -> float:
    if is_revisited(traces):
        return rms(revisits(traces))
    values = sum(trace.measured.size for trace in traces)
    rests, spanned = [], 0
    for trace, signature, others in zip(traces, signatures, nuisance, strict=True):
        basis = _basis(_flat([signature, *(each.columns for each in others)]))
        residual = trace.residual.T.reshape(-1)
        rests.append(residual - basis @ (basis.T @ residual))
        spanned += basis.shape[1]
    if 3 * (values - spanned) < values:
        return _few(traces, signatures, nuisance)
    return rms(np.concatenate(rests)) * float(np.sqrt(values / (values - spanned)))


def _few(
    traces: Sequence[Trace], signatures: Sequence[Floats], nuisance: Sequence[Sequence[Nuisance]]
) -> float:
    """Return the noise beside nuisance at its usual size and signatures taken one at a time.

    One is taken where it passes an F-test with the number of all of them as its price (Bonferroni).
    """
    from scipy.special import fdtrc

    of_traces = zip(*_turned(traces, signatures, nuisance), strict=True)
    turned, variances = map(np.concatenate, of_traces)
    sigmas = rms(turned[:, -1]) * _SIGMAS
    count, taken = len(turned), list[int]()
    while True:
        whole, explained = _costs(turned, variances, sigmas, taken)
        best, column = float(whole.min()), int(np.argmin(explained.min(axis=0)))
        freedom = count - len(taken) - 1
        f = freedom * np.expm1(max(best - float(explained[:, column].min()), 0.0) / count)
        if 3 * freedom < count or fdtrc(1, freedom, f) * explained.shape[1] > _LIMITS.poses_chance:
            return float(sigmas[int(np.argmin(whole))]) * float(np.sqrt(count / (freedom + 1)))
        taken.append(column)


def _turned(
    traces: Sequence[Trace], signatures: Sequence[Floats], nuisance: Sequence[Sequence[Nuisance]]
) -> Iterator[tuple[Floats, Floats]]:
    """Yield of each trace columns (v, c + 1), the residual last, along nuisance's axes, and its variances."""
    for trace, signature, others in zip(traces, signatures, nuisance, strict=True):
        usual = _flat([np.zeros((*signature.shape[:2], 0)), *(each.columns for each in others)])
        variances, axes = np.linalg.eigh(usual @ usual.T)
        yield (
            axes.T @ np.column_stack([_flat([signature]), trace.residual.T.reshape(-1)]),
            np.maximum(variances, 0.0),
        )


def _costs(turned: Floats, variances: Floats, sigmas: Floats, taken: Sequence[int]) -> tuple[Floats, Floats]:
    """Return -2 log likelihood at some noises (s,), beside taken columns, and with one more each (s, c)."""
    whole, explained = [], []
    for sigma in sigmas:
        total = sigma**2 + variances
        white_ = turned / np.sqrt(total)[:, None]
        basis = _basis(white_[:, taken])
        white_ = white_ - basis @ (basis.T @ white_)
        columns, residual = white_[:, :-1], white_[:, -1]
        power = np.sum(columns**2, axis=0)
        gain = (columns.T @ residual) ** 2 / np.maximum(power, 1e-300)
        gain[power <= _RANK * np.sum((turned[:, :-1] ** 2) / total[:, None], axis=0)] = 0.0
        whole.append(float(np.sum(np.log(total)) + residual @ residual))
        explained.append(whole[-1] - gain)
    return np.array(whole), np.array(explained)


def _flat(columns: Sequence[Floats]) -> Floats:
    """Return columns (k, n, c) side by side, as (k·n, c)."""
    joined = np.concatenate(columns, axis=2)
    return joined.reshape(joined.shape[0] * joined.shape[1], joined.shape[2])


def _basis(columns: Floats) -> Floats:
    """Return an orthonormal basis (v, r) of what columns (v, c) span."""
    scale = np.linalg.norm(columns, axis=0)
    vectors, singular, _ = np.linalg.svd(columns[:, scale > 0.0] / scale[scale > 0.0], full_matrices=False)
    return vectors[:, singular > _RANK * singular.max(initial=0.0)]
