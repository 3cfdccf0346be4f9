"""The links of the measuring chain: what is measured against what, run by run.

timing and path: q_cmd of the log against the predicted one · servo: q_act - q_cmd · gear: q_load - q_act ·
force: measured against predicted · mechanics: tip against FK(joints) + C(q)·F. The measured signal before a
link is the input of its model, so that an error upstream is not blamed twice.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.effects import Applied, Inputs
from gcode2krl.gap.beside.holdout import with_rows
from gcode2krl.gap.beside.pair import Pair, usable_rows
from gcode2krl.gap.beside.trace import Trace, nearest_rows
from gcode2krl.runs import Controller, Measured
from gcode2krl.units import DEG_PER_RAD, RAD_PER_DEG

JOINTS = ("A1", "A2", "A3", "A4", "A5", "A6")
LINKS = ("timing", "path", "servo", "gear", "force", "mechanics", "part")
EXAMINED = ("path", "servo", "gear", "force", "mechanics")
"""Links with a model of their own; timing is the tangential part of path."""
MODEL_RAD = 4e-4 * RAD_PER_DEG
"""The predicted path is right to 0.01 mm (design/gap.md), 4e-4 degrees at an arm's length."""
_JUMP_S, _JUMP, _AROUND_S = 0.012, 0.1, 0.02
"""A change by a tenth of the largest force within 12 ms is a jump; a cutter enters in tenths of a second."""
_MOVES_RAD = 1e-4 * RAD_PER_DEG
SIGNAL = {
    "timing": "timing", "path": "joint_commanded", "servo": "joint_actual", "gear": "joint_load",
    "force": "force", "mechanics": "tcp", "part": "scan",
}  # fmt: skip
UNIT = {
    "timing": "s",
    "path": "deg",
    "servo": "deg",
    "gear": "deg",
    "force": "N",
    "mechanics": "mm",
    "part": "mm",
}
_NEEDS = {
    "timing": "controller.csv with q1_cmd_deg …, and a prediction",
    "path": "controller.csv with q1_cmd_deg …, and a prediction",
    "servo": "controller.csv with q1_cmd_deg … and q1_act_deg …",
    "gear": "controller.csv with q1_load_deg … (encoders behind the gear)",
    "force": "force.csv, and a prediction with forces",
    "mechanics": "tracker.csv, absolute angles and a known robot",
    "part": "scan.csv with walls that the cutter has left, a prediction with forces, one tool axis",
}


def needs(link: str) -> str:
    """Return what a run must hold for a link to be examined."""
    return _NEEDS[link]


def traces_of(link: str, pairs: Sequence[Pair], found: Sequence[Applied] = ()) -> list[Trace]:
    """Return the measured signals of a link, one a run that has it; ``found`` belongs to the model."""
    build = {"path": _path, "servo": _servo, "gear": _gear, "force": _force, "mechanics": _mechanics}[link]
    traces = [build(pair, tuple(found)) for pair in pairs]
    return [trace for trace in traces if trace is not None and len(trace.time_s) >= 10]


def _path(pair: Pair, found: tuple[Applied, ...]) -> Trace | None:
    table = pair.run.controller
    if table is None or table.q_cmd_rad is None or pair.from_log or pair.run.head.angles == "relative":
        return None
    # joints alone: what plans anew need not remove the material again
    pair = replace(pair, inputs=replace(pair.inputs, cut=None, forces=None))
    return _joint_trace(pair, table, "path", table.q_cmd_rad, "q_cmd_rad", None, found)


def _servo(pair: Pair, found: tuple[Applied, ...]) -> Trace | None:
    table = pair.run.controller
    if table is None or table.q_act_rad is None or table.q_cmd_rad is None:
        return None
    pair = pair.with_measured_joints("q_cmd")
    apart = table.q_act_rad - table.q_cmd_rad - logged_correction(pair, table)
    return _joint_trace(pair, table, "servo", apart, "q_act_rad", "q_cmd_rad", found)


def logged_correction(pair: Pair, table: Controller) -> Floats:
    """Return what a logged RSI correction moves the joints by (n, 6); rows without an answer hold the last.

    Under a correction the commanded columns stay those of the program and the actual ones move.
    """
    joints = np.zeros((len(table), 6))
    if table.q_correction_rad is not None:
        joints += _held(table.q_correction_rad)
    if table.correction_mm is not None:
        twist = np.zeros((len(table), 6))
        twist[:, :3] = _held(table.correction_mm)
        if table.correction_rad is not None:  # A, B, C turn about z, y, x
            twist[:, 3:] = _held(table.correction_rad)[:, ::-1]
        jacobian = pair.inputs.jacobian[nearest_rows(pair.inputs.time_s, pair.stamps(table))]
        joints += np.linalg.solve(jacobian, twist[:, :, None])[:, :, 0]
    return np.cumsum(joints, axis=0) if pair.run.head.channels.correction == "relative" else joints


def _held(values: Floats) -> Floats:
    """Return the values with the last one before each that is missing; 0 before the first."""
    known = np.isfinite(values)
    row = np.maximum.accumulate(np.where(known, np.arange(len(values))[:, None], -1), axis=0)
    held: Floats = np.take_along_axis(np.nan_to_num(values), np.maximum(row, 0), axis=0)
    return np.where(row >= 0, held, 0.0)


