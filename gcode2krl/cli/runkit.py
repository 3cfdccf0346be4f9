"""``gcode2krl runkit part.src -o folder/``."""

from pathlib import Path

import click

from gcode2krl.cli.console import Console
from gcode2krl.cli.help_examples import examples
from gcode2krl.cli.inputs import cell_files, common_options, read_cell
from gcode2krl.errors import Gcode2KrlError, input_error


@click.command(
    "runkit",
    epilog=examples(
        "gcode2krl runkit part.src --cell cell.toml",
        "gcode2krl runkit part.src -o kit/ --lift 50 --cell cell.toml",
    ),
)
@click.argument("program", metavar="PART.src")
@click.option("-o", "--output", metavar="FOLDER", help="Folder of the kit; default: part_runkit beside it.")
@click.option(
    "--lift",
    "lift_mm",
    type=float,
    metavar="MM",
    default=100.0,
    show_default=True,
    help="Height of the run in air.",
)
@common_options
def command(
    program: str,
    output: str | None,
    lift_mm: float,
    cell_path: str | None,
    as_json: bool,
    quiet: bool,
) -> int:
    """Write what a program is accepted with: a variant in air, its prediction, a trace set-up, a check list.

    Use the cell the program was made with. docs/acceptance.md says what to do with each file.
    """
    console = Console(quiet, as_json)
    try:
        console.heading.reads(program)
        path = Path(program)
        if path.suffix.lower() != ".src":
            sentence = f"{path.name!r} is no KRL program"
            raise input_error("option-value", sentence, "name the .src that was written", source=path.name)
        cell = read_cell(cell_path)
        from gcode2krl.runkit import make_kit

        folder = Path(output) if output is not None else path.with_name(f"{path.stem}_runkit")
        with console.stage("planning, writing"):
            kit = make_kit(path, folder, cell, lift_mm=lift_mm, inputs=cell_files(cell_path))
    except Gcode2KrlError as error:
        return console.refused(error, ["time_s"])
    if as_json:
        return console.record({"time_s": kit.time_s}, kit.issues, files=kit.files)
    console.findings(kit.issues, kit.source, notes=False)
    console.say(f"{path} -> {folder}: {kit.time_s:.1f} s of motion at 100 %")
    console.say(f"  {kit.air_name}.src   the same path {lift_mm:g} mm higher, spindle and outputs left out")
    console.say("  checklist.html  print it: what to compare at the cell, and the steps")
    console.say("  trace.txt       set-up of the controller's recorder; the recording belongs into run_air/")
    console.say("  prediction/     of the run in air: gcode2krl diagnose prediction/ run_air/")
    return 0
