"""Set-up slips that need no fit, a test for each kind; `gap.posterior.set_up` has the others and the order.

**Exact stops** that nobody planned are found where a run falls behind from one leg of its path to the next.
Where they are belongs to the run: a WAIT or an output in its program, say. The model is the motion planned
anew with an exact stop at these corners; the robot stands equally long at all of them.

**Another program** is told by the commanded path, the tip of the logged joints beside the predicted curve,
without time: where it lies, and how fast it goes along its moves. A program that was edited keeps to the
predicted curve for a good part of its way and leaves it for a stretch. A blended corner leaves it near that
corner only, another base or an accurate model of the robot everywhere.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from math import log
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from gcode2krl import robot
from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.effects import Applied, Effect, Inputs
from gcode2krl.effects.builtin.advance_stop import with_stops
from gcode2krl.errors import Gcode2KrlError, Issue
from gcode2krl.gap.compare.clocks import gone, with_table_clock
from gcode2krl.gap.compare.inputs import rows_of_passing
from gcode2krl.gap.compare.interpolation import length_along, rms, rms_length, usual_step_s
from gcode2krl.gap.compare.links import FORCE, MECHANICS, PATH
from gcode2krl.gap.compare.pair import Pair
from gcode2krl.gap.compare.trace import Link, Trace
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.runs import check_against
from gcode2krl.units import DEG_PER_RAD

_LIMITS = THRESHOLDS.compare


@dataclass(frozen=True, eq=False)
class CommandedPath:
    """The commanded tips of a run where it moves, n of them, beside its prediction."""

    name: str
    inputs: Inputs
    time_s: Floats
    """(n,) on the prediction's clock."""
    tip_mm: Floats
    """(n, 3) nominal tip of the commanded joints, by each tool of the prediction in turn the nearest."""
    way_mm: Floats
    """(n,) way that each sample stands for."""
    apart_mm: Floats
    """(n,) distance from the predicted curve."""
    resolution_mm: float
    """What the last decimal of the logged angles is worth at the tip."""

    @property
    def on_mm(self) -> float:
        """Return the distance up to which a sample is right on the curve."""
        return max(_LIMITS.path_on_mm, _LIMITS.path_on_decimals * self.resolution_mm)

    @property
    def off_mm(self) -> float:
        """Return the distance above which a sample is off the curve."""
        return max(_LIMITS.path_off_mm, _LIMITS.path_off_decimals * self.resolution_mm)

    def share(self, rows: Bools) -> float:
        """Return the share of the way that some samples (n,) stand for."""
        return float(self.way_mm[rows].sum() / self.way_mm.sum())

    @cached_property
    def gone_mm(self) -> Floats:
        """(n,) way up to each sample."""
        return length_along(self.tip_mm)


def commanded_path(pair: Pair, tool: int | None = None) -> CommandedPath | None:
    """Return the commanded path of a run from where it first meets the curve to the prediction's end.

    ``tool``: the number of the tool whose tip it is; without one each of the prediction's own.
    None where there is no prediction, no motion, or no absolute angle of every joint.
    """
    table, inputs = pair.run.controller, pair.inputs
    if pair.from_log or pair.run.head.angles == "relative" or table is None or table.q_cmd_rad is None:
        return None
    if not np.isfinite(table.q_cmd_rad).all():
        return None
    tip_mm, apart_mm = _nearest_tool(table.q_cmd_rad, inputs, tool)
    steps_mm = np.linalg.norm(np.diff(tip_mm, axis=0), axis=1)
    way_mm = 0.5 * (np.append(steps_mm, 0.0) + np.append(0.0, steps_mm))
    resolution_mm = _last_decimal_rad(table.q_cmd_rad) * _reach_mm(tip_mm, inputs)
    rows = np.arange(len(tip_mm))
    rows = rows[way_mm > max(_LIMITS.path_still_mm, resolution_mm)]
    rows = rows[_of_the_program(tip_mm[rows], apart_mm[rows], inputs)]
    if len(rows) < 2:
        return None
    of_rows = pair.stamps(table)[rows], tip_mm[rows], way_mm[rows], apart_mm[rows]
    return CommandedPath(pair.name, inputs, *of_rows, resolution_mm)


