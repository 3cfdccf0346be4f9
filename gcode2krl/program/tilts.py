"""Checks of a tool axis that is tilted or turns: can the robot stand and turn as the program says?"""

from collections.abc import Iterator

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.arrays import Bools, Floats
from gcode2krl.cell import Cell
from gcode2krl.errors import MOST_PLACES, Issue
from gcode2krl.program.targets import LEAST_UPRIGHT
from gcode2krl.tables import Targets, Toolpath
from gcode2krl.units import DEG_PER_RAD

_LIMIT_DEG = 0.1
"""How far the tool axis may leave the plane of its turn within a feed motion; chords of 5° stay below it."""
_RAPID_LIMIT_DEG = 5.0


def tilt_issues(targets: Targets, toolpath: Toolpath, cell: Cell) -> Iterator[Issue]:
    """Yield feed moves with a tool that lies, and motions on which the robot would swing the tool aside."""
    if toolpath.axis.strides[0] == 0:
        return
    yield from _lying(toolpath, cell)
    yield from _swinging(targets, toolpath)


def _lying(toolpath: Toolpath, cell: Cell) -> Iterator[Issue]:
    on_path = toolpath.is_position() & ~toolpath.machine
    on_path[:1] = False
    follows = on_path[1:] & on_path[:-1] & (toolpath.tool[1:] == toolpath.tool[:-1])
    met = on_path & ~(np.append(False, follows) & np.append(follows, False))
    if cell.clearance_z_mm is not None:
        met &= toolpath.position_mm[:, 2] < cell.clearance_z_mm
    for row in _begins(met & (toolpath.axis[:, 2] < LEAST_UPRIGHT - 1e-9)):
        tilt_deg = float(np.arccos(np.clip(toolpath.axis[row, 2], -1.0, 1.0)) * DEG_PER_RAD)
        yield Issue(
            "error",
            "tool-lies",
            int(toolpath.source_line[row]),
            f"the tool is tilted by {tilt_deg:.1f} degrees where it has to reach the clearance plane",
            "program a move to the clearance plane, or one that tilts the tool by 80 degrees at most",
        )


def _swinging(targets: Targets, toolpath: Toolpath) -> Iterator[Issue]:
    off_deg = off_plane_deg(targets.rotation[:-1], targets.rotation[1:])
    row = np.maximum(targets.move[1:], 0)
    feed = (targets.move[1:] >= 0) & (targets.move[:-1] >= 0) & ~toolpath.rapid[row] & ~toolpath.machine[row]
    limit_deg = np.where(feed, _LIMIT_DEG, _RAPID_LIMIT_DEG)
    lin = ~targets.ptp[1:] & (targets.tool[1:] == targets.tool[:-1])
    for k in _begins(lin & (targets.move[1:] >= 0) & (off_deg > limit_deg)):
        yield Issue(
            "error",
            "axis-swings",
            int(targets.source_line[k + 1]),
            f"between two motions the robot would swing the tool {off_deg[k]:.2f} degrees out of its plane",
            "lower [machine] axis_step_deg",
        )


def off_plane_deg(start: Floats, end: Floats) -> Floats:
    """Return how far (p,) the z axis is from the plane of its turn, halfway between quaternions (p, 4)."""
    middle = fr.slerp(start, end, np.full(len(start), 0.5))
    z0, z1, halfway = (_z_axis(each) for each in (start, end, middle))
    meant = z0 + z1
    size = np.linalg.norm(meant, axis=1, keepdims=True)
    meant = np.where(size > 1e-9, meant / np.maximum(size, 1e-9), z0)
    return np.asarray(2.0 * np.arcsin(0.5 * np.linalg.norm(halfway - meant, axis=1)) * DEG_PER_RAD)


def _z_axis(quaternion: Floats) -> Floats:
    x, y, z, w = quaternion.T
    return np.stack([2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)], axis=1)


def _begins(wrong: Bools) -> list[int]:
    """Return the first row of each run of wrong rows."""
    starts = np.flatnonzero(wrong & ~np.concatenate([[False], wrong[:-1]]))
    return [int(row) for row in starts[:MOST_PLACES]]
