"""Bytes to words: the scanner turns a piece of G-code text into columns (``native/gcode/words.c``).

A word is (letter, value, line). Things that are not words travel in the same stream so that their order is
kept: ``$`` (a whole line with an expression or an O-word; value = its number), ``/`` (block delete), ``%``
(tape mark), ``(`` (a message comment; value = its number), ``!`` (something cannot be read; value = number of
the finding, ``extra`` = what was found) and a small letter (a word whose value cannot be read). A line has at
most one ``!`` of its characters; the words around it are still read, so that later mistakes in the line are
found too.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Floats, Ints, Ints32
from gcode2krl.compiled.core import (
    BYTES,
    INT,
    INTS32,
    OUT_BYTES,
    OUT_FLOATS,
    OUT_INTS,
    OUT_INTS32,
    ArrayOf,
    StructOf,
    core_function,
)
from gcode2krl.gcode.dialects import DEFAULT, DIALECTS, Dialect
from gcode2krl.gcode.program_tables import LINE
from gcode2krl.gcode.vocabulary import PROGRAM_LINE

_MOST_EXTRAS = 1024
"""Marks of a piece that keep what was found: only the first findings are ever shown."""
SCAN = StructOf(
    text=BYTES,
    statement_names=BYTES,
    statement_kinds=INTS32,
    syntax=INT,
    letter=OUT_BYTES,
    value=OUT_FLOATS,
    line=OUT_INTS32,
    extra=OUT_FLOATS,
    message_span=OUT_INTS,
    lines=ArrayOf(LINE, written=True),
    whole_program=INT,
    first_line=INT,
    words=INT,
    marks=INT,
    messages=INT,
    program_lines=INT,
    most_decimals=INT,
)
_fill = core_function("gcode_scan", SCAN)


class Words(NamedTuple):
    """Columns of the words of a piece of text, and the spans of its message comments."""

    letter: NDArray[np.uint8]
    value: Floats
    extra: Floats
    line: Ints32
    message_span: Ints
    """(k, 2) start and end byte of each message comment."""
    most_decimals: int
    """Largest number of decimals behind X, Y or Z."""


class Scanner:
    """Scans pieces of text; the words of a piece are overwritten by those of the next."""

    def __init__(self, dialect: Dialect = DIALECTS[DEFAULT]) -> None:
        """Take the dialect of the text."""
        self._syntax, (self._names, self._kinds) = dialect.syntax_bits(), dialect.names()
        self._lines = np.zeros(0, LINE)
        self._reserve(0)

    def _reserve(self, words: int) -> None:
        """Make room; pages that no word reaches cost nothing."""
        self._letter, self._value = np.empty(words, np.uint8), np.empty(words)
        self._line, self._extra = np.empty(words, np.int32), np.empty(_MOST_EXTRAS)

    def scan_whole(self, text: bytes, first_line: int) -> tuple[Words, NDArray[np.void]]:
        """Scan a program that computes or jumps; return its words and its marked lines."""
        self._lines = np.zeros(text.count(b"\n") + 1, LINE)
        words = self.scan(text, first_line, whole_program=True)
        return words, self._lines[: np.count_nonzero(words.letter == PROGRAM_LINE)]

    def scan(self, text: bytes, first_line: int, *, whole_program: bool = False) -> Words:
        """Scan whole lines of text; ``first_line`` is the file line of the first."""
        if len(self._letter) < 2 * len(text):  # a byte makes at most two words
            self._reserve(2 * len(text))
        span = np.empty((text.count(b"("), 2), dtype=np.int64)
        done: Any = SCAN(
            text=np.frombuffer(text, np.uint8),
            statement_names=self._names,
            statement_kinds=self._kinds,
            syntax=self._syntax,
            letter=self._letter,
            value=self._value,
            line=self._line,
            extra=self._extra,
            message_span=span,
            lines=self._lines,
            whole_program=int(whole_program),
            first_line=first_line,
        )
        _fill(done)
        count = done.words
        return Words(
            self._letter[:count],
            self._value[:count],
            self._extra[: done.marks],
            self._line[:count],
            span[: done.messages],
            done.most_decimals,
        )
