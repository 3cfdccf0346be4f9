"""Set-up slips: the program runs with another tool or base than it was made for."""

from dataclasses import replace

import numpy as np

from gcode2krl import frames as fr
from gcode2krl import robot
from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.effects import arm
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect, Target
from gcode2krl.effects.frame_effect import frame_of, frame_parameters, is_nothing
from gcode2krl.effects.inputs import Inputs
from gcode2krl.errors import input_error


class ToolNumber(Effect):
    """The controller works with the frame of another tool than the one in the spindle.

    The wrong tip follows the path: joints are those of its poses, and the true tip is where the flange then
    has it. Targets are the tools of the cell, by number. It has no parameter.
    """

    name = "tool_number"
    family = "set-up slips"
    links = frozenset({"path", "mechanics"})
    where = frozenset({Where.JOINT, Where.TIP})
    depends_on = frozenset({Dependence.CONSTANT, Dependence.PLACE})
    kind = "slip"

    def targets(self, cell: Cell) -> tuple[Target, ...]:
        """Return the numbers of the cell's tools."""
        return tuple(str(number) for number in sorted(cell.tool))

    def replan(self, inputs: Inputs, applied: Applied) -> Inputs:
        """Return the inputs with the joints of the wrong tool."""
        position, rotation = _moved(inputs, _wrong_tool(inputs, applied))
        return _with_joints(inputs, position, rotation)

    def tcp(self, tcp_mm: Floats, deflection_mm: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the true tip."""
        return tcp_mm + _moved(inputs, _wrong_tool(inputs, applied))[0] - inputs.position_mm


class BaseNumber(Effect):
    """The controller works with another ``$BASE`` than the stated one: tip' = frame·tip, joints follow.

    The frame is that of the base really used, seen from the stated one. Unlike `base_frame` the commanded
    joints show it.
    """

    name = "base_number"
    family = "set-up slips"
    links = frozenset({"path", "mechanics"})
    where = frozenset({Where.JOINT, Where.TIP})
    depends_on = frozenset({Dependence.CONSTANT, Dependence.PLACE})
    kind = "slip"
    parameters = frame_parameters(2000.0, 180.0, 10.0, 1.0, source="another base of the cell: anything")

    def replan(self, inputs: Inputs, applied: Applied) -> Inputs:
        """Return the inputs with the joints of that base."""
        if is_nothing(applied):
            return inputs
        frame = frame_of(applied)
        position = inputs.position_mm @ frame[:3, :3].T + frame[:3, 3]
        return _with_joints(inputs, position, frame[:3, :3] @ inputs.tool_rotation)

    def tcp(self, tcp_mm: Floats, deflection_mm: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the true tip."""
        if is_nothing(applied):
            return tcp_mm
        frame = frame_of(applied)
        moved: Floats = inputs.position_mm @ frame[:3, :3].T + frame[:3, 3]
        return tcp_mm + moved - inputs.position_mm


def _wrong_tool(inputs: Inputs, applied: Applied) -> dict[int, Floats]:
    """Return, by the tool in the spindle, its frame seen from the wrong tip (4, 4)."""
    wrong = fr.invert(inputs.cell.tool_matrix(int(applied.target or 0)))
    return {number: wrong @ inputs.cell.tool_matrix(number) for number, _ in arm.tool_rows(inputs.tool)}


def _moved(inputs: Inputs, frames: dict[int, Floats]) -> tuple[Floats, Floats]:
    """Return position (m, 3) and rotation (m, 3, 3) of the commanded poses times a frame a tool."""
    position, rotation = np.array(inputs.position_mm), np.array(inputs.tool_rotation)
    for number, rows in arm.tool_rows(inputs.tool):
        position[rows] += inputs.tool_rotation[rows] @ frames[number][:3, 3]
        rotation[rows] = inputs.tool_rotation[rows] @ frames[number][:3, :3]
    return position, rotation


def _with_joints(inputs: Inputs, position_mm: Floats, rotation: Floats) -> Inputs:
    """Return the inputs with the joints (m, 6) that bring the tool there, of the branch nearest to theirs.

    Where forces are known the material is removed again along the moved path.

    Raises an input error where a pose is out of reach.
    """
    q = np.empty_like(inputs.q_cmd_rad)
    quaternion = fr.quaternion_from_rotation(rotation)
    for number, rows in arm.tool_rows(inputs.tool):
        before = inputs.q_cmd_rad[rows][:, None, :]
        q_rad = robot.inverse(position_mm[rows], quaternion[rows], inputs.cell, number)
        q_rad = before + (q_rad - before + np.pi) % (2.0 * np.pi) - np.pi
        way = np.abs(q_rad - before).max(axis=2)
        nearest = np.argmin(np.where(np.isnan(way), np.inf, way), axis=1)
        q[rows] = q_rad[np.arange(len(q_rad)), nearest]
    if np.isnan(q).any():
        raise input_error("effect-impossible", "with this frame the path is out of the robot's reach")
    moved = replace(inputs, q_cmd_rad=q)
    if "cut" not in inputs.offers:
        return moved
    force_N, moment_Nmm = inputs.recut(shift_mm=position_mm - inputs.position_mm)
    return replace(moved, force_base_N=force_N, moment_base_Nmm=moment_Nmm)


EFFECT = (ToolNumber(), BaseNumber())
