"""``read_gcode``: a file of G-code into a Toolpath, in pieces of bounded memory."""

import io
import math
import os
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.compiled.threads import ahead
from gcode2krl.errors import Issue, NotUnderstoodError, input_error
from gcode2krl.gcode import dialect_marks as d
from gcode2krl.gcode import findings, machine, tool_table
from gcode2krl.gcode import vocabulary as v
from gcode2krl.gcode.columns import Columns
from gcode2krl.gcode.dialects import DEFAULT, REASON_CORNER, Dialect, dialect_of, with_cutter
from gcode2krl.gcode.issues import found_issues, lines_to_quote, program_issues
from gcode2krl.gcode.origin import control_of, refuse_foreign
from gcode2krl.gcode.other_control import doubts_of_control, with_other_control
from gcode2krl.gcode.program_tables import FRAMES
from gcode2krl.gcode.reporting import COUNTS, EVENT, FOUND
from gcode2krl.gcode.rotary import in_part
from gcode2krl.gcode.sense import machine_issues
from gcode2krl.gcode.sentences import make_issue
from gcode2krl.gcode.state import (
    DOUBT_OF_G,
    DOUBT_OF_GROUP,
    DOUBT_OF_LETTER,
    EVENT_COOLANT,
    EVENT_M,
    EVENT_SPINDLE,
    EVENT_TOOL,
    GROUP_OF_G,
    IMPLIED_M5,
    KNOWN_AXES,
    MODES,
    OF_CYCLE,
    WORK_OFFSETS,
    initial_state,
    start_of,
)
from gcode2krl.gcode.text import beginning, pieces
from gcode2krl.gcode.tool_comments import (
    NamedTool,
    changes_in_comments,
    named_tools,
    other_tools,
    tool_not_changed,
)
from gcode2krl.gcode.words import Scanner, Words
from gcode2krl.tables import Event, Toolpath

# How far chords may be from their arc: which tolerances are plausible, doubtful or refused.

WIDE_MM = 1.0
"""Assumed: facets this deep are visible on any part."""
MOST_MM = 10.0
"""Assumed: arcs of most parts would be one chord."""


def chord_tolerance_issues(chord_tolerance_mm: float, source: str) -> Iterator[Issue]:
    """Yield what is doubtful about a chord tolerance; raise an input error where it is too large."""
    if chord_tolerance_mm > MOST_MM:
        raise input_error(
            "option-value",
            f"chord tolerance {chord_tolerance_mm:g} mm is more than {MOST_MM:g} mm: arcs would be lost",
            "0.01 is usual (--chord-tolerance)",
            source=source,
        )
    if chord_tolerance_mm > WIDE_MM:
        yield Issue(
            "warning",
            "chord-tolerance",
            0,
            f"chords may be {chord_tolerance_mm:g} mm off their arc",
            "0.01 is usual (--chord-tolerance)",
        )


if TYPE_CHECKING:  # a cell file costs its library a noticeable start
    from gcode2krl.cell import Cell
    from gcode2krl.gcode.program import Program

CHORD_TOLERANCE_MM = 0.01
_ROOM = 1.25
"""Room for rows is made for the estimated lines of the file, from its first piece, times this."""
_FIRST_ROWS, _FIRST_EVENTS = 8192, 256
"""Room at first; more is made when it is wanted."""
_MOST_REST_BYTES = 8_000_000
"""Bytes behind the program's end in which lines that are not read are looked for."""
_MOST_ISSUES = 1000

_HEAD_BYTES, _MARKED_BYTES = 4000, 1_000_000
"""So much of a program is looked through for marks of its control: where it is read, where it is refused."""

Progress = Callable[[int], None]


