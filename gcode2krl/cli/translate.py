"""``gcode2krl translate part.nc -o part.src``, the default command."""

import sys
from pathlib import Path
from typing import Any, Literal

import click
import numpy as np

from gcode2krl.cell import Cell
from gcode2krl.cli.console import Console, issue_dicts
from gcode2krl.cli.inputs import STANDARD, common_options, gcode_options, read_cell, read_part, require_other
from gcode2krl.errors import Gcode2KrlError, Issue, input_error


@click.command("translate")
@click.argument("part")
@click.option(
    "-o", "--output", metavar="PART.src", help="Output; default: beside the input. - is standard output."
)
@common_options
@gcode_options
@click.option("--name", help="Program name; default: the output's name.")
@click.option("--allow", multiple=True, metavar="CODE:LINE", help="Release one finding; may be repeated.")
@click.option("--strict", is_flag=True, help="Warnings refuse the program too.")
@click.option("--no-guard", is_flag=True, help="Leave out the checks at the program's start.")
@click.option(
    "--split",
    type=click.Choice(["defs", "files"]),
    default="defs",
    show_default=True,
    help="Parts of a long program.",
)
@click.option("--max-lines", type=click.IntRange(100), help="Motions in a part; default: the cell's.")
@click.option("--comment-every", type=click.IntRange(0), help="A G-code line number every so many motions.")
def command(
    part: str, output: str | None, cell_path: str | None, as_json: bool, quiet: bool, verbose: bool,
    tolerance: float | None, chord_tolerance: float, block_delete: bool,
    name: str | None, allow: tuple[str, ...], strict: bool, no_guard: bool,
    split: Literal["defs", "files"], max_lines: int | None, comment_every: int | None,
) -> int:  # fmt: skip
    """Translate G-code into a KRL program, verify it, and say what it is.

    Exit code 0: written (warnings allowed); 1: understood and refused; 2: not understood.
    """
    console = Console(quiet or output == STANDARD, as_json)
    try:
        if as_json and output == STANDARD:
            raise input_error("option-value", "--json and -o - both claim standard output", "choose one")
        file = _output_file(part, output, cell_path)
        cell = _with_options(read_cell(cell_path), max_lines, comment_every)
        toolpath = read_part(part, cell, console, chord_tolerance, block_delete)
        from gcode2krl import predict
        from gcode2krl.krl import write_krl

        options = _words(
            tolerance=tolerance,
            chord_tolerance=chord_tolerance,
            block_delete=block_delete,
            spin=cell.frames.spin,
        )
        with console.progress("planning, writing, verifying", None):
            targets = predict.set_targets(toolpath, cell, tolerance)
            written = write_krl(
                targets,
                file,
                cell,
                name=name,
                allow=allow,
                guard=not no_guard,
                split=split,
                options=options,
                strict=strict,
            )
    except Gcode2KrlError as error:
        if not as_json:
            raise _from_part(error, part) from None
        console.json(_result((), error.issues, None, None, None))
        return error.exit_code
    if output == STANDARD:
        sys.stdout.buffer.write(written.texts[f"{written.name}.src"])
        sys.stdout.buffer.flush()
        console.findings(written.issues, part)
        return 0
    if as_json:
        console.json(_result(written.files, written.issues, toolpath, targets, written.report.as_dict()))
        return 0
    console.findings(written.issues, part)
    from gcode2krl.cli.summary import summary_lines

    for line in summary_lines(part, toolpath, targets, predict.solve_joints(targets, cell), written, cell):
        console.say(line)
    return 0


def _from_part(error: Gcode2KrlError, part: str) -> Gcode2KrlError:
    """Return the error with the part's name where it names no source."""
    if not error.source:
        error.source = part
    return error


def _output_file(part: str, output: str | None, cell_path: str | None) -> Path | None:
    if output == STANDARD:
        return None
    if output is None and part == STANDARD:
        raise input_error("option-value", "standard input needs an output", "give -o part.src, or -o -")
    file = Path(output) if output is not None else Path(part).with_suffix(".src")
    if file.suffix.lower() != ".src":
        raise input_error(
            "option-value", f"the output {file.name!r} does not end in .src", "name it part.src"
        )
    require_other(file, part, *([cell_path] if cell_path else []))
    return file


def _with_options(cell: Cell, max_lines: int | None, comment_every: int | None) -> Cell:
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


def _result(
    files: tuple[Path, ...],
    issues: tuple[Issue, ...],
    toolpath: Any,
    targets: Any,
    verify: dict[str, Any] | None,
) -> dict[str, Any]:
    """Return the object of the contract; a figure whose stage did not run is null."""
    return {
        "files": [str(file) for file in files],
        "moves": len(toolpath) - 1 if toolpath is not None else None,
        "time_s": None,
        "path_mm": programmed_path_mm(targets) if targets is not None else None,
        "max_force_N": None,
        "max_deflection_mm": None,
        "corner_error_mm": None,
        "verify": verify or {"max_deviation_mm": None},
        "pilot": {"knots": None, "max_error_N": None},
        "issues": issue_dicts(issues),
    }


def programmed_path_mm(targets: Any) -> float:
    """Return the length of the straight lines from the first to the last programmed position."""
    rows = np.flatnonzero((targets.move >= 0) & ~targets.ptp)
    if len(rows) < 2:
        return 0.0
    steps = np.linalg.norm(np.diff(targets.position_mm[rows[0] : rows[-1] + 1], axis=0), axis=1)
    lin = ~targets.ptp[rows[0] + 1 : rows[-1] + 1]
    return float(steps[lin].sum())
