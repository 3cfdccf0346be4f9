"""Toolpath to Targets: HOME, approach, the moves themselves, retracts, tool changes, HOME.

The robot is either at HOME, standing above the work on the clearance plane, or on the path. Only rows
whose X, Y and Z have all been programmed are positions; machine moves become retracts.
"""

import functools
import itertools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcode2krl import frames as fr
from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.cell import Cell
from gcode2krl.cell.confirmation import confirmation_issues
from gcode2krl.compiled.chunks import ROWS, chunk_borders, in_chunks
from gcode2krl.compiled.threads import in_threads
from gcode2krl.errors import Issue, NotUnderstoodError, input_error
from gcode2krl.program.blending import corner_cdis
from gcode2krl.program.checks import axes_nowhere, check_toolpath
from gcode2krl.tables import Event, Targets, Toolpath
from gcode2krl.units import MM_PER_M

HomePose = Callable[[int], tuple[Floats, Floats]]
GRID_MM = 1e-3
"""Decimals of the KRL text: rows that print as the same point are one target."""

_UP = np.array([0.0, 0.0, 1.0])
_UPRIGHT = 1.0 - 1e-12
LEAST_UPRIGHT = 0.17364817766693033
"""Cosine of 80 degrees: a tool that is tilted further has no way to the clearance plane along its axis."""


class Away(NamedTuple):
    """The poses of a route (r) away from HOME, but for the turn about the tool axis."""

    position_mm: Floats
    axis: Floats
    """(r, 3) tool axis in ``$BASE``."""
    tool: Ints32
    lines: Bools
    """(r,) True where a straight line leads to a pose from the one before, with the same tool."""


@dataclass
class _Columns:
    """Growing columns of the plan; each append is a run of rows."""

    position: list[Floats] = field(default_factory=list)
    axis: list[Floats] = field(default_factory=list)
    move: list[Ints32] = field(default_factory=list)
    tool: list[Ints32] = field(default_factory=list)
    kind: list[NDArray[np.int8]] = field(default_factory=list)
    count: int = 0

    def append(self, position: Floats, axis: Floats, move: Ints32, tool: int, kind: int) -> None:
        size = len(position)
        self.position.append(position)
        self.axis.append(axis)
        self.move.append(move)
        self.tool.append(np.full(size, tool, dtype=np.int32))
        self.kind.append(np.full(size, kind, dtype=np.int8))
        self.count += size


_LIN, _PTP, _HOME = 0, 1, 2