def read_gcode(
    path: str | Path,
    cell: "Cell | None" = None,
    *,
    dialect: str = DEFAULT,
    tools: str | Path | None = None,
    chord_tolerance_mm: float = CHORD_TOLERANCE_MM,
    block_delete: bool = False,
    search: Sequence[str | Path] = (),
    progress: Progress | None = None,
) -> Toolpath:
    """Read a G-code file into a `Toolpath`.

    Parameters
    ----------
    path : the file, UTF-8 or Latin-1, any line ends.
    cell : gives tool lengths and work offsets; without it (and without ``tools``) every length is 0.
    dialect : ``linuxcnc``, ``fanuc``, ``fanuc-calculator``, ``fanuc-increments``, ``grbl`` or ``sinumerik``.
    tools : a LinuxCNC ``tool.tbl`` in mm, used instead of the cell's tools.
    chord_tolerance_mm : largest distance between an arc and the chords that replace it.
    block_delete : skip lines that begin with ``/``.
    search : folders with files of subprograms, looked into behind the program's own folder.
    progress : called with the number of bytes read.

    Raises
    ------
    NotUnderstoodError
        With every finding (line, remedy), where a line cannot be understood.

    Notes
    -----
    Positions are the tool tip in the frame in which work offsets are stated, in mm. Source of meaning:
    LinuxCNC's RS274/NGC.

    Examples
    --------
    >>> from gcode2krl import read_gcode
    >>> toolpath = read_gcode("part.nc")
    >>> toolpath
    Toolpath(... moves, part.nc)
    >>> int(toolpath.source_line[-1]), float(toolpath.position_mm[-1, 2])
    (14, 20.0)
    """
    name = str(path)

    def read(as_dialect: str, hear: Progress | None = None) -> Toolpath:
        try:
            with Path(path).open("rb") as stream:
                return read_stream(
                    stream,
                    name,
                    cell,
                    dialect=as_dialect,
                    tools=tools,
                    chord_tolerance_mm=chord_tolerance_mm,
                    block_delete=block_delete,
                    folders=(Path(path).parent, *map(Path, search)),
                    progress=hear,
                )
        except OSError as error:
            what = f"cannot read: {error.strerror}"
            raise input_error("file-unreadable", what, "check the path", source=name) from None

    try:
        toolpath = read(dialect, progress)
    except NotUnderstoodError as error:
        mark = control_of(beginning(path, name, _MARKED_BYTES))
        raise with_other_control(error, mark, dialect, read) from None
    if dialect != DEFAULT:  # it was named: nobody knows better
        return toolpath
    mark = control_of(beginning(path, name, _HEAD_BYTES))
    doubts = tuple(doubts_of_control(toolpath, mark, dialect, read))
    return replace(toolpath, issues=(*toolpath.issues, *doubts)) if doubts else toolpath


def read_stream(
    stream: BinaryIO,
    name: str,
    cell: "Cell | None" = None,
    *,
    dialect: str = DEFAULT,
    tools: str | Path | None = None,
    chord_tolerance_mm: float = CHORD_TOLERANCE_MM,
    block_delete: bool = False,
    folders: Sequence[Path] = (),
    progress: Progress | None = None,
) -> Toolpath:
    """Read G-code from an open binary stream; see `read_gcode`.

    ``folders`` are all in which a file of a subprogram may be.
    """
    spoken = replace(_of_cell(dialect_of(dialect, name), cell), tool_names=tool_table.tools_by_name(cell))
    if not (np.isfinite(chord_tolerance_mm) and chord_tolerance_mm > 0):
        raise input_error(
            "option-value", f"chord tolerance {chord_tolerance_mm} mm is not positive", source=name
        )
    of_cell = tool_table.tools_from_cell(cell)
    stated = tool_table.tools_from_table(tools) if tools is not None else of_cell
    offsets, offset_known = _work_offsets(cell)
    from_table = spoken.length_by_d or (cell is not None and cell.program.tool_length == "from_table")
    doubts = list(chord_tolerance_issues(chord_tolerance_mm, name))
    interpreter = _Interpreter(
        name,
        spoken,
        {} if cell is None else _at_start(cell, stated.length_mm if from_table else None),
        offsets=offsets,
        offset_known=offset_known,
        tool_length_mm=stated.length_mm,
        tool_diameter_mm=stated.diameter_mm,
        cutter_diameter_mm=of_cell.diameter_mm,
        chord_tolerance_mm=chord_tolerance_mm,
        block_delete=block_delete,
        lengths_from_table=from_table,
        **_rotary_settings(cell),
    )
    read_pieces = pieces(stream, name)
    if spoken.is_conversational:
        read_pieces, spoken = interpreter.translate(read_pieces)
    with ahead(_scanned(read_pieces, spoken)) as scanned:
        head, named = _interpreted(interpreter, scanned, spoken, name, _size_of(stream), folders, progress)
    toolpath = interpreter.finish(head, cell)
    if cell is not None:
        doubts += other_tools(named, toolpath, cell)
        doubts += changes_in_comments(named, toolpath, cell)
        doubts += tool_not_changed(*interpreter.selected(), toolpath, cell)
    return replace(toolpath, issues=(*toolpath.issues, *doubts)) if doubts else toolpath


