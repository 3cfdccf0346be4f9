"""A program with parameters, expressions and O-words: it is read whole, and runs in the core.

A plain file never comes here. The first block that computes or jumps ends the reading in pieces: from there
on the text is scanned as a whole, its O-lines are looked at once (`o_words`), and the core runs it
(``native/gcode/execute.c``). It comes back for room, and for a subprogram in another file.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Ints
from gcode2krl.compiled.core import BYTES, FLOATS, INT, INTS32, core_function
from gcode2krl.errors import Issue, input_error
from gcode2krl.gcode import dialect_marks as d
from gcode2krl.gcode import findings, macro_words
from gcode2krl.gcode import program_tables as tables
from gcode2krl.gcode.dialects import Dialect
from gcode2krl.gcode.machine import MACHINE
from gcode2krl.gcode.o_words import Definition, Flow, Label, parsed
from gcode2krl.gcode.parameter_names import NAMES
from gcode2krl.gcode.siemens_words import SiemensFlow, formals_of, variables_of, with_own_names
from gcode2krl.gcode.state import STATE
from gcode2krl.gcode.subprograms import found_file, own_number
from gcode2krl.gcode.vocabulary import LINE_LIMIT, PROGRAM_LINE
from gcode2krl.gcode.words import Scanner, Words

# Calls that give fewer arguments than their subprogram reads, or more.
#
# What is read and not given is noted while the program runs (``native/gcode/parameters.c:note_argument``),
# as a subprogram may ask first; not on a Fanuc, where an argument that is not passed leaves its word out,
# and macros are written for that. What is given and never read is looked for in the text of the subprogram:
# a branch that this program does not take may read it.

_COMMENT = re.compile(rb"\([^()]*\)|;.*")
_PARAMETER = re.compile(rb"#\s*(?P<number>\d[\d \t]*)?(?P<sets>\s*=)?")
_BEFORE_M98 = re.compile(rb"M\s*0*98(?!\d)", re.IGNORECASE)
_MACRO_ENDS = re.compile(rb"\s*(?:N\s*\d+\s*)?[O:]\s*\d", re.IGNORECASE)
_OPENS, _CLOSES = {"if", "while", "repeat"}, {"endif", "endwhile", "endrepeat"}
_MOST, _MOST_NAMED = 33, 4
_ALL = (2 << _MOST) - 2
_LETTERS = dict(
    zip((1, 2, 3, 7, 8, 9, 11, 4, 5, 6, 13, *range(17, 27)), "ABCDEFHIJKMQRSTUVWXYZ", strict=True)
)
"""Letters of G65 by the variable that holds them."""


def missing(called: Any, label: Label) -> Issue:
    """Return the warning of a row of `program_tables.SUBPROGRAM` that reads what is not given."""
    number, line = int(called["missing"]), int(called["missing_read"])
    count = int(called["missing_given"]).bit_count()
    given = f"{count} argument{'' if count == 1 else 's'}"
    what = f"{_name(label)} is called with {given}, and line {line} reads #{number}, which is 0"
    remedy = f"give {number} arguments, each in [ ]; or set #{number} in the subprogram"
    return Issue("warning", "argument-count", int(called["missing_line"]), what, remedy)


def too_many(called: Any, unread: int, label: Label, begin_line: int, *, of_fanuc: bool) -> Issue:
    """Return the warning of a row whose arguments ``unread``, as bits, nothing reads."""
    numbers = [number for number in range(1, _MOST + 1) if unread >> number & 1]
    names = [_LETTERS.get(n, f"#{n}") if of_fanuc else f"#{n}" for n in numbers]
    named = ", ".join(names) if len(names) <= _MOST_NAMED else f"{names[0]} to {names[-1]}"
    what = f"the call gives {named}, which the subprogram that begins at line {begin_line} never reads"
    remedy = "leave it out, or check which argument the subprogram takes where"
    return Issue("warning", "argument-count", int(called["given_line"]), f"{_name(label)}: {what}", remedy)


def _name(label: Label) -> str:
    return f"O{label}" if label.isdigit() else f"O<{label}>"


def unread_of(given: int, body: Iterable[bytes], *, of_fanuc: bool) -> int:
    """Return the bits of ``given`` arguments that no line of a subprogram reads; ``body`` begins with it.

    A parameter that the body sets before it reads it, in no branch and no loop, is no argument.
    """
    arguments, assigned, depth = 0, 0, 0
    for line in body:
        code = _COMMENT.sub(b"", line)
        if of_fanuc and _MACRO_ENDS.match(code):
            break
        word = "" if of_fanuc or b"o" not in code.lower() else parsed(code).word
        if word == "endsub":
            depth = 0
        depth += (word in _OPENS) - (word in _CLOSES)
        if _BEFORE_M98.search(code):  # the program that it calls has the same parameters
            return 0
        sets = 0
        for parameter in _PARAMETER.finditer(code):
            if parameter["number"] is None:
                if code.startswith(b"<", parameter.end()):
                    continue
                return 0  # its number is computed
            number = int(re.sub(rb"\s", b"", parameter["number"]))
            if number > _MOST:
                continue
            if parameter["sets"]:
                sets |= 1 << number
            elif not assigned >> number & 1:
                arguments |= 1 << number
        assigned |= sets if depth == 0 and not of_fanuc else 0
        if word == "endsub":
            break
    return given & ~arguments & _ALL


MOST_BYTES = 256_000_000
"""Largest program with parameters or O-words: its text and its words are in memory as a whole."""
MOST_STEPS = 10_000_000
"""Lines that a program may run beyond those of its files: a loop that takes more is taken as endless."""
MOST_ROWS = 20_000_000
"""Moves that such a program may make; they take 2 GB."""
_NOTHING_WANTED, _WANTED_BY_NUMBER = -1, -2
_DEBUG_IS_SHOWN = 5599
"""A parameter that is 1 at first, as in LinuxCNC."""
_LINES = re.compile(r"\blines? \d+(?:, \d+)*(?: and \d+)?")
"""How a message names lines."""
_NUMBER = re.compile(r"\d+")

_execute = core_function(
    "gcode_execute", MACHINE, tables.PROGRAM, BYTES, FLOATS, FLOATS, INTS32, INT, returns=INT
)
_set_names = core_function("gcode_set_names", tables.PROGRAM, returns=None)


class HandsOver(NamedTuple):
    """The interpreter of blocks, and its arrays that tell how far it is."""

    machine: Any
    state: NDArray[Any]
    counts: NDArray[Any]
    raised: NDArray[Any]


class File(NamedTuple):
    """One file of a program; lines of all files are numbered one behind the other."""

    name: str
    first_line: int
    """Number of its first line among those of all files."""
    text: bytes
    start_line: int
    """Its own number of that line."""


class Program:
    """A whole program; `run` runs it from the line at which the reading in pieces has stopped."""

    def __init__(self, name: str, spoken: Dialect, folders: Sequence[Path], *, block_delete: bool) -> None:
        """Take the program's name and dialect, and the folders in which its subprograms may be."""
        self.name, self._folders, self._block_delete = name, folders, block_delete
        self._spoken, self._is_macro = spoken, spoken.programs == d.PROGRAMS_FANUC
        self.files: list[File] = []
        self.messages: list[bytes] = []
        self.most_decimals = 0
        self._letter, self._line = np.zeros(0, np.uint8), np.zeros(0, np.int32)
        self._value, self._lines = np.zeros(0), np.zeros(0, tables.LINE)
        self._text = b""
        self._labels: dict[Label, int] = {}
        self._definitions: dict[Label, list[tuple[int, Definition]]] = {}
        self._ends: list[int] = []
        self._looked_for: set[Label] = set()
        self._at = 0
        self.course = np.zeros(1, tables.COURSE)
        self._subprograms = np.zeros(0, tables.SUBPROGRAM)
        self._segments, self._numbered = 0, np.zeros(0, tables.LABEL)
        self._program = _empty_program(self.course, spoken)

    # --- files ------------------------------------------------------------------------------------------

    def add(self, name: str, text: bytes, start_line: int, messages: int) -> None:
        """Take a file, or the rest of one from a line on; so many messages have been numbered before."""
        if len(self._text) + len(text) > MOST_BYTES:
            raise input_error(
                "program-size",
                f"a program with parameters or O-words has more than {MOST_BYTES / 1e6:.0f} MB",
                "let the post write plain moves",
                source=name,
            )
        first_line = int(self._line[-1]) + 1 if self.files else start_line
        text = text if text.endswith(b"\n") else text + b"\n"
        self.files.append(File(name, first_line, text, start_line))
        if self._spoken.programs == d.PROGRAMS_SINUMERIK:
            taken, arrays = self._spoken.variables, self._spoken.arrays
            if len(self.files) > 1:
                text = with_own_names(text, taken.keys() | arrays.keys())
            variables, more = variables_of(text, taken, arrays)
            self._spoken = replace(self._spoken, variables={**taken, **variables}, arrays={**arrays, **more})
            self._program.statement_names, self._program.statement_kinds = self._spoken.names()
            self._program.arrays = np.array(list(self._spoken.arrays.values()), tables.ARRAY)
        scanned, lines = Scanner(self._spoken).scan_whole(text, first_line)
        self.most_decimals = max(self.most_decimals, scanned.most_decimals)
        messages += len(self.messages)
        self.messages += [text[a:b] for a, b in scanned.message_span]
        last = first_line + text.count(b"\n")
        self._append(text, scanned, lines, messages, last, is_main=len(self.files) == 1)

    def _append(
        self, text: bytes, scanned: Words, lines: NDArray[Any], messages: int, last: int, *, is_main: bool
    ) -> None:
        letter, value, line = scanned.letter, scanned.value, scanned.line
        if not is_main:  # the tape marks of another file end nothing
            kept = letter != ord("%")
            letter, value, line = letter[kept], value[kept], line[kept]
        value = value.copy()
        value[letter == ord("(")] += messages
        marked = letter == PROGRAM_LINE
        value[marked] += len(self._lines)
        lines["start"] += len(self._text)
        lines["first_message"] += messages
        end = np.zeros(1, tables.LINE)
        end["kind"] = tables.KIND_END_OF_FILE
        rows, words = len(self._lines), len(self._letter)
        self._lines = np.concatenate((self._lines, lines, end))
        self._letter = np.concatenate((self._letter, letter, np.array([PROGRAM_LINE], np.uint8)))
        self._value = np.concatenate((self._value, value, [float(len(self._lines) - 1)]))
        self._line = np.concatenate((self._line, line, np.array([last], np.int32)))
        word_of_row = np.zeros(len(self._lines), dtype=np.int64)
        word_of_row[rows : rows + len(lines)] = words + np.flatnonzero(marked)
        self._text += text
        self._ends.append(len(self._letter))
        if self._is_macro:
            self._look_at_macro_lines(rows, word_of_row, words)
        elif self._spoken.programs == d.PROGRAMS_SINUMERIK:
            self._look_at_siemens_lines(text, rows, word_of_row, words)
        else:
            self._look_at_o_lines(rows, word_of_row)
        self._program.text = np.frombuffer(self._text, np.uint8)
        self._program.lines = self._lines
        self._count("most_steps", MOST_STEPS + int(self._line[-1]))
        self._count("most_rows", MOST_ROWS)
        self._count("main_words", self._ends[0])

    def _look_at_o_lines(self, first_row: int, word_of_row: Ints) -> None:
        flow = Flow(self._lines, word_of_row, _LabelRows(self._labels))
        of_flow = (self._lines["kind"] == tables.KIND_O_WORD) | (self._lines["fault"] != findings.F.OK)
        for row in (first_row + np.flatnonzero(of_flow[first_row:])).tolist():
            start = int(self._lines["start"][row])
            content = self._text[start : self._text.index(b"\n", start)]
            if self._block_delete and content.lstrip(b" \t\r").startswith(b"/"):
                self._lines["kind"][row] = tables.KIND_NOTHING
            elif self._lines["fault"][row] != findings.F.OK:
                flow.add_refused(row, is_o_line=bool(parsed(content).label))
            else:
                flow.add(row, parsed(content))
        flow.finish()
        self._define(flow.definitions)

    def _look_at_macro_lines(self, first_row: int, word_of_row: Ints, first_word: int) -> None:
        file = self.files[-1]
        at_start = len(self.files) == 1 and file.start_line == 1
        flow = macro_words.MacroFlow(self._lines, word_of_row, first_word, at_start=at_start)
        kind = self._lines["kind"][first_row:]
        for row in (first_row + np.flatnonzero(kind == tables.KIND_O_WORD)).tolist():
            start = int(self._lines["start"][row])
            line = macro_words.parsed(self._text[start : self._text.index(b"\n", start)])
            if line.deleted and self._block_delete:
                self._lines["kind"][row] = tables.KIND_NOTHING
            else:
                flow.add(row, line)
        flow.finish()
        self._lines["segment"][first_row:] += self._segments
        labels = macro_words.labels_of(
            file.text, file.first_line, self._line.astype(np.int64), first_word, flow, self._segments
        )
        self._segments += len(flow.segments)
        known = np.concatenate((self._numbered, labels))
        self._numbered = known[np.lexsort((known["word"], known["number"], known["segment"]))]
        self._program.labels = self._numbered
        self._define(flow.definitions)
        if not flow.definitions and len(self.files) > 1:  # a file of a program without its number
            number = own_number(file.name)
            self._define([Definition(number, first_word, is_program=True)])

    def _look_at_siemens_lines(self, text: bytes, first_row: int, word_of_row: Ints, first_word: int) -> None:
        file = self.files[-1]
        line_of_word = self._line.astype(np.int64)
        known = {name for names in self._spoken.statements.values() for name in names}
        known |= set(self._spoken.variables)
        rows_of_labels = _LabelRows(self._labels)
        flow = SiemensFlow(
            text, file.first_line, line_of_word, self._lines, word_of_row, rows_of_labels, known
        )
        for row in range(first_row, len(self._lines) - 1):
            start = int(self._lines["start"][row])
            content = self._text[start : self._text.index(b"\n", start)]
            if self._block_delete and content.lstrip(b" \t\r").startswith(b"/"):
                self._lines["kind"][row] = tables.KIND_NOTHING
            else:
                flow.add(row, content)
        flow.finish()
        self._number_cases(flow.cases)
        if len(self.files) == 1:
            self._tell_subprograms()
            return
        label = Path(file.name).stem.lower()
        self._define([Definition(label, first_word, is_program=True)])
        formals = formals_of(text, self._spoken.variables)
        called = self._subprograms[self._labels[label]]
        called["fault"] = findings.PF.FAULT_FORMALS if formals is None else 0
        called["formals"] = len(formals or ())
        called["formal"][: len(formals or ())] = formals or ()

    def _number_cases(self, cases: Sequence[tuple[int, int, int]]) -> None:
        """Keep where the numbers of each CASE lead, in a segment of its own."""
        rows = np.zeros(len(cases), tables.LABEL)
        for case, (row, number, word) in zip(rows, cases, strict=True):
            self._lines["segment"][row] = row
            case["segment"], case["number"], case["word"] = row, number, word
        self._numbered = self._program.labels = np.concatenate((self._numbered, rows))

    def _define(self, definitions: Iterable[Definition]) -> None:
        for definition in definitions:
            self._labels.setdefault(definition.label, len(self._labels))
            self._definitions.setdefault(definition.label, []).append((len(self.files) - 1, definition))
        self._tell_subprograms()

    def start_at(self, line: int) -> None:
        """Begin at a line of the main program: what stands before it has run."""
        self._at = int(np.searchsorted(self._line, line))

    def _tell_subprograms(self) -> None:
        known = self._subprograms
        rows = np.zeros(max(16, len(self._labels)), tables.SUBPROGRAM)
        rows["entry"] = -1
        rows["number"] = -1
        rows[: len(known)] = known[: len(rows)]
        for label, row in self._labels.items():
            rows["number"][row] = int(label) if label.isdigit() else -1
        self._subprograms = self._program.subprograms = rows
        self._count("subprograms", len(self._labels))

    def _count(self, name: str, number: int) -> None:
        self.course[name] = number

    # --- running ----------------------------------------------------------------------------------------

    def run(self, hands_over: HandsOver, make_room: Callable[[], None]) -> None:
        """Run the program to its end, or to the first error that it cannot go on behind."""
        extra = np.full(1, float(LINE_LIMIT))  # every mark that is left is a line too long
        while not (hands_over.state["ended"][0] or self.course["is_stopped"][0]):
            self._at = _execute(
                hands_over.machine, self._program, self._letter, self._value, extra, self._line, self._at
            )
            if self.course["wanted"][0] != _NOTHING_WANTED:
                self._find_subprogram(hands_over)
            elif self._at < len(self._letter):
                make_room()
            else:
                return

    def _find_subprogram(self, hands_over: HandsOver) -> None:
        """Make the subprogram that is called ready: its file, else what stands below, as in LinuxCNC."""
        label = self._wanted_label()
        word = int(self.course["wanted_word"][0])
        file = next(k for k, end in enumerate(self._ends) if word < end)
        if not self._is_macro or not self._in_file(label, file):
            self._read_file(label)
        definition = self._macro(label, file) if self._is_macro else self._definition(label, file, word)
        if definition is None:
            self._report(hands_over, word, findings.F.SUBPROGRAM_MISSING)
            return
        if self._is_macro and len(self._in_file(label, file)) > 1:
            self._report(hands_over, word, findings.F.O_WORD, findings.PF.FAULT_SUB_TWICE)
            return
        self._tell_subprograms()
        ready = self._subprograms[self._labels[label]]
        ready["number"], ready["entry"] = int(label) if label.isdigit() else -1, definition.entry
        ready["is_ready"], ready["is_program"] = 1, definition.is_program

    def _wanted_label(self) -> Label:
        row = int(self.course["wanted"][0])
        if row == _WANTED_BY_NUMBER:
            label = str(int(self.course["wanted_number"][0]))
            self._labels.setdefault(label, len(self._labels))
            self._tell_subprograms()
            return label
        return next(label for label, own in self._labels.items() if own == row)

    def _definition(self, label: Label, file: int, word: int) -> Definition | None:
        """Return where a subprogram is defined: in its own file, else behind the call in the same file."""
        known = self._definitions.get(label, [])
        of_own_file = [d for k, d in known if self.files[k].name != self.name and self._is_own(k, label)]
        below = [d for k, d in known if k == file and d.entry > word]
        return next(iter((*of_own_file, *below)), None)

    def _in_file(self, label: Label, file: int) -> list[Definition]:
        """Return where a program of a number begins in a file."""
        return [definition for k, definition in self._definitions.get(label, []) if k == file]

    def _macro(self, label: Label, file: int) -> Definition | None:
        """Return where a program of a Fanuc begins: in the file that calls it, else in its own."""
        namesakes = [k for k in range(1, len(self.files)) if self._is_own(k, label)]
        return next((each for k in (file, *namesakes) for each in self._in_file(label, k)), None)

    def _is_own(self, file: int, label: Label) -> bool:
        name = self.files[file].name
        return own_number(name) == label if self._is_macro else Path(name).stem.lower() == label

    def _read_file(self, label: Label) -> None:
        if label in self._looked_for:
            return
        self._looked_for.add(label)
        path = found_file(label, self._folders, Path(self.name).suffix, self._spoken.programs)
        if path is not None:
            self.add(str(path), path.read_bytes(), 1, messages=0)

    def _report(self, hands_over: HandsOver, word: int, number: int, fault: int = 0) -> None:
        counts, raised = hands_over.counts, hands_over.raised
        row = int(counts["findings"][0])
        if row < len(raised):
            raised[row] = (number, int(self._line[word]), float(fault), 0.0, -1.0)
            counts["findings"] += 1
        counts["errors"] += 1
        self.course["is_stopped"] = 1

    # --- arguments --------------------------------------------------------------------------------------

    def argument_issues(self) -> Iterator[Issue]:
        """Yield a warning for each subprogram that reads what is not given, or does not read what is."""
        lines: dict[str, list[bytes]] = {}
        for label, row in self._labels.items():
            called = self._subprograms[row]
            if called["missing"]:
                yield missing(called, label)
            if called["given"]:
                entry = int(called["entry"])
                head_line, first_line = int(self._line[entry - 1]), int(self._line[entry])
                file = self._file(first_line)
                texts = lines[file.name] = lines.get(file.name) or file.text.split(b"\n")
                body = (texts[k] for k in range(first_line - file.first_line, len(texts)))
                unread = unread_of(int(called["given"]), body, of_fanuc=self._is_macro)
                if unread:
                    begin = head_line if self._file(head_line) is file else first_line
                    yield too_many(called, unread, label, begin, of_fanuc=self._is_macro)

    # --- places -----------------------------------------------------------------------------------------

    def place(self, line: int) -> tuple[str, int]:
        """Return the file and the line in it that a line among those of all files is."""
        file = self._file(line)
        return file.name, line - file.first_line + file.start_line

    def placed(self, issue: Issue) -> Issue:
        """Return a finding with the lines of subprograms in other files named as such.

        It then has no line of its own: that of the main program which led there may be one of many.
        """
        message = _LINES.sub(lambda lines: _NUMBER.sub(self._told_number, lines[0]), issue.message)
        if not self._is_elsewhere(issue.line):
            return replace(issue, message=message)
        name, line = self.place(issue.line)
        message_with_place = f"{message} (in {Path(name).name} line {line})"
        return replace(issue, line=0, message=message_with_place, file=name, file_line=line)

    def _is_elsewhere(self, line: int) -> bool:
        return len(self.files) > 1 and line >= self.files[1].first_line

    def _told_number(self, number: re.Match[str]) -> str:
        if not self._is_elsewhere(int(number[0])):
            return number[0]
        name, line = self.place(int(number[0]))
        return f"{line} of {Path(name).name}"

    def texts(self, lines: Iterable[int]) -> dict[int, bytes]:
        """Return lines of the program by their numbers."""
        lines_of = {id(file): file.text.split(b"\n") for file in {self._file(n) for n in lines}}
        return {n: lines_of[id(self._file(n))][n - self._file(n).first_line] for n in lines}

    def _file(self, line: int) -> File:
        return next((file for file in reversed(self.files) if file.first_line <= line), self.files[0])


