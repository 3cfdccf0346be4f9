"""What a cell puts around a program that `execution.py` runs: its arm, its frames, its inputs."""

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.cell import Cell, carriers
from gcode2krl.krl.statements import base_of_controller, coupled_table, has_coupled_rail, written_tool
from gcode2krl.robot.inverse_kinematics import all_branches
from gcode2krl.robot.kinematics import flange_pose
from tests.krl.execution import Environment, Kinematics, frame_of
from tests.krl.language import EXTERNAL_KEYS

_TURN = 360.0


class Arm(Kinematics):
    """The arm of a cell."""

    def __init__(self, cell: Cell) -> None:
        """Take the lengths of the cell's robot."""
        self.geometry = cell.robot.geometry.array()

    def flange(self, q_deg):
        """Return the flange in the robot root (4, 4)."""
        position, rotation = flange_pose(np.radians(q_deg)[None], self.geometry)
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = rotation[0], position[0]
        return matrix

    def joints(self, flange, near_deg, status=None, turn=None):
        """Return the axes in degrees of a flange, of a branch or nearest to others."""
        branches = np.degrees(all_branches(flange[None, :3, 3], flange[None, :3, :3], self.geometry)[0])
        if status is not None:
            q_deg = branches[status]
            is_negative = np.array([bool(turn >> axis & 1) for axis in range(6)])
            q_deg = q_deg - _TURN * (is_negative & (q_deg > 1e-3)) + _TURN * (~is_negative & (q_deg < -1e-3))
            return None if np.isnan(q_deg).any() else q_deg
        branches += _TURN * np.rint((near_deg - branches) / _TURN)
        way = np.abs(branches - near_deg).max(axis=1)
        return None if np.isnan(way).all() else branches[np.nanargmin(way)]


def environment_of(cell: Cell, tools=(1,), standing=None, **more) -> Environment:
    """Return the environment of a cell as its file says; ``standing`` E1 to E6, ``more`` its fields."""
    at = np.zeros(6) if standing is None else np.asarray(standing, dtype=float)
    frames = cell.frames
    robroot = np.eye(4) if frames.robroot is None else frames.robroot.matrix()

    def row(external):
        return np.array([[external[key] for key in EXTERNAL_KEYS]])

    def root(external):
        if has_coupled_rail(cell):
            return carriers.root_in_world(cell.external, row(external), robroot)[0]
        return robroot

    def table(machine, external):
        assert coupled_table(cell) == f"MACHINE_DEF[{machine}]"
        return carriers.base_in_world(cell.external, row(external), np.eye(4), frames.base_on)[0]

    inputs = {guarded.number: guarded.value for guarded in cell.guard_inputs}
    spindle = cell.spindle
    if spindle.at_speed_input is not None:
        runs = (spindle.run_cw_output, spindle.run_ccw_output)
        inputs[spindle.at_speed_input] = lambda c: any(c.outputs.get(number, False) for number in runs)
    base = {} if frames.base_data is None else {frames.base_data: frame_of(base_of_controller(cell, at))}
    numbered = {cell.tool[n].tool_data: n for n in tools if cell.tool[n].tool_data is not None}
    return Environment(
        **{
            "kinematics": Arm(cell),
            "root": root,
            "table": table,
            "system": {
                "$TRAFONAME": f"#{cell.robot.trafo_name}",
                "$ROBROOT": frame_of(robroot),
                "$EX_AX_NUM": max((int(name[1]) for name in cell.external), default=0),
            },
            "base_data": base,
            "tool_data": {number: frame_of(written_tool(cell, n)) for number, n in numbered.items()},
            "load_data": {number: load_of(cell, n) for number, n in numbered.items()},
            "inputs": inputs,
            "q_deg": tuple(cell.home.q_deg),
            **more,
        }
    )


def load_of(cell: Cell, tool: int) -> dict:
    """Return LOAD_DATA of a tool as the cell states it."""
    load = cell.load_of(tool)
    centre = {"X": load.x_mm, "Y": load.y_mm, "Z": load.z_mm}
    inertia = {"X": load.jx_kgm2, "Y": load.jy_kgm2, "Z": load.jz_kgm2}
    return {"M": load.mass_kg, "CM": centre, "J": inertia}


def expected_flange(cell: Cell, targets, row: int) -> np.ndarray:
    """Return the flange in the robot root (4, 4) that a row of Targets asks for."""
    base = cell.base_in_root(targets.external[row][None])[0]
    tool = fr.transform(targets.position_mm[row], fr.rotation_from_quaternion(targets.rotation[row]))
    return base @ tool @ fr.invert(cell.tool_matrix(int(targets.tool[row])))
