"""Excursions: what moves a signal one way, or to and fro, for some tenths of a second in few stretches.

A press sways the floor, a cable pulls and jerks free. In few stretches no flip of their signs is rare, and
instruments are loud for moments, too: they have bursts, and tails of any weight. But noise goes either way
from row to row however loud it is. Of the whitened rows r_t (k,) of a window

    T² = Sᵀ·V⁻¹·S,    S = Σ r_t,    V = Σ r_t·r_tᵀ

is n, the number of its rows, where all go one way. Of normal rows without a mean T²/n is distributed as
Beta(k/2, (n - k)/2) (Hotelling 1931), and large values are rarer still where single rows are louder than
others, as long as either sign is as likely (Efron 1969). That holds with rows turned round, too: of a swing
the half waves, up to three, are added with signs that change. p of the largest one is that times the number
of windows, of all widths and places (Bonferroni). What the rows remember beyond the noise's model makes T²
large everywhere: its median over all windows of a width, where that is more than the distribution's, divides
it.

**Levels.** A tracker that finds its beam again reads from there on, or for a while, some hundredths of a
millimetre beside. So around a window, along the direction in which it goes, what levels with two jumps
explain is compared with what a tone does, or a pull that grows and ends at once, each with as many numbers.
Levels are a step's (`gcode2krl.gap.posterior.study`), or of the instrument.

Encoders of joints are asked one by one, the tip and the force along all axes together.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.gap.compare.events import jump_within, line_at
from gcode2krl.gap.compare.interpolation import usual_step_s
from gcode2krl.gap.compare.trace import Event, Trace, Whose
from gcode2krl.gap.posterior.likelihood import Likelihood
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.posterior
_STEPS = 4
"""Windows that begin within the width of one."""
_HALVES = (1, 2, 3)
"""Half waves of a window: what rings dies away."""
_LEAST_ROWS = 3
"""Times the components: of fewer rows any noise goes one way."""
_HOLES = 2.0
"""Times its width a window may last over rows that are left out."""
_PLACES = 8
"""Of a jump within the width of a window."""
_TONES = 8
"""Half waves over a window and its surroundings, at most."""


class _Window(NamedTuple):
    """Rows of a trace that go one way, and -log p of that by chance anywhere."""

    surprise: float
    number: int
    first: int
    last: int
    halves: int
    """So many half waves of opposite signs it has."""
    components: tuple[int, ...]


def with_excursions(likelihood: Likelihood, residuals: Sequence[Floats]) -> tuple[Trace, ...]:
    """Return the traces of a likelihood, with the excursions of their rests (n, k) among their events."""
    traces = likelihood.traces
    if traces[0].still or not traces[0].link.has_instrument:
        return tuple(traces)
    surprising = (each for each in _windows(likelihood, residuals) if each.surprise > -np.log(_LIMITS.gap_p))
    kept, seen = list[_Window](), list[_Window]()
    for window in sorted(surprising, reverse=True):
        if not any(_is_near(traces[window.number], window, other) for other in seen):
            seen.append(window)
            if not _is_of_levels(likelihood, residuals[window.number], window):
                kept.append(window)
    return tuple(_with_events(trace, i, kept, residuals[i]) for i, trace in enumerate(traces))


def _is_near(trace: Trace, window: _Window, other: _Window) -> bool:
    """Tell whether two windows are of one event."""
    if window.number != other.number:
        return False
    first, last = max(window.first, other.first), min(window.last, other.last) - 1
    return bool(trace.time_s[first] - trace.time_s[last] < max(_LIMITS.excursion_widths_s))


def _windows(likelihood: Likelihood, residuals: Sequence[Floats]) -> Iterator[_Window]:
    """Yield the windows of all traces, and how surprising they are over all widths and components."""
    k = len(likelihood.noise)
    groups = [(j,) for j in range(k)] if likelihood.traces[0].link.of_joints else [tuple(range(k))]
    for group in groups:
        rows = [
            np.column_stack([likelihood.white(i, j, residual[:, [j]])[:, 0] for j in group])
            for i, residual in enumerate(residuals)
        ]
        searched = list(product(_LIMITS.excursion_widths_s, _HALVES))
        for width_s, halves in searched:
            searches = len(groups) * len(searched)
            for window in _of_width(likelihood.traces, rows, width_s, halves, searches):
                yield _Window(*window, halves, group)


def _of_width(
    traces: Sequence[Trace], rows: Sequence[Floats], width_s: float, halves: int, searches: int
) -> Iterator[tuple[float, int, int, int]]:
    """Yield of each window of a width its surprise, its trace's number, its first row and that behind it."""
    from scipy.special import betainc, betaincinv

    k = rows[0].shape[1]
    counts, places, shares = [], [], []
    for number, (trace, white) in enumerate(zip(traces, rows, strict=True)):
        half = round(width_s / usual_step_s(trace.time_s))
        count = halves * half
        if count < _LEAST_ROWS * k:
            continue
        first = np.arange(0, max(len(white) - count, 0), max(1, half // _STEPS))
        lasts_s = trace.time_s[first + count - 1] - trace.time_s[first]
        first = first[lasts_s < _HOLES * halves * width_s]
        places.append(np.stack([np.full(len(first), number), first, first + count], axis=1))
        counts.append(np.full(len(first), count))
        shares.append(one_way(white, first, half, halves))
    if not places:
        return
    n, share, place = np.concatenate(counts), np.concatenate(shares), np.concatenate(places)
    usual = betaincinv(k / 2.0, (n - k) / 2.0, 0.5)
    spread = max(float(np.median(share / usual)), 1.0) if len(n) else 1.0
    p = betainc((n - k) / 2.0, k / 2.0, 1.0 - np.minimum(share / spread, 1.0))
    surprise = -np.log(np.maximum(p, 1e-300)) - np.log(len(n) * searches)
    for nats, (number, first, last) in zip(surprise.tolist(), place.tolist(), strict=True):
        yield nats, number, first, last


def one_way(rows: Floats, first: Ints, half: int, halves: int = 1) -> Floats:
    """Return T²/n (w,) of windows of rows (n, k): 1 where all are alike, 0 without a mean.

    A window has so many ``halves`` of so many rows, which count with signs that change.
    """
    k = rows.shape[1]
    sums = np.concatenate([np.zeros((1, k)), np.cumsum(rows, axis=0)])
    products = np.concatenate([np.zeros((1, k, k)), np.cumsum(rows[:, :, None] * rows[:, None], axis=0)])
    count = half * halves
    edges = first + half * np.arange(halves + 1)[:, None]
    signs = (-1.0) ** np.arange(halves)
    total = np.tensordot(signs, np.diff(sums[edges], axis=0), axes=1)
    scatter = products[first + count] - products[first]
    ridge = 1e-9 * np.trace(scatter, axis1=1, axis2=2)[:, None, None] * np.eye(k) + 1e-300 * np.eye(k)
    solved = np.linalg.solve(scatter + ridge, total[:, :, None])[:, :, 0]
    share: Floats = np.sum(total * solved, axis=1) / count
    return share


def _is_of_levels(likelihood: Likelihood, residual: Floats, window: _Window) -> bool:
    """Tell whether levels with two jumps explain what is around a window better than a tone or a pull."""
    half, time_s = (window.last - window.first) // window.halves, likelihood.traces[window.number].time_s
    first, last = max(window.first - half, 0), min(window.last + half, len(residual))
    at = np.arange(first + 1, last - 1, max(1, half // _PLACES))

    def white(columns: Floats, component: int) -> Floats:
        return likelihood.white(window.number, component, columns)[first:last]

    rows = np.column_stack([white(residual[:, [j]], j)[:, 0] for j in window.components])
    signs = np.repeat((-1.0) ** np.arange(window.halves), half)
    along = signs @ rows[window.first - first : window.last - first]
    along /= np.linalg.norm(along)

    def along_it(columns: Floats) -> Floats:
        parts = [a * a * white(columns, j) for a, j in zip(along, window.components, strict=True)]
        return np.asarray(np.sum(parts, axis=0), dtype=np.float64)

    after = (np.arange(len(residual))[:, None] >= at).astype(np.float64)
    level, steps = along_it(np.ones((len(residual), 1))), along_it(after)
    turns = np.outer(time_s - time_s[first], 2.0 * np.pi * np.arange(1, _TONES + 1))
    turns /= 2.0 * (time_s[last - 1] - time_s[first])
    waves = [along_it(np.column_stack([np.cos(turn), np.sin(turn)])) for turn in turns.T]
    pulls = [
        along_it(np.maximum(time_s[:, None] - time_s[begin], 0.0) * (1.0 - after[:, i + 1 :]))
        for i, begin in enumerate(at[:-1].tolist())
    ]
    values = rows @ along
    best_step = max(steps.T, key=lambda step: _gain(values, level, step))
    of_levels = max(_gain(values, level, best_step, step) for step in steps.T)
    of_tones = max(_gain(values, level, *wave.T) for wave in waves)
    of_pulls = max(_gain(values, level, pull) for of_begin in pulls for pull in of_begin.T)
    of_one_level, best = _gain(values, level), max(of_tones, of_pulls)
    # of noise a tone or a pull, of so many that are tried, takes something beside a level that lasts
    return bool(of_levels > best or best - of_one_level < -4.0 * np.log(_LIMITS.gap_p))


def _gain(values: Floats, *columns: Floats) -> float:
    """Return the fall of the sum of squares of values (n,) by some columns (n,) or (n, c)."""
    basis = np.linalg.qr(np.column_stack(columns))[0]
    return float(np.sum((basis.T @ values) ** 2))


def _with_events(trace: Trace, number: int, windows: Sequence[_Window], residual: Floats) -> Trace:
    events = tuple(_event(trace, each, residual) for each in windows if each.number == number)
    return replace(trace, events=(*trace.events, *events)) if events else trace


def _event(trace: Trace, window: _Window, residual: Floats) -> Event:
    """Return the event of a window; where the residual jumps near it, that is its moment."""
    time_s, off = trace.time_s[window.first : window.last], residual[window.first : window.last]
    squares = np.sum(off**2, axis=1)
    span_s = float(time_s[0]), float(time_s[-1])
    width_s = span_s[1] - span_s[0]
    middle_s = float(squares @ time_s) / max(float(squares.sum()), 1e-300)
    at_s = jump_within(trace, (span_s[0] - width_s, span_s[1] + width_s)) or middle_s
    return Event(
        link=trace.link.name,
        run=trace.run,
        whose=Whose.IMPULSE,
        span_s=span_s,
        at_s=at_s,
        line=line_at(trace.inputs, at_s),
        peak=off[int(np.argmax(squares))],
        change=np.zeros(off.shape[1]),
        power=float(squares.sum()),
    )
