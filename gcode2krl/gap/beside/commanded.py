"""The commanded path of a run, the tip of its logged joints, beside the predicted curve; without time."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from gcode2krl import robot
from gcode2krl.arrays import Bools, Floats
from gcode2krl.effects import Inputs
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.units import DEG_PER_RAD

LIMITS = THRESHOLDS.beside


@dataclass(frozen=True, eq=False)
class CommandedPath:
    """The commanded tips of a run where it moves, n of them, beside its prediction."""

    name: str
    inputs: Inputs
    time_s: Floats
    """(n,) on the prediction's clock."""
    tip_mm: Floats
    """(n, 3) nominal tip of the commanded joints, by each tool of the prediction in turn the nearest."""
    way_mm: Floats
    """(n,) way that each sample stands for."""
    apart_mm: Floats
    """(n,) distance from the predicted curve."""
    resolution_mm: float
    """What the last decimal of the logged angles is worth at the tip."""

    @property
    def on_mm(self) -> float:
        """Return the distance up to which a sample is right on the curve."""
        return max(LIMITS.path_on_mm, LIMITS.path_on_decimals * self.resolution_mm)

    @property
    def off_mm(self) -> float:
        """Return the distance above which a sample is off the curve."""
        return max(LIMITS.path_off_mm, LIMITS.path_off_decimals * self.resolution_mm)

    def share(self, rows: Bools) -> float:
        """Return the share of the way that some samples (n,) stand for."""
        return float(self.way_mm[rows].sum() / self.way_mm.sum())

    @cached_property
    def gone_mm(self) -> Floats:
        """(n,) way up to each sample."""
        steps = np.linalg.norm(np.diff(self.tip_mm, axis=0), axis=1)
        gone: Floats = np.concatenate([[0.0], np.cumsum(steps)])
        return gone


def commanded_path(pair: Pair, tool: int | None = None) -> CommandedPath | None:
    """Return the commanded path of a run from where it first meets the curve to the prediction's end.

    ``tool``: the number of the tool whose tip it is; without one each of the prediction's own.
    None where there is no prediction, no motion, or no absolute angle of every joint.
    """
    table, inputs = pair.run.controller, pair.inputs
    if pair.from_log or pair.run.head.angles == "relative" or table is None or table.q_cmd_rad is None:
        return None
    if not np.isfinite(table.q_cmd_rad).all():
        return None
    tip_mm, apart_mm = _nearest_tool(table.q_cmd_rad, inputs, tool)
    steps_mm = np.linalg.norm(np.diff(tip_mm, axis=0), axis=1)
    way_mm = 0.5 * (np.append(steps_mm, 0.0) + np.append(0.0, steps_mm))
    resolution_mm = _last_decimal_rad(table.q_cmd_rad) * _reach_mm(tip_mm, inputs)
    rows = np.arange(len(tip_mm))
    rows = rows[way_mm > max(LIMITS.path_still_mm, resolution_mm)]
    rows = rows[_of_the_program(tip_mm[rows], apart_mm[rows], inputs)]
    if len(rows) < 2:
        return None
    return CommandedPath(
        pair.name,
        inputs,
        pair.stamps(table)[rows],
        tip_mm[rows],
        way_mm[rows],
        apart_mm[rows],
        resolution_mm,
    )


def _nearest_tool(q_rad: Floats, inputs: Inputs, tool: int | None) -> tuple[Floats, Floats]:
    """Return tips (n, 3) and distances (n,) from the curve of the tool that is nearer to its own."""
    tips, apart = [], []
    for number in np.unique(inputs.tool):
        tip_mm = robot.forward(q_rad, inputs.cell, int(number) if tool is None else tool)[0]
        tips.append(tip_mm)
        apart.append(Curve(inputs.position_mm[inputs.tool == number]).foot(tip_mm)[1])
    best = np.argmin(apart, axis=0)
    rows = np.arange(len(q_rad))
    return np.stack(tips)[best, rows], np.stack(apart)[best, rows]


