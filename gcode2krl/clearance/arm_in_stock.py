"""Arm and spindle against the stock as it stands at that moment, which needs joints and removal together.

Cutter, shank and holder in the stock are judged by the removal itself. Where arm or spindle comes into the
box around the raw part, the samples are cut in short stretches, and the capsules are held against what
stands before each: material that a stretch takes away counts as standing until its end, and so does what
the field lags behind the cutter. The ways that a Motion does not show are held against what stands when the
samples behind them begin, with holder and cutter, which no removal judges there.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from gcode2krl import collision, cutting
from gcode2krl.arrays import Floats, Ints, Ints32
from gcode2krl.cell import Cell
from gcode2krl.cell.carried import points_moved, to_rest
from gcode2krl.cell.checked_parts import checks_collisions
from gcode2krl.clearance.ways import Beside
from gcode2krl.errors import Issue, Severity
from gcode2krl.frames import invert
from gcode2krl.tables import Motion, Toolpath, rows_of

_STRETCH_ROWS = 64
"""Samples within the box that are judged against one state of the material: 0.8 s."""
_MARGIN_MM = 1.0
_STEP_MM = 0.5
"""Between two samples the joints go straight, in steps in which no end of a capsule moves farther."""
_MOST_STEPS = 200
_AROUND = "choose a higher [clearance] z_mm or another HOME, or cut in another order"
_CONTACT_MM = 0.1
"""A capsule that is less deep in the material touches it by the rounding of cells."""

Samples = tuple[Motion, Floats, Floats, bool]
"""As in `blockwise.Loads.along`."""


class Inside(NamedTuple):
    """Rows of joints (k) within the box around the raw part, and ways that come before them."""

    before_rad: Floats
    """(k, 6) the rows before them."""
    q_rad: Floats
    before_external: Floats
    """(k, 6) E1 to E6."""
    external: Floats
    line: Ints32
    ways: tuple[Beside, ...] = ()


class _Place(NamedTuple):
    """Line of the G-code, and which way beside it."""

    line: int
    words: str = ""


class ArmInStock:
    """Holds arm and spindle against the stock along a motion that comes block after block."""

    def __init__(
        self, toolpath: Toolpath, cell: Cell, milling: cutting.Milling, ways: Sequence[Beside] = ()
    ) -> None:
        """Take what cuts the stock, and the ways that a Motion does not show.

        Those before the first cut are left out where a raw part is stated, against which they are held as
        what stands in the cell.
        """
        self._toolpath, self._milling, self._box = toolpath, milling, milling.raw_box()
        frame = cell.base_matrix()
        self._to_base = np.linalg.inv(frame)
        to_root = np.eye(4)
        to_root[:3, :3] = frame[:3, :3] @ self._box.to_field.T
        to_root[:3, 3] = frame[:3, 3]
        self._carried = collision.Carried(cell)
        self._dips = self._dips_in(to_root, self._carried)
        self._contacts = collision.Contacts(0.0)
        self._hit_lines: set[int] = set()
        self._last_rad, self._last_external = np.zeros((0, 6)), np.zeros((0, 6))
        held = [way for way in ways if not way.is_uncut or self._box.guessed]
        self._ways = sorted(held, key=lambda way: way.before)
        self._with_tools: dict[tuple[int, bool], collision.Carried] = {}
        self._cell, self._dips_at = cell, cell.external_rest()
        self._frame, self._to_root = frame, to_root

    @classmethod
    def of(
        cls,
        toolpath: Toolpath,
        cell: Cell,
        milling: cutting.Milling,
        ways: Sequence[Beside] = (),
    ) -> "ArmInStock | None":
        """Return what watches them, None where the cell is not checked for collisions or states neither."""
        stated = bool(cell.robot.body.capsules) or cell.spindle.body is not None
        if not (stated and checks_collisions(cell) and cell.robot.geometry.known):
            return None
        return cls(toolpath, cell, milling, ways)

    def divided(self, samples: Samples) -> Iterator[tuple[Samples, Inside | None]]:
        """Yield samples in stretches that are cut one after the other, each with its rows within the box.

        Where no row is within it, that is one stretch.
        """
        motion, q_rad, qd_rad_s, ends = samples
        before = np.concatenate([self._last_rad if len(self._last_rad) else q_rad[:1], q_rad])
        external = motion.external[np.minimum(np.arange(len(q_rad)), len(motion) - 1)]
        stood = np.concatenate([self._last_external if len(self._last_external) else external[:1], external])
        self._last_rad, self._last_external = before[-1:].copy(), stood[-1:].copy()
        rows, due = self._rows_inside(motion, q_rad), self._due(motion)
        if not len(rows) and not due:
            yield samples, None
            return
        line = self._lines(motion, len(q_rad))
        last = min(int(rows[-1]) + 1, len(motion)) if len(rows) else 0  # a row of joints more than samples
        borders = sorted({0, *rows[::_STRETCH_ROWS].tolist(), *due, last, len(motion)})
        for start, end in pairwise(borders):
            behind = None if end == len(motion) else end
            inside_rows = rows[rows >= start] if behind is None else rows[(rows >= start) & (rows < end)]
            part = rows_of(motion, start, end), q_rad[start:behind], qd_rad_s[start:behind]
            columns = (
                before[inside_rows],
                q_rad[inside_rows],
                stood[inside_rows],
                external[inside_rows],
                line[inside_rows],
            )
            ways = tuple(due.get(start, ()))
            inside = Inside(*columns, ways) if len(inside_rows) or ways else None
            yield (*part, ends and behind is None), inside

    def judge(self, inside: Inside) -> None:
        """Hold rows against what stands now; to be called before the stretch they belong to is cut.

        A line that has hit something in an earlier stretch is told already.
        """
        for way in inside.ways:
            self._judge_way(way)
        known_lines = set(self._hit_lines)
        for before, after, stood, stands, line in zip(*inside[:5], strict=True):
            if int(line) not in known_lines:
                before = before if np.isfinite(before).all() else after  # behind what is out of reach
                place = _Place(int(line))
                q_rad, external = np.stack([before, after]), np.stack([stood, stands])
                self._hit_lines |= self._hold_along(self._carried, q_rad, external, place)

    def finish(self) -> None:
        """Hold the ways behind the last cut against what is left; to be called once all is cut."""
        for way in self._ways:
            self._judge_way(way)
        self._ways = []

    def issues(self) -> tuple[Issue, ...]:
        """Return the collisions, as warnings where the stock is guessed."""
        severity: Severity = "warning" if self._box.guessed else "error"
        return tuple(replace(issue, severity=severity) for issue in self._contacts.issues())

    def _due(self, motion: Motion) -> dict[int, list[Beside]]:
        """Return the ways that come before rows of a motion, and take them off the list."""
        move, due = self._moves(motion, len(motion)), dict[int, list[Beside]]()
        while self._ways and len(move) and self._ways[0].before <= int(move[-1]):
            way = self._ways.pop(0)
            due.setdefault(int(np.argmax(move >= way.before)), []).append(way)
        return due

    def _judge_way(self, way: Beside) -> None:
        """Hold a way against what stands now."""
        if not np.isfinite(way.q_rad).all():
            return  # out of reach, which is a finding of its own
        carried = self._with_tool(way.tool, way.is_ptp)
        at, place = way.external, _Place(way.line, way.words)
        rows = np.arange(len(way.q_rad))
        if (at == at[0]).all():
            rows = np.flatnonzero(self._dips_in(self._frame_with(at[:1]), carried).take(way.q_rad))
        for row in rows[rows > 0].tolist():
            both = slice(row - 1, row + 1)
            self._hold_along(carried, way.q_rad[both], at[both], place)

    def _with_tool(self, tool: int, is_ptp: bool) -> collision.Carried:
        key = tool, is_ptp
        if key not in self._with_tools:
            self._with_tools[key] = collision.Carried(self._cell, tool, cuts=not is_ptp)
        return self._with_tools[key]

    def _hold_along(
        self, carried: collision.Carried, q_rad: Floats, external: Floats, place: "_Place"
    ) -> set[int]:
        """Hold capsules against the material between two rows (2, 6) of joints; return the line of a hit."""
        (before, after), (stood, stands) = q_rad, external
        ends = self._ends_mm(carried, q_rad, external)
        chord_mm = np.sqrt(np.square(np.diff(ends.reshape(2, -1, 3), axis=0)).sum(axis=2).max())
        steps = int(np.clip(np.ceil(chord_mm / _STEP_MM), 1, _MOST_STEPS))
        share = np.linspace(0.0, 1.0, steps + 1)[1:, None]
        at = np.array([stands]) if (stood == stands).all() else stood + share * (stands - stood)
        return self._hold(carried, self._ends_mm(carried, before + share * (after - before), at), place)

    def _rows_inside(self, motion: Motion, q_rad: Floats) -> Ints:
        """Return the rows of joints within the box, but for ways that a Motion does not show as they are."""
        if not len(q_rad):
            return np.zeros(0, dtype=np.int64)
        shown = ~self._toolpath.machine[self._moves(motion, len(q_rad))]
        if (motion.external != motion.external[0]).any():
            self._dips_at = np.full(6, np.nan)  # another box with each row: all of them are looked at
            return np.flatnonzero(shown)
        if not np.array_equal(motion.external[0], self._dips_at):
            self._dips = self._dips_in(self._frame_with(motion.external[:1]), self._carried)
            self._dips_at = motion.external[0].copy()
        return np.flatnonzero(self._dips.take(q_rad) & shown)

    def _frame_with(self, external: Floats) -> Floats:
        """Return the frame (4, 4) of the box in the robot root at rest, E1 to E6 at (1, 6)."""
        by = to_rest(external, self._cell)
        moved = np.eye(4) if by is None else by[0]
        frame: Floats = self._frame @ moved @ invert(self._frame) @ self._to_root
        return frame

    def _dips_in(self, to_root: Floats, carried: collision.Carried) -> collision.Dips:
        """Return what tells when a capsule comes into the box, which stands in a frame of the root."""
        return collision.Dips(carried, self._box.low_mm, self._box.high_mm, to_root, _MARGIN_MM)

    def _lines(self, motion: Motion, count: int) -> Ints32:
        lines: Ints32 = self._toolpath.source_line[self._moves(motion, count)]
        return lines

    def _moves(self, motion: Motion, count: int) -> Ints:
        """Return the rows (count,) of the Toolpath that rows of joints belong to, to a sample."""
        sample = np.minimum(np.arange(count), len(motion) - 1)
        return np.clip(motion.move[sample], 0, len(self._toolpath) - 1)

    def _ends_mm(self, carried: collision.Carried, q_rad: Floats, external: Floats) -> Floats:
        """Return both ends (n, b, 6) of all capsules in ``$BASE``, E1 to E6 at (n, 6) or (1, 6)."""
        ends = carried.ends_mm(q_rad)
        base: Floats = ends.reshape(-1, 3) @ self._to_base[:3, :3].T + self._to_base[:3, 3]
        by = to_rest(external, self._cell)
        if by is not None:
            points = len(base) // len(q_rad)
            base = points_moved(base, invert(np.repeat(by, points, axis=0) if len(by) > 1 else by))
        return base.reshape(ends.shape)

    def _hold(self, carried: collision.Carried, ends_mm: Floats, at: "_Place") -> set[int]:
        """Hold capsules (n, b, 6) against the material, note the deepest; return the line of a hit."""
        count, bodies, _ = ends_mm.shape
        depth, place = self._milling.bodies_in(ends_mm.reshape(-1, 6), np.tile(carried.radius_mm, count))
        deepest = depth.reshape(count, bodies).argmax(axis=0) * bodies + np.arange(bodies)
        hit = set[int]()
        for body, row in enumerate(deepest.tolist()):
            if depth[row] > _CONTACT_MM:
                touch = collision.Touch(-float(depth[row]), at.line, place[row], at.words)
                if at.words:
                    touch.remedy = _AROUND
                self._contacts.note(carried.names[body], collision.STOCK, touch)
                hit.add(at.line)
        return hit
