"""Rotary values to tool tip and tool axis in the part: what a declared machine makes of its angles.

With R_H the rotation of the head and R_T that of the table, each the product of its axes from the base
outwards, and z the tool axis at zero,

    axis = R_Tᵀ·R_H·z                                                    (1)
    tip  = c + R_Tᵀ·(s + p·z - (p + l)·R_H·z - c)                        (2)

s is the programmed position plus l·z, l the tool length offset, p the distance from the head's pivot to the
gauge line, c the centre of the table. Under TCPM the programmed position is the tip, and (1) is all.

The angles of a machine run linearly during a move, so that neither axis nor tip go straight in the part.
Moves are divided into chords: between two of them the robot turns the tool axis in one plane. How many, is
judged at places at most `_PROBE_DEG` apart.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.cell.sections.fields import missing_key
from gcode2krl.errors import Issue, NotUnderstoodError, input_error
from gcode2krl.gcode import vocabulary as v
from gcode2krl.tables import Event
from gcode2krl.units import DEG_PER_RAD, RAD_PER_DEG, S_PER_MIN

if TYPE_CHECKING:  # a cell file costs its library a noticeable start
    from gcode2krl.cell.sections.machine import Machine

_PROBE_DEG = 10.0
"""A move is judged piece by piece, each of at most this turn: sines are parabolas there to 0.1 %."""
_SAFE = 0.98
"""Fraction of a tolerance that a parabola may use."""
_RAPID_STEP_DEG, _RAPID_TOLERANCE_DEG = 90.0, 1.0
"""For rapid moves: nothing is cut on them."""
_SPOT_STEP_DEG = 5.0
"""Largest turn of a motion where the tip stands: each ends at rest."""
_SPOT_MM = 1e-3
"""The last decimal of the KRL text: a shorter way is none."""
_MOST_CHORDS = 20_000_000
_REVERSED = -1.0 + 1e-9
"""Cosine of a turn between tool vectors that has no plane."""
_PLANES = {"A": (1, 2), "B": (2, 0), "C": (0, 1)}
"""Which component each axis turns towards which."""


class TurnedColumns(NamedTuple):
    """What the rotary stage makes of the columns."""

    columns: dict[str, NDArray[Any]]
    axis: Floats
    events: tuple[Event, ...]
    issues: tuple[Issue, ...]


def in_part(
    columns: dict[str, NDArray[Any]],
    events: tuple[Event, ...],
    machine: "Machine",
    chord_tolerance_mm: float,
    vel_ori_deg_s: float,
    source: str,
) -> TurnedColumns:
    """Return columns whose positions are the tip in the part, the tool axis, and events at their new rows.

    Parameters
    ----------
    columns : those of the interpreter; the rotary ones (`columns.ROTARY`) are left out of the result.
    chord_tolerance_mm : how far the tip may be off between chords.
    vel_ori_deg_s : how fast the robot turns where the tip stands.

    Raises
    ------
    NotUnderstoodError
        Where the cell lacks a length of the machine, a tool vector turns back by 180°, or a program turns
        so far that its chords have no room.
    """
    kept = {name: column for name, column in columns.items() if name not in ("turn", "turn_mode", "time_s")}
    if not columns["turn"].any():
        upright = np.broadcast_to(np.array([0.0, 0.0, 1.0]), (len(columns["turn"]), 3))
        return TurnedColumns(kept, upright, events, ())
    way = _Way(columns, machine, source)
    chords = way.chords(chord_tolerance_mm)
    owner = np.repeat(np.arange(len(chords)), chords)
    number = np.arange(len(owner)) - (np.cumsum(chords) - chords)[owner]
    tip, axis = way.at(owner, (number + 1) / chords[owner])
    ends = number + 1 == chords[owner]
    kept = {name: column[owner] for name, column in kept.items()}
    kept["dwell_s"] = np.where(ends, kept["dwell_s"], 0.0)
    kept["exact_stop"] = kept["exact_stop"] & ends
    kept["known"] = way.known()[owner]
    kept["position_mm"] = tip
    time_s, turn_deg = way.time_s()[owner] / chords[owner], _angle_deg(axis[:-1], axis[1:])
    on_spot = np.concatenate([[False], np.linalg.norm(np.diff(tip, axis=0), axis=1) < _SPOT_MM])
    kept["feed_mm_s"] = _feeds(kept, tip, time_s, on_spot)
    issues = tuple(_turns_on_spot(kept, np.append(0.0, turn_deg), time_s, on_spot, vel_ori_deg_s))
    last = np.cumsum(chords) - 1
    moved = tuple(event._replace(row=int(last[event.row])) for event in events)
    return TurnedColumns(kept, axis, moved, issues)


def posed(machine: "Machine", stand: Floats, deg: Floats, lift_mm: Floats) -> tuple[Floats, Floats]:
    """Return tip and axis (n, 3) in the part where the pivot stands at (n, 3) mm: eq. 1 and 2.

    ``deg`` are A, B, C (n, 3), ``lift_mm`` (n,) is p + l, from the pivot to the tip.
    """
    centre = np.array(machine.centre_mm or (0.0, 0.0, 0.0))
    axis = np.broadcast_to(np.array([0.0, 0.0, 1.0]), stand.shape)
    for letter, sign in reversed(machine.head_axes):
        axis = _turned(axis, letter, sign * deg[:, ord(letter) - ord("A")])
    tip = stand - lift_mm[:, None] * axis - centre
    for letter, sign in machine.table_axes:
        angle = -sign * deg[:, ord(letter) - ord("A")]
        tip, axis = _turned(tip, letter, angle), _turned(axis, letter, angle)
    return tip + centre, axis


def _feeds(columns: dict[str, NDArray[Any]], tip: Floats, time_s: Floats, on_spot: Bools) -> Floats:
    """Return the speeds of the tip (n,): the programmed ones, or such that chords take their time."""
    way_mm = np.linalg.norm(np.diff(tip, axis=0, prepend=tip[:1]), axis=1)
    timed = np.isfinite(time_s) & (time_s > 0.0) & ~on_spot & ~columns["rapid"]
    return np.where(timed, way_mm / np.where(timed, time_s, 1.0), columns["feed_mm_s"])


def _turns_on_spot(
    columns: dict[str, NDArray[Any]], turn_deg: Floats, time_s: Floats, on_spot: Bools, vel_ori_deg_s: float
) -> Iterator[Issue]:
    """Yield where the robot would turn faster than the program says: no word of KRL's speed is for it."""
    turning = on_spot & ~columns["rapid"] & ~columns["machine"] & (turn_deg > 1e-6)
    by_feed = np.isnan(time_s) & turning  # tool vectors under G94: F degrees a minute
    time_s = np.where(
        by_feed, turn_deg / np.maximum(columns["feed_mm_s"] * S_PER_MIN, 1e-9) * S_PER_MIN, time_s
    )
    rate = np.divide(turn_deg, time_s, out=np.full(len(turn_deg), np.inf), where=turning)
    rows = np.flatnonzero(turning & (rate < vel_ori_deg_s * (1.0 - 1e-6)))
    if not len(rows):
        return
    worst = int(rows[np.argmin(rate[rows])])
    lines = len(np.unique(columns["source_line"][rows]))
    yield Issue(
        "error",
        "turn-speed",
        int(columns["source_line"][worst]),
        f"the tool turns on the spot at {rate[worst]:.3g} deg/s, and the robot would at {vel_ori_deg_s:g} "
        f"({lines} such line{'s' * (lines > 1)})",
        f"set [controller] vel_ori_deg_s to {max(rate[worst], 0.1):.3g} or less; in air --allow turn-speed",
    )