def _interpreted(
    interpreter: "_Interpreter",
    scanned: Iterator[tuple[int, bytes, Words]],
    spoken: Dialect,
    name: str,
    size: int,
    folders: Sequence[Path],
    progress: Progress | None,
) -> tuple[bytes, list[NamedTool]]:
    """Interpret a program; return how its text begins, and the tools that its comments name."""
    head, rest_bytes = b"", 0
    named: list[NamedTool] = []
    for first_line, text, words in scanned:
        if not interpreter.ended:
            if not head:
                head = text[:4000]
                refuse_foreign(text, name)
            stopped_at = interpreter.feed(words, text, first_line, size)
            if stopped_at is not None:
                # a jump may lead back to a line that has run, as far as it is in this piece
                begin = stopped_at if spoken.programs == d.PROGRAMS_LINUXCNC else first_line
                unread = text[_start_of_line(text, begin - first_line) :]
                whole = b"".join((unread, *(more for _, more, _ in scanned)))
                interpreter.run_whole(whole, begin, stopped_at, folders)
                break
            named += named_tools(text, first_line)
            if progress is not None:
                progress(len(text))
        if interpreter.ended:
            rest_bytes += len(text)
            if interpreter.check_rest(text, first_line) or rest_bytes > _MOST_REST_BYTES:
                break
    return head, named


def _of_cell(dialect: Dialect, cell: "Cell | None") -> Dialect:
    """Return a dialect as the control of a cell speaks it: its start-up modes, and its cutter
    compensation."""
    if cell is None:
        return dialect
    cutter, start = cell.program.cutter, {**dialect.start, **start_of(cell.program.start.modes())}
    return replace(with_cutter(dialect, cutter.lead_in, cutter.d), start=start)


def _at_start(cell: "Cell", table_mm: Floats | None) -> dict[str, float]:
    """Return fields of the state for the machine as it stands at the start: tool, spindle, place of the tip.

    With ``table_mm``, lengths by tool number, the length of the mounted tool is in force, as behind its M6.
    """
    start, state = cell.program.start, dict[str, float]()
    if cell.mounted_tool is not None:
        state["tool"] = cell.mounted_tool
        if table_mm is not None:
            length_mm = table_mm[cell.mounted_tool] if cell.mounted_tool < len(table_mm) else np.nan
            state |= {"offset_tool": cell.mounted_tool, "length_offset": np.nan_to_num(length_mm)}
    if start.spindle_rpm is not None:
        state |= {"rpm": start.spindle_rpm, "direction": 1}
    if start.position_mm is not None:
        turned = any(frame.a_deg for frame in cell.work_offsets.values())
        if turned or cell.machine is not None:
            what = "a turned zero in [work_offsets]" if turned else "rotary axes in [machine]"
            raise input_error(
                "cell-key",
                f"program.start.position_mm: with {what} it is not read",
                "let the program begin with G0 and all axes",
            )
        state |= dict(zip("xyz", start.position_mm, strict=True)) | dict.fromkeys(KNOWN_AXES, 1)
    return state


def _rotary_settings(cell: "Cell | None") -> dict[str, int]:
    """Return what the interpreter has to know of the machine: its letters, and what X, Y, Z mean."""
    machine = cell.machine if cell is not None else None
    if machine is None:
        return {"rotary_axes": 0, "tcpm": 0}
    return {"rotary_axes": sum(1 << v.index_of(letter) for letter in machine.axes), "tcpm": int(machine.tcpm)}


def _scanned(
    whole_lines: Iterator[tuple[int, bytes]],
    spoken: Dialect,
) -> Generator[tuple[int, bytes, Words], None, None]:
    """Yield (first line, text, its words), which hold until the next but one is made."""
    scanners = cycle((Scanner(spoken), Scanner(spoken)))  # one's words are read while the other writes
    for (first_line, text), scanner in zip(whole_lines, scanners, strict=False):
        yield first_line, text, scanner.scan(text, first_line)


