"""Statements of a Fanuc's custom macro B: which END ends which DO, and where a program of a number begins.

A line is looked at once a file, as O-lines are (`o_words`); what makes no sense gets its fault and is
reported where it is executed. Where GOTO leads is found when it is executed, as its number may be computed.
"""

import re
from bisect import bisect_right
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Ints
from gcode2krl.gcode import findings
from gcode2krl.gcode import program_tables as tables
from gcode2krl.gcode.o_words import COMMENTS_TO_END, Definition

_BLANKS = rb"[ \t\r]*"
_HEAD = _BLANKS + rb"(?P<deleted>/\d?)?" + _BLANKS + rb"(?:N[ \t]*\d[\d \t]*)?" + _BLANKS


def _spaced(word: str) -> bytes:
    return _BLANKS.join(bytes([c]) for c in word.encode())


_STATEMENTS = {
    "goto": re.compile(_HEAD + _spaced("goto"), re.IGNORECASE),
    "if": re.compile(_HEAD + _spaced("if") + rb"(?=" + _BLANKS + rb"\[)", re.IGNORECASE),
    "while": re.compile(_HEAD + _spaced("while") + rb"(?=" + _BLANKS + rb"\[)", re.IGNORECASE),
    "do": re.compile(
        _HEAD + _spaced("do") + _BLANKS + rb"(?P<number>\d+)" + COMMENTS_TO_END, re.IGNORECASE | re.DOTALL
    ),
    "end": re.compile(
        _HEAD + _spaced("end") + _BLANKS + rb"(?P<number>\d+)" + COMMENTS_TO_END, re.IGNORECASE | re.DOTALL
    ),
    "program": re.compile(
        _HEAD + rb"[O:]" + _BLANKS + rb"(?P<number>\d+)" + COMMENTS_TO_END, re.IGNORECASE | re.DOTALL
    ),
}
_DO = re.compile(
    rb"\]" + _BLANKS + _spaced("do") + _BLANKS + rb"(\d+)" + COMMENTS_TO_END, re.IGNORECASE | re.DOTALL
)
_NUMBERED = re.compile(rb"^[ \t\r]*(?:/\d?)?[ \t\r]*N[ \t]*(\d[\d \t]*)", re.MULTILINE | re.IGNORECASE)
_MOST_NUMBER = 10**9
_LOOP_NUMBERS = ("1", "2", "3")


class MacroLine(NamedTuple):
    """What a line says."""

    word: str
    """goto, if, while, do, end or program; empty for what is no statement."""
    number: str
    """Of DO, END or a program, without leading zeros."""
    behind: int
    """Bytes before its expressions."""
    deleted: bool


def parsed(line: bytes) -> MacroLine:
    """Return what a line says, without its expressions."""
    for word, pattern in _STATEMENTS.items():
        match = pattern.match(line)
        if match is None:
            continue
        number = match["number"] if "number" in pattern.groupindex else None
        if word == "while":
            loop = _DO.search(line)
            number = loop[1] if loop is not None else b"0"
        return MacroLine(word, str(int(number or b"0")), match.end(), match["deleted"] is not None)
    slash = line.lstrip(b" \t\r").startswith(b"/")
    return MacroLine("", "", 0, slash)


class _Open(NamedTuple):
    number: str
    row: int