class _Way:
    """The rows as moves of a machine: where each begins and ends, and what is between."""

    def __init__(self, columns: dict[str, NDArray[Any]], machine: "Machine", source: str) -> None:
        self._columns, self._machine, self._source = columns, machine, source
        self._mode, turn = columns["turn_mode"], columns["turn"]
        self._line = columns["source_line"]
        by_vector = self._mode == v.TURN_VECTOR
        self._by_machine = self._mode == v.TURN_MACHINE
        turned = self._by_machine & turn.any(axis=1) & ~columns["machine"]
        self._require_lengths(turned)
        self._require_tool_lengths(turned)
        self._to_deg = np.where(by_vector[:, None], 0.0, turn)
        before_by_vector = np.append(False, by_vector[:-1])
        self._in_plane = by_vector | before_by_vector
        """Rows whose axis turns in the plane of its ends: a vector says not how the machine turns."""
        self._from_deg = np.concatenate([self._to_deg[:1], self._to_deg[:-1]])
        self._from_deg[self._in_plane] = self._to_deg[self._in_plane]
        offset = np.nan_to_num(columns["length_offset_mm"], nan=0.0)
        self._length_mm = offset + (machine.pivot_mm or 0.0)
        self._ends(turn, by_vector)

    def _require_lengths(self, used: Bools) -> None:
        """Raise where machine axes are programmed turned, and a length of the machine is not stated."""
        machine, rows = self._machine, np.flatnonzero(used)
        lacking = []
        if len(rows) and machine.head_axes and machine.pivot_mm is None:
            lacking.append("machine.pivot_mm")
        if len(rows) and machine.table_axes and machine.centre_mm is None:
            lacking.append("machine.centre_mm")
        if lacking:
            reason = f"line {int(self._line[rows[0]])} turns rotary axes without TCPM"
            raise NotUnderstoodError([missing_key(key, reason) for key in lacking], self._source)

    def _require_tool_lengths(self, used: Bools) -> None:
        """Raise where a head is turned whose tip nobody can tell: no G43, or a tool of unknown length."""
        offset = np.nan_to_num(self._columns["length_offset_mm"], nan=0.0)
        rows = np.flatnonzero(used & (offset == 0.0))
        if len(rows) and self._machine.head_axes:
            sentence = "the head turns the tip about its pivot, and the length of the tool is not known here"
            remedy = "program G43 with a tool that has length_mm in the cell"
            line = int(self._line[rows[0]])
            raise input_error("turned-length", sentence, remedy, line=line, source=self._source)

    def _ends(self, turn: Floats, by_vector: Bools) -> None:
        """Find where each row ends, and where it begins in its own terms."""
        position, lift = self._columns["position_mm"], self._length_mm
        stand = position + np.outer(lift, [0.0, 0.0, 1.0])  # of the pivot
        tip, axis = posed(self._machine, stand, self._to_deg, lift)
        axis[by_vector] = turn[by_vector] / np.linalg.norm(turn[by_vector], axis=1, keepdims=True)
        self._to_tip = np.where(self._by_machine[:, None], tip, position)
        self._to_axis = axis
        self._from_tip = np.concatenate([self._to_tip[:1], self._to_tip[:-1]])
        self._from_axis = np.concatenate([axis[:1], axis[:-1]])
        self._to_stand = stand
        before = np.concatenate([stand[:1], stand[:-1]])
        other = np.append(False, ~self._by_machine[:-1])
        before[other] = self._standing(self._from_tip[other], self._from_deg[other], lift[other])
        self._from_stand = before

    def _standing(self, tip: Floats, deg: Floats, lift_mm: Floats) -> Floats:
        """Return where the pivot stands (n, 3) with the tip there: eq. 2 solved for it."""
        centre = np.array(self._machine.centre_mm or (0.0, 0.0, 0.0))
        axis = np.broadcast_to(np.array([0.0, 0.0, 1.0]), tip.shape)
        for letter, sign in reversed(self._machine.head_axes):
            axis = _turned(axis, letter, sign * deg[:, ord(letter) - ord("A")])
        turned = tip - centre
        for letter, sign in reversed(self._machine.table_axes):
            turned = _turned(turned, letter, sign * deg[:, ord(letter) - ord("A")])
        return np.asarray(turned + centre + lift_mm[:, None] * axis)

    def at(self, row: Ints, part: Floats) -> tuple[Floats, Floats]:
        """Return tip and axis (m, 3) at parts (m,) of rows (m,)."""
        share = part[:, None]
        deg = _between(self._from_deg[row], self._to_deg[row], share)
        stand = _between(self._from_stand[row], self._to_stand[row], share)
        tip, axis = posed(self._machine, stand, deg, self._length_mm[row])
        straight = ~self._by_machine[row] | self._in_plane[row]
        tip[straight] = _between(self._from_tip[row], self._to_tip[row], share)[straight]
        flat = self._in_plane[row]
        axis[flat] = _in_plane(self._from_axis[row[flat]], self._to_axis[row[flat]], part[flat])
        return tip, axis

    def known(self) -> Bools:
        """Return which coordinates (n, 3) are known: of turned machine axes all or none."""
        known: Bools = self._columns["known"]
        mixed = self._by_machine & self._to_deg.any(axis=1) & ~known.all(axis=1) & ~self._columns["machine"]
        return np.asarray(known & ~mixed[:, None])

    def time_s(self) -> Floats:
        """Return the time (n,) that each row takes, NaN where its tip has the programmed speed."""
        time_s: Floats = np.array(self._columns["time_s"])
        turning = (self._from_deg != self._to_deg).any(axis=1)
        time_s[~turning] = np.nan
        way_mm = np.linalg.norm(self._to_stand - self._from_stand, axis=1)
        by_way = turning & self._by_machine & np.isnan(time_s) & ~self._columns["rapid"]
        feed = self._columns["feed_mm_s"]
        by_way &= feed > 0.0
        time_s[by_way] = way_mm[by_way] / feed[by_way]
        return time_s

    def chords(self, chord_tolerance_mm: float) -> Ints:
        """Return into how many chords (n,) each row is divided."""
        columns = self._columns
        chords = np.ones(len(self._mode), dtype=np.int64)
        turning = (self._from_deg != self._to_deg).any(axis=1)
        turning |= self._in_plane & (np.abs(self._from_axis - self._to_axis).max(axis=1) > 1e-12)
        self._refuse_reversals(turning & self._in_plane)
        is_place = ~columns["machine"] & self.known().all(axis=1)
        is_place[:1] = False
        rows = np.flatnonzero(
            turning & is_place & np.append(False, is_place[:-1])
        )  # else there is no way to it
        if not len(rows):
            return chords
        most_deg = np.abs(self._to_deg[rows] - self._from_deg[rows]).max(axis=1)
        pieces = np.maximum(np.ceil(most_deg / _PROBE_DEG), 1.0).astype(np.int64)
        self._refuse_many(pieces, rows)
        chords[rows] = self._counted(rows, pieces, chord_tolerance_mm)
        self._refuse_many(chords, np.arange(len(chords)))
        return chords

    def _counted(self, rows: Ints, pieces: Ints, chord_tolerance_mm: float) -> Ints:
        """Return the chords of turning rows from places in the middle and at the ends of their pieces."""
        size = 2 * pieces + 1
        begin = np.cumsum(size) - size
        owner = np.repeat(np.arange(len(rows)), size)
        number = np.arange(len(owner)) - begin[owner]
        part = number / (2.0 * pieces[owner])
        tip, axis = self.at(rows[owner], part)
        rapid = self._columns["rapid"][rows]
        way_mm = np.linalg.norm(self._to_tip[rows] - self._from_tip[rows], axis=1)
        machine = self._machine
        step = np.where(way_mm < _SPOT_MM, max(_SPOT_STEP_DEG, machine.axis_step_deg), machine.axis_step_deg)
        step = np.where(rapid, _RAPID_STEP_DEG, step)
        tolerance_deg = np.where(rapid, _RAPID_TOLERANCE_DEG, machine.axis_tolerance_deg)
        ends = begin + size - 1
        off_mm = _off_line(tip, tip[begin][owner], tip[ends][owner])
        off_deg = _angle_deg(axis, _in_plane(axis[begin][owner], axis[ends][owner], part))
        whole = np.maximum.reduceat(off_mm, begin) <= chord_tolerance_mm
        whole &= np.maximum.reduceat(off_deg, begin) <= tolerance_deg
        whole &= _angle_deg(axis[begin], axis[ends]) <= step + 1e-9
        middle = np.flatnonzero(number % 2 == 1)
        first, behind, of_row = middle - 1, middle + 1, owner[middle]
        finer_mm = _off_line(tip[middle], tip[first], tip[behind]) / (_SAFE * chord_tolerance_mm)
        in_plane = _in_plane(axis[first], axis[behind], np.full(len(middle), 0.5))
        finer_deg = _angle_deg(axis[middle], in_plane) / (_SAFE * tolerance_deg[of_row])
        steps = _angle_deg(axis[first], axis[behind]) / step[of_row]
        needed = np.maximum(np.sqrt(np.maximum(finer_mm, finer_deg)), steps)
        per_piece = np.maximum.reduceat(needed, np.cumsum(pieces) - pieces)
        counts = pieces * np.maximum(np.ceil(per_piece - 1e-9), 1.0).astype(np.int64)
        return np.where(whole, 1, counts)

    def _refuse_reversals(self, rows: Bools) -> None:
        back = rows & (np.einsum("ij,ij->i", self._from_axis, self._to_axis) < _REVERSED)
        if back.any():
            line = int(self._line[np.argmax(back)])
            sentence = "the tool vector turns by 180 degrees: which way is not said"
            raise input_error(
                "tool-vector", sentence, "give a vector between", line=line, source=self._source
            )

    def _refuse_many(self, chords: Ints, rows: Ints) -> None:
        total = np.cumsum(chords)
        if total[-1] <= _MOST_CHORDS:
            return
        line = int(self._line[rows[np.searchsorted(total, _MOST_CHORDS)]])
        sentence = f"rotary axes turn so far that the moves have more than {_MOST_CHORDS} chords up to here"
        remedy = "check the rotary words, or allow a larger [machine] axis_step_deg"
        raise input_error("too-far", sentence, remedy, line=line, source=self._source)


