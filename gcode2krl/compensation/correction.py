"""The correction that a deflection asks for, as shifts of targets: ramped, tied at corners, lines divided.

Minus the deflection without its component along the intended line (Haehn & Weigold 2020, eq. 10). At a sharp
corner the shifted lines are brought to meet; on a curve the targets keep its distance.
"""

import itertools
import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from gcode2krl import compliance
from gcode2krl import frames as fr
from gcode2krl.arrays import Bools, Floats, Rows
from gcode2krl.cell import Cell
from gcode2krl.cell.carried import to_rest, vectors_turned
from gcode2krl.compensation.intended_path import MOST_SLOPE, Evaluated, Placed, Ways

SETTLED_MM = 1e-3
"""Change of the targets below which the rounds end; smaller differences are ignored."""
_COLLINEAR = 1e-7
"""1 minus the cosine of a turn, 0.03°, up to which two lines are one."""
_ALONG_OF_WAY = 1.0 / 3.0
"""Most that two targets come closer or farther, over the way between them."""


@dataclass(frozen=True)
class Shift:
    """How far targets and places between them are moved."""

    target_mm: Floats
    """(p, 3) at the intended targets."""
    row: Rows
    """(q,) line that is divided."""
    along_mm: Floats
    """(q,) place of the division, from the start of the line; rising within a line."""
    piece_mm: Floats
    """(q, 3) the shift there."""

    @classmethod
    def none(cls, ways: Ways) -> "Shift":
        """Return the shift that moves nothing."""
        nothing = np.zeros(0)
        return cls(np.zeros_like(ways.unit), nothing.astype(np.int64), nothing, np.zeros((0, 3)))

    def change_mm(self, other: "Shift") -> float:
        """Return the distance of the targets from another shift's; infinite if lines divide differently."""
        if len(self.row) != len(other.row):
            return math.inf
        pieces = np.linalg.norm(self.piece_mm - other.piece_mm, axis=1).max(initial=0.0)
        return float(max(pieces, np.linalg.norm(self.target_mm - other.target_mm, axis=1).max(initial=0.0)))

    def largest_mm(self) -> float:
        """Return the largest shift."""
        return float(np.linalg.norm(np.concatenate([self.target_mm, self.piece_mm]), axis=1).max(initial=0.0))


class Contact(NamedTuple):
    """Places on the intended path with their forces; in air up to the first loaded one and from the last one.

    Kept for all rounds: the intended path says where the tool is to cut. Every round bends at these places.
    Its own samples move with the time law, and beside a step of the force the correction would then depend
    on which side of it a sample happens to be.
    """

    path_mm: Floats
    """(k,) rising places."""
    row: Rows
    """(k,) row of Targets whose line each is on."""
    corner: Bools
    """(k,) True in an approximated corner."""
    air_mm: Floats
    """(k,) distance to the nearest place in air."""
    force_base_N: Floats
    """(k, 3) force on the tool."""
    moment_base_Nmm: Floats
    """(k, 3) its moment about the tip."""

    @classmethod
    def of(cls, ways: Ways, evaluated: Evaluated) -> "Contact":
        """Return the contact of the intended targets as evaluated."""
        motion, _, forces, _ = evaluated
        placed = ways.place(motion)
        path_mm, sample = placed.distinct()
        air: Bools = np.append(False, ~np.asarray(forces.force_base_N[sample].any(axis=1)))
        near_air = air | np.roll(air, 1) | np.roll(air, -1)  # contact begins somewhere between two samples
        return cls(
            path_mm,
            placed.row[sample],
            motion.corner[sample],
            _distance(path_mm, near_air[1:]),
            forces.force_base_N[sample],
            forces.moment_base_Nmm[sample],
        )

    def against(self, placed: Placed, evaluated: Evaluated, cell: Cell, turns: bool) -> Floats:
        """Return minus the deflection (k, 3) at the places, with the arm as at the nearest sample.

        Where the tool ``turns``, as between two: the samples of a round move, and the arm with each.
        """
        path_mm, sample = placed.distinct()
        near = sample[np.searchsorted((path_mm[1:] + path_mm[:-1]) / 2.0, self.path_mm)]
        motion, joints = evaluated[:2]
        q_rad = interpolated(self.path_mm, path_mm, joints.q_rad[sample]) if turns else joints.q_rad[near]
        force, moment, tool = self.force_base_N, self.moment_base_Nmm, motion.tool[near]
        by = to_rest(motion.external[near], cell)
        if by is None:
            return -compliance.deflection_of(q_rad, force, moment, np.zeros(3), cell, tool)[0]
        force, moment = vectors_turned(force, by), vectors_turned(moment, by)
        bent = compliance.deflection_of(q_rad, force, moment, np.zeros(3), cell, tool)[0]
        return -vectors_turned(bent, fr.invert(by))

    def air_at(self, path_mm: Floats) -> Floats:
        """Return the distance (n,) of places to the nearest in air."""
        return np.interp(path_mm, self.path_mm, self.air_mm)


