"""A program that leaves out corners, against every move of its G-code: none cut, skipped, swapped or faster.

How the targets were made plays no part. `Targets.move`, the row of the Toolpath at whose end the tool stands,
is only a claim. With the positions and speeds that were read it is checked that

- the claims rise, and each claimed motion ends at the end of its row;
- between two claims that follow each other on the path, every corner of the G-code is within the tolerance of
  the straight way between the two, and no corner lies behind an earlier one along it, so that both paths stay
  within the tolerance of each other in the same order (the proof stands in `program.merging`);
- at a corner that is left out nothing else is programmed, and all moves of the way have its feed;
- every row that is a position is claimed or on such a way, and every event and dwell of the G-code is there,
  behind the motion that leads to its row.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.cell import Cell
from gcode2krl.errors import MOST_PLACES, Issue, input_error
from gcode2krl.krl.differences import POSITION_LIMIT_MM, SPEED_LIMIT_MM_S, WAIT_LIMIT_S
from gcode2krl.krl.read import KrlProgram
from gcode2krl.krl.rules import in_file
from gcode2krl.tables import BLOCK_ROWS, Event, Targets, Toolpath, lengths
from gcode2krl.units import MM_PER_M

_WRITTEN_MM = 1e-3
"""The last decimal of the text: ends of motions, and of the pieces that a pilot force needs."""
_REMEDY = "translate again with the same --simplify"
_STATED = re.compile(rb"^; simplified: within (\S+) mm", re.MULTILINE)
_HEAD_BYTES = 10_000


@dataclass(frozen=True)
class OriginalFigures:
    """How a program keeps to the moves of its G-code."""

    simplify_mm: float
    limit_mm: float
    """What a corner may be off: the tolerance, the last decimal, and the correction of a compensation."""
    max_deviation_mm: float
    """How far a corner of the G-code is off the program's lines at most; NaN where they cannot be paired."""
    moves: int
    """Rows of the Toolpath that are positions."""
    left_out: int

    def as_dict(self) -> dict[str, Any]:
        """Return the object for ``--json``."""
        known = not np.isnan(self.max_deviation_mm)
        return {
            "simplify_mm": self.simplify_mm,
            "limit_mm": self.limit_mm if known else None,
            "max_deviation_mm": self.max_deviation_mm if known else None,
            "moves": self.moves,
            "left_out": self.left_out,
        }


def require_stated(program: KrlProgram, simplify_mm: float | None) -> None:
    """Raise where a program says that it leaves out corners, within another tolerance than the one asked for.

    The tolerance is never taken from the program that is to be judged by it.
    """
    main = program.file[0]
    match = _STATED.search(program.texts[main][:_HEAD_BYTES])
    stated = match[1].decode("ascii", "replace") if match else None
    if stated == (f"{simplify_mm:g}" if simplify_mm is not None else None):
        return
    if stated is None:
        sentence, remedy = "the program leaves out no corners", "leave out --simplify"
    else:
        sentence = f"the program leaves out corners within {stated} mm of the G-code"
        remedy = f"--simplify {stated}, if that is what you accept"
    raise input_error("option-value", sentence, remedy, source=main)


def compare_with_original(
    program: KrlProgram, targets: Targets, toolpath: Toolpath, cell: Cell
) -> tuple[OriginalFigures, list[Issue]]:
    """Compare a program as read, its motions paired with simplified targets, with the G-code's moves."""
    simplified = targets.simplified
    if simplified is None:
        raise ValueError("the targets leave out nothing")
    if int(targets.move.max(initial=0)) >= len(toolpath):
        nan, text = float("nan"), "the G-code has fewer moves than the program was made from"
        issue = Issue("error", "verify-original", program.def_line, text, _REMEDY)
        return OriginalFigures(simplified.tolerance_mm, nan, nan, len(toolpath), 0), [issue]
    walk = _Walk(program, targets, toolpath, cell, simplified.tolerance_mm)
    issues = list(islice(walk.issues(), MOST_PLACES))
    figures = OriginalFigures(
        simplify_mm=simplified.tolerance_mm,
        limit_mm=walk.limit_mm,
        max_deviation_mm=walk.largest_mm,
        moves=int(np.count_nonzero(walk.plain)),
        left_out=walk.left_out,
    )
    return figures, issues


