"""``gcode2krl make-test controller|reversals|circle|… -o test.nc``."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gcode2krl.cli.console import Console
from gcode2krl.cli.help_examples import examples
from gcode2krl.cli.inputs import STANDARD, cell_files, common_options, read_cell, require_outputs
from gcode2krl.errors import Gcode2KrlError, Issue, input_error

if TYPE_CHECKING:
    from gcode2krl.cell import Cell
    from gcode2krl.tables import Targets

CONTROLLER = "controller"
NAMES = (
    CONTROLLER,
    "reversals",
    "circle",
    "weights",
    "sync",
    "orientation",
    "repeat",
    "dwell",
    "spindle",
    "single-joint",
)
_SIZE_MM, _PERCENT = 100.0, 100.0
Point = tuple[float, float, float]


@dataclass(frozen=True)
class _Test:
    """A test program, made when its form is known."""

    gcode: Callable[[], str]
    targets: "Callable[[], Targets]"
    minutes: "Callable[[], float] | None"
    """None where it is not said."""
    option: str
    """For the header of the KRL form."""


@click.command(
    "make-test",
    epilog=examples(
        "gcode2krl make-test controller -o test.src",
        "gcode2krl make-test reversals -o reversals.nc --at 100 0 60 --size 80",
    ),
)
@click.argument("what", type=click.Choice(NAMES))
@click.argument("part", metavar="[PART.nc]", type=click.Path(), required=False)
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
    "at_mm",
    nargs=3,
    type=float,
    metavar="X Y Z",
    help="Where the program begins in $BASE, mm; default: 100 0 and 40 below the clearance plane.",
)
@click.option(
    "--size",
    "size_mm",
    type=float,
    metavar="MM",
    help=f"Side of the square it stays in; default: {_SIZE_MM:g}.",
)
@click.option(
    "--speed", "speed_percent", type=float, metavar="PERCENT", help="Of the program's feeds; default: 100."
)
def command(
    what: str,
    part: str | None,
    output: str,
    cell_path: str | None,
    as_json: bool,
    quiet: bool,
    at_mm: Point | None,
    size_mm: float | None,
    speed_percent: float | None,
) -> int:
    """Write a test program of air moves.

    controller shows how the controller plans: hand its trace to `gcode2krl identify controller`. The others
    separate causes that `gcode2krl diagnose` cannot tell apart (docs/test_programs.md); each begins and ends
    with a sync gesture and three reference points. repeat runs PART.nc again.

    A .src is complete. A .nc must be translated and lacks the lines that turn the tool, which three-axis
    G-code cannot express. Run it with nothing below the tool and override 100 %.
    """
    console = Console(quiet or output == STANDARD, as_json)
    try:
        console.heading.reads(part)
        if as_json and output == STANDARD:
            raise input_error("option-value", "--json and -o - both claim standard output", "choose one")
        if at_mm and not all(map(math.isfinite, at_mm)):
            raise input_error("option-value", f"--at {at_mm}: found no numbers", "give X Y Z in mm")
        cell = read_cell(cell_path)
        test = _test_of(what, part, cell, at_mm, size_mm, speed_percent)
        if output == STANDARD:
            click.echo(test.gcode(), nl=False)
            return 0
        file = Path(output)
        krl = file.suffix.lower() == ".src"
        outputs = [file]
        if krl:
            from gcode2krl.krl import output_files

            outputs = output_files(file, None)
        inputs = [*cell_files(cell_path), *([Path(part)] if part is not None else [])]
        require_outputs(outputs, *inputs)
        files, lines, issues = _write_krl(test, file, cell, inputs) if krl else _write_gcode(test, file)
        minutes = None if test.minutes is None else round(test.minutes(), 1)
    except Gcode2KrlError as error:
        return console.refused(error, ["lines"])
    if as_json:
        lasting = {} if minutes is None else {"minutes": minutes}
        return console.record({"lines": lines, **lasting}, issues, files=files)
    console.findings(issues, file.name)
    console.say(f"{', '.join(map(str, files))}: {lines} lines, air moves{_lasting(minutes)}")
    _say_next(console, what, file)
    return 0


def _lasting(minutes: float | None) -> str:
    return "" if minutes is None else f", {minutes:g} min"


def _say_next(console: Console, what: str, file: Path) -> None:
    """Say what to do with the program."""
    controller, krl = what == CONTROLLER, file.suffix.lower() == ".src"
    record = "record the commanded position," if controller else "record all instruments,"
    if krl:
        console.say(f"  next: run it, {record}")
    else:
        console.say(f"  next: gcode2krl {file} -o {file.with_suffix('.src')}, run it, {record}")
    if controller:
        of_part = "" if krl else f" --part {file}"
        console.say(f"  then: gcode2krl identify controller trace.csv{of_part}")
    elif not krl:
        console.say(f"  then: gcode2krl predict {file} --no-forces -o prediction/,")
        console.say("  and gcode2krl diagnose prediction/ run/")


def _test_of(
    what: str, part: str | None, cell: "Cell", at: Point | None, size: float | None, speed: float | None
) -> _Test:
    """Return the program that is asked for."""
    if what == CONTROLLER:
        return _controller_test(cell, part, at, size, speed)
    from gcode2krl import canned

    place = canned.place_of(
        cell, at or None, _SIZE_MM if size is None else size, _PERCENT if speed is None else speed
    )
    draft = canned.draft_of(what, place, None if part is None else _text_of(part))
    return _Test(
        gcode=lambda: canned.gcode_of(draft),
        targets=lambda: canned.targets_of(draft, cell),
        minutes=lambda: canned.minutes_of(draft, canned.targets_of(draft, cell), cell),
        option=f"test program {what}",
    )


def _controller_test(
    cell: "Cell", part: str | None, at: Point | None, size: float | None, speed: float | None
) -> _Test:
    from gcode2krl.identify.trial_program import controller_test_program
    from gcode2krl.pipeline import controller_test_targets

    if part is not None or size is not None or speed is not None:
        words = "make-test controller takes no part, no --size and no --speed"
        raise input_error("option-value", words, "its lengths and speeds are those that identify it")
    return _Test(
        gcode=lambda: controller_test_program(cell, at or None),
        targets=lambda: controller_test_targets(cell, at),
        minutes=None,
        option="test of the controller",
    )


def _text_of(part: str) -> str:
    try:
        return Path(part).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        words = getattr(error, "strerror", None) or "not a text"
        raise input_error("file-unreadable", f"cannot read: {words}", "name a file", source=part) from None


def _write_krl(
    test: _Test, file: Path, cell: "Cell", inputs: list[Path]
) -> tuple[list[Path], int, tuple[Issue, ...]]:
    """Write the program with the lines that turn the tool; returns files, lines and findings."""
    from gcode2krl.krl import write_krl

    written = write_krl(test.targets(), file, cell, options=test.option, inputs=inputs)
    lines = sum(text.count(b"\n") for text in written.texts.values())
    return list(written.files), lines, written.issues


def _write_gcode(test: _Test, file: Path) -> tuple[list[Path], int, tuple[Issue, ...]]:
    from gcode2krl.files import write_together

    text = test.gcode()
    write_together({file: text.encode("utf-8")})
    return [file], text.count("\n"), ()
