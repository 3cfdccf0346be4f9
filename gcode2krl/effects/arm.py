"""The rigid and the elastic arm along one run: tips, joint torques, deflection, all along ``$BASE``."""

from collections.abc import Iterator

import numpy as np

from gcode2krl import robot
from gcode2krl.arrays import Floats, Ints, Ints32
from gcode2krl.cell import Cell
from gcode2krl.compliance import chain, missing_stiffness, model
from gcode2krl.frames import invert
from gcode2krl.robot.kinematics import flange_pose
from gcode2krl.units import MM_PER_M

Rows = slice | Ints
Load = tuple[Floats, Floats]
"""Force (m, 3) in N on the tool and moment (m, 3) in N·mm about its tip, along ``$BASE``."""


def tool_rows(tool: Ints32) -> Iterator[tuple[int, Rows]]:
    """Yield each tool number and its rows."""
    numbers = np.unique(tool)
    for number in numbers:
        yield int(number), slice(None) if len(numbers) == 1 else np.flatnonzero(tool == number)


def tip_mm(q_rad: Floats, lengths_mm: Floats, cell: Cell, tool: Ints32) -> Floats:
    """Return the tips (m, 3) in mm in ``$BASE`` of an arm of these lengths (6,)."""
    flange_mm, rotation = flange_pose(q_rad, lengths_mm)
    root = np.empty_like(flange_mm)
    for number, rows in tool_rows(tool):
        # all rows in one product: a stack of matrices times a vector takes ten times as long
        reach_mm = rotation[rows].reshape(-1, 3) @ cell.tool_matrix(number)[:3, 3]
        root[rows] = flange_mm[rows] + reach_mm.reshape(-1, 3)
    to_base = invert(cell.base_matrix())
    tips: Floats = root @ to_base[:3, :3].T + to_base[:3, 3]
    return tips


def tool_rotation(q_rad: Floats, cell: Cell, tool: Ints32) -> Floats:
    """Return the rotations (m, 3, 3) of the tool frame in ``$BASE``."""
    _, rotation = flange_pose(q_rad, cell.robot.geometry.array())
    turned = cell.base_matrix()[:3, :3].T @ rotation
    for number, rows in tool_rows(tool):
        turned[rows] = turned[rows] @ cell.tool_matrix(number)[:3, :3]
    return turned


def axes_mm(q_rad: Floats, lengths_mm: Floats, cell: Cell) -> Floats:
    """Return a point (m, 6, 3) in mm of each axis in ``$BASE``: of A1 at the foot, of A4 to A6 the wrist.

    Eq. 1 of `gcode2krl.robot.kinematics`, link by link.
    """
    a1, a2, c1, c2, c3, _ = lengths_mm
    cos_1, sin_1 = np.cos(q_rad[:, 0]), np.sin(q_rad[:, 0])
    upper, fore = q_rad[:, 1], q_rad[:, 1] + q_rad[:, 2]
    radius = np.stack([0.0 * upper, 0.0 * upper + a1, a1 + c2 * np.cos(upper)], axis=1)
    height = np.stack([0.0 * upper, 0.0 * upper + c1, c1 - c2 * np.sin(upper)], axis=1)
    wrist_out = radius[:, 2] + c3 * np.cos(fore) - a2 * np.sin(fore)
    wrist_up = height[:, 2] - c3 * np.sin(fore) - a2 * np.cos(fore)
    radius = np.column_stack([radius, wrist_out, wrist_out, wrist_out])
    height = np.column_stack([height, wrist_up, wrist_up, wrist_up])
    root = np.stack([cos_1[:, None] * radius, -sin_1[:, None] * radius, height], axis=2)
    to_base = invert(cell.base_matrix())
    points: Floats = root @ to_base[:3, :3].T + to_base[:3, 3]
    return points


def jacobian_base(q_rad: Floats, cell: Cell, tool: Ints32) -> Floats:
    """Return the Jacobian (m, 6, 6) of the tip along ``$BASE``: mm/rad over rad/rad."""
    jacobian = np.empty((len(q_rad), 6, 6))
    for number, rows in tool_rows(tool):
        jacobian[rows] = robot.jacobian(q_rad[rows], cell, number)
    to_base = cell.base_matrix()[:3, :3].T
    if not np.array_equal(to_base, np.eye(3)):
        jacobian[:, :3] = to_base @ jacobian[:, :3]
        jacobian[:, 3:] = to_base @ jacobian[:, 3:]
    return jacobian


def torque_Nm(jacobian: Floats, force_N: Floats, moment_Nmm: Floats) -> Floats:
    """Return the joint torques (m, 6) in N·m of a load at the tip: Jᵀ·(F, M), positive with the angle."""
    load = np.concatenate([force_N, moment_Nmm], axis=1)
    torque: Floats = np.matmul(load[:, None, :], jacobian)[:, 0, :] / MM_PER_M
    return torque


def softness_of(cell: Cell) -> Floats | None:
    """Return 1/k_C, 1/k_B, 1/k_A (10, 3) of the virtual joints; None where the cell does not state all."""
    return None if missing_stiffness(cell) is not None else model.softness(cell)


def bend(
    q_rad: Floats,
    force_N: Floats,
    moment_Nmm: Floats,
    softness: Floats | None,
    cell: Cell,
    tool: Ints32,
    turned: bool = False,
) -> tuple[Floats, Floats]:
    """Return how far the tip moves and turns under a load along ``$BASE``, eq. 1-9 of Haehn & Weigold 2020.

    Both (m, 3), in mm and rad; the turn is zero unless ``turned``. Without stiffness nothing bends.
    """
    shift, turn = np.zeros((len(q_rad), 3)), np.zeros((len(q_rad), 3))
    if softness is None or not (force_N.any() or moment_Nmm.any()):
        return shift, turn
    tips = model.tips(cell, tool, len(q_rad))
    base = np.ascontiguousarray(cell.base_matrix()[:3, :3])
    chain.displaced_rows(
        np.ascontiguousarray(q_rad, dtype=np.float64),
        np.ascontiguousarray(force_N, dtype=np.float64),
        np.ascontiguousarray(moment_Nmm, dtype=np.float64),
        model.frames(cell),
        softness,
        base,
        tips.position_mm,
        tips.tool,
        shift,
        turn if turned else turn[:0],
    )
    return shift, turn