def _start_of_line(text: bytes, line: int) -> int:
    """Return the place in a text at which a line begins, the first being 0."""
    return int(np.flatnonzero(np.frombuffer(text, np.uint8) == ord("\n"))[line - 1]) + 1 if line else 0


def _size_of(stream: BinaryIO) -> int:
    """Return the size of a file in bytes, 0 where the stream is none."""
    try:
        return os.fstat(stream.fileno()).st_size
    except (OSError, AttributeError):  # a stream in memory has no file
        return 0


def _work_offsets(cell: "Cell | None") -> tuple[Floats, Bools]:
    """Return the work offsets (n, 4), X, Y, Z in mm, rotation about Z in degrees; and which are stated."""
    offsets, known = np.zeros((len(WORK_OFFSETS), 4)), np.zeros(len(WORK_OFFSETS), dtype=np.bool_)
    for name, frame in (cell.work_offsets if cell is not None else {}).items():
        if frame.b_deg or frame.c_deg:
            raise input_error(
                "cell-key",
                f"work_offsets.{name}: found a rotation about Y or X (b_deg, c_deg), allowed: Z (a_deg)",
                "tilt $BASE itself: [frames] base",
            )
        if frame.a_deg and cell is not None and cell.machine is not None:
            raise input_error(
                "cell-key",
                f"work_offsets.{name}: with rotary axes in [machine] no rotation (a_deg) is read",
                "rotate $BASE itself: [frames] base",
            )
        index = WORK_OFFSETS.index(name)
        offsets[index] = frame.x_mm, frame.y_mm, frame.z_mm, frame.a_deg
        known[index] = True
    return offsets, known


