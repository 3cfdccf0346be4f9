"""Jumps of a Sinumerik: which line GOTOF, GOTOB and GOTO lead to.

All labels are written out, so all of it is known before the program runs.
"""

import re
from bisect import bisect_right
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Ints
from gcode2krl.gcode import findings
from gcode2krl.gcode import program_tables as tables

_HEAD = rb"[ \t\r]*(?:/\d?)?[ \t\r]*(?:N[ \t]*(?P<block>\d+)[ \t]*)?"
_LABEL = rb"(?P<label>[A-Z_][A-Z0-9_]+)[ \t]*:(?!=)"
_LINE = re.compile(_HEAD + rb"(?:" + _LABEL + rb")?", re.IGNORECASE)
_JUMP = re.compile(
    _HEAD
    + rb"(?:[A-Z_][A-Z0-9_]+[ \t]*:(?!=))?[ \t]*(?:IF\b(?P<test>[^;]*?))?"
    + rb"\bGOTO(?P<way>[FB]?)[ \t]+(?P<target>[A-Z_][A-Z0-9_]+|N\d+)[ \t\r\x1a]*(?:;.*)?\Z",
    re.IGNORECASE | re.DOTALL,
)


class SiemensFlow:
    """Fills in the jumps of one file."""

    def __init__(self, text: bytes, first_line: int, line_of_word: Ints) -> None:
        """Take the text of a program from its first line on, and the line of each of its words."""
        self._words: dict[bytes, list[int]] = {}
        """Words at which the lines of a label or a block number begin, in their order."""
        names, lines = [], []
        for line, content in enumerate(text.split(b"\n"), start=first_line):
            found = _LINE.match(content)
            if found is None:
                continue
            for name in (found["label"], b"N%d" % int(found["block"]) if found["block"] else None):
                if name is not None:
                    names.append(name.upper())
                    lines.append(line)
        words = np.searchsorted(line_of_word, np.array(lines, np.int64)).tolist()
        for name, word in zip(names, words, strict=True):
            self._words.setdefault(name, []).append(word)

    def add(self, lines: NDArray[Any], row: int, word: int, content: bytes) -> None:
        """Take the line of a row; what is no jump stays a block."""
        lines["kind"][row] = tables.KIND_BLOCK
        found = _JUMP.match(content)
        if found is None:
            return
        target = self._target(found["target"].upper(), found["way"].upper(), word)
        if target is None:
            lines["kind"][row], lines["fault"][row] = tables.KIND_FAULT, findings.PF.FAULT_NO_LABEL
            return
        lines["kind"][row] = tables.KIND_JUMP if found["test"] is None else tables.KIND_SIEMENS_IF
        lines["target"][row] = target
        if found["test"] is not None:
            lines["expression"][row] = lines["start"][row] + found.start("test")

    def _target(self, name: bytes, way: bytes, word: int) -> int | None:
        """Return the next line of a name forwards (F), the last one backwards (B), or either."""
        number = re.fullmatch(rb"N(\d+)", name)
        known = self._words.get(b"N%d" % int(number[1]) if number else name, [])
        split = bisect_right(known, word)
        if way != b"B" and split < len(known):
            return known[split]
        return known[split - 1] if way != b"F" and split else None