class Field(NamedTuple):
    """The correction that a deflection asks for."""

    shift: Shift
    placed: Placed
    ramped: Bools
    """(m,) True where a ramp replaces the correction that the deflection there asks for."""


@dataclass
class LineRun:
    """A run of lines: places (n,) and minus the deflection there (n, 3), later ramped."""

    first: int
    last: int
    path_mm: Floats
    value_mm: Floats
    air_mm: Floats
    """(n,) distance to the nearest place in air."""
    place: Rows
    """(n,) place of the Contact, -1 where there is none."""
    slope: float = MOST_SLOPE
    asked_mm: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    """(n, 3) the values before they were ramped."""

    def ramp(self, slope: float) -> None:
        """Make the values no steeper than ``slope``, and 0 in air."""
        self.slope, self.asked_mm = slope, self.value_mm
        room = slope * self.air_mm[:, None]
        self.value_mm = np.clip(_no_steeper(self.path_mm, self.value_mm, slope), -room, room)


def wanted_correction(
    ways: Ways,
    evaluated: Evaluated,
    contact: Contact,
    cell: Cell,
    before: Shift,
    tolerance_mm: float,
    divides: bool,
) -> Field:
    """Return the shift that the deflection of the arm as evaluated asks for.

    Lines stay divided where ``before`` divides them; with ``divides`` they are also divided where the
    correction differs from a straight line by more than half of ``tolerance_mm``.
    """
    placed = ways.place(evaluated[0], before.target_mm)
    divided = ways.begin_mm[before.row] + before.along_mm
    runs = []
    if len(contact.path_mm):
        against = contact.against(placed, evaluated, cell, bool(ways.turn.any()))
        runs = [_run(ways, first, last, against, contact, divided) for first, last in ways.runs()]
    target_mm = _corners(ways, runs)
    ramped = np.ones(len(contact.path_mm), dtype=np.bool_)
    rows, alongs, pieces = [before.row[:0]], [before.along_mm[:0]], [before.piece_mm[:0]]
    for run in runs:
        _tie(run, ways, target_mm)
        place = run.place[run.place >= 0]
        off = (run.value_mm - run.asked_mm)[run.place >= 0]
        off = compliance.project_normal(off, ways.unit[contact.row[place]])
        ramped[place] = np.linalg.norm(off, axis=1) > SETTLED_MM
        inner = np.arange(run.first, run.last)
        value = interpolated(ways.end_mm[inner], run.path_mm, run.value_mm)
        target_mm[inner] = _on_curve(ways, inner, value, tolerance_mm)
        length = ways.length_mm[run.first : run.last + 1]
        long = run.first + np.flatnonzero(length >= 2.0 * ways.piece_mm[run.first : run.last + 1])
        for row in long.tolist():
            fixed = before.along_mm[slice(*np.searchsorted(before.row, [row, row + 1]))]
            along = _division(ways, row, run, fixed, tolerance_mm if divides else math.inf)
            rows.append(np.full(len(along), row))
            alongs.append(along)
            pieces.append(_on_line(ways, row, run, along))
    row_of, along_mm = np.concatenate(rows), np.concatenate(alongs)
    stretch_mm = _stretch(ways, target_mm, row_of, along_mm)
    shift = Shift(target_mm, row_of, along_mm, np.concatenate(pieces) + stretch_mm)
    return Field(shift, placed, _near_ramps(ways, placed, contact, ramped))