def _nearest_tool(q_rad: Floats, inputs: Inputs, tool: int | None) -> tuple[Floats, Floats]:
    """Return tips (n, 3) and distances (n,) from the curve of the tool that is nearer to its own."""
    tips, apart = [], []
    for number in np.unique(inputs.tool):
        tip_mm = robot.forward(q_rad, inputs.cell, int(number) if tool is None else tool)[0]
        tips.append(tip_mm)
        apart.append(Curve(inputs.position_mm[inputs.tool == number]).foot(tip_mm)[1])
    best = np.argmin(apart, axis=0)
    rows = np.arange(len(q_rad))
    return np.stack(tips)[best, rows], np.stack(apart)[best, rows]


def _last_decimal_rad(q_rad: Floats) -> float:
    """Return the unit of the last decimal of degrees in which angles (n, 6) are stated."""
    q_deg = q_rad * DEG_PER_RAD
    for decimals in range(_LIMITS.log_most_decimals):
        if np.abs(q_deg - np.round(q_deg, decimals)).max() < 0.01 * 10.0**-decimals:
            return float(10.0**-decimals / DEG_PER_RAD)
    return float(10.0**-_LIMITS.log_most_decimals / DEG_PER_RAD)


def _reach_mm(tip_mm: Floats, inputs: Inputs) -> float:
    """Return the largest distance of the tip from the robot's root."""
    root_mm = np.linalg.inv(inputs.cell.base_matrix())[:3, 3]
    return float(np.linalg.norm(tip_mm - root_mm, axis=1).max())


def _of_the_program(tip_mm: Floats, apart_mm: Floats, inputs: Inputs) -> Bools:
    """Return which samples (n,) are neither on the way to the program's start nor after its end."""
    on = np.flatnonzero(apart_mm <= _LIMITS.path_off_mm)
    inside = np.ones(len(tip_mm), dtype=np.bool_)
    if len(on):
        inside[: on[0]] = False
        ended = np.linalg.norm(tip_mm - inputs.position_mm[-1], axis=1) <= _LIMITS.path_off_mm
        if ended.any():
            inside[np.flatnonzero(ended)[-1] + 1 :] = False
    return inside


