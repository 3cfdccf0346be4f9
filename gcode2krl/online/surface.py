"""Deviation of a machined part from nominal: the floor over a grid, and the walls along the path."""

from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.online.judge import CELL_MM, SIDE_RAD, Judged, floor_over, grid_of
from gcode2krl.online.touching import Touching
from gcode2krl.online.twin import TwinRun
from gcode2krl.prediction import Prediction


class Surface(NamedTuple):
    """Deviation of a part from nominal in mm, seen along the tool axis; above 0 material is left."""

    x_mm: Floats
    """(nx + 1,) edges of the cells."""
    y_mm: Floats
    floor_mm: Floats
    """(ny, nx), NaN where no floor was cut."""
    wall_mm: Floats
    """(w, 3) points on the walls."""
    wall_off_mm: Floats
    """(w,)"""

    @property
    def worst_mm(self) -> float:
        """Return the largest deviation, of floor or wall."""
        both = (np.abs(self.floor_mm[np.isfinite(self.floor_mm)]), np.abs(self.wall_off_mm))
        return max(float(part.max(initial=0.0)) for part in both)


def surface_of(prediction: Prediction, run: TwinRun, judged: Judged) -> Surface:
    """Return how the part that a run leaves differs from the one its commanded path would leave.

    The floor is the lowest tip over each cell, of a flat bottom. Walls are where an edge passes the side of
    the cut, at the tool's radius; the tip's error towards a wall is the excess cut. Where the tool axis turns
    there is no floor: all is points at which the cutter touches the part, with the tip's error along their
    normals.
    """
    motion, forces, cell = prediction.motion, prediction.forces, prediction.cell
    if motion is None or forces is None:
        raise ValueError("a prediction without forces")
    is_judged = judged.counts | judged.ploughs
    if judged.touching is not None:
        return _touched(judged.touching, run, is_judged)
    cuts = (forces.force_base_N != 0.0).any(axis=1)
    radius = np.array([cell.tool[int(number)].diameter_mm / 2.0 for number in motion.tool])
    low, shape = grid_of(motion.position_mm[cuts], radius[cuts])
    nominal = floor_over(motion.position_mm[cuts], radius[cuts], low, shape)
    remaining = floor_over((motion.position_mm + run.error_mm)[cuts], radius[cuts], low, shape)
    cut_by_both = np.isfinite(nominal) & np.isfinite(remaining)
    floor = np.full(nominal.shape, np.nan)
    floor[cut_by_both] = remaining[cut_by_both] - nominal[cut_by_both]
    velocity = np.gradient(motion.position_mm, motion.time_s, axis=0)
    across = np.stack([-velocity[:, 1], velocity[:, 0]], axis=1)  # to the left of the feed, where phi is 0
    speed = np.linalg.norm(across, axis=1)
    moves = speed > 1e-9
    across[moves] /= speed[moves, None]
    start, end = forces.phi_rad[:, 0::2], forces.phi_rad[:, 1::2]
    points, off = [], []
    with np.errstate(invalid="ignore"):
        sides = ((1.0, (start <= SIDE_RAD).any(axis=1)), (-1.0, (end >= np.pi - SIDE_RAD).any(axis=1)))
    for sign, is_wall in sides:
        rows = is_judged & is_wall & moves
        normal = sign * across[rows]
        shift = np.concatenate([radius[rows, None] * normal, np.zeros((rows.sum(), 1))], axis=1)
        points.append(motion.position_mm[rows] + shift)
        off.append(-np.einsum("ij,ij->i", run.error_mm[rows, :2], normal))
    edges = [low[axis] + CELL_MM * (np.arange(shape[1 - axis] + 1) - 0.5) for axis in (0, 1)]
    return Surface(edges[0], edges[1], floor, np.concatenate(points), np.concatenate(off))


def _touched(touching: Touching, run: TwinRun, is_judged: Bools) -> Surface:
    """Return the deviation at points that touch the part, and a floor of one empty cell."""
    kept = is_judged[touching.row]
    point, normal = touching.point_mm[kept], touching.normal[kept]
    off = -np.einsum("ij,ij->i", run.error_mm[touching.row[kept]], normal)
    x, y = (np.array([point[:, k].min(initial=0.0), point[:, k].max(initial=1.0)]) for k in (0, 1))
    return Surface(x, y, np.full((1, 1), np.nan), point, off)