def _near_ramps(ways: Ways, placed: Placed, contact: Contact, ramped: Bools) -> Bools:
    """Return the samples (m,) within two pieces of a ramp: no line can follow its kinks more closely."""
    if not ramped.any():
        return np.zeros(len(placed.row), dtype=np.bool_)
    away_mm = np.interp(placed.path_mm, contact.path_mm, _distance(contact.path_mm, ramped))
    return np.asarray((away_mm <= 2.0 * ways.piece_mm[placed.row]) & (placed.row >= 0))


def _stretch(ways: Ways, target_mm: Floats, row: Rows, along_mm: Floats) -> Floats:
    """Return how far places on lines (q, 3) move along the lines when the ends of the lines do."""
    head, tail, _ = ways.stretched(target_mm)
    fraction = along_mm / ways.length_mm[row]
    return np.asarray((head[row] + fraction * (tail - head)[row])[:, None] * ways.unit[row])


def _run(ways: Ways, first: int, last: int, against: Floats, contact: Contact, divided_mm: Floats) -> LineRun:
    """Return minus the deflection along a run and at its ends, without the places in the corners there.

    There are values at the places of the contact, at the targets, and at ``divided_mm``, where lines are
    divided already.
    """
    path_mm, corner = contact.path_mm, contact.corner
    begin, end = ways.begin_mm[first], ways.end_mm[last]
    low, high = np.searchsorted(path_mm, [begin, end])
    high = high + int(high < len(path_mm) and path_mm[high] == end)
    at = path_mm[low:high]
    head = ways.blend_mm[first - 1] if ways.follows[first] else 0.0
    keep = ~(corner[low:high] & ((at - begin < head) | (end - at < ways.blend_mm[last])))
    keep &= (at > begin) & (at < end)
    rows = low + np.flatnonzero(keep)
    if len(rows) == 0:  # without a place: the correction of its neighbour
        near = min(low, len(path_mm) - 1)
        places, ends = np.array([begin, end]), np.repeat(against[near : near + 1], 2, axis=0)
        run = LineRun(first, last, places, ends, contact.air_at(places), np.array([-1, -1]))
        run.ramp(float(ways.slope[first : last + 1].min()))
        return run
    places = np.concatenate([[begin], path_mm[rows], [end]])
    air_mm = contact.air_at(places)
    value = np.where((air_mm > 0.0)[:, None], np.concatenate([against[:1], against[rows], against[:1]]), 0.0)
    value[0], value[-1] = _outwards(places, value, air_mm), _outwards(places[::-1], value[::-1], air_mm[::-1])
    more = ways.end_mm[first:last]
    more = np.concatenate([more, divided_mm[slice(*np.searchsorted(divided_mm, [begin, end]))]])
    every, of = np.unique(np.concatenate([places, more]), return_index=True)
    place = np.concatenate([[-1], rows, [-1], np.full(len(more), -1)])[of]
    run = LineRun(first, last, every, interpolated(every, places, value), contact.air_at(every), place)
    run.ramp(float(ways.slope[first : last + 1].min()))
    return run


def _outwards(path_mm: Floats, value: Floats, air_mm: Floats) -> Floats:
    """Return the value (3,) at the first place: extrapolated from the next two, or the next one alone."""
    if air_mm[0] == 0.0:
        return np.zeros(3)
    if len(path_mm) < 4 or air_mm[1] == 0.0 or air_mm[2] == 0.0:
        return np.asarray(value[1])
    fraction = max(-2.0, (path_mm[0] - path_mm[1]) / (path_mm[2] - path_mm[1]))
    return np.asarray(value[1] + fraction * (value[2] - value[1]))