def _last_decimal_rad(q_rad: Floats) -> float:
    """Return the unit of the last decimal of degrees in which angles (n, 6) are stated."""
    q_deg = q_rad * DEG_PER_RAD
    for decimals in range(LIMITS.log_most_decimals):
        if np.abs(q_deg - np.round(q_deg, decimals)).max() < 0.01 * 10.0**-decimals:
            return float(10.0**-decimals / DEG_PER_RAD)
    return float(10.0**-LIMITS.log_most_decimals / DEG_PER_RAD)


def _reach_mm(tip_mm: Floats, inputs: Inputs) -> float:
    """Return the largest distance of the tip from the robot's root."""
    root_mm = np.linalg.inv(inputs.cell.base_matrix())[:3, 3]
    return float(np.linalg.norm(tip_mm - root_mm, axis=1).max())


def _of_the_program(tip_mm: Floats, apart_mm: Floats, inputs: Inputs) -> Bools:
    """Return which samples (n,) are neither on the way to the program's start nor after its end."""
    on = np.flatnonzero(apart_mm <= LIMITS.path_off_mm)
    inside = np.ones(len(tip_mm), dtype=np.bool_)
    if len(on):
        inside[: on[0]] = False
        ended = np.linalg.norm(tip_mm - inputs.position_mm[-1], axis=1) <= LIMITS.path_off_mm
        if ended.any():
            inside[np.flatnonzero(ended)[-1] + 1 :] = False
    return inside


class Curve:
    """A predicted path (m, 3) as segments no longer than a millimetre where that is not too many."""

    def __init__(self, position_mm: Floats) -> None:
        steps = np.linalg.norm(np.diff(position_mm, axis=0), axis=1)
        moving = np.concatenate([[True], steps > 0.0])
        points, gone = position_mm[moving], np.concatenate([[0.0], np.cumsum(steps[moving[1:]])])
        spacing = max(LIMITS.curve_spacing_mm, gone[-1] / LIMITS.curve_most_points)
        at = np.union1d(gone, np.arange(0.0, gone[-1], spacing))
        self.points = np.stack([np.interp(at, gone, column) for column in points.T], axis=1)
        self.tree = cKDTree(self.points)

    def foot(self, tip_mm: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the curve's points nearest to points (n, 3), distances (n,) and directions (n, 3)."""
        last = len(self.points) - 1
        _, near = self.tree.query(tip_mm, k=min(LIMITS.curve_neighbours, last + 1))
        near = near.reshape(len(tip_mm), -1)
        first = np.clip(np.concatenate([near - 1, near], axis=1), 0, max(last - 1, 0))
        start = self.points[first]
        along = self.points[np.minimum(first + 1, last)] - start
        length = np.maximum(np.linalg.norm(along, axis=2), 1e-12)
        share = np.sum((tip_mm[:, None] - start) * along, axis=2) / length**2
        feet = start + np.clip(share, 0.0, 1.0)[:, :, None] * along
        apart = np.linalg.norm(tip_mm[:, None] - feet, axis=2)
        rows, best = np.arange(len(tip_mm)), np.argmin(apart, axis=1)
        return feet[rows, best], apart[rows, best], (along / length[:, :, None])[rows, best]


def on_the_curve(pair: Pair, frame: Floats | None = None, tool: int | None = None) -> bool:
    """Tell whether nearly all of a commanded path is on the predicted curve, moved by a frame (4, 4).

    ``tool``: the tool by which the controller works, where it is not the prediction's. True as well where
    nothing can be compared. An accurate model of the robot brings no frame and no tool onto the curve.
    """
    path = commanded_path(pair, tool)
    if path is None:
        return True
    back = np.eye(4) if frame is None else np.linalg.inv(frame)
    tip_mm = path.tip_mm @ back[:3, :3].T + back[:3, 3]
    _, apart_mm, _ = Curve(pair.inputs.position_mm).foot(tip_mm)
    inside = _of_the_program(tip_mm, apart_mm, pair.inputs)
    on_mm = float(path.way_mm[inside & (apart_mm <= path.on_mm)].sum())
    return on_mm > LIMITS.path_mostly * float(path.way_mm[inside].sum())