class Route:
    """The motions of a KRL program, with the turn about the tool axis still open."""

    def __init__(self, toolpath: Toolpath, cell: Cell, home_pose: HomePose) -> None:
        """Go through the rows of a Toolpath.

        ``home_pose`` tells of a tool's number where HOME is in ``$BASE``: tip (3,) in mm, quaternion (4,).
        Raises `NotUnderstoodError` where the program has no motion.
        """
        self.toolpath, self.cell, self.home_pose = toolpath, cell, home_pose
        self.clearance = cell.clearance_z_mm if cell.clearance_z_mm is not None else _highest(toolpath)
        self.columns = _Columns()
        self.place: Literal["home", "clearance", "path"] = "home"
        self.here = np.zeros(3)
        self.axis = toolpath.axis[0]
        self.tool = self._frame_tool(0)
        self.tool_events: dict[int, int] = {}  # index of toolpath.events → target
        self._walk()
        self._join()

    def _frame_tool(self, number: int) -> int:
        """Return the tool whose frame moves: an unknown or unnamed tool moves as the usual one."""
        usual = self.cell.usual_tool
        assert usual is not None  # `require_geometry`
        return number if number in self.cell.tool else usual

    # --- the walk -------------------------------------------------------------------------------------

    def _walk(self) -> None:
        """Go through the rows once: runs of plain moves at a time, everything else one by one."""
        toolpath = self.toolpath
        plain = toolpath.is_position() & ~toolpath.machine
        plain[0] = False
        if not plain.any():
            raise _no_motion(toolpath)
        changes = [(event.row, index) for index, event in enumerate(toolpath.events) if event.kind == "tool"]
        stops = sorted(
            {0, len(toolpath), *np.flatnonzero(np.diff(plain)) + 1, *(row + 1 for row, _ in changes)}
        )
        at_start = (toolpath.events[index].values["tool"] for row, index in changes if row == 0)
        first_tool = next(at_start, int(toolpath.tool[0]))
        self.tool = self._frame_tool(first_tool)
        self._home(-1)
        for start, end in itertools.pairwise(stops):
            for row, index in changes:
                if row == start - 1:
                    self._change_tool(index)
            if plain[start]:
                self._run(start, end)
            else:
                for row in range(max(start, 1), end):
                    self._special(row)
        for row, index in changes:
            if row == len(toolpath) - 1 and index not in self.tool_events:
                self._change_tool(index)
        self._leave()

    def _add(self, position: Floats, move: int, kind: int = _LIN) -> None:
        moves = np.array([move], dtype=np.int32)
        self.columns.append(np.array([position]), self.axis[None, :], moves, self.tool, kind)
        self.here = np.array(position)

    def _home(self, move: int) -> None:
        self._add(self.home_pose(self.tool)[0], move, _HOME)
        self.place = "home"

    def _above(self, position: Floats, axis: Floats) -> Floats:
        """Return where the axis of a tool at a position meets the clearance plane, or the position above it.

        Along its axis a tool that is tilted leaves the work through the hole that it stands in.
        """
        if axis[2] > _UPRIGHT:
            return np.array([position[0], position[1], max(position[2], self.clearance)])
        way_mm = max(self.clearance - position[2], 0.0) / max(float(axis[2]), LEAST_UPRIGHT)
        return np.asarray(position + way_mm * axis)

    def _retract(self, move: int) -> None:
        """Add the retract from the path straight up to the clearance plane."""
        if self.place == "path":
            if self.here[2] < self.clearance:
                self._add(self._above(self.here, self.axis), move)
            self.place = "clearance"

    def _run(self, start: int, end: int) -> None:
        """Add a run of plain rows, approached over the clearance plane if the robot is not on the path."""
        rows = slice(start, end)
        position = self.toolpath.position_mm[rows]
        turns = not np.array_equal(self.axis, self.toolpath.axis[start])
        self.axis = self.toolpath.axis[start]
        above = self._above(position[0], self.axis)
        moves = np.arange(start, end, dtype=np.int32)
        direct = np.array_equal(above, position[0])  # the first position lies on the plane or above it
        if self.place == "home":
            self._add(above, start if direct else -1, _PTP)
        elif self.place == "clearance" and not direct and (turns or not np.array_equal(above, self.here)):
            self._add(above, -1)
        self.columns.append(position, self.toolpath.axis[rows], moves, self.tool, _LIN)
        self.here, self.axis, self.place = position[-1], self.toolpath.axis[end - 1], "path"

    def _special(self, row: int) -> None:
        """Add a machine move, or a row in which not every axis has a programmed position."""
        toolpath = self.toolpath
        known = toolpath.known[row]
        self._retract(row if toolpath.machine[row] else -1)
        if self.place == "home":
            return
        if toolpath.machine[row]:
            if not (known[0] or known[1]):
                self._home(row)
        elif known[0] and known[1] and toolpath.rapid[row]:
            self._add(np.array([*toolpath.position_mm[row, :2], self.clearance]), row)

    def _change_tool(self, index: int) -> None:
        """Add a tool change on the clearance plane, high enough for the longer of the two tools."""
        if index in self.tool_events:
            return
        new = self._frame_tool(self.toolpath.events[index].values["tool"])
        if self.columns.count > 1:
            self._retract(-1)
            deeper_mm = self._deeper_mm(new)
            if self.place == "clearance" and deeper_mm > 0:
                self._add(self.here + deeper_mm * _UP, -1)
            self.here = np.full(3, np.nan)  # the new tip is elsewhere
        self.tool_events[index] = self.columns.count - 1
        self.tool = new

    def _deeper_mm(self, number: int) -> float:
        """Return how far below the present tip another tool's tip stands, the flange at rest."""
        shift = fr.invert(self.cell.tool_matrix(self.tool)) @ self.cell.tool_matrix(number)
        return -float(shift[2, 3])

    def _leave(self) -> None:
        self._retract(-1)
        if self.place != "home":
            self._home(-1)

    # --- the table ------------------------------------------------------------------------------------

    def _join(self) -> None:
        """Join the columns, without rows that print as the point before them."""
        columns = self.columns
        position, move = _joined(columns.position), np.concatenate(columns.move)
        kind, tool = np.concatenate(columns.kind), np.concatenate(columns.tool)
        axis = self._axes()
        stand, keep = _StandingAt(move), _distinct(position, axis, kind, tool)
        if not keep.all():
            position, move, kind, tool = position[keep], move[keep], kind[keep], tool[keep]
            axis = _rows(axis, keep)
        self._position, self._move, self._kind, self._of_tool = position, move, kind, tool
        self._stand, self._kept = stand, _Kept(keep)
        self._planned = planned = _as_slice(kind != _HOME)
        lines = straight(kind != _LIN, kind == _HOME, tool)
        self.away = Away(position[planned], _rows(axis, planned), tool[planned], lines[planned])

    def targets(self, rotation: Floats, tolerance_mm: float | None) -> Targets:
        """Return the table, with the quaternions (r, 4) of the poses that are `away` from HOME.

        ``tolerance_mm`` is the blend tolerance; below ``G64 P``, above the cell's own.
        """
        toolpath, position, move = self.toolpath, self._position, self._move
        kind, tool, stand, kept = self._kind, self._of_tool, self._stand, self._kept
        wait = np.zeros(len(position))
        events = self._place_events(stand, kept)
        for row in np.flatnonzero(toolpath.dwell_s > 0).tolist():
            for target, dwell_s in self._dwells(row, stand, kept):
                wait[target] += dwell_s
        programmed = self._programmed_columns(move, kind, tolerance_mm)
        exact = self._exact_stops(programmed, move, kind, tool, wait, events)
        return Targets(
            position_mm=position,
            rotation=self._rotations(rotation),
            ptp=kind != _LIN,
            home=kind == _HOME,
            speed_mm_s=programmed.speed_mm_s,
            cdis_mm=corner_cdis(position, programmed.tolerance_mm, self.cell.controller.cdis_mm, exact),
            wait_s=wait,
            move=move,
            source_line=self._source_lines(move, kind),
            tool=tool,
            events=events,
            issues=(*toolpath.issues, *check_toolpath(toolpath, self.cell), *self._notes()),
            source=toolpath.source,
            restart=toolpath.restart,
        )

    def _source_lines(self, move: Ints32, kind: NDArray[np.int8]) -> Ints32:
        """Return the G-code line of each target; added targets have that of the move they lead to."""
        line: Ints32 = self.toolpath.source_line[np.maximum(move, 0)]
        programmed, added = np.flatnonzero(move >= 0), np.flatnonzero(move < 0)
        after = programmed[np.minimum(np.searchsorted(programmed, added), len(programmed) - 1)]
        line[added] = np.where(kind[added] == _HOME, 0, self.toolpath.source_line[move[after]])
        return line

    def _programmed_columns(
        self, move: Ints32, kind: NDArray[np.int8], tolerance_mm: float | None
    ) -> "_Programmed":
        """Return the columns that the G-code gives the targets; added ones are rapid, without a tolerance.

        Order of precedence of the tolerance: ``G64 P``, then the option, then the cell's.
        """
        toolpath, controller = self.toolpath, self.cell.controller
        of_cell = controller.tolerance_mm
        below = tolerance_mm if tolerance_mm is not None else (of_cell if of_cell is not None else np.nan)
        count = len(move)
        columns = _Programmed(np.empty(count, bool), np.empty(count), np.empty(count), np.empty(count, bool))

        def part(start: int, end: int) -> None:
            rows, row = slice(start, end), np.maximum(move[start:end], 0)
            added = move[rows] < 0
            rapid = added | toolpath.rapid[row] | toolpath.machine[row]
            speed = np.where(rapid, controller.rapid_m_s * MM_PER_M, toolpath.feed_mm_s[row])
            programmed = np.where(added, np.nan, toolpath.tolerance_mm[row])
            columns.rapid[rows] = rapid
            columns.speed_mm_s[rows] = np.where(kind[rows] == _LIN, speed, np.nan)
            columns.tolerance_mm[rows] = np.where(np.isnan(programmed), below, programmed)
            columns.exact_stop[rows] = ~added & toolpath.exact_stop[row]

        in_chunks(part, chunk_borders(count))
        return columns

    def _axes(self) -> Floats:
        if self.toolpath.axis.strides[0] == 0:
            return np.broadcast_to(self.toolpath.axis[0], (self.columns.count, 3))
        return np.concatenate(self.columns.axis)

    def _rotations(self, away: Floats) -> Floats:
        """Return the quaternions (p, 4) of all targets: those away from HOME (r, 4), and HOME's."""
        rotation, planned = np.empty((len(self._position), 4)), self._planned
        if isinstance(planned, slice):

            def part(start: int, end: int) -> None:
                rotation[planned][start:end] = away[start:end]

            in_chunks(part, chunk_borders(len(away)))
        else:
            rotation[planned] = away
        for row in np.flatnonzero(self._kind == _HOME):
            rotation[row] = self.home_pose(int(self._of_tool[row]))[1]
        return rotation

    def _place_events(self, stand: "_StandingAt", kept: "_Kept") -> tuple[Event, ...]:
        placed: list[Event] = []
        earliest, switched = 0, 0
        for index, event in enumerate(self.toolpath.events):
            if index in self.tool_events:
                target = kept.at(self.tool_events[index])
            elif event.values.get("implied"):  # above the work, not while the mill is in the material
                target = kept.at(self._next_tool_change(index))
            else:
                target = kept.at(stand.at(event.row))
            implied = event.values.get("implied")  # may move before M30 and messages only
            row = max(switched if implied else earliest, target)
            earliest = max(earliest, row)
            switched = row if event.kind != "message" else switched
            dwell_s = event.values.get("dwell_s", 0.0) - self._dwell_before_change_s(event.row, index)
            values = {**event.values, "dwell_s": dwell_s} if dwell_s > 0 else _without_dwell(event.values)
            placed.append(Event(row, event.kind, values))
        return tuple(sorted(placed, key=lambda event: event.row))

    def _changes_at(self, row: int) -> list[int]:
        """Return the tool changes (numbers of events) at a row of the Toolpath, in order."""
        return sorted(index for index in self.tool_events if self.toolpath.events[index].row == row)

    def _dwell_before_change_s(self, row: int, index: int) -> float:
        """Return the dwell at a row that is over before the last tool change up to an event."""
        earlier = [k for k in self._changes_at(row) if k <= index]
        return float(self.toolpath.events[earlier[-1]].values.get("dwell_s", 0.0)) if earlier else 0.0

    def _dwells(self, row: int, stand: "_StandingAt", kept: "_Kept") -> list[tuple[int, float]]:
        """Return (target, seconds) of the dwell at a row: before and after tool changes there."""
        marks = [(kept.at(stand.at(row)), 0.0)]
        for index in self._changes_at(row):
            before_s = float(self.toolpath.events[index].values.get("dwell_s", 0.0))
            marks.append((kept.at(self.tool_events[index]), before_s))
        ends = [*(start_s for _, start_s in marks[1:]), float(self.toolpath.dwell_s[row])]
        return [(target, end_s - start_s) for (target, start_s), end_s in zip(marks, ends, strict=True)]

    def _next_tool_change(self, index: int) -> int:
        """Return the (unthinned) target of the tool change after an event, else the last before HOME."""
        return next((at for k, at in sorted(self.tool_events.items()) if k > index), self._before_home())

    def _before_home(self) -> int:
        """Return the (unthinned) target from which the last way to HOME begins, above the work."""
        away = np.flatnonzero(np.concatenate(self.columns.kind) != _HOME)
        return int(away[-1]) if len(away) else self.columns.count - 1

    def _exact_stops(
        self,
        programmed: "_Programmed",
        move: Ints32,
        kind: NDArray[np.int8],
        tool: Ints32,
        wait: Floats,
        events: tuple[Event, ...],
    ) -> Bools:
        """Mark the targets (p) reached at rest, including both ends of the predicted motion."""
        exact: Bools = (kind != _LIN) | (wait > 0) | programmed.exact_stop
        exact[:-1] |= (programmed.rapid[:-1] != programmed.rapid[1:]) | (kind[1:] != _LIN)
        exact[1:] |= tool[1:] != tool[:-1]  # that motion began with another tip
        exact[[event.row for event in events]] = True
        exact[np.flatnonzero(move >= 0)[[0, -1]]] = True
        exact[-1] = True
        return exact

    def _notes(self) -> list[Issue]:
        return [*self._stopped_by_end(), *confirmation_issues(self.cell)]

    def _stopped_by_end(self) -> list[Issue]:
        """Return a note on what is still on at the program's end and is switched off there."""
        last = max(self.tool_events, default=-1)
        ends = [event for event in self.toolpath.events[last + 1 :] if event.values.get("implied")]
        if not ends:
            return []
        kinds = {event.kind: event.values["m"] for event in ends}
        on = " and ".join(name for name in ("spindle", "coolant") if name in kinds)
        codes = " and ".join(f"M{kinds[name]}" for name in ("spindle", "coolant") if name in kinds)
        sentence = f"the program ends with {on} on: {codes} on the clearance plane, before the way to HOME"
        line = int(ends[0].values["line"])
        return [Issue("note", "stopped-by-end", line, sentence, f"program {codes} before the end")]


