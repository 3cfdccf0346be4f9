"""What is wrong with an order before its part is read, and the files that it writes."""

from pathlib import Path
from typing import TYPE_CHECKING

from gcode2krl.errors import input_error
from gcode2krl.files.program_names import program_stem
from gcode2krl.translation.inputs import STANDARD
from gcode2krl.translation.order import Order

if TYPE_CHECKING:
    from gcode2krl.cell import Cell
    from gcode2krl.tables import Targets


def place_of(order: Order) -> Path | None:
    """Return the file or the folder to write into, None for standard output."""
    from_standard = str(order.part) == STANDARD
    if order.output is not None and str(order.output) == STANDARD:
        return None
    if order.output == "":
        raise input_error("option-value", "-o: the name is empty", "give -o part.src")
    if from_standard and order.output is None:
        raise input_error("option-value", "standard input needs an output", "give -o part.src, or -o -")
    place = Path(order.output) if order.output is not None else Path(order.part).parent
    if from_standard and order.name is None and place.is_dir():
        raise input_error("option-value", "standard input has no name", "give -o part.src, or --name PART")
    return place


def refuse_online(order: Order, place: Path | None) -> None:
    """Raise where ``--online`` is not possible or not allowed with another option."""
    if order.both and (order.online is None or order.compensate is None):
        sentence = "--both: there are no two compensations"
        raise input_error("option-value", sentence, "give --online NAME and --compensate offline too")
    if order.online is None:
        return
    from gcode2krl.krl.rsi_files import refuse_file_name

    refuse_file_name(order.online)
    if place is None:
        sentence = "--online writes RSI files, which standard output cannot carry"
        raise input_error("option-value", sentence, "give -o part.src")
    if order.compensate == "offline":
        from gcode2krl.compensation.iteration import refuse_twice

        refuse_twice(online=True, both=order.both)


def outputs_of(order: Order, place: Path | None, name: str | None, cell: "Cell") -> list[Path]:
    """Return the files to write, without the parts of a long program; raises where a name is bad."""
    from gcode2krl.krl import output_files, program_file

    outputs = [Path(file) for file in (order.compensate_plot, order.report) if file is not None]
    if place is not None:
        file, _ = program_file(place, name, str(order.part), cell.program.externals)
        outputs += output_files(file, order.online, cell.controller.rsi_version)
    return outputs


def refuse_early(targets: "Targets", cell: "Cell", order: Order) -> None:
    """Refuse targets that cannot move, or not be corrected online, before their motion is planned."""
    from gcode2krl.krl.release import matching, released
    from gcode2krl.krl.rsi_refusals import online_issues
    from gcode2krl.krl.versions import version_issues

    online = order.online is not None
    issues = [*targets.issues, *version_issues(cell), *(online_issues(targets, cell) if online else ())]
    if any(issue.severity == "error" for issue in issues):
        released(issues, matching(issues, order.allow))


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
