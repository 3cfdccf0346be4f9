"""A program that begins at a later G-code line: its options, its name, its record."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gcode2krl.errors import input_error
from gcode2krl.files.program_names import DIALECT_NAMES, program_stem
from gcode2krl.progress import Begin, unseen
from gcode2krl.translation.inputs import STANDARD, StandardInput, read_part

if TYPE_CHECKING:
    from gcode2krl.cell import Cell
    from gcode2krl.tables import Toolpath


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
    whole = f"{program_stem(part)}{suffix}"
    if not name_problem(whole, externals):
        return whole
    stem = suggested_name(program_stem(part), externals)[: LONGEST_NAME - len(suffix)]
    return suggested_name(f"{stem}{suffix}", externals)


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


def read_from_line(
    part: str,
    cell: "Cell",
    chord_tolerance_mm: float,
    block_delete: bool,
    tolerance_mm: float | None,
    from_line: int | None,
    begin: Begin = unseen,
    standard: StandardInput | None = None,
    dialect: str = DIALECT_NAMES[0],
    search: Sequence[str | Path] = (),
) -> "Toolpath":
    """Read G-code, from a line on where one is named; see `inputs.read_part`."""
    toolpath = read_part(part, cell, chord_tolerance_mm, block_delete, begin, standard, dialect, search)
    if from_line is None:
        return toolpath
    from gcode2krl.restart import restarted

    begin("cutting the lines before")
    return restarted(toolpath, from_line, cell, tolerance_mm)
