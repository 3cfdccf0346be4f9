"""``gcode2krl make-test controller -o test.nc``."""

from pathlib import Path

import click
import numpy as np

from gcode2krl.cli.console import Console, issue_dicts
from gcode2krl.cli.inputs import STANDARD, cell_files, common_options, read_cell, require_outputs
from gcode2krl.errors import Gcode2KrlError, Issue, input_error


@click.command("make-test")
@click.argument("what", type=click.Choice(["controller"]))
@click.option(
    "-o",
    "--output",
    metavar="TEST.src|TEST.nc",
    required=True,
    help="Output: a KRL program, or its G-code. - is standard output (G-code).",
)
@common_options
@click.option(
    "--at",
    nargs=3,
    type=float,
    metavar="X Y Z",
    help="Where the lines begin in $BASE, mm; default: 100 0 and 40 below the clearance plane.",
)
def command(
    what: str,
    output: str,
    cell_path: str | None,
    as_json: bool,
    quiet: bool,
    verbose: bool,
    at: tuple[float, float, float] | None,
) -> int:
    """Write a test program: air moves whose trace shows how the controller plans.

    A .src is complete. A .nc must be translated and lacks the lines that turn the tool, which three-axis
    G-code cannot express. Run it with nothing below the tool and override 100 %, record the commanded
    position, and hand the trace to `gcode2krl identify controller`.
    """
    console = Console(quiet or output == STANDARD, as_json)
    try:
        if as_json and output == STANDARD:
            raise input_error("option-value", "--json and -o - both claim standard output", "choose one")
        if at and not np.isfinite(at).all():
            raise input_error("option-value", f"--at {at}: found no numbers", "give X Y Z in mm")
        if output == STANDARD:
            click.echo(_gcode(cell_path, at), nl=False)
            return 0
        file = Path(output)
        write = _write_gcode
        outputs = [file]
        if file.suffix.lower() == ".src":
            from gcode2krl.krl import output_files

            write, outputs = _write_krl, output_files(file, None)
        require_outputs(outputs, *cell_files(cell_path))
        files, lines, issues = write(file, cell_path, at)
    except Gcode2KrlError as error:
        if not as_json:
            raise
        console.json({"files": [], "lines": None, "issues": issue_dicts(error.issues)})
        return error.exit_code
    if as_json:
        console.json({"files": [str(name) for name in files], "lines": lines, "issues": issue_dicts(issues)})
        return 0
    console.findings(issues, file.name)
    console.say(f"{', '.join(map(str, files))}: {lines} lines, air moves")
    if file.suffix.lower() == ".src":
        console.say("  next: run it, record the commanded position,")
        console.say("  then: gcode2krl identify controller trace.csv")
    else:
        program = file.with_suffix(".src")
        console.say(f"  next: gcode2krl {file} -o {program}, run it, record the commanded position,")
        console.say(f"  then: gcode2krl identify controller trace.csv --part {file}")
    return 0


def _write_krl(
    file: Path, cell_path: str | None, at: tuple[float, float, float] | None
) -> tuple[list[Path], int, tuple[Issue, ...]]:
    """Write the program with the lines that turn the tool; returns files, lines and findings."""
    from gcode2krl.krl import write_krl
    from gcode2krl.pipeline import controller_test_targets

    cell = read_cell(cell_path)
    targets, inputs = controller_test_targets(cell, at), cell_files(cell_path)
    written = write_krl(targets, file, cell, options="test of the controller", inputs=inputs)
    return list(written.files), sum(text.count(b"\n") for text in written.texts.values()), written.issues


def _write_gcode(
    file: Path, cell_path: str | None, at: tuple[float, float, float] | None
) -> tuple[list[Path], int, tuple[Issue, ...]]:
    from gcode2krl.files import write_together

    text = _gcode(cell_path, at)
    write_together({file: text.encode("ascii")})
    return [file], text.count("\n"), ()


def _gcode(cell_path: str | None, at: tuple[float, float, float] | None) -> str:
    from gcode2krl.identify.trial_program import controller_test_program

    return controller_test_program(read_cell(cell_path), at or None)
