"""Comment lines of a program's header: values taken over from other cells, and defaults."""

import textwrap
from collections.abc import Iterator
from typing import Any

from gcode2krl.cell import Cell
from gcode2krl.cell.confirmation import changed_lines
from gcode2krl.krl.statements import ascii_text

_WIDTH = 100
_MOST_OF_A_VALUE = 80
_BRACKETS = str.maketrans('{}"', "()'")
_KEPT = "\x00"
"""Stands for a space at which no line may end."""
_WITHOUT_WORD = frozenset(
    ["program.memory_moves", "program.warn_size_mb", "program.tool_length", "pilot.form"]
)
"""Defaults that are no words of the program, or that its header says elsewhere."""


def provenance_lines(cell: Cell, tools: list[int], pilot: bool, online: bool) -> list[str]:
    """Return the lines: every value taken over from another cell, and the defaults that nobody stated.

    ``tools`` are those of the program; defaults of the pilot force and of the online side are named where the
    program has them.
    """
    lines: list[str] = []
    for source in dict.fromkeys(taken.source for taken in cell.taken_over):
        rows = [taken for taken in cell.taken_over if taken.source == source]
        verified = "verified there" if all(row.verified for row in rows) else "NOT VERIFIED"
        lines.append(f"taken over from {ascii_text(source)} ({verified}):")
        lines += _wrapped(f"{row.key} = {_comment(row.value)}" for row in rows)
    named = list(_defaults(cell, tools, pilot, online))
    if named:
        lines.append("defaults that the cell does not state:")
        lines += _wrapped(named)
    return lines


def unconfirmed_lines(cell: Cell) -> list[str]:
    """Return the lines: what is not as a person confirmed it."""
    lines = changed_lines(cell)
    return [ascii_text(line.replace("…", "...").translate(_BRACKETS), 200) for line in lines]


def _defaults(cell: Cell, tools: list[int], pilot: bool, online: bool) -> Iterator[str]:
    values = default_values(cell)
    for key, value in values.items():
        section, _, name = key.partition(".")
        if (section, False) in (("pilot", pilot), ("online", online)) or key in _WITHOUT_WORD:
            continue
        if section != "tool" or int(name.split(".")[0]) in tools:
            yield f"{key} = {_comment(value)}"


def default_values(cell: Cell) -> dict[str, str]:
    """Return key → value of the documented defaults that nobody stated; what is empty or off is left out."""
    record = cell.model_dump(mode="json")
    hashes = {}
    for key in cell.defaults:
        value: Any = record
        for step in key.split("."):
            value = value[step]
        if key.endswith(".axis"):
            value = "+z"
        whose = " (library)" if key.endswith(".length_mm") else ""
        if value not in ("", [], None) and value is not False:
            hashes[key] = f"{value}{whose}"
    return hashes


def _comment(value: str) -> str:
    """Return a value as it may stand in a comment of KRL; names in templates stand between < and >."""
    plain = value.replace("{{", "<").replace("}}", ">").translate(_BRACKETS)
    return ascii_text(plain if len(plain) <= _MOST_OF_A_VALUE else plain[: _MOST_OF_A_VALUE - 3] + "...", 200)


def _wrapped(words: "Iterator[str] | list[str]") -> list[str]:
    """Return lines of whole words ``key = value``, where they fit on one."""
    text = "; ".join(word.replace(" ", _KEPT) for word in words)
    lines = textwrap.wrap(text, _WIDTH, break_long_words=True, break_on_hyphens=False)
    return [f"  {line.replace(_KEPT, ' ')}" for line in lines]
