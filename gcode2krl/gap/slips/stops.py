"""Exact stops that nobody planned, found where a run falls behind from one leg of its path to the next.

Where they are belongs to the run: a WAIT or an output in its program, say. The model is the motion planned
anew with an exact stop at these corners; the robot stands equally long at all of them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.effects import Applied, Effect, Inputs
from gcode2krl.effects.builtin.advance_stop import with_stops
from gcode2krl.gap.beside.clocks import with_table_clock
from gcode2krl.gap.beside.corners import rows_of_passing
from gcode2krl.gap.beside.links import MECHANICS, PATH
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.beside.timing import gone
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.slips.slip import Slip, motion_traces
from gcode2krl.gap.thresholds import THRESHOLDS

_NAME = "advance_stop"
_LIMITS = THRESHOLDS.slips


def unplanned_stops(pairs: Sequence[Pair], library: Mapping[str, Effect]) -> tuple[list[Slip], list[Pair]]:
    """Return the stops as one slip, and the pairs with them in the plan; without any the pairs as given."""
    effect, unchanged = library.get(_NAME), list(pairs)
    traces = motion_traces(pairs)
    plannable = all("plan" in pair.inputs.offers for pair in pairs)
    if effect is None or not plannable or len(traces) < len(pairs):
        return [], unchanged
    before = _rms(traces)
    if before < traces[0].link.least_off:
        return [], unchanged
    stops = _explaining_stops(pairs, before)
    if stops is None:
        return [], unchanged
    count = max(len(rows) for rows in stops.rows)
    applied = Applied(effect, None, {"count": float(count), "hold_s": stops.hold_s})
    lines = sorted(
        {int(line) for pair, rows in zip(pairs, stops.rows, strict=True) for line in _lines(pair, rows)}
    )
    words = f"the robot stopped exactly at {count} corners that are blended in the plan, lines {lines}"
    factor, unit = traces[0].factor, traces[0].unit
    slip = Slip(applied, traces[0].link, before * factor, stops.rms_left * factor, unit, words)
    return [slip], stops.pairs


class _Stops(NamedTuple):
    """Stops of all runs, in the plan."""

    rows: list[Ints]
    """Of each run the rows of its targets at which it stopped."""
    hold_s: float
    """How long the robot stands at each stop."""
    pairs: list[Pair]
    rms_left: float


def _explaining_stops(pairs: Sequence[Pair], before: float) -> _Stops | None:
    """Return the fewest stops that take the gap ``before``; None where those that the runs show do not.

    The corner after a stop may look late too. With it left out as much of the gap must go as with it: how
    many stops there are and how long each holds then follow from the same data.
    """
    found: list[_Stops] = []
    delays = [_delays_at_stops(pair) for pair in pairs]
    sizes_s = sorted({0.0, *(late_s for by_row in delays for late_s in by_row.values())})
    for least_s in sizes_s[: _LIMITS.stop_dropped_delays]:
        rows = [
            np.array([row for row, late_s in by_row.items() if late_s > least_s], np.int64)
            for by_row in delays
        ]
        if not any(len(of_run) for of_run in rows):
            break
        hold_s, stopped = _held(pairs, rows)
        left = _rms(motion_traces([_on_time(pair) for pair in stopped]))
        if left**2 < (1.0 - _LIMITS.stop_explained_share) * before**2:
            found.append(_Stops(rows, hold_s, stopped, left))
    least = min((each.rms_left for each in found), default=0.0)
    return next((each for each in reversed(found) if each.rms_left <= _LIMITS.stop_as_good * least), None)


def _held(pairs: Sequence[Pair], stops: Sequence[Ints]) -> tuple[float, list[Pair]]:
    """Return how long (s) the robot stands at each stop, and the pairs with the stops planned."""
    hold_s, stopped = 0.0, list(pairs)
    for _ in range(_LIMITS.stop_hold_steps):
        stopped = [_stopped(pair, rows, hold_s) for pair, rows in zip(pairs, stops, strict=True)]
        left_s = [
            _lateness(planned, corners := _corners(pair))[np.isin(corners, rows)]
            for pair, planned, rows in zip(pairs, stopped, stops, strict=True)
        ]
        change_s = float(np.median(np.concatenate(left_s)))
        if abs(change_s) < _LIMITS.stop_hold_settled_s:
            break
        hold_s = max(hold_s + change_s, 0.0)
    return hold_s, stopped


def _delays_at_stops(pair: Pair) -> dict[int, float]:
    """Return the rows of the targets at which a run stopped, and the delay (s) that each stop brought."""
    corners = _corners(pair)
    delay_s = _lateness(pair, corners)
    late = delay_s > _LIMITS.stop_late_s
    if late.sum() > _LIMITS.stop_most_corners * max(len(corners), 1):
        return {}
    return dict(zip(corners[late].tolist(), delay_s[late].tolist(), strict=True))


def _corners(pair: Pair) -> Ints:
    """Return the rows of the targets that are blended."""
    targets = pair.inputs.targets
    return np.zeros(0, dtype=np.int64) if targets is None else np.flatnonzero(targets.cdis_mm > 0.0)


def _lateness(pair: Pair, corners: Ints) -> Floats:
    """Return how much later (s) the run is on the leg after each corner than before it; 0 where unknown."""
    traces, targets = motion_traces([pair]), pair.inputs.targets
    if not traces or targets is None or not len(corners):
        return np.zeros(len(corners))
    trace = traces[0]
    run_s, run_way = gone(trace.time_s, trace.measured, trace.link.least_step)
    planned = trace.link.planned(pair.inputs)
    time_s, way = gone(pair.inputs.time_s, planned[:, list(trace.columns)], 0.0)
    rows = rows_of_passing(pair.inputs.position_mm, targets.position_mm[corners])
    edges = way[np.concatenate([[0], rows, [len(way) - 1]])]
    late = [0.0]
    for at in (_leg(a, b) for a, b in pairwise(edges)):
        behind = np.median(np.interp(at, run_way, run_s) - np.interp(at, way, time_s))
        # what the run did after the prediction's end was not looked at
        late.append(float(behind) if at[-1] < run_way[-1] else late[-1])
    return np.diff(late[1:])


def _leg(start: float, end: float) -> Floats:
    """Return places in the middle third of a leg."""
    return start + (end - start) * np.linspace(0.35, 0.65, 7)


def _stopped(pair: Pair, rows: Ints, hold_s: float) -> Pair:
    """Return the pair with stops at some targets in its plan."""
    inputs: Inputs = with_stops(pair.inputs, rows, hold_s) if len(rows) else pair.inputs
    return replace(pair, inputs=inputs)


def _on_time(pair: Pair) -> Pair:
    """Return the pair with the clock of its table as it fits best."""
    return with_table_clock(pair, PATH if PATH.traces([pair]) else MECHANICS)


def _lines(pair: Pair, rows: Ints) -> Ints:
    """Return the source lines of targets."""
    targets = pair.inputs.targets
    if targets is None:
        return rows[:0]
    at = rows_of_passing(pair.inputs.position_mm, targets.position_mm[rows])
    return np.asarray(pair.inputs.source_line[at], dtype=np.int64)


def _rms(traces: Sequence[Trace]) -> float:
    """Return the rms of the gap's components."""
    return float(np.sqrt(np.mean(np.concatenate([trace.residual.ravel() ** 2 for trace in traces]))))