def _gear(pair: Pair, found: tuple[Applied, ...]) -> Trace | None:
    table = pair.run.controller
    if table is None or table.q_load_rad is None or table.q_act_rad is None:
        return None
    pair = pair.with_measured_joints("q_act")
    apart = table.q_load_rad - table.q_act_rad
    return _joint_trace(pair, table, "gear", apart, "q_load_rad", "q_act_rad", found)


def _joint_trace(
    pair: Pair, table: Controller, link: str, values: Floats, plus: str, minus: str | None,
    found: tuple[Applied, ...],
) -> Trace | None:  # fmt: skip
    there = np.isfinite(values).all(axis=0) & _moves(table)
    stamps = pair.stamps(table)
    rows, segments = usable_rows(table, stamps, pair.inputs)
    if not there.any() or len(rows) == 0:
        return None
    noise = pair.run.head.noise
    stated = {"gear": noise.q_load_deg, "servo": noise.q_act_deg}.get(link)
    if link == "gear" and stated is not None:
        stated = float(np.hypot(stated, noise.q_act_deg or stated))
    sigma = MODEL_RAD if link == "path" else None if stated is None else stated * RAD_PER_DEG
    columns = tuple(np.flatnonzero(there).tolist())
    return Trace(
        link=link,
        run=pair.name,
        run_number=pair.number,
        signal=SIGNAL[link],
        unit="deg",
        factor=DEG_PER_RAD,
        components=tuple(JOINTS[column] for column in columns),
        columns=columns,
        plus=plus,
        minus=minus,
        inputs=pair.inputs,
        base=found,
        time_s=stamps[rows],
        measured=values[np.ix_(rows, np.array(columns))],
        segments=segments,
        declared_sigma=sigma,
    )


def _moves(table: Controller) -> Bools:
    """Return which joints (6,) ever move, by whatever of them is recorded; a joint at rest tells nothing."""
    moving = np.zeros(6, dtype=np.bool_)
    for values in (table.q_cmd_rad, table.q_act_rad):
        if values is not None:
            moving |= np.nan_to_num(np.ptp(values, axis=0)) > _MOVES_RAD
    return moving


def _force(pair: Pair, found: tuple[Applied, ...]) -> Trace | None:
    table = pair.run.force
    if table is None or pair.from_log:
        return None
    trace = _vector_trace(pair, table, "force", table.force_N, "force_meas_base_N", found)
    frame = pair.run.head.frames.force
    noise = pair.run.head.noise.force_N
    return replace(
        trace, in_sensor_frame=frame == "sensor", in_tool_frame=frame == "tcp", declared_sigma=noise
    )


def _mechanics(pair: Pair, found: tuple[Applied, ...]) -> Trace | None:
    table = pair.run.tracker
    if table is None or (pair.from_log and pair.run.head.angles == "relative"):
        return None
    pair = pair.with_measured_joints("q_load")
    trace = _vector_trace(pair, table, "mechanics", table.position_mm, "tcp_base_mm", found)
    frame = pair.run.head.frames.tracker
    return replace(
        trace,
        in_sensor_frame=frame == "sensor",
        in_tool_frame=frame == "tcp",
        declared_sigma=pair.run.head.noise.tcp_mm,
    )


def _vector_trace(
    pair: Pair, table: Measured, link: str, values: Floats, plus: str, found: tuple[Applied, ...]
) -> Trace:
    stamps = pair.stamps(table)
    rows, segments = usable_rows(table, stamps, pair.inputs)
    trace = Trace(
        link=link,
        run=pair.name,
        run_number=pair.number,
        signal=SIGNAL[link],
        unit=UNIT[link],
        factor=1.0,
        components=("x", "y", "z"),
        columns=(0, 1, 2),
        plus=plus,
        inputs=pair.inputs,
        base=found,
        time_s=stamps[rows],
        measured=values[rows],
        segments=segments,
    )
    return with_rows(trace, ~at_edges(pair.inputs, trace.time_s))


def at_edges(inputs: Inputs, time_s: Floats) -> Bools:
    """Return where (n,) the predicted force jumps, some hundredths of a second around it.

    Removal finds an edge of the cut to a sample; within it the force is right or wrong by all of itself.
    """
    force = inputs.force_base_N
    largest = float(np.linalg.norm(force, axis=1).max(initial=0.0))
    if largest == 0.0:
        return np.zeros(len(time_s), dtype=np.bool_)
    own_s = inputs.time_s
    later = np.stack([np.interp(own_s + _JUMP_S, own_s, column) for column in force.T], axis=1)
    jumps = own_s[np.linalg.norm(later - force, axis=1) > _JUMP * largest] + _JUMP_S / 2.0
    if len(jumps) == 0:
        return np.zeros(len(time_s), dtype=np.bool_)
    after = np.clip(np.searchsorted(jumps, time_s), 1, len(jumps) - 1) if len(jumps) > 1 else 0
    before = np.maximum(after - 1, 0)
    nearest = np.minimum(np.abs(time_s - jumps[after]), np.abs(time_s - jumps[before]))
    near: Bools = nearest < _AROUND_S
    return near