class Curve:
    """A predicted path (m, 3) as segments no longer than a millimetre where that is not too many."""

    def __init__(self, position_mm: Floats) -> None:
        steps = np.linalg.norm(np.diff(position_mm, axis=0), axis=1)
        moving = np.concatenate([[True], steps > 0.0])
        points, gone = position_mm[moving], np.concatenate([[0.0], np.cumsum(steps[moving[1:]])])
        spacing = max(_LIMITS.curve_spacing_mm, gone[-1] / _LIMITS.curve_most_points)
        at = np.union1d(gone, np.arange(0.0, gone[-1], spacing))
        self.points = np.stack([np.interp(at, gone, column) for column in points.T], axis=1)
        self.tree = cKDTree(self.points)

    def foot(self, tip_mm: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the curve's points nearest to points (n, 3), distances (n,) and directions (n, 3)."""
        last = len(self.points) - 1
        _, near = self.tree.query(tip_mm, k=min(_LIMITS.curve_neighbours, last + 1))
        near = near.reshape(len(tip_mm), -1)
        first = np.clip(np.concatenate([near - 1, near], axis=1), 0, max(last - 1, 0))
        start = self.points[first]
        along = self.points[np.minimum(first + 1, last)] - start
        length = np.maximum(np.linalg.norm(along, axis=2), 1e-12)
        share = np.sum((tip_mm[:, None] - start) * along, axis=2) / length**2
        feet = start + np.clip(share, 0.0, 1.0)[:, :, None] * along
        apart = np.linalg.norm(tip_mm[:, None] - feet, axis=2)
        rows, best = np.arange(len(tip_mm)), np.argmin(apart, axis=1)
        return feet[rows, best], apart[rows, best], (along / length[:, :, None])[rows, best]


def on_the_curve(pair: Pair, frame: Floats | None = None, tool: int | None = None) -> bool:
    """Tell whether nearly all of a commanded path is on the predicted curve, moved by a frame (4, 4).

    ``tool``: the tool by which the controller works, where it is not the prediction's. True as well where
    nothing can be compared. An accurate model of the robot brings no frame and no tool onto the curve.
    """
    path = commanded_path(pair, tool)
    if path is None:
        return True
    back = np.eye(4) if frame is None else np.linalg.inv(frame)
    tip_mm = path.tip_mm @ back[:3, :3].T + back[:3, 3]
    _, apart_mm, _ = Curve(pair.inputs.position_mm).foot(tip_mm)
    inside = _of_the_program(tip_mm, apart_mm, pair.inputs)
    on_mm = float(path.way_mm[inside & (apart_mm <= path.on_mm)].sum())
    return on_mm > _LIMITS.path_mostly * float(path.way_mm[inside].sum())


Alike = tuple[tuple[str, str | None], ...]


@dataclass(frozen=True)
class Slip:
    """A slip, where it showed, and whether anything can be said beyond it."""

    applied: Applied
    link: Link
    rms_before: float
    """In the unit of the report, as ``rms_after``, which is None where the slip cannot be simulated."""
    rms_after: float | None
    unit: str
    words: str
    final: bool = False
    """The run cannot be compared further."""
    alike: Alike = ()
    """Names and targets of the slips that it cannot be told from; None for a target that is not known."""


def motion_traces(pairs: Sequence[Pair]) -> list[Trace]:
    """Return what shows how far the runs have come: their joints, or without any their tips."""
    joints = [trace for pair in pairs if (trace := PATH.motion(pair)) is not None]
    long = [trace for trace in joints if len(trace.time_s) >= _LIMITS.trace_least_rows]
    return long or MECHANICS.traces(pairs)


def rms_left(traces: Sequence[Trace], applied: Applied) -> float:
    """Return the rms length of what is left with an effect in the model."""
    return rms_length(trace.measured - trace.sample([applied]) for trace in traces)


def rms_before(traces: Sequence[Trace]) -> float:
    """Return the rms length of the gap, a constant clock error of a run left in."""
    return rms_length(trace.residual for trace in traces)


def best_of(traces: Sequence[Trace], candidates: Sequence[Applied]) -> tuple[Applied, float]:
    """Return the effect that leaves least, and the rms that it leaves; inf where none can be simulated."""
    best, least = candidates[0], float("inf")
    for candidate in candidates:
        try:
            rms_mm = rms_left(traces, candidate)
        except Gcode2KrlError:
            continue
        if rms_mm < least:
            best, least = candidate, rms_mm
    return best, least


def slip_if_explained(traces: Sequence[Trace], applied: Applied, after: float, words: str) -> list[Slip]:
    """Return the slip where it takes nine tenths of the gap's power; ``after`` is the rms that it leaves."""
    before = rms_before(traces)
    if after**2 > (1.0 - _LIMITS.explained_share) * before**2:
        return []
    link, factor = traces[0].link, traces[0].factor
    return [Slip(applied, link, before * factor, after * factor, link.unit, words)]


def final_slip(effect: Effect, target: str | None, words: str, pairs: Sequence[Pair]) -> Slip:
    """Return a slip beyond which nothing is compared."""
    traces = motion_traces(pairs)
    factor, unit = (traces[0].factor, traces[0].link.unit) if traces else (1.0, "mm")
    before = rms_before(traces) if traces else 0.0
    values = {p.name: p.start if p.nominal is None else p.nominal for p in effect.parameters}
    return Slip(Applied(effect, target, values), PATH, before * factor, None, unit, words, final=True)


_EFFECT_OF = {"run-unit": "unit", "run-axes": "unit", "run-program": "other_program"}
"""Code of a finding that ends the comparison -> effect."""


def checked(pairs: Sequence[Pair]) -> list[Issue]:
    """Return what the checks say against the runs; a log alone has nothing to be checked against."""
    return [
        issue
        for pair in pairs
        if not pair.from_log
        for issue in check_against(
            pair.run, pair.inputs.time_s, pair.inputs.position_mm, pair.inputs.q_cmd_rad
        )
    ]


def check_slip(pairs: Sequence[Pair], library: Mapping[str, Effect], issues: Iterable[Issue]) -> list[Slip]:
    """Return the first finding of the checks after which nothing can be compared, as a slip."""
    for issue in issues:
        effect = library.get(_EFFECT_OF.get(issue.code, ""))
        if issue.severity == "error" and effect is not None:
            file = issue.message.split(".")[0].split(":")[0]
            target = file if file in effect.targets(pairs[0].inputs.cell) else None
            return [final_slip(effect, target, issue.message, pairs)]
    return []


_CLOCK = "clock"


def clock_slips(pairs: Sequence[Pair], library: Mapping[str, Effect]) -> list[Slip]:
    """Return the median offset that was taken off each table's stamps, where it is not zero."""
    effect = library.get(_CLOCK)
    if effect is None:
        return []
    return [slip for link in (PATH, MECHANICS) if (slip := _clock_of(link, pairs, effect)) is not None]


def _clock_of(link: Link, pairs: Sequence[Pair], effect: Effect) -> Slip | None:
    """Return the clock of the table that a link's signal is in."""
    table = link.table
    offset_s = float(np.median([pair.clock_s.get(table, 0.0) for pair in pairs]))
    if offset_s == 0.0:
        return None
    as_stamped = [replace(pair, clock_s={**pair.clock_s, table: 0.0}) for pair in pairs]
    on_time, off = link.traces(pairs), link.traces(as_stamped)
    if not on_time or not off:
        return None
    before, after = (on_time[0].factor * rms_before(traces) for traces in (off, on_time))
    applied = Applied(effect, table, {"offset_s": offset_s, "skew": 0.0})
    words = f"the clock of {table} is {offset_s:+.3f} s off the prediction's"
    return Slip(applied, link, before, after, link.unit, words)


_FORCE_UNIT = "unit"
_UNITS = {
    1e-3: "kilonewtons",
    0.1019716: "kilograms-force",
    0.2248089: "pounds-force",
    1e3: "millinewtons",
    10.0: "decinewtons",
}
"""How many of a unit a newton is."""


def force_unit_slip(pairs: Sequence[Pair], library: Mapping[str, Effect]) -> list[Slip]:
    """Return the unit of force, where the measured forces are those of the prediction in it."""
    traces, effect = FORCE.traces(pairs), library.get(_FORCE_UNIT)
    if effect is None or not any(trace.nominal.any() for trace in traces):
        return []
    power = sum(float(np.sum(trace.nominal**2)) for trace in traces)
    factor = max(sum(float(np.sum(trace.nominal * trace.measured)) for trace in traces) / power, 1e-12)
    unit = min(_UNITS, key=lambda known: abs(log(factor / known)))
    if abs(log(factor / unit)) > _LIMITS.force_unit_log:
        return []
    applied = Applied(effect, "force", {"factor": unit})
    words = f"force.csv is {unit:g} times the predicted force: {_UNITS[unit]} in place of newtons"
    return slip_if_explained(traces, applied, rms_left(traces, applied), words)


def without_cuts(pairs: Iterable[Pair]) -> tuple[list[Pair], list[Issue]]:
    """Return the pairs, those in air without forces; a warning for each that nobody stated."""
    pairs_in_air, issues = [], []
    for pair in pairs:
        stated, nothing = pair.run.head.in_air, np.zeros_like(pair.inputs.force_base_N)
        inputs = replace(pair.inputs, force_base_N=nothing, moment_base_Nmm=nothing, forces=None, cut=None)
        in_air = replace(pair, inputs=inputs)
        cuts = stated is False or not pair.inputs.force_base_N.any()
        if cuts or not (stated or _is_nearer(pair, in_air)):
            pairs_in_air.append(pair)
            continue
        pairs_in_air.append(in_air)
        if not stated:
            words = f"{pair.name}: the tip shows nothing of the predicted deflection: taken as a run in air"
            remedy = "in_air = true in run.toml; false where something was cut"
            issues.append(Issue("warning", "run-in-air", 0, words, remedy))
    return pairs_in_air, issues


def _is_nearer(pair: Pair, in_air: Pair) -> bool:
    """Tell whether the tip is nearer to the model without forces from the first cut to the last."""
    traces, bare = MECHANICS.traces([pair]), MECHANICS.traces([in_air])
    if not traces or not bare or traces[0].frame != "base":
        return False
    _, rows, bare_rows = np.intersect1d(traces[0].time_s, bare[0].time_s, return_indices=True)
    cutting, air = traces[0].residual[rows], bare[0].residual[bare_rows]
    bent_mm = np.linalg.norm(traces[0].nominal[rows] - bare[0].nominal[bare_rows], axis=1)
    is_bent = bent_mm > 0.5 * bent_mm.max(initial=0.0)
    if is_bent.sum() < _LIMITS.trace_least_rows:
        return False
    quarters = zip(np.array_split(cutting[is_bent], 4), np.array_split(air[is_bent], 4), strict=True)
    return all(rms_length([bare]) < _LIMITS.air_share * rms_length([bent]) for bent, bare in quarters)


_OVERRIDE = "override"


def override_slip(pairs: Sequence[Pair], library: Mapping[str, Effect]) -> list[Slip]:
    """Return another override: the estimate by the duration, refined by simulating the motion again."""
    effect = library.get(_OVERRIDE)
    if effect is None or any(pair.from_log for pair in pairs):
        return []
    percents = [percent for pair in pairs if (percent := _percent(pair)) is not None]
    if not percents or abs(float(np.median(percents)) - 100.0) < _LIMITS.override_off_percent:
        return []
    traces = motion_traces(pairs)
    if not traces:
        return []
    tried = float(np.median(percents)) * np.array(_LIMITS.override_first_tries)
    best, after = best_of(traces, [Applied(effect, None, {"percent": float(each)}) for each in tried])
    for width in _LIMITS.override_widths:
        around = best.values["percent"] * (1.0 + width * np.array([-0.5, 0.0, 0.5, -1.0, 1.0]))
        best, after = best_of(traces, [replace(best, values={"percent": float(each)}) for each in around])
    words = f"the run was at {best.values['percent']:.1f} % override"
    return slip_if_explained(traces, best, after, words)


def _percent(pair: Pair) -> float | None:
    """Return 100 times predicted over measured time in motion; None where paths differ in length."""
    controller, tracker = pair.run.controller, pair.run.tracker
    if controller is not None and controller.path_rad is not None and np.isfinite(controller.path_rad).all():
        measured_s, way = _in_motion(controller.time_s, controller.path_rad, _LIMITS.still_rad_s)
        predicted_s, planned = _in_motion(pair.inputs.time_s, pair.inputs.q_cmd_rad, _LIMITS.still_rad_s)
    elif tracker is not None:
        measured_s, way = _in_motion(tracker.time_s, tracker.position_mm, _LIMITS.still_mm_s)
        predicted_s, planned = _in_motion(pair.inputs.time_s, pair.inputs.position_mm, _LIMITS.still_mm_s)
    else:
        return None
    if measured_s <= 0.0 or predicted_s <= 0.0 or abs(way / planned - 1.0) > _LIMITS.override_same_length:
        return None
    return 100.0 * predicted_s / measured_s


def _in_motion(time_s: Floats, values: Floats, still: float) -> tuple[float, float]:
    """Return for how long values (n, k) move faster than ``still`` a second, and how far in their unit."""
    every = max(1, round(_LIMITS.motion_step_s / usual_step_s(time_s)))
    way = np.linalg.norm(np.diff(values[::every], axis=0), axis=1)
    step_s = np.diff(time_s[::every])
    moves = way > still * step_s
    return float(step_s[moves].sum()), float(way[moves].sum())


_STOPS = "advance_stop"


def unplanned_stops(pairs: Sequence[Pair], library: Mapping[str, Effect]) -> tuple[list[Slip], list[Pair]]:
    """Return the stops as one slip, and the pairs with them in the plan; without any the pairs as given."""
    effect, unchanged = library.get(_STOPS), list(pairs)
    traces = motion_traces(pairs)
    plannable = all("plan" in pair.inputs.offers for pair in pairs)
    if effect is None or not plannable or len(traces) < len(pairs):
        return [], unchanged
    before, link, factor = _rms(traces), traces[0].link, traces[0].factor
    if before < link.least_off:
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
    slip = Slip(applied, link, before * factor, stops.rms_left * factor, link.unit, words)
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
    kept: list[_Stops] = []
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
        after = _rms(motion_traces([_on_time(pair) for pair in stopped]))
        if after**2 < (1.0 - _LIMITS.stop_explained_share) * before**2:
            kept.append(_Stops(rows, hold_s, stopped, after))
    least = min((each.rms_left for each in kept), default=0.0)
    return next((each for each in reversed(kept) if each.rms_left <= _LIMITS.stop_as_good * least), None)


def _held(pairs: Sequence[Pair], stops: Sequence[Ints]) -> tuple[float, list[Pair]]:
    """Return how long (s) the robot stands at each stop, and the pairs with the stops planned."""
    hold_s, stopped = 0.0, list(pairs)
    for _ in range(_LIMITS.stop_hold_steps):
        stopped = [
            replace(pair, inputs=with_stops(pair.inputs, rows, hold_s)) if len(rows) else pair
            for pair, rows in zip(pairs, stops, strict=True)
        ]
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
    for first, last in pairwise(edges):
        at = first + (last - first) * np.linspace(0.35, 0.65, 7)  # the middle third of the leg
        behind = np.median(np.interp(at, run_way, run_s) - np.interp(at, way, time_s))
        # what the run did after the prediction's end was not looked at
        late.append(float(behind) if at[-1] < run_way[-1] else late[-1])
    return np.diff(late[1:])


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
    return rms(np.concatenate([trace.residual.ravel() for trace in traces]))


def other_feeds(paths: Sequence[CommandedPath]) -> str | None:
    """Return what shows that feeds are not the predicted ones, as a sentence; None where nothing does.

    An override scales feeds and rapids alike, so the share of feeds is compared with that of rapids. Rapids
    at a smaller share than feeds show nothing: T1 and the limits of the axes slow them down.
    """
    ratios = [ratio for path in paths for ratio in _ratios(path)]
    rapid = np.array([ratio for ratio, is_rapid in ratios if is_rapid])
    feed = np.array([ratio for ratio, is_rapid in ratios if not is_rapid])
    if len(rapid) == 0 or len(feed) == 0:
        return None
    of_feed, of_rapid = float(np.median(feed)), float(np.median(rapid))
    spread = float(np.median(np.abs(feed / of_feed - 1.0)))
    slower = of_feed < (1.0 - _LIMITS.feed_other) * of_rapid
    faster = of_feed > 1.0 + _LIMITS.feed_other and abs(of_rapid - 1.0) < _LIMITS.feed_consistent
    if spread > _LIMITS.feed_consistent or not (slower or faster):
        return None
    return (
        f"feed moves at {100.0 * of_feed:.0f} % of the predicted speed, rapid ones at "
        f"{100.0 * of_rapid:.0f} %: the run is of another program"
    )


def _ratios(path: CommandedPath) -> Iterator[tuple[float, bool]]:
    """Yield measured over predicted speed on each stretch at the programmed speed, and whether it is rapid.

    Where the curve is the same.
    """
    inputs = path.inputs
    steps = np.linalg.norm(np.diff(inputs.position_mm, axis=0), axis=1)
    planned_mm = np.concatenate([[0.0], np.cumsum(steps)])
    length_mm = path.gone_mm[-1]
    same = path.share(path.apart_mm <= path.off_mm) >= _LIMITS.feed_same_curve and planned_mm[-1] > 0.0
    if inputs.toolpath is None or not same:
        return
    if abs(length_mm / planned_mm[-1] - 1.0) > _LIMITS.feed_same_length:
        return
    gone_mm = path.gone_mm * (planned_mm[-1] / length_mm)
    for start, end in _steady(steps, inputs):
        edge_mm = _LIMITS.feed_edge_share * (planned_mm[end] - planned_mm[start])
        at_mm = np.linspace(planned_mm[start] + edge_mm, planned_mm[end] - edge_mm, 3)
        there_s = np.diff(np.interp(at_mm, planned_mm, inputs.time_s))
        here_s = np.diff(np.interp(at_mm, gone_mm, path.time_s))
        if (here_s > 0.0).all() and abs(here_s[0] / here_s[1] - 1.0) < _LIMITS.feed_constant:
            rapid = bool(inputs.toolpath.rapid[inputs.move[end]])
            yield float(there_s.sum() / here_s.sum()), rapid


def _steady(steps_mm: Floats, inputs: Inputs) -> Iterator[tuple[int, int]]:
    """Yield the first and last sample of stretches at the programmed speed; steps are (m - 1,).

    A move too short to reach its programmed speed has no such stretch: an override does not change its peak.
    """
    toolpath, targets = inputs.toolpath, inputs.targets
    if toolpath is None or targets is None:
        return
    programmed_mm_s = np.full(len(toolpath.rapid), np.nan)
    of_moves = targets.move >= 0
    programmed_mm_s[targets.move[of_moves]] = targets.speed_mm_s[of_moves]
    speed_mm_s = steps_mm / np.diff(inputs.time_s)
    at_speed = np.abs(speed_mm_s / programmed_mm_s[inputs.move[1:]] - 1.0) < _LIMITS.feed_constant
    same_move = np.append(True, inputs.move[1:-1] == inputs.move[2:])
    starts = at_speed & ~(np.append(False, at_speed[:-1]) & same_move)
    ends = at_speed & ~(np.append(at_speed[1:], False) & np.append(same_move[1:], False))
    for start, end in zip(np.flatnonzero(starts).tolist(), np.flatnonzero(ends).tolist(), strict=True):
        if inputs.time_s[end + 1] - inputs.time_s[start] >= _LIMITS.feed_least_s:
            yield start, end + 1


_OTHER_PROGRAM = "other_program"


def program_slip(pairs: Sequence[Pair], library: Mapping[str, Effect]) -> list[Slip]:
    """Return the slip where a commanded path shows another program. Nothing is compared beyond it."""
    effect = library.get(_OTHER_PROGRAM)
    words = other_program(pairs) if effect is not None else None
    return [] if effect is None or words is None else [final_slip(effect, None, words, pairs)]


def other_program(pairs: Sequence[Pair]) -> str | None:
    """Return what shows that the runs are of another program, as a sentence; None where nothing does."""
    paths = [path for pair in pairs if (path := commanded_path(pair)) is not None]
    for path in paths:
        words = _beside(path)
        if words is not None:
            return f"{path.name}: {words}: the run is of another program"
    return other_feeds(paths)


def _beside(path: CommandedPath) -> str | None:
    """Return from when on a path is beside the curve, where part of it is right on it; None otherwise."""
    on = _long_stretches(path.apart_mm <= path.on_mm, path.way_mm)
    on_way_mm = sum(float(path.way_mm[rows].sum()) for rows in on)
    if not on or on_way_mm < _LIMITS.program_on_share * path.way_mm.sum():
        return None
    off = _long_stretches(path.apart_mm > path.off_mm, path.way_mm)
    off = [rows for rows in off if not _in_corners(path, rows)]
    if not off or _is_frame(path):
        return None
    most_mm = max(float(path.apart_mm[rows].max()) for rows in off)
    return (
        f"from t = {path.time_s[off[0].start]:.1f} s the commanded path is up to {most_mm:.3g} mm beside "
        "the predicted one"
    )


def _long_stretches(rows: Bools, way_mm: Floats) -> list[slice]:
    """Return the stretches of True rows (n,) whose way is longer than that of corners."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], rows, [False]]).astype(np.int8)))
    stretches = [slice(int(start), int(end)) for start, end in edges.reshape(-1, 2)]
    return [each for each in stretches if float(way_mm[each].sum()) > _LIMITS.program_off_way_mm]


def _in_corners(path: CommandedPath, rows: slice) -> bool:
    """Tell whether a stretch may be blended corners, whatever their approximation distance.

    A blend stays in the triangle of its corner and of a point on each leg, at most half a move away from it.
    """
    targets = path.inputs.targets
    if targets is None or len(targets.position_mm) < 3:
        return False
    blended = targets.cdis_mm[1:-1] > 0.0
    moves_mm = np.diff(targets.position_mm, axis=0)
    corner_mm = targets.position_mm[1:-1][blended]
    legs_mm = -_leg_mm(moves_mm[:-1][blended]), _leg_mm(moves_mm[1:][blended])
    chosen = np.unique(np.linspace(rows.start, rows.stop - 1, _LIMITS.program_corner_rows).astype(np.int64))
    outside = [not _in_a_triangle(tip, corner_mm, *legs_mm, path.off_mm) for tip in path.tip_mm[chosen]]
    way_mm = float(path.way_mm[rows].sum())
    return float(np.mean(outside)) * way_mm <= _LIMITS.program_off_way_mm


def _leg_mm(move_mm: Floats) -> Floats:
    """Return half of each move (c, 3), at most the largest approximation distance."""
    length = np.maximum(np.linalg.norm(move_mm, axis=1, keepdims=True), 1e-12)
    leg: Floats = move_mm * np.minimum(0.5, _LIMITS.corner_blend_mm / length)
    return leg


def _in_a_triangle(
    tip_mm: Floats, corner_mm: Floats, back_mm: Floats, on_mm: Floats, slack_mm: float
) -> bool:
    """Tell whether a point (3,) is in one of the triangles corner, corner + back, corner + on (c, 3)."""
    to = tip_mm - corner_mm
    bb, oo, bo = (np.sum(u * v, axis=1) for u, v in ((back_mm, back_mm), (on_mm, on_mm), (back_mm, on_mm)))
    area = bb * oo - bo**2
    turns = area > 1e-6 * bb * oo
    tb, to_on = np.sum(to * back_mm, axis=1), np.sum(to * on_mm, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        along_back, along_on = (oo * tb - bo * to_on) / area, (bb * to_on - bo * tb) / area
        off_plane = np.linalg.norm(to - along_back[:, None] * back_mm - along_on[:, None] * on_mm, axis=1)
        least_back, least_on = -slack_mm / np.sqrt(bb), -slack_mm / np.sqrt(oo)
        inside = (along_back > least_back) & (along_on > least_on) & (along_back + along_on < 1.0)
    return bool(np.any(turns & inside & (off_plane < slack_mm)))


def _is_frame(path: CommandedPath) -> bool:
    """Tell whether one shift and turn bring the whole path onto the curve: then it is in another frame.

    Points to lines by least squares, each step from the feet of the one before (Chen & Medioni 1992).
    """
    rows = np.unique(np.linspace(0, len(path.tip_mm) - 1, _LIMITS.program_frame_rows).astype(np.int64))
    moved, way_mm, curve = path.tip_mm[rows], path.way_mm[rows], Curve(path.inputs.position_mm)
    for _ in range(_LIMITS.program_frame_steps):
        feet, apart_mm, along = curve.foot(moved)
        on_way_mm = float(way_mm[apart_mm <= path.on_mm].sum())
        if on_way_mm > _LIMITS.program_frame_share * float(way_mm.sum()):
            return True
        moved = moved + _twist(moved, feet - moved, along)
    return False


def _twist(points_mm: Floats, wanted_mm: Floats, along: Floats) -> Floats:
    """Return the displacement (n, 3) by the small shift and turn that best bring points onto lines.

    ``wanted_mm`` : (n, 3) from each point to its line, whose direction is ``along``.
    """
    lever = points_mm - points_mm.mean(axis=0)
    scale_mm = float(np.sqrt(np.mean(np.sum(lever**2, axis=1)))) or 1.0
    across = np.eye(3) - along[:, :, None] * along[:, None, :]
    turns = np.cross(np.eye(3)[None], lever[:, None, :]) / scale_mm  # (n, 3 turns, 3)
    moves = np.concatenate([np.broadcast_to(np.eye(3), (len(lever), 3, 3)), turns], axis=1)
    design = np.einsum("nij,nkj->nik", across, moves).reshape(-1, 6)
    target = np.einsum("nij,nj->ni", across, wanted_mm).ravel()
    values = np.linalg.lstsq(design, target, rcond=1e-9)[0]
    added: Floats = np.einsum("k,nkj->nj", values, moves)
    return added
