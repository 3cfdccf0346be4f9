"""``carry_out``: from an order to a written program, stage by stage."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from gcode2krl.errors import Gcode2KrlError, Issue, input_error
from gcode2krl.files.program_names import DIALECT_NAMES, program_stem
from gcode2krl.progress import Begin, unseen
from gcode2krl.translation.attempt import Attempt
from gcode2krl.translation.inputs import (
    STANDARD,
    StandardInput,
    cell_files,
    existing,
    files_of_job,
    read_cell_under_job,
    read_from_line,
    require_part,
)
from gcode2krl.translation.order import Order
from gcode2krl.translation.outputs import require_figure, require_outputs
from gcode2krl.translation.page import (
    can_be_written,
    require_report,
    write_page_of_refused,
    write_page_of_written,
)

if TYPE_CHECKING:
    from gcode2krl.cell import Cell
    from gcode2krl.tables import Targets


# What is wrong with an order before its part is read, and the files that it writes.


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


if TYPE_CHECKING:
    from gcode2krl.cell import Cell
    from gcode2krl.krl import WrittenProgram
    from gcode2krl.prediction import Prediction
    from gcode2krl.prediction.forecast import Forecast


_Stage = TypeVar("_Stage")


@dataclass(frozen=True)
class _Ready:
    """An order whose options, cell and names are in order."""

    cell: "Cell"
    """With the options that change it."""
    place: Path | None
    name: str | None
    inputs: list[Path]
    """Files that must not be overwritten."""
    outputs: list[Path]
    """Files to write, without the parts of a long program."""
    of_job: tuple[Issue, ...]


def carry_out(order: Order, begin: Begin = unseen) -> Attempt:
    """Translate a part: read, plan, predict, write, read back.

    ``begin`` is told the name of each stage as it begins. No `Gcode2KrlError` leaves: it is the attempt's
    ``error``, beside what was known when it came. Nothing is printed.
    """
    from gcode2krl.files import watched

    attempt = Attempt(order)
    try:
        ready = _ready(attempt)
        with watched(ready.outputs):
            _carry_on(attempt, ready, begin)
    except Gcode2KrlError as refused:
        attempt.error = _with_page(attempt, refused)
    return attempt


def _carry_on(attempt: Attempt, ready: _Ready, begin: Begin) -> None:
    """Run the stages behind what an order names; each leaves what it finds in the attempt."""
    order = attempt.order
    _read(attempt, ready, begin)
    begin("planning")
    _plan(attempt, ready.cell)
    prediction = _predict(attempt, ready, begin)
    begin("writing and reading back")
    attempt.written = _write(attempt, ready, _done(attempt.forecast))
    if prediction is not None and order.report is not None:
        page = Path(order.report)
        write_page_of_written(page, str(order.part), prediction, attempt.written.issues, ready.inputs)
        attempt.page = page


def _ready(attempt: Attempt) -> _Ready:
    """Return the order with its cell and names; raises where it cannot be carried out."""
    order = attempt.order
    part, output = str(order.part), None if order.output is None else str(order.output)
    require_part(part)
    place = place_of(order)
    refuse_online(order, place)
    refuse_without_forces(order.from_line, order.no_forces)
    attempt.cell, of_job = read_cell_under_job(order.cell_path, order.job_path, order.tools_path)
    cell = _with_options(attempt.cell, order)
    name = restart_name(part, order.name, output, order.from_line, cell)
    inputs = existing(part, *cell_files(order.cell_path), *files_of_job(order.job_path, order.tools_path))
    require_figure(order.compensate_plot)
    require_report(order.report, inputs)
    outputs = outputs_of(order, place, name, cell)
    require_outputs(outputs, *inputs)
    return _Ready(cell, place, name, inputs, outputs, of_job)


def _read(attempt: Attempt, ready: _Ready, begin: Begin) -> None:
    """Read the G-code, from a line on where one is named."""
    order = attempt.order
    attempt.standard = StandardInput() if str(order.part) == STANDARD else None
    toolpath = read_from_line(
        str(order.part),
        ready.cell,
        order.chord_tolerance_mm,
        order.block_delete,
        order.tolerance_mm,
        order.from_line,
        begin,
        attempt.standard,
        order.dialect,
        order.search,
    )
    attempt.toolpath = replace(toolpath, issues=(*toolpath.issues, *ready.of_job, *order.project.issues))


def _plan(attempt: Attempt, cell: "Cell") -> None:
    """Set the targets, and refuse those that a robot cannot run."""
    from gcode2krl.chain import prepare

    order = attempt.order
    prepared = prepare(_done(attempt.toolpath), cell, order.tolerance_mm, order.simplify_mm)
    attempt.plan, attempt.corner_mm = prepared.with_corners(order.tolerance_mm)
    refuse_early(attempt.plan.targets, cell, order)


def _predict(attempt: Attempt, ready: _Ready, begin: Begin) -> "Prediction | None":
    """Foresee motion, forces and deflection; returns whole tables where something needs them."""
    from gcode2krl.chain import Plan, collect, forecast_of, foresee

    order = attempt.order
    plan, forces = _done(attempt.plan), not order.no_forces
    if order.compensate is None and order.report is None:
        attempt.forecast = foresee(plan, forces=forces, begin=begin)
        return None
    prediction = collect(plan, forces=forces, begin=begin)
    if order.compensate == "offline":
        from gcode2krl.translation.compensation import compensated

        begin("compensation")
        prediction = compensated(prediction, order.compensate_plot, ready.inputs)
        attempt.plan = Plan.of(plan.toolpath, prediction.targets, ready.cell)
    attempt.forecast = forecast_of(prediction)
    return prediction


def _write(attempt: Attempt, ready: _Ready, forecast: "Forecast") -> "WrittenProgram":
    """Write the program and read it back."""
    from gcode2krl.krl import suggested_name, write_krl

    order = attempt.order
    name = ready.name
    if ready.place is None and name is None and str(order.part) != STANDARD:
        name = suggested_name(program_stem(order.part), ready.cell.program.externals)
    return write_krl(
        forecast,
        ready.place,
        joints=_done(attempt.plan).joints,
        name=name,
        allow=() if "allow" in order.project.options else order.allow,
        allow_where_found=order.project.options.get("allow", ()),
        guard=not order.no_guard,
        split=order.split,
        options=_header_words(order, ready.cell),
        strict=order.strict,
        pilot=order.pilot,
        online=order.online,
        inputs=ready.inputs,
    )


def _with_page(attempt: Attempt, error: Gcode2KrlError) -> Gcode2KrlError:
    """Write the page of a refused program where one is asked for; returns what refuses it."""
    order = attempt.order
    inputs = existing(str(order.part), *cell_files(order.cell_path))
    if order.report is None or not can_be_written(order.report, inputs):
        return error
    page = Path(order.report)
    try:
        prediction = write_page_of_refused(
            page, str(order.part), error, attempt.toolpath, attempt.cell, inputs, order.simplify_mm
        )
    except Gcode2KrlError as unwritable:
        return unwritable
    attempt.page = page
    if prediction is not None and attempt.forecast is None:
        from gcode2krl.chain import forecast_of

        attempt.forecast = forecast_of(prediction)
    return error


def _with_options(cell: "Cell", order: Order) -> "Cell":
    given = {"max_lines": order.max_lines, "comment_every": order.comment_every}
    program = cell.program.model_copy(
        update={key: value for key, value in given.items() if value is not None}
    )
    return cell.under(program=program)


def _header_words(order: Order, cell: "Cell") -> str:
    """Return the options that the header of the program names."""
    named: dict[str, Any] = {
        "tolerance": order.tolerance_mm,
        "simplify": order.simplify_mm,
        "chord_tolerance": order.chord_tolerance_mm,
        "block_delete": order.block_delete,
        "dialect": order.dialect if order.dialect != DIALECT_NAMES[0] else None,
        "search": ",".join(Path(folder).name for folder in order.search) or None,
        "job": Path(order.job_path).name if order.job_path is not None else None,
        "tools": Path(order.tools_path).name if order.tools_path is not None else None,
        "spin": cell.frames.spin,
        "compensate": order.compensate,
        "online": order.online,
        "both": order.both,
        "from_line": order.from_line,
        "project": ",".join(order.project.keys) or None,
    }
    return " ".join(
        f"{key}={value:g}" if isinstance(value, float) else f"{key}={value}"
        for key, value in named.items()
        if value not in (None, False)
    )


def _done(table: "_Stage | None") -> "_Stage":
    """Return what an earlier stage has left."""
    if table is None:
        raise AssertionError("the stages run in their order")
    return table