class _Programmed(NamedTuple):
    """Columns that the G-code gives the targets (p)."""

    rapid: Bools
    speed_mm_s: Floats
    tolerance_mm: Floats
    exact_stop: Bools


class _StandingAt:
    """Finds the planned motion at whose end the tool is after a row of the Toolpath."""

    def __init__(self, move: Ints32) -> None:
        self.move, self.latest = move, np.maximum.accumulate(move)

    def at(self, row: int) -> int:
        index = int(np.searchsorted(self.latest, row, side="right")) - 1
        while index > 0 and self.move[index] < 0:  # added, the tool has left that place
            index -= 1
        return max(index, 0)


class _Kept:
    """Finds the target of a planned motion, where some are left out: its own, or the one before."""

    def __init__(self, keep: Bools) -> None:
        self.left_out = np.flatnonzero(~keep)

    def at(self, index: int) -> int:
        return index - int(np.searchsorted(self.left_out, index, side="right"))


def _joined(parts: list[Floats]) -> Floats:
    """Return parts (n, 3) one behind the other, copied by all cores at once."""
    begins = list(itertools.accumulate((len(part) for part in parts), initial=0))
    result = np.empty((begins[-1], 3))
    pieces = [
        (begin + first, part[first : first + ROWS])
        for begin, part in zip(begins, parts, strict=False)
        for first in range(0, len(part), ROWS)
    ]

    def copy(piece: tuple[int, Floats]) -> None:
        result[piece[0] : piece[0] + len(piece[1])] = piece[1]

    in_threads(copy, pieces)
    return result


