"""The intended path as straight lines: the place of samples on it, the deviation of the bent tool.

Every quantity is a function of the place along this path: a correction normal to a line does not change that
place, so forces, corrections and deviations of different Motions are compared at equal places.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gcode2krl import compliance
from gcode2krl import frames as fr
from gcode2krl.arrays import Bools, Floats, Ints32, Rows
from gcode2krl.cell import Cell
from gcode2krl.cell.tool_tips import motion_starts
from gcode2krl.cutting.milling import tool_axes
from gcode2krl.program.blending import LEVELS_MM
from gcode2krl.tables import Deflection, Forces, Joints, Motion, Targets, Toolpath
from gcode2krl.units import MM_PER_M, RAD_PER_DEG

Evaluated = tuple[Motion, Joints, Forces, Deflection]

MOST_SLOPE = 0.25
"""Largest sideways step of the correction per step along the path."""
SHARP_COS = math.cos(20.0 * RAD_PER_DEG)
"""A larger turn is a corner of two lines, each with its own correction; a smaller one belongs to a curve."""
_LEAST_PIECE_MM = 0.5
_PLANNED_AHEAD = 3
"""Motions that the controller is assumed to plan ahead where the cell calls it unlimited."""
_NEWTON_STEPS = 6
_NO_SWING_RAD = 1e-6


class Placed(NamedTuple):
    """Samples on the intended path."""

    row: Rows
    """(m,) row of Targets whose straight line the sample is on, -1 = none of the cutting lines."""
    path_mm: Floats
    """(m,) the place on the intended path, never decreasing."""

    def distinct(self) -> tuple[Floats, Rows]:
        """Return the different places (k,) and the last sample (k,) at each."""
        on = np.flatnonzero(self.row >= 0)
        places, back = np.unique(self.path_mm[on][::-1], return_index=True)
        return places, on[len(on) - 1 - back]


@dataclass(frozen=True)
class Ways:
    """The straight lines (p) to the intended targets."""

    start_mm: Floats
    unit: Floats
    length_mm: Floats
    begin_mm: Floats
    """(p,) place on the path at which each begins."""
    cuts: Bools
    """(p,) True where the correction may go: LIN at feed."""
    follows: Bools
    """(p,) True where the correction may go on both a line and the line before it."""
    row_of: Rows
    """Row of Targets of a row of the Toolpath, -1 = none that may be corrected."""
    blend_mm: Floats
    """(p,) approximation at the end of each line: min(CDIS, half lines)."""
    cos_turn: Floats
    """(p,) cosine of the turn at the end of each line."""
    piece_mm: Floats
    """(p,) shortest piece that each line may be divided into."""
    piece_cdis_mm: Floats
    slope: Floats
    """(p,) largest change of the correction per path length."""
    source_line: Ints32
    arc: Ints32
    """(p,) number of the arc that each is a chord of, -1 = none."""
    turn: Floats
    """(p, 3) rotation vector along ``$BASE`` by which the tool turns on a line, in rad/mm."""
    middle_mm: Floats
    """(p,) height of the middle of a ball above its tip; NaN of other tools."""

    @classmethod
    def of(cls, toolpath: Toolpath, targets: Targets, cell: Cell) -> "Ways":
        """Return the lines of a program."""
        start, from_rotation = motion_starts(targets, cell)
        way = targets.position_mm - start
        length = np.linalg.norm(way, axis=1)
        size = np.where(length > 0, length, 1.0)[:, None]
        unit, turn = way / size, _turns(from_rotation, targets.rotation) / size
        move = np.maximum(targets.move, 0)
        cuts = ~targets.ptp & (targets.move >= 0) & (length > 0)
        cuts &= ~toolpath.rapid[move] & ~toolpath.machine[move]
        follows = np.zeros(len(cuts), dtype=np.bool_)
        follows[1:] = cuts[1:] & cuts[:-1] & (targets.tool[1:] == targets.tool[:-1])
        row_of = np.full(len(toolpath), -1, dtype=np.int64)
        row_of[targets.move[cuts]] = np.flatnonzero(cuts)
        blend, cos_turn = np.zeros(len(cuts)), np.ones(len(cuts))
        blend[:-1] = np.minimum(targets.cdis_mm[:-1], np.minimum(length[:-1], length[1:]) / 2.0)
        blend[:-1][~follows[1:]] = 0.0
        cos_turn[:-1] = np.einsum("ij,ij->i", unit[:-1], unit[1:])
        piece, cdis, slope = _pieces(targets, np.linalg.norm(turn, axis=1), cell)
        balls = {n: tool.diameter_mm / 2.0 for n, tool in cell.tool.items() if tool.kind == "ball"}
        return cls(
            start,
            unit,
            length,
            np.cumsum(length) - length,
            cuts,
            follows,
            row_of,
            blend,
            cos_turn,
            piece,
            cdis,
            slope,
            targets.source_line,
            np.where(cuts, toolpath.arc[move], -1),
            turn,
            np.array([balls.get(number, np.nan) for number in targets.tool.tolist()]),
        )

    @property
    def end_mm(self) -> Floats:
        """(p,) place on the path at which each line ends."""
        return self.begin_mm + self.length_mm

    def place(self, motion: Motion, shift_mm: Floats | None = None) -> Placed:
        """Return where samples are, the targets moved by ``shift_mm`` (p, 3); added moves have no place.

        The component of a shift along its line stretches the line.
        """
        row = np.where(motion.move >= 0, self.row_of[motion.move], -1)
        away = motion.position_mm - self.start_mm[row]
        along = np.einsum("ij,ij->i", away, self.unit[row])
        off_mm = np.linalg.norm(away - along[:, None] * self.unit[row], axis=1)
        head, tail, reach_mm = self.stretched(shift_mm)
        along = (along - head[row]) / (self.length_mm + tail - head)[row] * self.length_mm[row]
        room = reach_mm + self.blend_mm[row] + np.append(0.0, self.blend_mm[:-1])[row] + 1e-6
        on = (row >= 0) & (off_mm <= room) & (along >= -room) & (along <= self.length_mm[row] + room)
        path = self.begin_mm[row] + np.clip(along, 0.0, self.length_mm[row])
        path = np.maximum.accumulate(np.where(on, path, 0.0))
        return Placed(np.where(on, row, -1), path)

    def stretched(self, shift_mm: Floats | None) -> tuple[Floats, Floats, float]:
        """Return (p,) how far start and end of each line move along it, and the largest shift."""
        if shift_mm is None:
            return np.zeros_like(self.length_mm), np.zeros_like(self.length_mm), 0.0
        before = np.where(self.follows[:, None], np.roll(shift_mm, 1, axis=0), 0.0)
        head, tail = (np.einsum("ij,ij->i", shift, self.unit) for shift in (before, shift_mm))
        tail = np.where(self.cuts, tail, 0.0)
        return head, tail, float(np.linalg.norm(shift_mm, axis=1).max(initial=0.0))

    def runs(self) -> Iterator[tuple[int, int]]:
        """Yield first and last row of each run of cutting lines without a sharp corner."""
        joined = self.follows.copy()
        joined[1:] &= (self.cos_turn[:-1] >= SHARP_COS) | (
            (self.arc[1:] >= 0) & (self.arc[1:] == self.arc[:-1])
        )
        first = np.flatnonzero(self.cuts & ~joined)
        ends = np.flatnonzero(self.cuts & ~np.append(joined[1:], False))
        yield from zip(first.tolist(), ends.tolist(), strict=True)


def _turns(from_rotation: Floats, to_rotation: Floats) -> Floats:
    """Return rotation vectors (p, 3) between quaternions; 0 where the tool turns about its axis alone."""
    turn = fr.turn_between(from_rotation, to_rotation)
    x, y, z, w = to_rotation.T
    axis = np.stack([2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)], axis=1)
    turn[np.linalg.norm(np.cross(turn, axis), axis=1) < _NO_SWING_RAD] = 0.0
    return turn


def _pieces(targets: Targets, turn_per_mm: Floats, cell: Cell) -> tuple[Floats, Floats, Floats]:
    """Return (p,) the shortest piece, its approximation distance, and the steepest correction of each line.

    The pieces that the controller plans ahead are together as long as the stopping distance v·(v/a + k)/2, so
    that dividing a line does not slow it down; the approximation at the ends of the line does not change.
    With an approximation distance d between pieces a kink takes the acceleration v²·angle/(2·d) <= a. Where
    the tool turns, the stopping distance is that which the acceleration of its turn needs.
    """
    controller = cell.controller
    a_mm_s2, v = controller.acc_cp_m_s2 * MM_PER_M, np.nan_to_num(targets.speed_mm_s)
    a_along: float | Floats = a_mm_s2
    if turn_per_mm.any():
        mm_per_rad = 1.0 / np.maximum(turn_per_mm, 1e-12)
        a_along = np.minimum(a_mm_s2, controller.acc_ori_deg_s2 * RAD_PER_DEG * mm_per_rad)
        v = np.minimum(v, controller.vel_ori_deg_s * RAD_PER_DEG * mm_per_rad)
    ahead = _PLANNED_AHEAD if controller.advance == "unlimited" else int(controller.advance)
    if ahead == 0:  # every target is an exact stop: each piece adds a stop
        return np.full(len(v), np.inf), np.zeros(len(v)), np.full(len(v), MOST_SLOPE)
    reach = np.maximum(targets.cdis_mm, np.append(0.0, targets.cdis_mm[:-1]))
    piece = np.maximum(
        v * (v / a_along + controller.k_s) / (2.0 * ahead), np.maximum(2.0 * reach, _LEAST_PIECE_MM)
    )
    level = np.searchsorted(LEVELS_MM, piece / 2.0, side="right") - 1
    cdis = LEVELS_MM[level]
    return piece, cdis, np.minimum(cdis * a_mm_s2 / np.maximum(v * v, 1e-9), MOST_SLOPE)


@dataclass(frozen=True)
class Deviation:
    """Where the bent tool runs against the intended path, a row per sample of a Motion."""

    intended_mm: Floats
    """(m, 3) nearest point of the intended path, corners blended; off the cutting moves the bent tip."""
    offset_mm: Floats
    """(m, 3) deflected minus intended, normal to the path; 0 off the cutting moves. Where the tool turns, at
    the height between tip and depth of cut where it is largest, normal to the way of the edge there."""
    cuts: Bools
    """(m,) True where the tool is loaded on a cutting move."""
    steady: Bools
    """(m,) the samples of ``cuts`` away from corners and from ramps of the correction."""
    source_line: Ints32

    @property
    def max_mm(self) -> float:
        """Largest deviation in the cut."""
        return self._largest(self.cuts)

    @property
    def steady_max_mm(self) -> float:
        """Largest deviation in the cut, away from corners and ramps."""
        return self._largest(self.steady)

    @property
    def rms_mm(self) -> float:
        """Root mean square of the deviation in the cut."""
        square = np.einsum("ij,ij->i", self.offset_mm, self.offset_mm)[self.cuts]
        return float(np.sqrt(square.mean())) if len(square) else 0.0

    def _largest(self, rows: Bools) -> float:
        return float(np.linalg.norm(self.offset_mm[rows], axis=1).max(initial=0.0))


def deviation_from(ways: Ways, evaluated: Evaluated, placed: Placed, ramped: Bools) -> Deviation:
    """Return where the bent tool runs against the intended lines and their parabolas in the corners."""
    motion, _, forces, deflection = evaluated
    row = placed.row
    cuts = (row >= 0) & forces.force_base_N.any(axis=1)
    bent = motion.position_mm + deflection.deflection_base_mm
    away = bent - ways.start_mm[row]
    along = np.einsum("ij,ij->i", away, ways.unit[row])
    offset = away - along[:, None] * ways.unit[row]
    turns = np.flatnonzero((row >= 0) & ways.turn[row].any(axis=1))
    if len(turns):
        offset[turns] = _off_edge(ways, evaluated, placed, away, turns)
    in_corner = np.zeros(len(motion), dtype=np.bool_)
    head = np.append(0.0, ways.blend_mm[:-1])[row]
    for vertex, near in ((row, along > ways.length_mm[row] - ways.blend_mm[row]), (row - 1, along < head)):
        rows = np.flatnonzero((row >= 0) & near & (ways.blend_mm[vertex] > 0.0))
        offset[rows] = _off_parabola(ways, vertex[rows], bent[rows])
        in_corner[rows] = True
    offset[row < 0] = 0.0
    steady = cuts & ~in_corner & ~ramped & ~motion.corner
    line = np.where(row >= 0, ways.source_line[row], 0).astype(np.int32)
    return Deviation(np.where((row >= 0)[:, None], bent - offset, bent), offset, cuts, steady, line)


def _off_edge(ways: Ways, evaluated: Evaluated, placed: Placed, away: Floats, at: Rows) -> Floats:
    """Return how far the bent edge is off its intended way, (k, 3), at samples ``at`` whose tool turns.

    ``away`` (m, 3) from the start of a line to the bent tip. A place at the height z of the axis moves by
    u + z·w for a mm of the tip's way, u that of the line and w the turn of the axis: a shift along that
    leaves the same surface. What is normal to it is taken at the tip, at the depth of cut, and where the
    shift is all across; of a ball at its middle alone, as its surface moves like that.
    """
    row, axis = placed.row[at], tool_axes(evaluated[0])[at]
    shift = away[at] - (placed.path_mm[at] - ways.begin_mm[row])[:, None] * ways.unit[row]
    swing = np.cross(ways.turn[row], axis)
    depth = np.nan_to_num(evaluated[2].a_p_mm[at])
    across, swung = (np.einsum("ij,ij->i", shift, each) for each in (ways.unit[row], swing))
    between = np.clip(-across / np.where(swung == 0.0, np.inf, swung), 0.0, depth)
    middle = ways.middle_mm[row]
    worst = np.zeros_like(shift)
    for height in (np.zeros(len(at)), depth, between):
        height = np.where(np.isnan(middle), height, middle)
        off = compliance.project_normal(shift, ways.unit[row] + height[:, None] * swing)
        larger = np.linalg.norm(off, axis=1) > np.linalg.norm(worst, axis=1)
        worst[larger] = off[larger]
    return worst


def _off_parabola(ways: Ways, vertex: Rows, point: Floats) -> Floats:
    """Return how far points (k, 3) are off the approximated corner at the ends of lines, normal to it.

    The parabola V + d·(t²·u2 - (1 - t)²·u1) for t from 0 to 1 (Bigliardi et al. 2022); its nearest point by
    Newton's method.
    """
    before, after, d = ways.unit[vertex], ways.unit[vertex + 1], ways.blend_mm[vertex][:, None]
    corner = ways.start_mm[vertex] + ways.length_mm[vertex][:, None] * before
    t = np.full((len(vertex), 1), 0.5)
    second = 2.0 * d * (after - before)
    for _ in range(_NEWTON_STEPS):
        off = corner + d * (t * t * after - (1.0 - t) ** 2 * before) - point
        first = 2.0 * d * ((1.0 - t) * before + t * after)
        slope = np.sum(first * first, axis=1, keepdims=True)
        curve = slope + np.sum(off * second, axis=1, keepdims=True)
        t = t - np.sum(off * first, axis=1, keepdims=True) / np.where(curve > 0.2 * slope, curve, slope)
        t = np.clip(t, 0.0, 1.0)
    off = point - corner - d * (t * t * after - (1.0 - t) ** 2 * before)
    return compliance.project_normal(off, (1.0 - t) * before + t * after)
