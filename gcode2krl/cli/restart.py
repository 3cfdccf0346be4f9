"""``--from-line``: what the commands share for a program that begins at a later G-code line."""

import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gcode2krl.cli.console import Console
from gcode2krl.cli.inputs import STANDARD, read_part
from gcode2krl.errors import input_error

if TYPE_CHECKING:
    from gcode2krl.cell import Cell
    from gcode2krl.tables import Toolpath

_RESTART = re.compile(rb"^; \*\* RESTART AT G-CODE LINE (\d+)", re.MULTILINE)
_HEAD_BYTES = 10_000
from_line_option = click.option(
    "--from-line",
    type=click.IntRange(1, 10**9),
    metavar="LINE",
    help="Begin at this G-code line, as after a broken cutter.",
)


def refuse_without_forces(from_line: int | None, no_forces: bool) -> None:
    """Raise where a restart is wanted without the material removal that judges it."""
    if from_line is not None and no_forces:
        sentence = "--from-line needs the material as cut so far, which --no-forces leaves out"
        raise input_error("option-value", sentence, "leave out --no-forces")


def restart_name(
    part: str, name: str | None, output: str | None, from_line: int | None, cell: "Cell"
) -> str | None:
    """Return the name of the program: ``part_from4812`` for a restart, where nothing names it."""
    into_folder = output is None or (output not in ("", STANDARD) and Path(output).is_dir())
    if from_line is None or name is not None or part == STANDARD or not (into_folder or output == STANDARD):
        return name
    from gcode2krl.krl.names import name_problem, suggested_name
    from gcode2krl.krl_words import LONGEST_NAME

    externals, suffix = cell.program.externals, f"_from{from_line}"
    whole = f"{Path(part).stem}{suffix}"
    if not name_problem(whole, externals):
        return whole
    stem = suggested_name(Path(part).stem, externals)[: LONGEST_NAME - len(suffix)]
    return suggested_name(f"{stem}{suffix}", externals)


def read_restarted(
    part: str,
    cell: "Cell",
    console: Console,
    chord_tolerance_mm: float,
    block_delete: bool,
    tolerance_mm: float | None,
    from_line: int | None,
) -> "Toolpath":
    """Read the G-code of a command, from a line on where one is named."""
    toolpath = read_part(part, cell, console, chord_tolerance_mm, block_delete)
    if from_line is None:
        return toolpath
    from gcode2krl.restart import restarted

    with console.stage("cutting the lines before"):
        return restarted(toolpath, from_line, cell, tolerance_mm)


def refuse_other_start(program: str, from_line: int | None) -> None:
    """Raise where a program says that it is a restart, and ``--from-line`` does not name its line.

    A file that cannot be read is left to whoever reads it.
    """
    try:
        with Path(program).open("rb") as file:
            found = _RESTART.search(file.read(_HEAD_BYTES))
    except OSError:
        return
    if found and int(found[1]) != from_line:
        line = int(found[1])
        sentence = f"the program is a restart: it begins at G-code line {line}"
        raise input_error("option-value", sentence, f"--from-line {line}", source=program)


def restart_record(toolpath: "Toolpath") -> dict[str, Any]:
    """Return what ``--json`` says of a restart, empty where the program runs from its start."""
    restart = toolpath.restart
    if restart is None:
        return {}
    from gcode2krl.program import state_words

    way_mm = toolpath.position_mm[1 : restart.way_rows + 1]
    record = {
        "line": restart.line,
        "begins_line": restart.begins_line,
        "in_force": state_words(toolpath),
        "way_mm": [[round(float(value), 3) for value in point] for point in way_mm],
    }
    return {"restart": record}


def restart_words(toolpath: "Toolpath") -> list[str]:
    """Return the lines of the summary about a restart."""
    if toolpath.restart is None:
        return []
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
