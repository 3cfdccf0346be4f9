"""Calls that give fewer arguments than their subprogram reads, or more.

What is read and not given is noted while the program runs (``native/gcode/parameters.c:note_argument``), as a
subprogram may ask first; not on a Fanuc, where an argument that is not passed leaves its word out, and macros
are written for that. What is given and never read is looked for in the text of the subprogram: a branch that
this program does not take may read it.
"""

import re
from collections.abc import Iterable
from typing import Any

from gcode2krl.errors import Issue
from gcode2krl.gcode.o_words import Label, parsed

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


def unread(given: int, body: Iterable[bytes], *, of_fanuc: bool) -> int:
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
        for found in _PARAMETER.finditer(code):
            if found["number"] is None:
                if code.startswith(b"<", found.end()):
                    continue
                return 0  # its number is computed
            number = int(re.sub(rb"\s", b"", found["number"]))
            if number > _MOST:
                continue
            if found["sets"]:
                sets |= 1 << number
            elif not assigned >> number & 1:
                arguments |= 1 << number
        assigned |= sets if depth == 0 and not of_fanuc else 0
        if word == "endsub":
            break
    return given & ~arguments & _ALL
