"""A cell on one line, and as a notebook shows it."""

from collections.abc import Mapping, Sequence

from gcode2krl.exchange.html import block, text_table

_MOST_LETTERS = 40
"""Of a name on one line."""


def cell_words(name: str, robot: str, tools: int, is_confirmed: bool) -> str:
    """Return ``my cell: KR 300 R2500 ultra, 3 tools, not verified``."""
    facts = [robot[:_MOST_LETTERS] or "no robot", f"{tools} tool{'' if tools == 1 else 's'}"]
    facts.append("verified" if is_confirmed else "not verified")
    return f"{name[:_MOST_LETTERS] or 'without a name'}: {', '.join(facts)}"


def cell_html(title: str, facts: Mapping[str, object], tools: Mapping[int, Sequence[object]]) -> str:
    """Return the facts of a cell and its tools (model, diameter, teeth, length) as HTML."""
    rows = [(name, "not stated" if value is None or value == "" else value) for name, value in facts.items()]
    listed = [
        (f"T{number}", *("" if value is None else value for value in tool)) for number, tool in tools.items()
    ]
    head = ("tool", "model", "diameter (mm)", "teeth", "length (mm)")
    return block(title, text_table((), rows), text_table(head, listed) if listed else "")