class MacroFlow:
    """Fills in the statements of one file."""

    def __init__(self, lines: NDArray[Any], word_of_row: Ints, first_word: int, *, at_start: bool) -> None:
        """Take the marked lines, the word at which each begins, and the file's first word.

        ``at_start``: the file is the main program and is read from its beginning.
        """
        self.lines, self.word_of_row = lines, word_of_row
        self.definitions: list[Definition] = []
        self.segments = [first_word]
        """Words at which a program of the file begins."""
        self.loops: list[tuple[int, int]] = []
        """First and last word of each loop."""
        self._open: list[_Open] = []
        self._at_start = at_start

    def add(self, row: int, line: MacroLine) -> None:
        """Take the line of a row, in the order of the file."""
        self.lines["expression"][row] = self.lines["start"][row] + line.behind
        self.lines["segment"][row] = len(self.segments) - 1
        match line.word:
            case "goto":
                self._set(row, tables.KIND_GOTO)
            case "if":
                self._set(row, tables.KIND_MACRO_IF)
            case "while":
                self._begin(row, line.number, tables.KIND_MACRO_WHILE)
            case "do":
                self._begin(row, line.number, tables.KIND_NOTHING)
            case "end":
                self._end(row, line.number)
            case "program":
                self._program(row, line.number)
            case _:
                self._fault(row, findings.PF.FAULT_STATEMENT)

    def finish(self) -> None:
        """Whatever is open at the end of the file has no end."""
        for loop in self._open:
            self._fault(loop.row, findings.PF.FAULT_DO_OPEN)
        self._open.clear()

    def _set(self, row: int, kind: int, target: int = -1) -> None:
        self.lines["kind"][row] = kind
        self.lines["target"][row] = target

    def _fault(self, row: int, fault: int) -> None:
        self._set(row, tables.KIND_FAULT)
        self.lines["fault"][row] = fault

    def _word(self, row: int) -> int:
        return int(self.word_of_row[row])

    def _begin(self, row: int, number: str, kind: int) -> None:
        self._set(row, kind)
        if number not in _LOOP_NUMBERS:
            self._fault(row, findings.PF.FAULT_DO_NUMBER)
            return
        if any(each.number == number for each in self._open):
            self._fault(row, findings.PF.FAULT_DO_OPEN)
            return
        self._open.append(_Open(number, row))

    def _end(self, row: int, number: str) -> None:
        if not self._open or self._open[-1].number != number:
            self._fault(row, findings.PF.FAULT_END_ALONE)
            return
        begin = self._open.pop().row
        self._set(row, tables.KIND_JUMP, self._word(begin))
        self.lines["target"][begin] = self._word(row) + 1
        self.loops.append((self._word(begin), self._word(row)))

    def _program(self, row: int, number: str) -> None:
        self.finish()
        is_head = self._at_start and not self.definitions and self._is_first(row)
        self.definitions.append(Definition(number, self._word(row) + 1, is_program=True))
        if is_head:
            self._set(row, tables.KIND_NOTHING)
            return
        self._fault(row, findings.PF.FAULT_NEXT_PROGRAM)
        self.segments.append(self._word(row))

    def _is_first(self, row: int) -> bool:
        """Tell whether nothing but a tape mark stands before the line of a row."""
        return self._word(row) - self.segments[0] <= 1


def labels_of(
    text: bytes, first_line: int, line_of_word: Ints, first_word: int, flow: MacroFlow, before: int
) -> NDArray[Any]:
    """Return the numbered lines of a file as rows of `program_tables.LABEL`.

    ``line_of_word`` are the lines of all words, those of the file from ``first_word`` on; ``before`` segments
    are those of earlier files.
    """
    numbers, lines, line, place = [], [], first_line, 0
    for match in _NUMBERED.finditer(text):
        line += text.count(b"\n", place, match.start())
        place = match.start()
        number = int(re.sub(rb"[ \t]", b"", match[1]))
        if number < _MOST_NUMBER:
            numbers.append(number)
            lines.append(line)
    words = first_word + np.searchsorted(line_of_word[first_word:], np.array(lines, np.int64))
    rows = np.zeros(len(numbers), tables.LABEL)
    rows["number"], rows["word"] = numbers, words
    rows["segment"] = before + np.searchsorted(flow.segments, words, side="right") - 1
    rows["loop_first"] = rows["loop_last"] = -1
    loops = sorted(flow.loops)
    firsts = [first for first, _ in loops]
    for row in rows if loops else ():
        word = int(row["word"])
        for first, last in reversed(loops[: bisect_right(firsts, word)]):
            if word <= last:
                row["loop_first"], row["loop_last"] = first, last
                break
    return rows