class _LabelRows(dict[Label, int]):
    """The row of every label; a new label gets the next."""

    def __init__(self, labels: dict[Label, int]) -> None:
        super().__init__()
        self._labels = labels

    def __getitem__(self, label: Label) -> int:
        return self._labels.setdefault(label, len(self._labels))


def _empty_program(course: NDArray[Any], spoken: Dialect) -> Any:
    """Return the tables of a program at its start; pages that nothing reaches cost nothing."""
    frames = np.zeros(tables.FRAMES, tables.FRAME)
    statement_names, statement_kinds = spoken.names()
    course["wanted"] = _NOTHING_WANTED
    course["lap_word"] = -1
    course["generation"] = frames["generation"][0] = 1
    names = np.zeros(tables.MOST_NAMES, tables.NAME)
    parameters = np.full(tables.MOST_PARAMETERS, np.nan)  # none is set
    parameters[_DEBUG_IS_SHOWN] = 1.0  # no variable of a Fanuc
    program = tables.PROGRAM(
        text=np.frombuffer("\n".join(f"<{name}>" for name in NAMES).encode(), np.uint8),
        lines=np.zeros(0, tables.LINE),
        subprograms=np.zeros(0, tables.SUBPROGRAM),
        names=names,
        name_slots=np.zeros(2 * len(names) + 1, np.int32),
        pool=np.zeros(32 * len(names), np.uint8),
        local_value=np.zeros((tables.FRAMES, len(names))),
        local_generation=np.zeros((tables.FRAMES, len(names)), np.int64),
        parameters=parameters,
        frames=frames,
        repeats=np.zeros(tables.MOST_REPEATS, tables.REPEAT),
        assignments=np.zeros(tables.ROOM_OF_LINE, tables.ASSIGNMENT),
        course=course,
        lap=np.zeros(1, STATE),
        letter=np.zeros(tables.ROOM_OF_LINE, np.uint8),
        value=np.zeros(tables.ROOM_OF_LINE),
        line=np.zeros(tables.ROOM_OF_LINE, np.int32),
        extra=np.zeros(tables.ROOM_OF_LINE),
        labels=np.zeros(0, tables.LABEL),
        statement_names=statement_names,
        statement_kinds=statement_kinds,
        arrays=np.zeros(0, tables.ARRAY),
        syntax=spoken.syntax_bits(),
        language=spoken.programs,
    )
    _set_names(program)
    return program
