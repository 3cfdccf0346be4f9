"""``gcode2krl verify part.src part.nc``."""

import math
from dataclasses import replace
from typing import Literal

import click

from gcode2krl.cli.console import Console
from gcode2krl.cli.help_examples import examples
from gcode2krl.cli.inputs import (
    common_options,
    gcode_options,
    job_option,
    options_of_project,
    read_cell_under_job,
    simplify_option,
)
from gcode2krl.cli.restart import from_line_option, refuse_other_start
from gcode2krl.errors import Gcode2KrlError
from gcode2krl.translation.inputs import read_from_line
from gcode2krl.translation.project import Project


@click.command(
    "verify",
    epilog=examples(
        "gcode2krl verify part.src part.nc", "gcode2krl verify part.src part.nc --cell cell.toml --json"
    ),
)
@click.argument("program", metavar="PART.src")
@click.argument("part", metavar="PART.nc")
@common_options
@gcode_options
@simplify_option
@click.option(
    "--compensate", type=click.Choice(["offline"]), help="The program was made with --compensate offline."
)
@click.option("--no-forces", is_flag=True, help="Leave out material removal and its findings.")
@click.option(
    "--allow",
    multiple=True,
    metavar="CODE[:[FILE:]LINE]",
    help="Findings that are accepted beside those released in the header; may be repeated.",
)
@job_option
@from_line_option
@options_of_project
def command(
    program: str,
    part: str,
    cell_path: str | None,
    as_json: bool,
    quiet: bool,
    tolerance_mm: float | None,
    chord_tolerance_mm: float,
    dialect: str,
    search: tuple[str, ...],
    block_delete: bool,
    simplify_mm: float | None,
    compensate: Literal["offline"] | None,
    no_forces: bool,
    allow: tuple[str, ...],
    job_path: str | None,
    tools_path: str | None,
    from_line: int | None,
    project: Project,
) -> int:
    """Read a KRL program back, compare it with its G-code, and judge its hazards anew.

    Use the options the program was made with (its header names them), and the cell that it is to run in;
    those that a gcode2krl.toml states for the part are taken from it.
    Exit code 1 where it differs, where the cell has changed since it was written, or where a hazard is seen.
    """
    console = Console(quiet, as_json)
    try:
        from gcode2krl.krl import verify_krl

        console.heading.reads(program, part)
        refuse_other_start(program, from_line)
        cell, of_job = read_cell_under_job(cell_path, job_path, tools_path)
        with console.stages() as begin:
            toolpath = read_from_line(
                part,
                cell,
                chord_tolerance_mm,
                block_delete,
                tolerance_mm,
                from_line,
                begin,
                dialect=dialect,
                search=search,
            )
        toolpath = replace(toolpath, issues=(*toolpath.issues, *of_job, *project.issues))
        prediction = None
        if compensate == "offline":
            from gcode2krl.chain import collect, prepare
            from gcode2krl.translation.compensation import compensated

            plan, _ = prepare(toolpath, cell, tolerance_mm, simplify_mm).with_corners(tolerance_mm)
            prediction = compensated(collect(plan), None)
        report = verify_krl(
            program,
            toolpath,
            cell,
            tolerance_mm,
            simplify_mm=simplify_mm,
            prediction=prediction,
            forces=not no_forces,
            allow=allow,
        )
    except Gcode2KrlError as error:
        if not as_json:
            raise
        return console.record({"verify": {"max_deviation_mm": None}}, error.issues, exit_code=error.exit_code)
    if as_json:
        from gcode2krl.restart.rows import restart_record

        figures = {"verify": report.as_dict(), **project.record, **restart_record(toolpath)}
        console.record(figures, report.issues, exit_code=0 if report.ok else 1)
    else:
        console.findings((issue for issue in report.issues if not issue.file), program)
        console.findings((issue for issue in report.issues if issue.file), part)
        state = "agrees with" if report.ok else "DIFFERS from"
        console.say(f"{program} {state} {part}: {report.motions} motions of {report.intended}")
        if math.isnan(report.max_deviation_mm + report.max_rotation_deg + report.max_speed_difference_mm_min):
            console.say("  largest deviation not known: not every motion can be compared")
        else:
            console.say(
                f"  largest deviation {report.max_deviation_mm:.4f} mm, {report.max_rotation_deg:.4f} deg, "
                f"{report.max_speed_difference_mm_min:.2f} mm/min"
            )
        if report.original is not None and not math.isnan(report.original.max_deviation_mm):
            kept = report.original
            console.say(
                f"  simplified: of {kept.moves} moves {kept.left_out} corners left out, at most "
                f"{kept.max_deviation_mm:.4f} mm off ({kept.limit_mm:.4f} allowed)"
            )
        if not report.ok:
            console.explain_hint(report.issues)
    return 0 if report.ok else 1
