"""A run of another program, found from its commanded path: where that lies, and how fast its moves are gone.

Where it lies is compared without time: the tip of the commanded joints beside the predicted curve. A program
that was edited keeps to the curve for a good part of its way and leaves it for a stretch. A corner leaves it
near that corner only, another base or an accurate model of the robot everywhere.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gcode2krl import robot
from gcode2krl.effects import Inputs
from gcode2krl.gap.side import Side
from gcode2krl.units import DEG_PER_RAD

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]

_ON_MM, _OFF_MM = 0.03, 0.2
"""The predicted path is right to 0.01 mm (design/gap.md); a commanded one 0.2 mm beside it is another."""
_DECIMALS_ON, _DECIMALS_OFF = 2.0, 5.0
_MOST_DECIMALS = 6
_ON_SHARE, _MOSTLY = 0.1, 0.8
_STRETCH_MM = 30.0
_BLEND_MM = 50.0
"""Largest approximation distance that occurs (KUKA's examples, see the effect ``corner``)."""
_SPACING_MM, _MOST_POINTS, _NEIGHBOURS = 1.0, 200_000, 4
_STILL_MM = 1e-3
_FRAME_STEPS, _ALL, _FRAME_ROWS = 8, 0.95, 4000
_MOST_CHECKED = 200
_SAME_CURVE, _SAME_LENGTH = 0.9, 0.02
_CONSTANT, _LEAST_S, _MIDDLE = 0.02, 0.05, 0.2
"""A speed is constant within 2 %; of a stretch that lasts the middle three fifths are timed."""
_OTHER_FEED, _CONSISTENT = 0.05, 0.03


def other_program(sides: Sequence[Side]) -> str | None:
    """Return what shows that the runs are of another program, as a sentence; None where nothing does."""
    paths = [path for side in sides if (path := commanded_path(side)) is not None]
    beside = [f"{path.name}: {words}" for path in paths if (words := _beside(path)) is not None]
    if beside:
        return f"{beside[0]}: the run is of another program"
    return _other_feeds(paths)


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
        return max(_ON_MM, _DECIMALS_ON * self.resolution_mm)

    @property
    def off_mm(self) -> float:
        """Return the distance above which a sample is off the curve."""
        return max(_OFF_MM, _DECIMALS_OFF * self.resolution_mm)

    def share(self, rows: Bools) -> float:
        """Return the share of the way that some samples (n,) stand for."""
        return float(self.way_mm[rows].sum() / self.way_mm.sum())

    @cached_property
    def gone_mm(self) -> Floats:
        """(n,) way up to each sample."""
        steps = np.linalg.norm(np.diff(self.tip_mm, axis=0), axis=1)
        gone: Floats = np.concatenate([[0.0], np.cumsum(steps)])
        return gone


def commanded_path(side: Side, tool: int | None = None) -> CommandedPath | None:
    """Return the commanded path of a run from where it first meets the curve to the prediction's end.

    ``tool``: the number of the tool whose tip it is; without one each of the prediction's own.
    None where there is no prediction, no motion, or no absolute angle of every joint.
    """
    table, inputs = side.run.controller, side.inputs
    if side.from_log or side.run.head.angles == "relative" or table is None or table.q_cmd_rad is None:
        return None
    if not np.isfinite(table.q_cmd_rad).all():
        return None
    tip_mm, apart_mm = _nearest_tool(table.q_cmd_rad, inputs, tool)
    steps_mm = np.linalg.norm(np.diff(tip_mm, axis=0), axis=1)
    way_mm = 0.5 * (np.append(steps_mm, 0.0) + np.append(0.0, steps_mm))
    resolution_mm = _last_decimal_rad(table.q_cmd_rad) * _reach_mm(tip_mm, inputs)
    rows = np.arange(len(tip_mm))
    rows = rows[way_mm > max(_STILL_MM, resolution_mm)]
    rows = rows[_of_the_program(tip_mm[rows], apart_mm[rows], inputs)]
    if len(rows) < 2:
        return None
    return CommandedPath(
        side.name, inputs, side.stamps(table)[rows], tip_mm[rows], way_mm[rows], apart_mm[rows],
        resolution_mm,
    )  # fmt: skip


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
    for decimals in range(_MOST_DECIMALS):
        if np.abs(q_deg - np.round(q_deg, decimals)).max() < 0.01 * 10.0**-decimals:
            return float(10.0**-decimals / DEG_PER_RAD)
    return float(10.0**-_MOST_DECIMALS / DEG_PER_RAD)


def _reach_mm(tip_mm: Floats, inputs: Inputs) -> float:
    """Return the largest distance of the tip from the robot's root."""
    root_mm = np.linalg.inv(inputs.cell.base_matrix())[:3, 3]
    return float(np.linalg.norm(tip_mm - root_mm, axis=1).max())


def _of_the_program(tip_mm: Floats, apart_mm: Floats, inputs: Inputs) -> Bools:
    """Return which samples (n,) are neither on the way to the program's start nor after its end."""
    on = np.flatnonzero(apart_mm <= _OFF_MM)
    inside = np.ones(len(tip_mm), dtype=np.bool_)
    if len(on):
        inside[: on[0]] = False
        ended = np.linalg.norm(tip_mm - inputs.position_mm[-1], axis=1) <= _OFF_MM
        if ended.any():
            inside[np.flatnonzero(ended)[-1] + 1 :] = False
    return inside


class Curve:
    """A predicted path (m, 3) as segments no longer than a millimetre where that is not too many."""

    def __init__(self, position_mm: Floats) -> None:
        steps = np.linalg.norm(np.diff(position_mm, axis=0), axis=1)
        moving = np.concatenate([[True], steps > 0.0])
        points, gone = position_mm[moving], np.concatenate([[0.0], np.cumsum(steps[moving[1:]])])
        spacing = max(_SPACING_MM, gone[-1] / _MOST_POINTS)
        at = np.union1d(gone, np.arange(0.0, gone[-1], spacing))
        self.points = np.stack([np.interp(at, gone, column) for column in points.T], axis=1)
        self.tree = cKDTree(self.points)

    def foot(self, tip_mm: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the curve's points nearest to points (n, 3), distances (n,) and directions (n, 3)."""
        last = len(self.points) - 1
        _, near = self.tree.query(tip_mm, k=min(_NEIGHBOURS, last + 1))
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


def on_the_curve(side: Side, frame: Floats | None = None, tool: int | None = None) -> bool:
    """Tell whether nearly all of a commanded path is on the predicted curve, moved by a frame (4, 4).

    ``tool``: the tool by which the controller works, where it is not the prediction's. True as well where
    nothing can be compared. An accurate model of the robot brings no frame and no tool onto the curve.
    """
    path = commanded_path(side, tool)
    if path is None:
        return True
    back = np.eye(4) if frame is None else np.linalg.inv(frame)
    tip_mm = path.tip_mm @ back[:3, :3].T + back[:3, 3]
    _, apart_mm, _ = Curve(side.inputs.position_mm).foot(tip_mm)
    inside = _of_the_program(tip_mm, apart_mm, side.inputs)
    on_mm = float(path.way_mm[inside & (apart_mm <= path.on_mm)].sum())
    return on_mm > _MOSTLY * float(path.way_mm[inside].sum())


# Where it lies


def _beside(path: CommandedPath) -> str | None:
    """Return from when a path is beside the curve, where part of it is right on it; None otherwise."""
    on = _long_stretches(path.apart_mm <= path.on_mm, path.way_mm)
    if not on or sum(float(path.way_mm[rows].sum()) for rows in on) < _ON_SHARE * path.way_mm.sum():
        return None
    off = _long_stretches(path.apart_mm > path.off_mm, path.way_mm)
    off = [rows for rows in off if not _in_corners(path, rows)]
    if not off or _is_frame(path):
        return None
    most_mm = max(float(path.apart_mm[rows].max()) for rows in off)
    return (
        f"from t = {path.time_s[off[0].start]:.1f} s the commanded path is up to {most_mm:.3g} mm beside "
        "the predicted one"
    )


def _long_stretches(rows: Bools, way_mm: Floats) -> list[slice]:
    """Return the runs of True (n,) that go further than corners do."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], rows, [False]]).astype(np.int8)))
    stretches = [slice(int(start), int(end)) for start, end in edges.reshape(-1, 2)]
    return [each for each in stretches if float(way_mm[each].sum()) > _STRETCH_MM]


def _in_corners(path: CommandedPath, rows: slice) -> bool:
    """Tell whether a stretch may be blended corners, whatever their approximation distance.

    A blend stays in the triangle of a corner and the points from which and to which it goes, which are at
    most half a move away.
    """
    targets = path.inputs.targets
    if targets is None or len(targets.position_mm) < 3:
        return False
    chosen = np.unique(np.linspace(rows.start, rows.stop - 1, _MOST_CHECKED).astype(np.int64))
    corner_mm = targets.position_mm[1:-1][targets.cdis_mm[1:-1] > 0.0]
    before, after = np.diff(targets.position_mm, axis=0)[:-1], np.diff(targets.position_mm, axis=0)[1:]
    blended = targets.cdis_mm[1:-1] > 0.0
    legs = -_leg_mm(before[blended]), _leg_mm(after[blended])
    outside = np.array(
        [not _in_a_triangle(tip, corner_mm, *legs, path.off_mm) for tip in path.tip_mm[chosen]]
    )
    way_mm = float(path.way_mm[rows].sum())
    return float(np.mean(outside)) * way_mm <= _STRETCH_MM


def _leg_mm(move_mm: Floats) -> Floats:
    """Return half of each move (c, 3), at most the largest approximation distance."""
    length = np.maximum(np.linalg.norm(move_mm, axis=1, keepdims=True), 1e-12)
    leg: Floats = move_mm * np.minimum(0.5, _BLEND_MM / length)
    return leg


def _in_a_triangle(
    tip_mm: Floats, corner_mm: Floats, back_mm: Floats, on_mm: Floats, slack_mm: float
) -> bool:
    """Tell whether a point (3,) is in one of the triangles corner, corner + back, corner + on (c, 3)."""
    to = tip_mm - corner_mm
    bb, oo, bo = (np.sum(u * v, axis=1) for u, v in ((back_mm, back_mm), (on_mm, on_mm), (back_mm, on_mm)))
    area = bb * oo - bo**2
    turns = area > 1e-6 * bb * oo
    tb, to_on = np.sum(to * back_mm, axis=1), np.sum(to * on_mm, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        along_back, along_on = (oo * tb - bo * to_on) / area, (bb * to_on - bo * tb) / area
        off_plane = np.linalg.norm(to - along_back[:, None] * back_mm - along_on[:, None] * on_mm, axis=1)
        least_back, least_on = -slack_mm / np.sqrt(bb), -slack_mm / np.sqrt(oo)
        inside = (along_back > least_back) & (along_on > least_on) & (along_back + along_on < 1.0)
    return bool(np.any(turns & inside & (off_plane < slack_mm)))


def _is_frame(path: CommandedPath) -> bool:
    """Tell whether a shift and a turn of all of the path bring it onto the curve: another frame, then.

    Points to lines by least squares, each step from the feet of the one before (Chen & Medioni 1992).
    """
    rows = np.unique(np.linspace(0, len(path.tip_mm) - 1, _FRAME_ROWS).astype(np.int64))
    moved, way_mm, curve = path.tip_mm[rows], path.way_mm[rows], Curve(path.inputs.position_mm)
    for _ in range(_FRAME_STEPS):
        feet, apart_mm, along = curve.foot(moved)
        if float(way_mm[apart_mm <= path.on_mm].sum()) > _ALL * float(way_mm.sum()):
            return True
        moved = moved + _twist(moved, feet - moved, along)
    return False


def _twist(points_mm: Floats, wanted_mm: Floats, along: Floats) -> Floats:
    """Return what a small shift and turn add to points (n, 3) that miss lines by vectors (n, 3)."""
    lever = points_mm - points_mm.mean(axis=0)
    scale_mm = float(np.sqrt(np.mean(np.sum(lever**2, axis=1)))) or 1.0
    across = np.eye(3) - along[:, :, None] * along[:, None, :]
    turns = np.cross(np.eye(3)[None], lever[:, None, :]) / scale_mm  # (n, 3 turns, 3)
    moves = np.concatenate([np.broadcast_to(np.eye(3), (len(lever), 3, 3)), turns], axis=1)
    design = np.einsum("nij,nkj->nik", across, moves).reshape(-1, 6)
    target = np.einsum("nij,nj->ni", across, wanted_mm).ravel()
    values = np.linalg.lstsq(design, target, rcond=1e-9)[0]
    added: Floats = np.einsum("k,nkj->nj", values, moves)
    return added


# How fast it is gone


@dataclass(frozen=True)
class _Ratio:
    """Measured over predicted speed on a stretch at the programmed speed."""

    value: float
    rapid: bool


def _other_feeds(paths: Sequence[CommandedPath]) -> str | None:
    """Return the words for feeds that are others than the rapid moves say; None otherwise.

    An override scales all programmed speeds alike. Rapid moves that are slower than feeds say nothing: T1
    and the limits of the axes hold them back.
    """
    found = [ratio for path in paths for ratio in _ratios(path)]
    rapid = np.array([each.value for each in found if each.rapid])
    feed = np.array([each.value for each in found if not each.rapid])
    if len(rapid) == 0 or len(feed) == 0:
        return None
    of_feed, of_rapid = float(np.median(feed)), float(np.median(rapid))
    spread = float(np.median(np.abs(feed / of_feed - 1.0)))
    slower = of_feed < (1.0 - _OTHER_FEED) * of_rapid
    faster = of_feed > 1.0 + _OTHER_FEED and abs(of_rapid - 1.0) < _CONSISTENT
    if spread > _CONSISTENT or not (slower or faster):
        return None
    return (
        f"feed moves at {100.0 * of_feed:.0f} % of the predicted speed, rapid ones at "
        f"{100.0 * of_rapid:.0f} %: the run is of another program"
    )


def _ratios(path: CommandedPath) -> Iterator[_Ratio]:
    """Yield the ratios of speed on the stretches of constant predicted speed of the same curve."""
    inputs = path.inputs
    steps = np.linalg.norm(np.diff(inputs.position_mm, axis=0), axis=1)
    planned_mm = np.concatenate([[0.0], np.cumsum(steps)])
    length_mm = path.gone_mm[-1]
    same = path.share(path.apart_mm <= path.off_mm) >= _SAME_CURVE and planned_mm[-1] > 0.0
    if inputs.toolpath is None or not same or abs(length_mm / planned_mm[-1] - 1.0) > _SAME_LENGTH:
        return
    gone_mm = path.gone_mm * (planned_mm[-1] / length_mm)
    for start, end in _steady(steps, inputs):
        edge_mm = _MIDDLE * (planned_mm[end] - planned_mm[start])
        at_mm = np.linspace(planned_mm[start] + edge_mm, planned_mm[end] - edge_mm, 3)
        there_s = np.diff(np.interp(at_mm, planned_mm, inputs.time_s))
        here_s = np.diff(np.interp(at_mm, gone_mm, path.time_s))
        if (here_s > 0.0).all() and abs(here_s[0] / here_s[1] - 1.0) < _CONSTANT:
            rapid = bool(inputs.toolpath.rapid[inputs.move[end]])
            yield _Ratio(float(there_s.sum() / here_s.sum()), rapid)


def _steady(steps_mm: Floats, inputs: Inputs) -> Iterator[tuple[int, int]]:
    """Yield the first and last sample of stretches at the programmed speed; steps are (m - 1,).

    The peak of a move that is too short for its speed is none of them: no override changes it.
    """
    toolpath, targets = inputs.toolpath, inputs.targets
    if toolpath is None or targets is None:
        return
    programmed_mm_s = np.full(len(toolpath.rapid), np.nan)
    of_moves = targets.move >= 0
    programmed_mm_s[targets.move[of_moves]] = targets.speed_mm_s[of_moves]
    speed_mm_s = steps_mm / np.diff(inputs.time_s)
    at_speed = np.abs(speed_mm_s / programmed_mm_s[inputs.move[1:]] - 1.0) < _CONSTANT
    same_move = np.append(True, inputs.move[1:-1] == inputs.move[2:])
    starts = at_speed & ~(np.append(False, at_speed[:-1]) & same_move)
    ends = at_speed & ~(np.append(at_speed[1:], False) & np.append(same_move[1:], False))
    for start, end in zip(np.flatnonzero(starts).tolist(), np.flatnonzero(ends).tolist(), strict=True):
        if inputs.time_s[end + 1] - inputs.time_s[start] >= _LEAST_S:
            yield start, end + 1