def _distance(path_mm: Floats, marked: Bools) -> Floats:
    """Return how far each place (n,) is from the nearest marked one."""
    before = np.maximum.accumulate(np.where(marked, path_mm, -np.inf))
    after = np.minimum.accumulate(np.where(marked, path_mm, np.inf)[::-1])[::-1]
    return np.minimum(np.minimum(path_mm - before, after - path_mm), 1e6)


def _tie(run: LineRun, ways: Ways, target_mm: Floats) -> None:
    """Ramp the values of a run to those of the targets at its ends, no steeper than its lines allow."""
    start = target_mm[run.first - 1] if ways.follows[run.first] else np.zeros(3)
    at_ends = run.value_mm[[0, -1]]
    ends = at_ends + compliance.project_normal(
        np.stack([start, target_mm[run.last]]) - at_ends, ways.unit[[run.first, run.last]]
    )
    path, room = run.path_mm, run.slope * run.air_mm[:, None]
    from_start, from_end = run.slope * (path - path[0])[:, None], run.slope * (path[-1] - path)[:, None]
    low = np.maximum(ends[0] - from_start, ends[1] - from_end)
    high = np.minimum(ends[0] + from_start, ends[1] + from_end)
    value = np.where(low > high, (low + high) / 2.0, np.clip(run.value_mm, low, high))
    run.value_mm = np.clip(value, -room, room)
    run.value_mm[0], run.value_mm[-1] = ends


def _no_steeper(path_mm: Floats, value: Floats, slope: float) -> Floats:
    """Return the mean of the closest curves above and below that keep to the slope."""
    rise = slope * path_mm[:, None]
    above = np.maximum(
        np.maximum.accumulate(value + rise) - rise, np.maximum.accumulate((value - rise)[::-1])[::-1] + rise
    )
    below = np.minimum(
        np.minimum.accumulate(value - rise) + rise, np.minimum.accumulate((value + rise)[::-1])[::-1] - rise
    )
    middle: Floats = (above + below) / 2.0
    return middle


def _corners(ways: Ways, runs: list[LineRun]) -> Floats:
    """Return the shifts (p, 3) of the targets at the ends of runs; at a sharp corner that of both lines.

    There the shifted lines meet: the shift w solves N1·w = c1 and N2·w = c2, where N removes the component
    along the line. Normal to both lines it is the mean of the two corrections. Where w would shift the corner
    along a line by more than a third of its length, it is blended with the mean of the two corrections.
    """
    target = np.zeros_like(ways.unit)
    for run, after in zip(runs, [*runs[1:], None], strict=False):
        shift = compliance.project_normal(run.value_mm[-1:], ways.unit[run.last])[0]
        target[run.last] = shift
        if after is None or not (after.first == run.last + 1 and ways.follows[after.first]):
            continue
        if run.air_mm[-1] == 0.0 or after.air_mm[0] == 0.0:
            target[run.last] = 0.0
            continue
        lines = ways.unit[[run.last, after.first]]
        other = compliance.project_normal(after.value_mm[:1], lines[1])[0]
        across = np.eye(3) - lines[:, :, None] * lines[:, None, :]
        both = np.linalg.lstsq(across.reshape(6, 3), np.concatenate([shift, other]), rcond=1e-2)[0]
        most = ways.length_mm[[run.last, after.first]].min() / 3.0
        weight = min(1.0, most / max(float(np.abs(lines @ both).max()), 1e-9))
        target[run.last] = weight * both + (1.0 - weight) * (shift + other) / 2.0
    return target


