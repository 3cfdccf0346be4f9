"""``--from-line``: what the commands share for a program that begins at a later G-code line."""

import math
import re
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gcode2krl.errors import input_error

if TYPE_CHECKING:
    from gcode2krl.tables import Toolpath

_RESTART = re.compile(rb"^; \*\* RESTART AT G-CODE LINE (\d+)", re.MULTILINE)
_HEAD_BYTES = 10_000
from_line_option = click.option(
    "--from-line",
    type=click.IntRange(1, 10**9),
    metavar="LINE",
    help="Begin at this G-code line, as after a broken cutter.",
)


def refuse_other_start(program: str, from_line: int | None) -> None:
    """Raise where a program says that it is a restart, and ``--from-line`` does not name its line.

    A file that cannot be read is left to whoever reads it.
    """
    try:
        with Path(program).open("rb") as file:
            restart = _RESTART.search(file.read(_HEAD_BYTES))
    except OSError:
        return
    if restart and int(restart[1]) != from_line:
        line = int(restart[1])
        sentence = f"the program is a restart: it begins at G-code line {line}"
        raise input_error("option-value", sentence, f"--from-line {line}", source=program)


def restart_words(toolpath: "Toolpath") -> list[str]:
    """Return the lines of the summary about a restart."""
    if toolpath.restart is None:
        return []
    from gcode2krl.restart.rows import restart_record

    record = restart_record(toolpath)["restart"]
    line = f"from line {toolpath.restart.line}, begins with the move of line {record['begins_line']}"
    way = record["way_mm"]
    x, y, z = way[0]
    down = (
        ""
        if len(way) < 2
        else f", down the tool axis to Z {way[-1][2]:g}, the last {_feed_mm(way):g} mm at feed"
    )
    return [
        f"  restart    {line}; the part must be cut up to there",
        f"  in force   {record['in_force'] or 'nothing'}; comes in above X {x:g} Y {y:g} Z {z:g}{down}",
    ]


def _feed_mm(way_mm: list[list[float]]) -> float:
    return round(math.dist(way_mm[-2], way_mm[-1]), 3)