class _Walk:
    """The way along both paths at once."""

    def __init__(
        self, program: KrlProgram, targets: Targets, toolpath: Toolpath, cell: Cell, simplify_mm: float
    ) -> None:
        self.program, self.targets, self.toolpath, self.cell = program, targets, toolpath, cell
        self.limit_mm = simplify_mm + _WRITTEN_MM + targets.correction_mm
        self.place_mm = POSITION_LIMIT_MM + targets.correction_mm
        self.largest_mm, self.left_out = float("nan"), 0
        self.plain: Bools = toolpath.is_position() & ~toolpath.machine
        self.plain[:1] = False
        claimed = np.flatnonzero(targets.move >= 0)
        claimed = claimed[self.plain[targets.move[claimed]]]
        claim = targets.move[claimed]
        last = np.append(claim[1:] != claim[:-1], True)  # a divided line is several motions of one row
        self.end: Ints = claimed[last]
        """(e,) motions that end where a row of the Toolpath does."""
        self.claim = np.asarray(claim[last], dtype=np.int64)
        self.changed = np.zeros(len(toolpath), dtype=np.bool_)
        self.happening = np.zeros(len(toolpath), dtype=np.bool_)
        for event in toolpath.events:
            self.happening[event.row] = True
            self.changed[event.row] |= event.kind == "tool"

    def issues(self) -> Iterator[Issue]:
        """Yield what is wrong, along the program; stop where nothing behind it could be told."""
        if not len(self.end):
            yield self._issue(0, 0, "no motion of the G-code is in the program")
            return
        back = np.flatnonzero(np.diff(self.claim) <= 0)
        if len(back):
            at = int(back[0]) + 1
            yield self._issue(self.end[at], self.claim[at], "the order of the G-code is not kept")
            return
        yield from self._ends()
        yield from self._ways()
        yield from self._outside()
        yield from self._events()

    # --- the motions that end where a row does --------------------------------------------------------------

    def _ends(self) -> Iterator[Issue]:
        position = self.program.position_mm[self.end]
        off_mm = lengths(position - self.toolpath.position_mm[self.claim])
        self.largest_mm = float(off_mm.max())
        for at in np.flatnonzero(~(off_mm <= self.place_mm)):
            text = f"{off_mm[at]:.4f} mm off the end of its G-code move"
            yield self._issue(self.end[at], self.claim[at], text)
        tool = self.toolpath.tool[self.claim]
        known = np.isin(tool, np.array(sorted(self.cell.tool)))
        for at in np.flatnonzero(known & (tool != self.targets.tool[self.end])):
            yield self._issue(self.end[at], self.claim[at], f"not with T{tool[at]} of the G-code")

    # --- the ways between them ------------------------------------------------------------------------------

    def _linked(self) -> Bools:
        """Mark the ends (e,) to which the G-code goes straight from the end before, on the path."""
        stretch, changes = np.cumsum(~self.plain), np.cumsum(self.changed)
        before, here = self.claim[:-1], self.claim[1:]
        on = (stretch[before] == stretch[here]) & (changes[before - 1] == changes[here - 1])
        return np.append(False, on)

    def _ways(self) -> Iterator[Issue]:
        linked = self._linked()
        start = self.program.position_mm[self.end[np.maximum(np.arange(len(self.end)) - 1, 0)]]
        way = self.program.position_mm[self.end] - start
        length = lengths(way)
        unit = way / np.where(length > 0.0, length, 1.0)[:, None]
        begin = np.cumsum(length) - length
        yield from self._pieces(linked, start, unit, length)
        gone = 0.0
        first, behind = int(self.claim[0]) + 1, int(self.claim[-1]) + 1
        for low in range(first, behind, BLOCK_ROWS):
            row = np.arange(low, min(low + BLOCK_ROWS, behind))
            of = np.searchsorted(self.claim, row)
            follows, ends = linked[of], self.claim[of] == row
            yield from self._feeds(row[follows | ends], of[follows | ends], ends[follows | ends])
            yield from self._skipped(row[~follows & ~ends], of[~follows & ~ends])
            row, of, ends = row[follows], of[follows], ends[follows]
            from_start = self.toolpath.position_mm[row] - start[of]
            along = np.clip(np.einsum("ij,ij->i", from_start, unit[of]), 0.0, length[of])
            off_mm = lengths(from_start - along[:, None] * unit[of])
            furthest = np.maximum.accumulate(np.append(gone, begin[of] + along))
            back_mm, gone = furthest[:-1] - begin[of] - along, float(furthest[-1])
            stands = lengths(from_start) <= self.place_mm
            yield from self._left_out(row, of, ends, off_mm, back_mm, stands)

    def _left_out(
        self, row: Ints, of: Ints, ends: Bools, off_mm: Floats, back_mm: Floats, stands: Bools
    ) -> Iterator[Issue]:
        """Yield where what is left out is off the way, behind an earlier corner, or more than a corner."""
        inner = ~ends
        self.largest_mm = max(self.largest_mm, float(off_mm.max(initial=0.0)))
        self.left_out += int(np.count_nonzero(inner))
        for at in np.flatnonzero(inner & ~(off_mm <= self.limit_mm)):
            text = f"a corner of the G-code is {off_mm[at]:.4f} mm off, {self.limit_mm:.4f} are allowed"
            yield self._issue(self.end[of[at]], row[at], text)
        for at in np.flatnonzero(~(back_mm <= self.place_mm)):
            text = f"the G-code goes back by {back_mm[at]:.4f} mm here, which the program leaves out"
            yield self._issue(self.end[of[at]], row[at], text)
        for at in np.flatnonzero(inner & ~stands & ~self._is_plain_corner(row, self.claim[of])):
            yield self._issue(self.end[of[at]], row[at], "more than a corner is left out here")

    def _is_plain_corner(self, row: Ints, end: Ints) -> Bools:
        """Tell whether nothing happens at the end of rows, and rows and ends of their ways are alike."""
        path = self.toolpath
        # a row without a way has no stop of its own: the tool stands where the row before has led it
        here, before = (np.rint(path.position_mm[rows] / _WRITTEN_MM) for rows in (row, row - 1))
        stops = path.exact_stop[row] & (here != before).any(axis=1)
        plain = ~path.rapid[row] & ~path.rapid[end] & ~stops & ~self.happening[row]
        plain &= path.dwell_s[row] == 0.0
        for column in (path.tool, path.spindle_rad_s, path.tolerance_mm, path.length_offset_mm):
            here, there = column[row], column[end]
            plain &= (here == there) | ((here != here) & (there != there))  # NaN is as NaN
        if path.axis.strides[0]:
            plain &= (path.axis[row] == path.axis[end]).all(axis=1)
        return np.asarray(plain)

    def _feeds(self, row: Ints, of: Ints, ends: Bools) -> Iterator[Issue]:
        """Yield where the program does not go at the feed of rows that move the tool."""
        path = self.toolpath
        moving = ends | (lengths(path.position_mm[row] - path.position_mm[row - 1]) > _WRITTEN_MM)
        feed = np.where(path.rapid[row], self.cell.controller.rapid_m_s * MM_PER_M, path.feed_mm_s[row])
        speed_mm_s = self.program.speed_mm_s[self.end[of]]
        wrong = moving & ~self.program.ptp[self.end[of]] & ~(np.abs(speed_mm_s - feed) <= SPEED_LIMIT_MM_S)
        for at in np.flatnonzero(wrong):
            text = f"speed {speed_mm_s[at]:.3f} mm/s, {feed[at]:.3f} in the G-code"
            yield self._issue(self.end[of[at]], row[at], text)

    def _pieces(self, linked: Bools, start: Floats, unit: Floats, length: Floats) -> Iterator[Issue]:
        """Yield the motions between two ends that are not on the straight way, or not at its speed."""
        inner = np.ones(len(self.targets), dtype=np.bool_)
        inner[self.end] = False
        inner[: self.end[0]], inner[self.end[-1] :] = False, False
        row = np.flatnonzero(inner)
        of = np.searchsorted(self.end, row)
        row, of = row[linked[of]], of[linked[of]]
        from_start = self.program.position_mm[row] - start[of]
        along = np.einsum("ij,ij->i", from_start, unit[of])
        off_mm = lengths(from_start - np.clip(along, 0.0, length[of])[:, None] * unit[of])
        back = np.append(False, (of[1:] == of[:-1]) & (along[1:] < along[:-1] - self.place_mm))
        speed = self.program.speed_mm_s
        other = ~(np.abs(speed[row] - speed[self.end[of]]) <= SPEED_LIMIT_MM_S)
        for at in np.flatnonzero(~(off_mm <= self.place_mm) | back | other | self.program.ptp[row]):
            yield self._issue(row[at], self.claim[of[at]], "a motion that the G-code does not have")

    # --- what is nowhere ------------------------------------------------------------------------------------

    def _skipped(self, row: Ints, of: Ints) -> Iterator[Issue]:
        """Yield the positions that no motion reaches, between two ends that the G-code does not join."""
        position, read = self.toolpath.position_mm[row], self.program.position_mm
        at_hand = (self.end[of - 1], self.end[of] - 1, self.end[of])
        off_mm = np.min([lengths(position - read[near]) for near in at_hand], axis=0, initial=np.inf)
        for at in np.flatnonzero(self.plain[row] & ~(off_mm <= self.place_mm)):
            yield self._issue(self.end[of[at]], row[at], "a move of the G-code is left out")

    def _outside(self) -> Iterator[Issue]:
        """Yield the positions before the first end and behind the last that no motion reaches."""
        for rows, at in (
            (np.arange(self.claim[0]), self.end[0]),
            (np.arange(self.claim[-1] + 1, len(self.plain)), self.end[-1]),
        ):
            off_mm = lengths(self.toolpath.position_mm[rows] - self.program.position_mm[at])
            for row in rows[self.plain[rows] & ~(off_mm <= self.place_mm)]:
                yield self._issue(at, row, "a move of the G-code is left out")

    def _events(self) -> Iterator[Issue]:
        rows: dict[tuple[str, int], list[int]] = {}
        for event in reversed(self.toolpath.events):
            rows.setdefault(_key(event), []).append(event.row)
        earlier = -1
        for event in self.targets.events:
            waiting = rows.get(_key(event))
            if not waiting:
                yield self._issue(event.row, 0, f"{event.kind} is switched once more than in the G-code")
                continue
            row = waiting.pop()
            k = int(np.searchsorted(self.claim, row, side="right")) - 1
            low = int(self.end[k]) if k >= 0 else 0
            high = int(self.end[k + 1]) if k + 1 < len(self.end) else len(self.targets)
            moves = event.kind == "tool" or bool(event.values.get("implied"))  # to above the work
            if not (moves or low <= event.row < high or event.row == earlier):
                yield self._issue(event.row, row, f"{event.kind} is switched at another place")
            earlier = event.row
        for (kind, _), waiting in rows.items():
            yield from (self._issue(0, row, f"{kind} is not switched") for row in waiting)
        dwell_s, wait_s = float(self.toolpath.dwell_s.sum()), float(self.program.wait_s.sum())
        if abs(dwell_s - wait_s) > WAIT_LIMIT_S * max(1, int(np.count_nonzero(self.targets.wait_s))):
            yield self._issue(0, 0, f"dwells of {wait_s:.3f} s, {dwell_s:.3f} s in the G-code")

    def _issue(self, motion: Any, row: Any, text: str) -> Issue:
        file = in_file(self.program, self.program.file[self.program.file_of[motion]])
        line = int(self.toolpath.source_line[row])
        sentence = f"{file}{text}" + (f" (G-code line {line})" if line else "")
        return Issue("error", "verify-original", int(self.program.line[motion]), sentence, _REMEDY)


def _key(event: Event) -> tuple[str, int]:
    return event.kind, int(event.values["line"])
