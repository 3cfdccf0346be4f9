"""Static poses as a run: each pose one sample, without a time law, a clock or a load."""

import numpy as np

from gcode2krl import robot
from gcode2krl.cell import Cell
from gcode2krl.effects import Inputs
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.beside.temperature import temperature_at
from gcode2krl.runs import Run


def is_of_poses(run: Run) -> bool:
    """Tell whether a run is one of static poses; beside a tracker's table they are not looked at."""
    return run.poses is not None and run.tracker is None and run.controller is None


def pose_pair(run: Run, number: int, cell: Cell, hours: float, known_robot: bool = True) -> Pair:
    """Return a run of poses beside the robot's own kinematics: no motion is planned between them."""
    table = run.poses
    if table is None:
        raise ValueError("a run of poses has a table of them")
    tool = cell.usual_tool or 1
    count = len(table)
    position, rotation = np.zeros((count, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
    if known_robot and run.head.angles == "absolute":
        position, rotation = robot.forward(table.q_rad, cell, tool)
    inputs = Inputs(
        cell=cell,
        time_s=table.time_s,
        move=np.zeros(count, dtype=np.int32),
        source_line=np.zeros(count, dtype=np.int32),
        path_mm=np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(position, axis=0), axis=1))]),
        tool=np.full(count, tool, dtype=np.int32),
        spindle_rad_s=np.zeros(count),
        q_cmd_rad=table.q_rad,
        position_mm=position,
        rotation=rotation,
        force_base_N=np.zeros((count, 3)),
        moment_base_Nmm=np.zeros((count, 3)),
        hours=hours,
        temperature_C=temperature_at(table, table.time_s),
    )
    return Pair(run=run, number=number, inputs=inputs, from_log=True, known_robot=known_robot, still=True)
