"""The chain of one cell: frames, softness of the virtual joints, tool tips.

Frames and their order are those of Haehn & Weigold 2020, fig. 1 and table 1, for any arm with an
ortho-parallel base and a spherical wrist; docs/compliance.md has the reason for each place and axis.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from gcode2krl.arrays import Floats, Ints32
from gcode2krl.cell import Cell
from gcode2krl.cell.sections import VIRTUAL_JOINTS, missing_key
from gcode2krl.errors import Issue, NotUnderstoodError, input_error


class Tips(NamedTuple):
    """Tool tips in frame 10: ``position_mm`` (k, 3), and which of them each row has, ``tool`` (n,)."""

    position_mm: Floats
    tool: Ints32


def frames(cell: Cell) -> Floats:
    """Return cos alpha, sin alpha, a and d (10, 4) of eq. 1 for frames 1 to 10, in mm."""
    a1_mm, a2_mm, c1_mm, c2_mm, c3_mm, c4_mm = cell.robot.geometry.array()
    half_mm = cell.compliance.known_height_mm() / 2
    quarter_turns_a_d = np.array(
        [
            (0, 0.0, c1_mm),  # A1: foot of axis 1, lifted to axis 2
            (-1, a1_mm, 0.0),  # A2: axis 2
            (0, c2_mm / 2, 0.0),  # linked arm: its middle
            (0, c2_mm / 2, 0.0),  # A3: axis 3
            (-1, -a2_mm, c3_mm / 2),  # arm: on axis 4, half-way to the wrist
            (0, 0.0, c3_mm / 2),  # A4: wrist centre
            (1, 0.0, 0.0),  # A5: wrist centre
            (-1, 0.0, c4_mm),  # A6: flange
            (0, 0.0, half_mm),  # sensor: half its height
            (0, 0.0, half_mm),  # spindle and holder: mounting face on the sensor
        ]
    )
    cos_alpha = np.where(quarter_turns_a_d[:, 0] == 0, 1.0, 0.0)
    return np.column_stack([cos_alpha, quarter_turns_a_d])


def missing_stiffness(cell: Cell) -> Issue | None:
    """Return the finding that names the virtual joints without stiffness; None where all are stated."""
    missing = [name for name in VIRTUAL_JOINTS if name not in cell.compliance.virtual_joints]
    if not missing and cell.compliance.sensor_height_mm is None:
        return missing_key("compliance.sensor_height_mm", "no deflection without the sensor's place")
    if not missing:
        return None
    return Issue(
        "error",
        "stiffness-unknown",
        0,
        f"no deflection: the stiffness of {', '.join(missing)} of {cell.robot.model} is not known",
        "give k_c, k_b and k_a in N·mm/rad of each in [compliance.virtual_joints] of the cell "
        "(9.9e99 = rigid), or measure them: `gcode2krl identify stiffness`",
    )


def softness(cell: Cell) -> Floats:
    """Return 1/k_C, 1/k_B, 1/k_A (10, 3) in rad/(N·mm); raises what `missing_stiffness` finds."""
    issue = missing_stiffness(cell)
    if issue is not None:
        raise NotUnderstoodError(issue)
    stated = {str(name): (k.k_c, k.k_b, k.k_a) for name, k in cell.compliance.virtual_joints.items()}
    return 1.0 / np.array([stated[name] for name in VIRTUAL_JOINTS])


def tips(cell: Cell, tool: npt.ArrayLike | None, count: int) -> Tips:
    """Return the tips of ``count`` rows: one tool number for all, one a row (n,), or None = the mounted one.

    Raises
    ------
    NotUnderstoodError
        If the cell does not have the tool.
    ValueError
        If there is not one number for all or one a row.
    """
    if tool is None:
        tool = cell.mounted_tool if cell.mounted_tool is not None else min(cell.tool, default=0)
    if np.ndim(tool) == 0:  # a cycle of the online side has no time to sort
        numbers, index = np.array([tool]), np.array(0)
    else:
        numbers, index = np.unique(np.asarray(tool), return_inverse=True)
    for number in numbers:
        if int(number) not in cell.tool:
            known = ", ".join(str(name) for name in sorted(cell.tool)) or "none"
            raise input_error(
                "tool-unknown", f"tool {number} is not in the cell, which has {known}", f"add [tool.{number}]"
            )
    if np.shape(tool) not in ((), (count,)):
        raise ValueError(f"tool has shape {np.shape(tool)}, not () or ({count},)")
    holder_mm = np.array([0.0, 0.0, cell.compliance.known_height_mm()])
    position = np.array([cell.tool_matrix(int(number))[:3, 3] - holder_mm for number in numbers])
    rows = np.broadcast_to(index.reshape(np.shape(tool)), count)
    return Tips(position.reshape(-1, 3), np.ascontiguousarray(rows, dtype=np.int32))