def _turned(vector: Floats, letter: str, angle_deg: Floats) -> Floats:
    """Return vectors (n, 3) turned about X, Y or Z by angles (n,)."""
    first, second = _PLANES[letter]
    cos, sin = np.cos(angle_deg * RAD_PER_DEG), np.sin(angle_deg * RAD_PER_DEG)
    turned = np.array(vector)
    turned[:, first] = cos * vector[:, first] - sin * vector[:, second]
    turned[:, second] = sin * vector[:, first] + cos * vector[:, second]
    return turned


def _between(start: Floats, end: Floats, part: Floats) -> Floats:
    """Return values at parts of the way; at the end exactly the end."""
    return np.where(part < 1.0, start + (end - start) * part, end)


def _in_plane(start: Floats, end: Floats, part: Floats) -> Floats:
    """Return unit vectors (n, 3) between two, in their plane, at parts (n,) of the angle."""
    angle = np.arctan2(np.linalg.norm(np.cross(start, end), axis=1), np.einsum("ij,ij->i", start, end))
    sine = np.sin(angle)
    near = sine < 1e-9
    safe = np.where(near, 1.0, sine)
    before = np.where(near, 1.0 - part, np.sin((1.0 - part) * angle) / safe)
    behind = np.where(near, part, np.sin(part * angle) / safe)
    vector = before[:, None] * start + behind[:, None] * end
    size = np.linalg.norm(vector, axis=1, keepdims=True)
    return np.where(size > 1e-9, vector / np.maximum(size, 1e-9), start)


def _angle_deg(first: Floats, second: Floats) -> Floats:
    """Return the angles (n,) between unit vectors (n, 3)."""
    half = 0.5 * np.linalg.norm(first - second, axis=1)
    return np.asarray(2.0 * np.arcsin(np.minimum(half, 1.0)) * DEG_PER_RAD)


def _off_line(point: Floats, start: Floats, end: Floats) -> Floats:
    """Return the distances (n,) of points to the straight lines between two others."""
    way, off = end - start, point - start
    square = np.einsum("ij,ij->i", way, way)
    share = np.clip(np.einsum("ij,ij->i", off, way) / np.where(square > 0.0, square, 1.0), 0.0, 1.0)
    return np.asarray(np.linalg.norm(off - share[:, None] * way, axis=1))