def _distinct(position: Floats, axis: Floats, kind: NDArray[np.int8], tool: Ints32) -> Bools:
    """Mark the rows whose printed point differs from the row before, that are PTP or move another tool."""
    different: Bools = (kind != _LIN) | (np.arange(len(kind)) == 0)

    def part(start: int, end: int) -> None:
        rows, first = slice(start + 1, end + 1), slice(start, end)
        grid = np.rint(position[start : end + 1] / GRID_MM)
        moved = functools.reduce(np.logical_or, (grid[1:] != grid[:-1]).T)
        different[rows] |= moved | (tool[rows] != tool[first])
        if axis.strides[0] != 0:
            different[rows] |= (axis[rows] != axis[first]).any(axis=1)

    in_chunks(part, chunk_borders(len(kind) - 1))
    return different


def straight(ptp: Bools, home: Bools, tool: Ints32) -> Bools:
    """Mark the targets (p,) to which a straight line leads from the one before, with the same tool."""
    lines = np.zeros(len(ptp), dtype=np.bool_)
    lines[1:] = ~ptp[1:] & ~home[:-1] & (tool[1:] == tool[:-1])
    return lines


def _as_slice(chosen: Bools) -> slice | Ints:
    """Return the index of the chosen rows, a slice where they are contiguous, so that nothing is copied."""
    rows = np.flatnonzero(chosen)
    together = len(rows) and rows[-1] - rows[0] == len(rows) - 1
    return slice(int(rows[0]), int(rows[-1]) + 1) if together else rows


