"""``gcode2krl translate part.nc -o part.src``, the default command."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from gcode2krl.cli.console import Console, issue_dicts
from gcode2krl.cli.help_examples import examples
from gcode2krl.cli.inputs import (
    STANDARD,
    cell_files,
    common_options,
    existing,
    files_of_job,
    gcode_options,
    job_option,
    read_cell_under_job,
    require_figure,
    require_outputs,
    require_part,
)
from gcode2krl.cli.report import report_refused, report_written, require_report
from gcode2krl.cli.restart import (
    from_line_option,
    read_restarted,
    refuse_without_forces,
    restart_name,
    restart_record,
    restart_words,
)
from gcode2krl.cli.standard_files import write_bytes
from gcode2krl.errors import Gcode2KrlError, Issue, input_error

if TYPE_CHECKING:
    from gcode2krl.cell import Cell
    from gcode2krl.krl import WrittenProgram
    from gcode2krl.prediction import Prediction
    from gcode2krl.prediction.forecast import Forecast
    from gcode2krl.tables import Targets, Toolpath


@click.command(
    "translate",
    epilog=examples(
        "gcode2krl part.nc -o part.src",
        "gcode2krl part.nc --cell cell.toml -o part.src --tolerance 0.05",
        "cat part.nc | gcode2krl - -o - --name PART > part.src",
        "gcode2krl part.nc --cell cell.toml --compensate offline --json",
    ),
)
@click.argument("part")
@click.option(
    "-o",
    "--output",
    metavar="PART.src",
    help="Output, or its folder; default: beside the input. - is stdout.",
)
@common_options
@gcode_options
@job_option
@click.option("--name", help="Program name, where -o names no file; a controller needs both alike.")
@click.option(
    "--allow",
    multiple=True,
    metavar="CODE[:LINE]",
    help="Allow one finding, or all of a code; may be repeated.",
)
@click.option("--strict", is_flag=True, help="Warnings refuse the program too.")
@click.option("--no-guard", is_flag=True, help="Leave out the checks at the program's start.")
@click.option(
    "--split",
    type=click.Choice(["defs", "files"]),
    default="defs",
    show_default=True,
    help="How a long program is split.",
)
@click.option("--max-lines", type=click.IntRange(100), help="Motions in a part; default: the cell's.")
@click.option(
    "--compensate", type=click.Choice(["offline"]), help="Move the targets against the predicted deflection."
)
@click.option("--compensate-plot", metavar="FIGURE.png", help="Draw the path before and after it.")
@click.option(
    "--no-forces", is_flag=True, help="Leave out material removal, forces, deflection and their findings."
)
@click.option(
    "--pilot",
    type=click.Choice(["index", "values", "none"]),
    help="How the program carries the pilot force; default: the cell's, none on standard output.",
)
@click.option(
    "--online",
    metavar="NAME",
    help="Correct online by RSI: switch it in the program, write NAME.rsi.xml and NAME_ETH.xml beside it.",
)
@click.option(
    "--both", is_flag=True, help="--online on top of --compensate offline: the server knows of the offset."
)
@click.option("--report", metavar="PART.html", help="Write a page to look at, also of a refused program.")
@click.option(
    "--comment-every", type=click.IntRange(0, 10**9), help="Motions between comments with the G-code line."
)
@from_line_option
# each branch is one of the options, in the order in which they are refused or done
def command(
    part: str,
    output: str | None,
    cell_path: str | None,
    as_json: bool,
    quiet: bool,
    verbose: bool,
    tolerance: float | None,
    chord_tolerance: float,
    block_delete: bool,
    job_path: str | None,
    name: str | None,
    allow: tuple[str, ...],
    strict: bool,
    no_guard: bool,
    split: Literal["defs", "files"],
    max_lines: int | None,
    no_forces: bool,
    compensate: Literal["offline"] | None,
    compensate_plot: str | None,
    pilot: Literal["index", "values", "none"] | None,
    online: str | None,
    both: bool,
    comment_every: int | None,
    from_line: int | None,
    report: str | None,
) -> int:
    """Translate G-code into a KRL program, verify it, and print a summary.

    Exit code 0: written (warnings allowed); 1: understood and refused; 2: not understood.
    """
    console = Console(quiet or output == STANDARD, as_json)
    toolpath: Toolpath | None = None
    cell: Cell | None = None
    try:
        if as_json and output == STANDARD:
            raise input_error("option-value", "--json and -o - both claim standard output", "choose one")
        require_part(part)
        place = _place(part, output, name)
        _refuse_online(online, both, compensate, place)
        refuse_without_forces(from_line, no_forces)
        own_cell, of_job = read_cell_under_job(cell_path, job_path)
        cell = _with_options(own_cell, max_lines, comment_every)
        name = restart_name(part, name, output, from_line, cell)
        inputs = existing(part, *cell_files(cell_path), *files_of_job(job_path))
        require_figure(compensate_plot)
        require_report(report, inputs)
        require_outputs(_outputs(place, name, part, cell, online, compensate_plot, report), *inputs)
        from gcode2krl.compiled.long_columns import long_columns_on_disk

        click.get_current_context().with_resource(long_columns_on_disk())
        toolpath = read_restarted(part, cell, console, chord_tolerance, block_delete, tolerance, from_line)
        toolpath = replace(toolpath, issues=(*toolpath.issues, *of_job))
        from gcode2krl.cell.confirmation import future_confirmation
        from gcode2krl.compiled.memory import give_back
        from gcode2krl.files.spool import on_disk
        from gcode2krl.krl import suggested_name, write_krl
        from gcode2krl.pipeline import (
            corner_errors,
            forecast_of,
            forecast_toolpath,
            predict_toolpath,
            solve_joints,
            targets_and_joints,
        )

        options = _words(
            tolerance=tolerance,
            chord_tolerance=chord_tolerance,
            block_delete=block_delete,
            job=Path(job_path).name if job_path is not None else None,
            spin=cell.frames.spin,
            compensate=compensate,
            online=online,
            both=both,
            from_line=from_line,
        )
        if place is None and name is None and part != STANDARD:
            name = suggested_name(Path(part).stem, cell.program.externals)
        with console.stages() as begin:
            begin("planning")
            targets, joints = targets_and_joints(toolpath, cell, tolerance)
            errors_mm, corner_issues = corner_errors(toolpath, targets, cell, tolerance)
            corner_mm = float(errors_mm.max(initial=0.0))
            del errors_mm
            dated = future_confirmation(cell)
            targets = replace(targets, issues=(*targets.issues, *corner_issues, *dated))
            _refuse_early(targets, cell, allow, online)
            toolpath, joints = on_disk(toolpath), on_disk(joints)
            give_back()
            prediction: Prediction | None = None
            if compensate == "offline" or report is not None:  # they need whole tables
                prediction = predict_toolpath(
                    toolpath, cell, targets=targets, forces=not no_forces, begin=begin
                )
            if compensate == "offline" and prediction is not None:
                from gcode2krl.cli.compensation import compensated

                begin("compensation")
                prediction = compensated(prediction, compensate_plot, inputs)
                joints = solve_joints(prediction.targets, cell)
            if prediction is not None:
                forecast = forecast_of(prediction)
            else:
                forecast = forecast_toolpath(toolpath, cell, targets, forces=not no_forces, begin=begin)
            give_back()
            begin("writing and reading back")
            written = write_krl(
                forecast,
                place,
                joints=joints,
                name=name,
                allow=allow,
                guard=not no_guard,
                split=split,
                options=options,
                strict=strict,
                pilot=pilot,
                online=online,
                inputs=inputs,
            )
            if prediction is not None:
                report_written(report, part, prediction, written.issues, inputs, console)
    except Gcode2KrlError as error:
        report_refused(report, part, error, toolpath, cell, cell_path, console)
        if not as_json:
            raise _from_part(error, part) from None
        console.json(_result((), error.issues))
        return error.exit_code
    if output == STANDARD:
        for piece in written.contents[f"{written.name}.src"].pieces():
            write_bytes(piece)
        console.findings(written.issues, part)
        return 0
    if as_json:
        figures = _figures(forecast, corner_mm)
        pilot_figures = written.pilot.as_dict() if written.pilot is not None else None
        result = _result(written.files, written.issues, figures, written.report.as_dict(), pilot_figures)
        console.json(result | restart_record(toolpath))
        return 0
    console.findings(written.issues, part)
    from gcode2krl.cli.summary import summary_lines

    for line in summary_lines(part, forecast, joints, corner_mm, written):
        console.say(line)
    for line in restart_words(toolpath):
        console.say(line)
    if online is not None:
        for line in _online_lines(written):
            console.say(line)
    return 0


def _refuse_online(online: str | None, both: bool, compensate: str | None, file: Path | None) -> None:
    """Raise where ``--online`` is not possible or not allowed with another option."""
    if both and (online is None or compensate is None):
        sentence = "--both: there are no two compensations"
        raise input_error("option-value", sentence, "give --online NAME and --compensate offline too")
    if online is None:
        return
    from gcode2krl.krl.rsi_files import file_names

    file_names(online)
    if file is None:
        sentence = "--online writes RSI files, which standard output cannot carry"
        raise input_error("option-value", sentence, "give -o part.src")
    if compensate == "offline":
        from gcode2krl.compensation.iteration import refuse_twice

        refuse_twice(online=True, both=both)


def _online_lines(written: "WrittenProgram") -> Iterator[str]:
    """Yield what to do with the RSI files."""
    files = " and ".join(file.name for file in written.files if file.suffix == ".xml")
    yield f"  online     {files} belong into SensorInterface; docs/online.md lists what to confirm there"
    pilot = "".join(f" --pilot {file}" for file in written.files if file.suffix == ".csv")
    tool = int(written.targets.tool[~written.targets.home][-1])
    yield f"  server     gcode2krl online serve --tool {tool}{pilot} must listen before RSI_ON"


def _from_part(error: Gcode2KrlError, part: str) -> Gcode2KrlError:
    """Return the error with the part's name where it names no source."""
    if not error.source:
        error.source = part
    return error


