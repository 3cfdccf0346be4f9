"""Exact stops that nobody planned, found where a run falls behind from one leg of its path to the next.

Where they are belongs to the run: a WAIT or an output in its program, say. The model is the motion planned
anew with an exact stop at these corners; what all stops share is how long the robot stands.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.effects import Applied, Effect, Inputs
from gcode2krl.effects.builtin.advance_stop import with_stops
from gcode2krl.gap.beside.clocks import with_table_clock
from gcode2krl.gap.beside.links import MECHANICS, PATH
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.fit.place_times import gone
from gcode2krl.gap.slips.set_up import Slip

_LEAST_S = 0.02
"""A stop from a slow feed costs some hundredths of a second; time laws agree to 2 ms (design/gap.md)."""
_MOST_LEFT_OUT = 4
"""So many of the least are left out by and by: a last leg, say, may only look late."""
_MOST_SHARE = 0.5
"""Where more of the corners are late, it is the time law."""
_EXPLAINS = 0.95
_REFINED, _SETTLED_S = 4, 1e-3
_NEAR_MM = 0.3


def unplanned_stops(pairs: Sequence[Pair], library: Mapping[str, Effect]) -> tuple[list[Slip], list[Pair]]:
    """Return the stops as one finding, and the pairs with them in the plan; as they are without any."""
    effect, unchanged = library.get("advance_stop"), list(pairs)
    traces = _traces(pairs)
    plannable = all("plan" in pair.inputs.offers for pair in pairs)
    if effect is None or not plannable or len(traces) < len(pairs):
        return [], unchanged
    if _rms(traces) < traces[0].link.least_off:
        return [], unchanged
    jumps = [_stops_of(pair) for pair in pairs]
    before = _rms(traces)
    for least_s in sorted({0.0, *(late for own in jumps for late in own.values())})[:_MOST_LEFT_OUT]:
        stops = [np.array([row for row, late in own.items() if late > least_s], np.int64) for own in jumps]
        if not any(len(rows) for rows in stops):
            return [], unchanged
        hold_s, stopped = _held(pairs, stops)
        after = _rms(_traces([_on_time(pair) for pair in stopped]))
        if after**2 < (1.0 - _EXPLAINS) * before**2:
            break
    else:
        return [], unchanged
    count = max(len(rows) for rows in stops)
    one = Applied(effect, None, {"count": float(count), "hold_s": hold_s})
    places = zip(pairs, stops, strict=True)
    lines = sorted({int(line) for pair, rows in places for line in _lines(pair, rows)})
    words = f"the robot stopped exactly at {count} corners that are blended in the plan, lines {lines}"
    factor, unit = traces[0].factor, traces[0].unit
    return [Slip(one, traces[0].link.name, before * factor, after * factor, unit, words, False)], stopped


def _held(pairs: Sequence[Pair], stops: Sequence[Ints]) -> tuple[float, list[Pair]]:
    """Return for how long the robot stands at each stop, in s, and the pairs with the stops planned."""
    hold_s, stopped = 0.0, list(pairs)
    for _ in range(_REFINED):
        stopped = [_stopped(pair, rows, hold_s) for pair, rows in zip(pairs, stops, strict=True)]
        left = [
            late[np.isin(_corners(pair), rows)]
            for pair, one, rows in zip(pairs, stopped, stops, strict=True)
            for late in [_lateness(one, _corners(pair))]
        ]
        change = float(np.median(np.concatenate(left)))
        if abs(change) < _SETTLED_S:
            break
        hold_s = max(hold_s + change, 0.0)
    return hold_s, stopped


def _stops_of(pair: Pair) -> dict[int, float]:
    """Return the targets at which a run stopped, and how late it was behind each."""
    corners = _corners(pair)
    jumps = _lateness(pair, corners)
    late = jumps > _LEAST_S
    if late.sum() > _MOST_SHARE * max(len(corners), 1):
        return {}
    return dict(zip(corners[late].tolist(), jumps[late].tolist(), strict=True))


def _corners(pair: Pair) -> Ints:
    """Return the rows of the targets that are blended."""
    targets = pair.inputs.targets
    return np.zeros(0, dtype=np.int64) if targets is None else np.flatnonzero(targets.cdis_mm > 0.0)


def _lateness(pair: Pair, corners: Ints) -> Floats:
    """Return by how much later (s) the run is behind each corner than before it; 0 where nothing shows it."""
    traces, targets = _traces([pair]), pair.inputs.targets
    if not traces or targets is None or not len(corners):
        return np.zeros(len(corners))
    trace = traces[0]
    own_s, own_way = gone(trace.time_s, trace.measured, trace.link.least_step)
    planned = trace.link.planned(pair.inputs)
    time_s, way = gone(pair.inputs.time_s, planned[:, list(trace.columns)], 0.0)
    rows = _nearest_in_order(pair.inputs.position_mm, targets.position_mm[corners])
    edges = way[np.concatenate([[0], rows, [len(way) - 1]])]
    late = [0.0]
    for at in (_leg(a, b) for a, b in pairwise(edges)):
        behind = np.median(np.interp(at, own_way, own_s) - np.interp(at, way, time_s))
        # what the run did after the prediction's end was not looked at
        late.append(float(behind) if at[-1] < own_way[-1] else late[-1])
    return np.diff(late[1:])


def _leg(start: float, end: float) -> Floats:
    """Return places in the middle third of a leg."""
    return start + (end - start) * np.linspace(0.35, 0.65, 7)


def _nearest_in_order(path_mm: Floats, corners_mm: Floats) -> Ints:
    """Return the samples nearest to corners that are passed one after the other."""
    found, first = [], 0
    for corner in corners_mm:
        away = np.linalg.norm(path_mm[first:] - corner, axis=1)
        # the first local minimum that is as near as any: a path may come by again
        near = np.flatnonzero(away < away.min() + _NEAR_MM)
        gap = np.flatnonzero(np.diff(near) > 1)
        run = near[: gap[0] + 1] if len(gap) else near
        first += int(run[np.argmin(away[run])])
        found.append(first)
    return np.array(found, dtype=np.int64)


def _stopped(pair: Pair, rows: Ints, hold_s: float) -> Pair:
    inputs: Inputs = with_stops(pair.inputs, rows, hold_s) if len(rows) else pair.inputs
    return replace(pair, inputs=inputs)


def _on_time(pair: Pair) -> Pair:
    """Return the pair with the clock of its table as it fits best."""
    traces = _traces([pair])
    return with_table_clock(pair, traces[0].link) if traces else pair


def _traces(pairs: Sequence[Pair]) -> list[Trace]:
    """Return what shows how far the runs have come: the commanded joints, without them the tips."""
    return PATH.traces(pairs) or MECHANICS.traces(pairs)


def _lines(pair: Pair, rows: Ints) -> Ints:
    """Return the source lines of targets."""
    targets = pair.inputs.targets
    if targets is None:
        return rows[:0]
    at = _nearest_in_order(pair.inputs.position_mm, targets.position_mm[rows])
    return np.asarray(pair.inputs.source_line[at], dtype=np.int64)


def _rms(traces: Sequence[Trace]) -> float:
    return float(np.sqrt(np.mean(np.concatenate([trace.residual.ravel() ** 2 for trace in traces]))))