def _on_curve(ways: Ways, row: Rows, value: Floats, tolerance_mm: float) -> Floats:
    """Return the shifts (k, 3) of targets on a curve: normal to it, and along it only what its chords need.

    Without its component s along the curve a value misses the normals of the two chords by s·sin(turn/2); as
    much of s is kept as brings that down to a quarter of the tolerance. Where the tool turns, lines are
    divided by their turn too: at targets between two collinear pieces it changes evenly, and by at most a
    third of the way, so that no piece runs backwards.
    """
    mean = ways.unit[row] + ways.unit[row + 1]
    normal = compliance.project_normal(value, mean)
    along = value - normal
    missed = np.linalg.norm(along, axis=1) * np.sqrt(np.maximum(1.0 - ways.cos_turn[row], 0.0) / 2.0)
    kept = np.maximum(0.0, 1.0 - tolerance_mm / 4.0 / np.where(missed > 0.0, missed, 1e-9))
    if ways.turn[row].any():
        along = _evenly_along(ways, row, along, kept)
        kept = np.ones(len(row))
    result: Floats = normal + kept[:, None] * along
    return result


def _evenly_along(ways: Ways, row: Rows, along: Floats, kept: Floats) -> Floats:
    """Return how far (k, 3) targets move along a run; where it bends ``kept`` (k,) of ``along`` is wanted."""
    unit, at_mm = ways.unit[row], ways.end_mm[row]
    size = np.einsum("ij,ij->i", along, unit)
    bends = ways.cos_turn[row] < 1.0 - _COLLINEAR
    amount = np.interp(at_mm, at_mm[bends], (kept * size)[bends]) if bends.any() else np.zeros(len(row))
    amount = np.clip(amount, -np.abs(size), np.abs(size))
    room = np.minimum(at_mm - ways.begin_mm[row[0]], ways.end_mm[row[-1] + 1] - at_mm) * _ALONG_OF_WAY
    amount = np.clip(_no_steeper(at_mm, amount[:, None], _ALONG_OF_WAY)[:, 0], -room, room)
    share: Floats = (amount / np.where(size == 0.0, 1.0, size))[:, None] * along
    return share


def _on_line(ways: Ways, row: int, run: LineRun, along_mm: Floats) -> Floats:
    """Return the shifts (k, 3) at places of a line, normal to it."""
    value = interpolated(ways.begin_mm[row] + along_mm, run.path_mm, run.value_mm)
    return compliance.project_normal(value, ways.unit[row])


def _division(ways: Ways, row: int, run: LineRun, fixed: Floats, tolerance_mm: float) -> Floats:
    """Return the places (q,) that divide a line: ``fixed``, and where the correction between is curved."""
    begin, length, least = ways.begin_mm[row], ways.length_mm[row], ways.piece_mm[row]
    inside = slice(*np.searchsorted(run.path_mm, [begin, begin + length]))
    at = run.path_mm[inside] - begin
    value = compliance.project_normal(run.value_mm[inside], ways.unit[row])
    places = [0.0, *fixed.tolist(), float(length)]
    spans = list(itertools.pairwise(places)) if math.isfinite(tolerance_mm) else []
    while spans:
        low, high = spans.pop()
        if high - low < 2.0 * least:
            continue
        between = slice(*np.searchsorted(at, [low, high]))
        ends = _on_line(ways, row, run, np.array([low, high]))
        fraction = ((at[between] - low) / (high - low))[:, None]
        off = np.linalg.norm(value[between] - ends[0] - fraction * (ends[1] - ends[0]), axis=1)
        if len(off) and off.max() > tolerance_mm / 2.0:
            cut = min(max(float(at[between][off.argmax()]), low + least), high - least)
            places.append(cut)
            spans += [(low, cut), (cut, high)]
    return np.array(sorted(places)[1:-1])


def interpolated(at: Floats, path_mm: Floats, value: Floats) -> Floats:
    """Return the vectors (k, 3) at places between others."""
    return np.stack([np.interp(at, path_mm, column) for column in value.T], axis=1)
