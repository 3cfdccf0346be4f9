"""The part link: points of the finished part against the surface that the tip has swept.

A point belongs to a floor, under the lowest tip that has passed over it, or to a wall, a cutter's radius
beside the nearest tip below it. The tip is the model's, corrected by the tracker where there is one, so that
a bent arm is not taken for another cutter. A shift of the part and the height of its floors are not findings
here: they are those of frames, which the tip shows better.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.effects import Applied, Inputs, simulate
from gcode2krl.gap.beside.context import Context
from gcode2krl.gap.beside.interpolation import linear
from gcode2krl.gap.beside.links.base import Link
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.thresholds import THRESHOLDS

LIMITS = THRESHOLDS.beside


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """The points of one run that belong to a floor or a wall of the part; z is along the tool's axis."""

    deviation: Floats
    """(n,) in mm from the nominal surface; positive where material beyond it is removed."""
    wall: Bools
    normal: Floats
    """(n, 3) from the surface towards the tip."""
    deflection: Floats
    """(n,) of the tip along the normal."""
    place: Floats
    """(n, 3)"""


class SurfaceLink(Link):
    """The scanned part against the surface that the tip has swept; its signal is a place, not a time."""

    name = "part"
    signal = "scan"
    unit = "mm"
    needs = "scan.csv with walls that the cutter has left, a prediction with forces, one tool axis"

    def base(self, context: Context) -> tuple[Applied, ...]:
        """Return slips and what the force has shown: both move the tip."""
        return (*context.slips, *context.learned)

    def points(self, pair: Pair, base: Sequence[Applied] = ()) -> SurfacePoints | None:
        """Return the scanned points of a run with a prediction; None without a scan or if the tool turns."""
        if not pair.known_robot or pair.from_log:
            return None
        return _assigned(pair, base)


def _assigned(pair: Pair, base: Sequence[Applied]) -> SurfacePoints | None:
    """Return the points of a run's scan beside the surface that its tip has swept."""
    scan, inputs = pair.run.scan, pair.inputs
    axis = inputs.tool_rotation[:, :, 2]
    cuts: Bools = np.any(inputs.force_base_N, axis=1)
    if scan is None or not cuts.any() or np.ptp(axis, axis=0).max() > LIMITS.scan_straight:
        return None
    turn = _upright(-axis[0] if axis[0, 2] < 0.0 else axis[0])
    tip, bent = (values[cuts] @ turn.T for values in _tips(pair, base))
    radius, corner = _cutters(inputs, cuts)
    points = scan.position_mm @ turn.T
    feet = [_foot(point, tip, radius, corner) for point in points]
    kept = [foot for foot in feet if foot is not None]
    if len(kept) < LIMITS.scan_least_points:
        return None
    normal = np.array([foot.normal for foot in kept])
    return SurfacePoints(
        deviation=np.array([foot.deviation for foot in kept]),
        wall=np.array([foot.is_wall for foot in kept]),
        normal=normal,
        deflection=np.sum(bent[[foot.row for foot in kept]] * normal, axis=1),
        place=points[[foot is not None for foot in feet]],
    )


def _cutters(inputs: Inputs, cuts: Bools) -> tuple[Floats, Floats]:
    """Return the radius and the height of the corner of the cutter at each cutting sample."""
    tools = [inputs.cell.tool[int(number)] for number in inputs.tool[cuts]]
    return np.array([tool.diameter_mm / 2.0 for tool in tools]), np.array([_corner(tool) for tool in tools])


class _Foot(NamedTuple):
    """The point of the swept surface below or beside a scanned one."""

    deviation: float
    is_wall: bool
    normal: Floats
    row: int
    """Of the tip that has cut it."""


def _foot(point: Floats, path: Floats, radius: Floats, corner: Floats) -> _Foot | None:
    """Return the foot of a point on a floor or a wall; None where it belongs to neither."""
    offset = path[:, :2] - point[:2]
    away = np.hypot(offset[:, 0], offset[:, 1])
    over = np.flatnonzero(away < radius - corner - LIMITS.scan_inside_mm)
    if len(over):
        row = int(over[np.argmin(path[over, 2])])
        low = float(path[row, 2] - point[2])
        return _Foot(low, False, np.array([0.0, 0.0, 1.0]), row) if abs(low) < LIMITS.scan_reach_mm else None
    beside = np.flatnonzero(path[:, 2] + corner < point[2] - LIMITS.scan_above_mm)
    if not len(beside):
        return None
    row = int(beside[np.argmin(away[beside] - radius[beside])])
    far = float(away[row] - radius[row])
    if abs(far) > LIMITS.scan_reach_mm:
        return None
    return _Foot(far, True, np.array([*(offset[row] / away[row]), 0.0]), row)


def _tips(pair: Pair, base: Sequence[Applied]) -> tuple[Floats, Floats]:
    """Return the tips (m, 3) and how far the model bends them (m, 3)."""
    inputs, table = pair.inputs, pair.run.tracker
    tip = simulate(inputs, list(base)).tip_on_part_mm
    bent = inputs.deflection_mm
    if table is None or pair.run.head.frames.tracker != "base":
        return tip, bent
    own_s = pair.stamps(table)
    offset = table.position_mm - linear(own_s, inputs.time_s, tip)
    width = max(1, round(LIMITS.scan_smooth_s / float(np.median(np.diff(own_s)))))
    kernel = np.ones(width)
    weight = np.convolve(np.ones(len(offset)), kernel, mode="same")
    smooth = np.stack([np.convolve(column, kernel, mode="same") / weight for column in offset.T], axis=1)
    return tip + linear(inputs.time_s, own_s, smooth), np.zeros_like(bent)


def _corner(tool: object) -> float:
    """Return the height above the tip from which a cutter has its whole radius."""
    kind, diameter = getattr(tool, "kind", "flat"), float(getattr(tool, "diameter_mm", 0.0))
    return diameter / 2.0 if kind == "ball" else float(getattr(tool, "corner_radius_mm", 0.0))


def _upright(up: Floats) -> Floats:
    """Return a rotation (3, 3) that turns a direction to z."""
    helper = np.array([1.0, 0.0, 0.0]) if abs(up[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x = helper - up * float(helper @ up)
    x = x / np.linalg.norm(x)
    return np.stack([x, np.cross(up, x), up])