def _place(part: str, output: str | None, name: str | None) -> Path | None:
    """Return the file or the folder to write into, None for standard output."""
    if output == STANDARD:
        return None
    if output == "":
        raise input_error("option-value", "-o: the name is empty", "give -o part.src")
    if part == STANDARD and output is None:
        raise input_error("option-value", "standard input needs an output", "give -o part.src, or -o -")
    place = Path(output) if output is not None else Path(part).parent
    if part == STANDARD and name is None and place.is_dir():
        raise input_error("option-value", "standard input has no name", "give -o part.src, or --name PART")
    return place


def _outputs(
    place: Path | None, name: str | None, part: str, cell: "Cell", online: str | None, *more: str | None
) -> list[Path]:
    """Return the files to write, without the parts of a long program; raises where a name is bad."""
    from gcode2krl.krl import output_files, program_file

    outputs = [Path(file) for file in more if file is not None]
    if place is not None:
        file, _ = program_file(place, name, part, cell.program.externals)
        outputs += output_files(file, online)
    return outputs


def _with_options(cell: "Cell", max_lines: int | None, comment_every: int | None) -> "Cell":
    given = {"max_lines": max_lines, "comment_every": comment_every}
    program = cell.program.model_copy(
        update={key: value for key, value in given.items() if value is not None}
    )
    return cell.model_copy(update={"program": program})


