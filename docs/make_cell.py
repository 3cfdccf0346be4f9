"""Write the tables of keys in docs/cell.md from ``gcode2krl/cell/descriptions.toml`` and the cell's sections.

python docs/make_cell.py
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from gcode2krl.cell.definition import Cell
from gcode2krl.cell.descriptions import descriptions_of, sections_in
from gcode2krl.cell.ranges import all_ranges, general
from gcode2krl.cell.sections import Frame, Provenance
from gcode2krl.cell.setup.cell_text import toml_value

PAGE = Path(__file__).with_name("cell.md")
BEGIN, END = "<!-- keys: made by docs/make_cell.py -->\n", "<!-- end of keys -->\n"
_NAMED = {"tool": ".<number>", "compliance.virtual_joints": ".<name>"}
"""Tables of tables: what stands behind the name of the first."""
_FRAME, _VALUES = "A frame", "A table with `source`"
_TITLES = {"": "The cell", _FRAME: _FRAME, _VALUES: _VALUES}
_LISTS = (
    "effects",
    "guard_inputs",
    "online.axis_gains",
    "obstacle",
    "robot.body.capsules",
    "spindle.body.capsules",
)
"""Tables of which a file may have several."""
_ONCE = ("source", "sure")
"""Keys of many tables, listed once."""


def page() -> str:
    """Return the page with its tables made anew."""
    head, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
    return f"{head}{BEGIN}\n{tables()}{END}{rest.split(END)[1]}"


def tables() -> str:
    """Return all tables: the cell itself, then each section under its name in the file."""
    return "".join(_table(place, section) for place, section in _places())


def _places() -> Iterator[tuple[str, type[BaseModel]]]:
    """Yield (name in the file, section) of the cell and of each table in it."""
    yield "", Cell
    yield from _below("", Cell)
    yield _FRAME, Frame
    yield _VALUES, Provenance


def _below(place: str, section: type[BaseModel]) -> Iterator[tuple[str, type[BaseModel]]]:
    for key in descriptions_of(section):
        for child in dict.fromkeys(sections_in(section.model_fields[key].annotation)):
            if child is not Frame:
                name = f"{place}.{key}" if place else key
                name += _NAMED.get(name, "")
                yield name, child
                yield from _below(name, child)


def _table(place: str, section: type[BaseModel]) -> str:
    is_list = place in _LISTS
    title = _TITLES.get(place) or (f"`[[{place}]]`" if is_list else f"`[{place}]`")
    keys = [key for key in descriptions_of(section) if key not in _ONCE or place in (_VALUES, "effects")]
    rows = [_row(place, section, key) for key in keys]
    head = "| key | unit | meaning | default | usual | example |\n| --- | --- | --- | --- | --- | --- |\n"
    return f"### {title}\n\n{head}{''.join(rows)}\n"


def _row(place: str, section: type[BaseModel], key: str) -> str:
    known = descriptions_of(section)[key]
    example = f"`{toml_value(known.example)}`" if known.example is not None else ""
    cells = (f"`{key}`", known.unit, known.text, _default(section, key), _usual(place, key), example)
    return "| " + " | ".join(cell.replace("|", "\\|").replace("<", "&lt;") for cell in cells) + " |\n"


def _default(section: type[BaseModel], key: str) -> str:
    default: Any = section.model_fields[key].default
    if (
        default is None
        or default is PydanticUndefined
        or isinstance(default, BaseModel)
        or default in ("", ())
    ):
        return ""
    is_plain = not isinstance(default, tuple) or not isinstance(default[0], BaseModel)
    return f"`{toml_value(list(default) if isinstance(default, tuple) else default)}`" if is_plain else ""


def _usual(place: str, key: str) -> str:
    """Return the usual range of a physical key; beyond it there is a warning."""
    name = re.sub(r"<\w+>", "1", f"{place}.{key}" if place else key)
    known = all_ranges().get(general(name))
    if known is None:
        return ""
    low, high = known.plausible
    return f"{low:g} to {high:g}" if high < 1e300 else f"from {low:g}"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8", newline="\n")
