"""Runs without a prediction: the log's own commanded joints are the path."""

from collections.abc import Sequence

import numpy as np

from gcode2krl import frames as fr
from gcode2krl import robot
from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell, load_cell
from gcode2krl.cell.carried import require_still
from gcode2krl.effects import Inputs
from gcode2krl.effects.operators import play
from gcode2krl.gap.beside.decimals import resolution
from gcode2krl.gap.beside.interpolation import cubic, linear
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.beside.pairing import first_start, hours_since
from gcode2krl.gap.beside.poses import is_of_poses, pose_pair
from gcode2krl.gap.beside.temperature import temperature_at
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.runs import Controller, Run
from gcode2krl.units import MM_PER_M

_LIMITS = THRESHOLDS.beside


def log_pairs(runs: Sequence[Run], cell: Cell | None) -> list[Pair]:
    """Return a pair for each run that has a controller's table, or poses."""
    first, known_robot = first_start(runs), cell is not None
    cell = load_cell() if cell is None else cell
    require_still(cell, "a diagnosis of logs")
    pairs = []
    for number, run in enumerate(runs):
        if is_of_poses(run):
            pairs.append(pose_pair(run, number, cell, hours_since(first, run), known_robot))
            continue
        inputs = _inputs(run, cell, hours_since(first, run), known_robot)
        if inputs is not None:
            pairs.append(Pair(run=run, number=number, inputs=inputs, from_log=True, known_robot=known_robot))
    return pairs


def _inputs(run: Run, cell: Cell, hours: float, known_robot: bool) -> Inputs | None:
    table = run.controller
    if table is None:
        return None
    path = next((q for q in (table.q_cmd_rad, table.q_act_rad, table.q_load_rad) if q is not None), None)
    if path is None:
        return None
    time_s, logged = _often_enough(table.time_s), np.nan_to_num(path)
    # a commanded angle that stands flickers by its last decimal, which is no reversal
    still = [resolution(column) * np.sqrt(12.0) for column in logged.T]
    between = cubic(time_s, table.time_s, logged)
    q = np.stack([play(column, width) for column, width in zip(between.T, still, strict=True)], axis=1)
    count = len(q)
    tool = cell.usual_tool or 1
    kinematic = known_robot and run.head.angles == "absolute" and bool(np.isfinite(path).all())
    position, rotation = np.zeros((count, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
    if kinematic:
        position, rotation = robot.forward(q, cell, tool)
    load = np.zeros((count, 3))
    if kinematic and run.force is not None:
        measured = linear(time_s, run.force.time_s, run.force.force_N)
        if run.head.frames.force != "base":
            turned = fr.rotation_from_quaternion(rotation)
            if run.head.frames.force == "sensor":
                turned = turned @ cell.tool_matrix(tool)[:3, :3].T
            measured = np.einsum("nij,nj->ni", turned, measured)
        load = measured
    torque_Nm = _torque_Nm(table)
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(position, axis=0), axis=1))])
    return Inputs(
        cell=cell,
        time_s=time_s,
        move=np.zeros(count, dtype=np.int32),
        source_line=np.zeros(count, dtype=np.int32),
        path_mm=way,
        tool=np.full(count, tool, dtype=np.int32),
        spindle_rad_s=np.zeros(count),
        q_cmd_rad=q,
        position_mm=position,
        rotation=rotation,
        force_base_N=load,
        moment_base_Nmm=np.zeros((count, 3)),
        hours=hours,
        torque_Nm=None if torque_Nm is None else linear(time_s, table.time_s, torque_Nm),
        temperature_C=temperature_at(table, time_s),
    )


def _often_enough(time_s: Floats) -> Floats:
    """Return the times of a log with others between them where a drive's lag would miss what lies there.

    A lag of 12 ms that is filtered over lines between samples of 12 ms is off by a hundredth of itself.
    """
    parts = int(np.ceil(np.median(np.diff(time_s)) / _LIMITS.fine_step_s - 1e-6))
    if parts < 2:
        return time_s
    shares = np.arange(parts) / parts
    between: Floats = (time_s[:-1, None] + np.diff(time_s)[:, None] * shares).ravel()
    return np.append(between, time_s[-1])


def _torque_Nm(table: Controller) -> Floats | None:
    """Return the logged torque (n, 6) or, in its place, the current; None where there is neither."""
    if table.torque_Nmm is not None:
        return np.nan_to_num(table.torque_Nmm / MM_PER_M)
    return None if table.current_A is None else np.nan_to_num(table.current_A)