class _Interpreter:
    """Runs the compiled interpreter over pieces of words and collects what it writes."""

    def __init__(self, name: str, spoken: Dialect, at_start: Mapping[str, float], **settings: Any) -> None:
        """Begin with fields of the state as the machine stands ``at_start``."""
        self.name, self.spoken = name, spoken
        self.state, self.counts = initial_state(), np.zeros(1, dtype=COUNTS)
        for key, value in (*spoken.start.items(), *at_start.items()):
            self.state[key] = value
        self.columns = Columns(_FIRST_ROWS, with_rotary=settings["rotary_axes"] != 0)
        self.counts["rows"] = self.rows_at_start = self.columns.begin(self.state[0])
        self.chord_tolerance_mm = settings["chord_tolerance_mm"]
        self.events = np.zeros(_FIRST_EVENTS, dtype=EVENT)
        self.raised = np.zeros(_MOST_ISSUES, dtype=FOUND)
        self.machine: Any = machine.MACHINE(
            state=self.state,
            counts=self.counts,
            rows=self.columns.views(),
            events=self.events,
            raised=self.raised,
            saved=np.zeros(FRAMES, MODES),
            **spoken.settings(),
            group_of_g=GROUP_OF_G,
            doubt_of_g=DOUBT_OF_G,
            doubt_of_group=DOUBT_OF_GROUP,
            doubt_of_letter=DOUBT_OF_LETTER,
            **settings,
        )
        self.texts: dict[int, bytes] = {}
        self.messages: list[str] = []
        self.most_decimals = 0
        self.rest_line = 0
        self.program: Program | None = None
        self.original: list[bytes] | None = None
        """Lines of a program that was translated."""

    def translate(
        self, read_pieces: Iterator[tuple[int, bytes]]
    ) -> tuple[Iterator[tuple[int, bytes]], Dialect]:
        """Return a conversational program as the core reads it, in pieces, and its dialect with its
        variables."""
        from gcode2krl.gcode.heidenhain import Translator  # few programs need its patterns

        text = b"".join(piece for _, piece in read_pieces)
        translator = Translator(text.decode("utf-8", "replace"))
        translated = translator.text().encode()
        self.original = text.split(b"\n")
        self.spoken = replace(self.spoken, variables=translator.variables())
        return pieces(io.BytesIO(translated), self.name), self.spoken

    @property
    def ended(self) -> bool:
        return bool(self.state["ended"][0])

    def selected(self) -> tuple[int, int]:
        """Return the tool that T named last, and the line; below 0 where there is none."""
        return int(self.state["selected_tool"][0]), int(self.state["selected_line"][0])

    def _count(self, what: str) -> int:
        return int(self.counts[what][0])

    def feed(self, words: Words, text: bytes, first_line: int, size: int) -> int | None:
        """Execute a piece of words; ``size`` bytes are in the whole file, 0 = unknown.

        Return the line from which on the program has to be read as a whole, None if all of it was executed.
        """
        found_before = self._count("findings")
        if self._count("rows") == self.rows_at_start and len(words.line):
            lines = int(words.line[-1] - words.line[0]) + 1
            self._reserve(int(_ROOM * lines * max(1.0, size / len(text))))
        stopped_at = self._execute(words, text)
        self._remember_lines(text, first_line, found_before)
        return stopped_at

    def _execute(self, words: Words, text: bytes) -> int | None:
        self.most_decimals = max(self.most_decimals, words.most_decimals)
        if len(words.message_span):
            words.value[words.letter == ord("(")] += len(self.messages)
            self.messages += [_decode(text[a:b]) for a, b in words.message_span]
        self.counts["marks"] = 0
        at = 0
        while True:
            at = machine.run(self.machine, words.letter, words.value, words.extra, words.line, at)
            if at >= len(words.letter) or self.ended:
                return None
            if self._count("program_wanted"):
                return int(words.line[at])
            self._make_room()

    def run_whole(self, text: bytes, first_line: int, begin: int, folders: Sequence[Path]) -> None:
        """Run the rest of a program from the line ``begin`` on, the first that computes or jumps."""
        from gcode2krl.gcode.program import HandsOver, Program  # few programs need its patterns

        program = Program(self.name, self.spoken, folders, block_delete=bool(self.machine.block_delete))
        program.add(self.name, text, first_line, len(self.messages))
        program.start_at(begin)
        program.run(HandsOver(self.machine, self.state, self.counts, self.raised), self._make_room)
        self.messages += [_decode(message) for message in program.messages]
        self.most_decimals = max(self.most_decimals, program.most_decimals)
        raised = self.raised[: self._count("findings")]
        wanted = {n for n in lines_to_quote(raised, self.state[0]) if n >= first_line}
        self.texts |= program.texts(wanted)
        self.program = program

    def _remember_lines(self, text: bytes, first_line: int, found_before: int) -> None:
        """Keep the blocks of this piece that findings speak of, so that they can be quoted."""
        new = self.raised[found_before : self._count("findings")]
        wanted = {n for n in lines_to_quote(new, self.state[0]) if n >= first_line and n not in self.texts}
        if not wanted:
            return
        lines = text.split(b"\n")[:-1]
        self.texts |= {n: lines[n - first_line] for n in wanted if n - first_line < len(lines)}

    def _make_room(self) -> None:
        """Make the room that the next block wants."""
        self._reserve(self._count("rows_wanted"))
        if self._count("events_wanted") > len(self.events):
            larger = np.zeros(2 * self._count("events_wanted"), dtype=EVENT)
            larger[: len(self.events)] = self.events
            self.events = self.machine.events = larger

    def _reserve(self, rows: int) -> None:
        self.columns.reserve(rows, self._count("rows"))
        self.machine.rows = self.columns.views()

    def check_rest(self, text: bytes, first_line: int) -> bool:
        """Remember the first line of code behind the program's end, so that it is reported; tell if any."""
        lines = text.splitlines()
        behind = max(0, int(self.state["end_line"][0]) - first_line + 1)
        for number, line in enumerate(lines[behind:], start=first_line + behind):
            if line.strip() not in (b"", b"%", b"\x1a"):
                self.rest_line = number
                return True
        return False

    def finish(self, head: bytes, cell: "Cell | None" = None) -> Toolpath:
        """Raise the errors that were found, or return the table."""
        if self.original is not None:
            self.texts = {n: self.original[n - 1] for n in self.texts if 0 < n <= len(self.original)}
        known = found_issues(self.raised, self.counts[0], self.state[0], self.texts)
        if self.state["corner"][0]:  # the program has ended before the block that makes it
            line = int(self.state["corner_line"][0])
            known.append(make_issue(findings.F.DIALECT_STATEMENT, line, REASON_CORNER, 0.0, 0.0, ""))
        placed = [self._placed(issue) for issue in known]
        if any(issue.severity == "error" for issue in placed):
            raise NotUnderstoodError((i for i in placed if i.severity != "warning"), self.name)
        whole = program_issues(
            self.state[0],
            self.texts,
            rest_line=self.rest_line,
            most_decimals=self.most_decimals,
            head=head,
            programs=self.spoken.programs,
        )
        of_calls = self.program.argument_issues() if self.program is not None else ()
        return self._toolpath((*placed, *map(self._placed, (*whole, *of_calls))), cell, head)

    def _placed(self, issue: Issue) -> Issue:
        """Return a finding whose lines are named with their file, where that is not the main program's."""
        return issue if self.program is None else self.program.placed(issue)

    def _toolpath(self, issues: tuple[Issue, ...], cell: "Cell | None", head: bytes) -> Toolpath:
        rows = self._count("rows")
        columns = self.columns.finished(rows)
        events = (*self._events(), *self._stopped_by_end())
        axis: Floats = np.broadcast_to(np.array([0.0, 0.0, 1.0]), (rows, 3))
        if cell is not None and cell.machine is not None:
            issues = (*issues, *machine_issues(columns, cell, head))
            vel_ori_deg_s = cell.controller.vel_ori_deg_s
            part = in_part(columns, events, cell.machine, self.chord_tolerance_mm, vel_ori_deg_s, self.name)
            columns, axis, events, issues = part.columns, part.axis, part.events, (*issues, *part.issues)
        return Toolpath(
            **columns,
            axis=axis,
            events=events,
            issues=issues,
            source=self.name,
            restart=None,
        )

    def _stopped_by_end(self) -> Iterator[Event]:
        """The program's end stops spindle and coolant (RS274/NGC, M2 and M30)."""
        state, row = self.state[0], self._count("rows") - 1
        line = int(state["end_line"])
        if state["direction"]:
            yield Event(row, "spindle", {"rpm": 0.0, "m": v.M5, "line": line, "implied": True})
        if state["mist"] or state["flood"]:
            yield Event(
                row, "coolant", {"mist": False, "flood": False, "m": v.M9, "line": line, "implied": True}
            )

    def _events(self) -> Iterator[Event]:
        """Yield the events; ``dwell_s`` tells how much of the row's dwell lies before an event."""
        for row, kind, line, a, b, dwell_s, q, e in self.events[: self._count("events")].tolist():
            what, values = self._said(kind, line, a, b)
            if not math.isnan(q):
                values["q"] = q
            if not math.isnan(e):
                values["e"] = e
            if dwell_s > 0:
                values["dwell_s"] = dwell_s
            yield Event(row, what, values)

    def _said(self, kind: int, line: int, a: float, b: float) -> tuple[str, dict[str, Any]]:
        """Return an event's name and what it says."""
        if kind == EVENT_TOOL:
            return "tool", {"tool": int(a), "line": line}
        if kind == EVENT_SPINDLE:
            cycle, m = divmod(abs(int(b)), OF_CYCLE)
            spindle: dict[str, Any] = {"rpm": a, "m": m, "line": line}
            if cycle:
                of_sinumerik = self.spoken.programs == d.PROGRAMS_SINUMERIK
                spindle["cycle"] = f"CYCLE{cycle}" if of_sinumerik else f"G{cycle}"
            return "spindle", {**spindle, "implied": True} if b == IMPLIED_M5 else spindle
        if kind == EVENT_COOLANT:
            return "coolant", {"mist": b in (1.0, 3.0), "flood": b >= 2.0, "m": int(a), "line": line}
        if kind == EVENT_M:
            values: dict[str, Any] = {"m": int(a), "text": "", "line": line}
            return "message", values if math.isnan(b) else {**values, "p": b}
        return "message", {"m": -1, "text": self.messages[int(a)], "line": line}


def _decode(span: bytes) -> str:
    text = span.decode("utf-8", errors="replace").strip()
    return text[3:].lstrip(" ,").removeprefix('("').strip()
