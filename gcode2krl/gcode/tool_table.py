"""Tool lengths for G43 and diameters for G41: from a LinuxCNC ``tool.tbl`` in mm, or from the cell."""

import re
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.errors import input_error

if TYPE_CHECKING:  # a cell file costs its library a noticeable start
    from gcode2krl.cell import Cell

_WORD = re.compile(r"([A-Z])\s*([-+]?\d*\.?\d+)", re.IGNORECASE)
_LARGEST_TOOL = 99999


class Tools(NamedTuple):
    """What a program asks of tools, by tool number (t,) in mm; NaN where it is not stated."""

    length_mm: Floats
    diameter_mm: Floats


def tools_from_table(path: str | Path) -> Tools:
    """Return lengths (0 without Z) and diameters from a ``tool.tbl``."""
    try:
        text = Path(path).read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise input_error("file-unreadable", f"cannot read: {error.strerror}", source=str(path)) from None
    lengths: dict[int, float] = {}
    diameters: dict[int, float] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        words = {letter.upper(): float(value) for letter, value in _WORD.findall(line.split(";")[0])}
        if not words:
            continue
        tool = words.get("T", -1.0)
        if not tool.is_integer() or not 0 <= tool <= _LARGEST_TOOL:
            raise input_error(
                "tool-table", "no tool number T", "each line is T… P… Z… D…", line=number, source=str(path)
            )
        lengths[int(tool)] = words.get("Z", 0.0)
        if "D" in words:
            diameters[int(tool)] = words["D"]
    return Tools(_by_number(lengths), _by_number(diameters))


def tools_from_cell(cell: "Cell | None") -> Tools:
    """Return lengths and diameters from a cell."""
    tools = cell.tool if cell is not None else {}
    return Tools(
        _by_number({number: tool.length_mm for number, tool in tools.items() if tool.length_mm is not None}),
        _by_number({number: tool.diameter_mm for number, tool in tools.items()}),
    )


def tools_by_name(cell: "Cell | None") -> dict[str, int]:
    """Return the numbers of the tools that alone have their name, in capitals."""
    tools = cell.tool if cell is not None else {}
    names = [tool.name.upper() for tool in tools.values()]
    return {
        name: number for number, name in zip(tools, names, strict=True) if name and names.count(name) == 1
    }


def _by_number(lengths: dict[int, float]) -> Floats:
    table = np.full(max(lengths, default=0) + 1, np.nan)
    for number, length in lengths.items():
        table[number] = length
    return table
