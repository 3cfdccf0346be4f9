"""``gcode2krl make-test controller -o test.nc``."""

from pathlib import Path

import click

from gcode2krl.cli.console import Console, issue_dicts
from gcode2krl.cli.inputs import STANDARD, common_options, read_cell, require_other
from gcode2krl.errors import Gcode2KrlError, input_error


@click.command("make-test")
@click.argument("what", type=click.Choice(["controller"]))
@click.option("-o", "--output", metavar="TEST.nc", required=True, help="Output. - is standard output.")
@common_options
@click.option(
    "--at", nargs=3, type=float, metavar="X Y Z",
    help="Where the lines begin in $BASE, mm; default: 100 0 and 40 below the clearance plane.",
)  # fmt: skip
def command(
    what: str, output: str, cell_path: str | None, as_json: bool, quiet: bool, verbose: bool,
    at: tuple[float, float, float] | None,
) -> int:  # fmt: skip
    """Write the G-code of a test program: air moves whose trace tells how the controller plans.

    Translate it, run it with nothing below the tool and override 100 %, record the commanded position, and
    hand the trace to `gcode2krl identify controller`. Reorientations cannot be written in three-axis G-code
    and are not tested.
    """
    console = Console(quiet or output == STANDARD, as_json)
    try:
        if as_json and output == STANDARD:
            raise input_error("option-value", "--json and -o - both claim standard output", "choose one")
        text = _program(cell_path, at)
        if output == STANDARD:
            click.echo(text, nl=False)
            return 0
        file = Path(output)
        require_other(file, *((cell_path,) if cell_path else ()))
        from gcode2krl.krl.files import write_together

        write_together({file: text.encode("ascii")})
    except Gcode2KrlError as error:
        if not as_json:
            raise
        console.json({"files": [], "lines": None, "issues": issue_dicts(error.issues)})
        return error.exit_code
    if as_json:
        console.json({"files": [str(file)], "lines": text.count("\n"), "issues": []})
        return 0
    console.say(f"{file}: {text.count(chr(10))} lines of air moves")
    console.say(
        f"  next: gcode2krl {file} -o {file.with_suffix('.src')}, run it, record the commanded position,"
    )
    console.say(f"  then: gcode2krl identify controller trace.csv --part {file}")
    return 0


def _program(cell_path: str | None, at: tuple[float, float, float] | None) -> str:
    from gcode2krl.krc4.trial_program import controller_test_program

    return controller_test_program(read_cell(cell_path), at or None)