def _without_dwell(values: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in values.items() if key != "dwell_s"}


def _no_motion(toolpath: Toolpath) -> NotUnderstoodError:
    nowhere = axes_nowhere(toolpath)
    return input_error(
        "no-motion",
        "the program has no move to a programmed position" + (f": {nowhere}" if nowhere else ""),
        "program X, Y and Z",
        line=_first_move_line(toolpath) if nowhere else 0,
        source=toolpath.source,
    )


def _first_move_line(toolpath: Toolpath) -> int:
    """Return the G-code line of the first feed move, of the first move where there is none, 0 without any."""
    moves = ~toolpath.machine
    moves[:1] = False
    feed = moves & ~toolpath.rapid
    rows = np.flatnonzero(feed if feed.any() else moves)
    return int(toolpath.source_line[rows[0]]) if len(rows) else 0


def _rows(values: Floats, chosen: Any) -> Floats:
    """Select rows; a broadcast constant stays one."""
    if values.strides[0] == 0:
        count = len(np.empty(len(values), dtype=np.bool_)[chosen])
        return np.broadcast_to(values[0], (count, *values.shape[1:]))
    result: Floats = values[chosen]
    return result


def _highest(toolpath: Toolpath) -> float:
    known = toolpath.is_position()
    return float(toolpath.position_mm[known, 2].max()) if known.any() else 0.0
