"""Values of a KRL data list (``$config.dat``, ``$machine.dat``): assignments, read line by line.

``TOOL_DATA[1]={X 0.0,Y 0.0,…} ; comment`` becomes ``{"TOOL_DATA[1]": {"X": 0.0, "Y": 0.0, …}}``. Names are
in capitals, as KRL does not tell them apart. What is not such an assignment is passed over.
"""

import re
from collections.abc import Mapping
from typing import Union

Value = Union[float, bool, str, "Mapping[str, Value]"]

_MOST_LEVELS = 8
"""The deepest structure of a controller's data has 3."""
_ASSIGNMENT = re.compile(
    r"[ \t]*(?:[A-Za-z]\w{0,39}[ \t]+){0,4}(\$?[A-Za-z_]\w{0,39})[ \t]*(\[[\d, \t]{0,16}\])?[ \t]*=[ \t]*"
)
_NAME = re.compile(r"[ \t]*([A-Za-z_]\w{0,39})(?:\[[\d, ]{0,8}\])?[ \t]+")
_TYPE = re.compile(r"[ \t]*\w{1,40}[ \t]*:")
_TEXT = re.compile(r'"([^"]*)"')
_PLAIN = re.compile(r"[^,}; \t\r\n]+")


def krl_values(text: str) -> dict[str, Value]:
    """Return name → value of the assignments in a data list; of a name that is set twice the last counts."""
    values: dict[str, Value] = {}
    for line in text.splitlines():
        match = _ASSIGNMENT.match(line)
        if match is None:
            continue
        value, _ = _value(line, match.end(), 0)
        if value is not None:
            values[f"{match[1]}{(match[2] or '').replace(' ', '')}".upper()] = value
    return values


def _value(line: str, at: int, level: int) -> tuple[Value | None, int]:
    """Return the value that begins at a place, and where it ends; None where there is none."""
    if line.startswith("{", at) and level < _MOST_LEVELS:
        return _structure(line, at + 1, level)
    text = _TEXT.match(line, at)
    if text is not None:
        return text[1].strip(), text.end()
    plain = _PLAIN.match(line, at)
    return (_plain(plain[0]), plain.end()) if plain is not None else (None, at)


def _structure(line: str, at: int, level: int) -> tuple[Value | None, int]:
    """Read ``X 1.0,CM {…}}`` behind the opening brace; ``{E6AXIS: A1 …}`` may name its type first."""
    members: dict[str, Value] = {}
    kind = _TYPE.match(line, at)
    at = kind.end() if kind is not None else at
    while True:
        name = _NAME.match(line, at)
        if name is None:
            return None, at
        value, at = _value(line, name.end(), level + 1)
        if value is None:
            return None, at
        members[name[1].upper()] = value
        while line.startswith((" ", "\t"), at):
            at += 1
        if line.startswith("}", at):
            return members, at + 1
        if not line.startswith(",", at):
            return None, at
        at += 1


def _plain(word: str) -> Value:
    if word.upper() in ("TRUE", "FALSE"):
        return word.upper() == "TRUE"
    try:
        return float(word)
    except ValueError:
        return word
