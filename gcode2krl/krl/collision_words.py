"""Comment lines of a program's header: what was checked for collisions, and what was not."""

import textwrap
from collections.abc import Iterable

from gcode2krl.cell.checked_parts import CollisionScope
from gcode2krl.krl.statements import ascii_text

_WIDTH = 76


def collision_lines(scope: CollisionScope, *, is_corrected: bool) -> list[str]:
    """Return the lines; ``is_corrected`` where the program is corrected online."""
    unchecked = [*scope.unchecked, *(["the path as it is corrected online"] if is_corrected else [])]
    return [
        *_wrapped("COLLISIONS CHECKED, from HOME to HOME: ", scope.movers),
        *_wrapped("  against: ", scope.obstacles or ("nothing that the cell states",)),
        *_wrapped("NOT CHECKED for collisions: ", unchecked),
    ]


def _wrapped(head: str, words: Iterable[str]) -> list[str]:
    text = ascii_text(head.rstrip() + " " + "; ".join(words), 2000)
    indent = "  " if head.startswith("  ") else ""
    return textwrap.wrap(
        text, _WIDTH, initial_indent=indent, subsequent_indent=indent + "  ", break_on_hyphens=False
    )