def _words(**options: Any) -> str:
    return " ".join(
        f"{key}={value:g}" if isinstance(value, float) else f"{key}={value}"
        for key, value in options.items()
        if value not in (None, False)
    )


def _refuse_early(targets: "Targets", cell: "Cell", allow: tuple[str, ...], online: str | None) -> None:
    """Refuse targets that cannot move, or not be corrected online, before their motion is planned."""
    from gcode2krl.krl.release import matching, released
    from gcode2krl.krl.rsi_refusals import online_issues

    issues = [*targets.issues, *(online_issues(targets, cell) if online is not None else ())]
    if any(issue.severity == "error" for issue in issues):
        released(issues, matching(issues, allow))


def _figures(forecast: "Forecast", corner_mm: float) -> dict[str, Any]:
    """Return the figures of the JSON contract that the stages compute."""
    loads = forecast.loads
    return {
        "moves": len(forecast.toolpath) - 1,
        "time_s": forecast.time_s,
        "path_mm": forecast.path_mm,
        "max_force_N": loads.force_N if loads is not None else None,
        "max_deflection_mm": loads.deflection_mm if loads is not None else None,
        "corner_error_mm": corner_mm,
    }


def _result(
    files: tuple[Path, ...],
    issues: tuple[Issue, ...],
    figures: dict[str, Any] | None = None,
    verify: dict[str, Any] | None = None,
    pilot: dict[str, Any] | None = None,
) -> dict[str, Any]:
    """Return the object of the JSON contract; a figure whose stage did not run is null."""
    known = figures or {}
    return {
        "files": [str(file) for file in files],
        "moves": known.get("moves"),
        "time_s": known.get("time_s"),
        "path_mm": known.get("path_mm"),
        "max_force_N": known.get("max_force_N"),
        "max_deflection_mm": known.get("max_deflection_mm"),
        "corner_error_mm": known.get("corner_error_mm"),
        "verify": verify or {"max_deviation_mm": None},
        "pilot": pilot or {"knots": None, "max_error_N": None},
        "issues": issue_dicts(issues),
    }
