"""Exact stops that nobody planned, found where a run falls behind from one leg of its path to the next.

Where they are belongs to the run: a WAIT or an output in its program, say. The model is the motion planned
anew with an exact stop at these corners; what all stops share is how long the robot stands.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gcode2krl.effects import Applied, Effect, Inputs
from gcode2krl.effects.builtin.advance_stop import with_stops
from gcode2krl.gap.clocks import fitted_offset
from gcode2krl.gap.links import MODEL_RAD, parts_of
from gcode2krl.gap.part import Part
from gcode2krl.gap.place_time import LEAST_STEP, gone
from gcode2krl.gap.side import Side
from gcode2krl.gap.slips import Slip

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
_LEAST_S = 0.02
"""A stop from a slow feed costs some hundredths of a second; time laws agree to 2 ms (design/gap.md)."""
_MOST_LEFT_OUT = 4
"""So many of the least are left out by and by: a last leg, say, may only look late."""
_MOST_SHARE = 0.5
"""Where more of the corners are late, it is the time law."""
_LEAST_OFF = {"path": 2.0 * MODEL_RAD, "mechanics": 0.5}
_EXPLAINS = 0.95
_REFINED, _SETTLED_S = 4, 1e-3
_NEAR_MM = 0.3


def unplanned_stops(sides: Sequence[Side], library: Mapping[str, Effect]) -> tuple[list[Slip], list[Side]]:
    """Return the stops as one finding, and the sides with them in the plan; as they are without any."""
    effect, unchanged = library.get("advance_stop"), list(sides)
    parts = _parts(sides)
    plannable = all("plan" in side.inputs.offers for side in sides)
    if effect is None or not plannable or len(parts) < len(sides):
        return [], unchanged
    if _rms(parts) < _LEAST_OFF[parts[0].link]:
        return [], unchanged
    jumps = [_stops_of(side) for side in sides]
    before = _rms(parts)
    for least_s in sorted({0.0, *(late for own in jumps for late in own.values())})[:_MOST_LEFT_OUT]:
        stops = [np.array([row for row, late in own.items() if late > least_s], np.int64) for own in jumps]
        if not any(len(rows) for rows in stops):
            return [], unchanged
        hold_s, stopped = _held(sides, stops)
        after = _rms(_parts([_on_time(side) for side in stopped]))
        if after**2 < (1.0 - _EXPLAINS) * before**2:
            break
    else:
        return [], unchanged
    count = max(len(rows) for rows in stops)
    one = Applied(effect, None, {"count": float(count), "hold_s": hold_s})
    places = zip(sides, stops, strict=True)
    lines = sorted({int(line) for side, rows in places for line in _lines(side, rows)})
    words = f"the robot stopped exactly at {count} corners that are blended in the plan, lines {lines}"
    factor, unit = parts[0].factor, parts[0].unit
    return [Slip(one, parts[0].link, before * factor, after * factor, unit, words, False)], stopped


def _held(sides: Sequence[Side], stops: Sequence[Ints]) -> tuple[float, list[Side]]:
    """Return for how long the robot stands at each stop, in s, and the sides with the stops planned."""
    hold_s, stopped = 0.0, list(sides)
    for _ in range(_REFINED):
        stopped = [_stopped(side, rows, hold_s) for side, rows in zip(sides, stops, strict=True)]
        left = [
            late[np.isin(_corners(side), rows)]
            for side, one, rows in zip(sides, stopped, stops, strict=True)
            for late in [_lateness(one, _corners(side))]
        ]
        change = float(np.median(np.concatenate(left)))
        if abs(change) < _SETTLED_S:
            break
        hold_s = max(hold_s + change, 0.0)
    return hold_s, stopped


def _stops_of(side: Side) -> dict[int, float]:
    """Return the targets at which a run stopped, and how late it was behind each."""
    corners = _corners(side)
    jumps = _lateness(side, corners)
    late = jumps > _LEAST_S
    if late.sum() > _MOST_SHARE * max(len(corners), 1):
        return {}
    return dict(zip(corners[late].tolist(), jumps[late].tolist(), strict=True))


def _corners(side: Side) -> Ints:
    """Return the rows of the targets that are blended."""
    targets = side.inputs.targets
    return np.zeros(0, dtype=np.int64) if targets is None else np.flatnonzero(targets.cdis_mm > 0.0)


def _lateness(side: Side, corners: Ints) -> Floats:
    """Return by how much later (s) the run is behind each corner than before it; 0 where nothing shows it."""
    parts, targets = _parts([side]), side.inputs.targets
    if not parts or targets is None or not len(corners):
        return np.zeros(len(corners))
    part = parts[0]
    own_s, own_way = gone(part.time_s, part.measured, LEAST_STEP[part.link])
    planned = side.inputs.q_cmd_rad if part.link == "path" else side.inputs.position_mm
    time_s, way = gone(side.inputs.time_s, planned[:, list(part.columns)], 0.0)
    rows = _nearest_in_order(side.inputs.position_mm, targets.position_mm[corners])
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


def _stopped(side: Side, rows: Ints, hold_s: float) -> Side:
    inputs: Inputs = with_stops(side.inputs, rows, hold_s) if len(rows) else side.inputs
    return replace(side, inputs=inputs)


def _on_time(side: Side) -> Side:
    """Return the side with the clock of its table as it fits best."""
    parts = _parts([side])
    offset, deviation = fitted_offset(parts[0]) if parts else (0.0, np.inf)
    if not np.isfinite(deviation):
        return side
    table = "controller" if parts[0].link == "path" else "tracker"
    return replace(side, clock_s={**side.clock_s, table: side.clock_s.get(table, 0.0) + offset})


def _parts(sides: Sequence[Side]) -> list[Part]:
    """Return what shows how far the runs have come: the commanded joints, without them the tips."""
    return parts_of("path", sides) or parts_of("mechanics", sides)


def _lines(side: Side, rows: Ints) -> Ints:
    """Return the source lines of targets."""
    targets = side.inputs.targets
    if targets is None:
        return rows[:0]
    at = _nearest_in_order(side.inputs.position_mm, targets.position_mm[rows])
    return np.asarray(side.inputs.source_line[at], dtype=np.int64)


def _rms(parts: Sequence[Part]) -> float:
    return float(np.sqrt(np.mean(np.concatenate([part.residual.ravel() ** 2 for part in parts]))))
