"""Where an error of the tip counts: on surfaces that stay on the part, where the forces are reliable."""

from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.compiled.core import FLOAT, FLOATS, OUT_FLOATS, core_function
from gcode2krl.compiled.inputs import shaped
from gcode2krl.cutting.law import feed_per_tooth
from gcode2krl.cutting.milling import tool_axes
from gcode2krl.cutting.outlook import to_axis, turned
from gcode2krl.online.touching import Touching, touching_of
from gcode2krl.prediction import Prediction

SIDE_RAD = 0.05
"""An engagement arc that begins or ends this close to the normal of the feed leaves a wall."""
CELL_MM = 0.5
DEEPER_MM = 0.05
"""A surface that another pass cuts deeper by more than this does not stay."""
LEAST_CHIP_MM = 0.005
"""Below this the bottom edges plough; the force law is not valid there (docs/cutting.md)."""
_SINKS = 1e-3

_lower = core_function("online_lower", FLOATS, FLOATS, FLOATS, FLOAT, OUT_FLOATS)


class Judged(NamedTuple):
    """Samples (n,) on which errors are judged, and those that are left out although their surface stays."""

    counts: Bools
    ploughs: Bools
    """The tool sinks so slowly, or did just before, that the predicted force is that of ploughing edges."""
    touching: Touching | None = None
    """Where the cutter touches the finished part; None where the tool axis is constant."""


def judged(prediction: Prediction, memory_s: float, late_s: float = 0.0) -> Judged:
    """Return where an error of the tip stays on the part.

    It stays where an edge passes the side of the cut and makes a wall; at entry and exit of a slot this is
    where the tool's centre is over the part. It also stays where no other pass goes deeper. Where the tool
    axis turns, it stays where the cutter touches the finished part, and no edge ploughs. Samples with
    ploughing edges, and those that a compensator with a memory of ``memory_s`` derives from them, are marked
    separately. If the cutter enters and leaves ``late_s`` later than predicted, the samples shift with it.
    """
    motion, forces, cell = prediction.motion, prediction.forces, prediction.cell
    if motion is None or forces is None:
        raise ValueError("a prediction without forces")
    start, end = forces.phi_rad[:, 0::2], forces.phi_rad[:, 1::2]
    with np.errstate(invalid="ignore"):
        side = ((start <= SIDE_RAD) | (end >= np.pi - SIDE_RAD)).any(axis=1)
    cuts = (forces.force_base_N != 0.0).any(axis=1) & side
    axis, touching = tool_axes(motion), touching_of(prediction)
    if touching is None:
        radius = np.array([cell.tool[int(number)].diameter_mm / 2.0 for number in motion.tool])
        stays = cuts & _stays(turned(motion.position_mm, to_axis(axis[0])), radius, cuts)
        least = _SINKS
    else:
        stays = np.isin(np.arange(len(motion)), touching.row)
        least = np.inf  # bottoms are hollow there, and touch nothing that they sink to gently
    velocity = np.gradient(motion.position_mm, motion.time_s, axis=0)
    speed = np.linalg.norm(velocity, axis=1)
    sink = -np.einsum("ij,ij->i", velocity, axis) / np.maximum(speed, 1e-9)
    row = np.clip(motion.move, 0, len(prediction.toolpath) - 1)
    teeth = np.array([cell.tool[int(number)].teeth for number in motion.tool])
    chip = sink * feed_per_tooth(speed, prediction.toolpath.spindle_rad_s[row], 1) / teeth
    ploughing = (forces.force_base_N != 0.0).any(axis=1) & (sink > least) & (chip < LEAST_CHIP_MM)
    ploughs = stays & _lasting(ploughing, motion.time_s, memory_s)
    step_s = float(motion.time_s[1] - motion.time_s[0]) if len(motion) > 1 else 1.0
    later = round(late_s / step_s)
    return Judged(_shifted(stays & ~ploughs, later), _shifted(ploughs, later), touching)


def _shifted(where: Bools, samples: int) -> Bools:
    """Return (n,) the mask shifted by a number of samples: later, or earlier if negative."""
    moved = np.zeros_like(where)
    kept = len(where) - abs(samples)
    if kept > 0:
        moved[max(samples, 0) :][:kept] = where[max(-samples, 0) :][:kept]
    return moved


def grid_of(position_mm: Floats, radius_mm: Floats) -> tuple[Floats, tuple[int, int]]:
    """Return the centre of the first cell (2,) and the shape (ny, nx) of a grid below all positions."""
    most = float(radius_mm.max(initial=0.0)) + CELL_MM
    low = position_mm[:, :2].min(axis=0, initial=np.inf) - most
    if not np.isfinite(low).all():
        return np.zeros(2), (1, 1)
    size = np.ceil((position_mm[:, :2].max(axis=0) + most - low) / CELL_MM).astype(int) + 1
    return low, (int(size[1]), int(size[0]))


def floor_over(position_mm: Floats, radius_mm: Floats, low_mm: Floats, shape: tuple[int, int]) -> Floats:
    """Return the lowest tip over each cell (ny, nx) in mm; inf where nothing cuts."""
    floor = np.full(shape, np.inf)
    _lower(
        shaped("position_mm", position_mm, -1, 3),
        shaped("radius_mm", radius_mm, -1),
        shaped("low_mm", low_mm, 2),
        CELL_MM,
        floor,
    )
    return floor


def _lasting(happens: Bools, time_s: Floats, memory_s: float) -> Bools:
    """Return (n,) True where something happens, and for ``memory_s`` after it."""
    last_s = np.maximum.accumulate(np.where(happens, time_s, -np.inf))
    lasting: Bools = time_s - last_s <= memory_s
    return lasting


def _stays(position_mm: Floats, radius_mm: Floats, cuts: Bools) -> Bools:
    """Return (n,) True where no pass is deeper below the tool's centre."""
    low, shape = grid_of(position_mm[cuts], radius_mm[cuts])
    floor = floor_over(position_mm[cuts], radius_mm[cuts], low, shape)
    cell = np.rint((position_mm[:, :2] - low) / CELL_MM).astype(int)
    column, row = np.clip(cell[:, 0], 0, floor.shape[1] - 1), np.clip(cell[:, 1], 0, floor.shape[0] - 1)
    stays: Bools = position_mm[:, 2] <= floor[row, column] + DEEPER_MM
    return stays
