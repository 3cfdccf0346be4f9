"""Reading the inputs that several commands share: the part, the cell, and the words about the first run."""

import sys
from pathlib import Path
from typing import Any

import click

from gcode2krl.cell import Cell, load_cell
from gcode2krl.cli.console import Console
from gcode2krl.errors import input_error
from gcode2krl.tables import Toolpath

STANDARD = "-"


def common_options(function: Any) -> Any:
    """Add --cell, --json, -q and -v to a command."""
    for option in (
        click.option("-v", "--verbose", is_flag=True, help="Show details of an internal error."),
        click.option("-q", "--quiet", is_flag=True, help="Print nothing but findings."),
        click.option("--json", "as_json", is_flag=True, help="Print one JSON object on standard output."),
        click.option(
            "--cell", "cell_path", type=click.Path(), help="Cell file; default: the demonstration cell."
        ),
    ):
        function = option(function)
    return function


def gcode_options(function: Any) -> Any:
    """Add the options that say how G-code is read."""
    for option in (
        click.option("--block-delete", is_flag=True, help="Skip lines that begin with /."),
        click.option(
            "--chord-tolerance",
            default=0.01,
            show_default=True,
            metavar="MM",
            help="Arcs to chords within this.",
        ),
        click.option(
            "--tolerance", type=float, metavar="MM", help="Blend corners within this (below G64 P)."
        ),
    ):
        function = option(function)
    return function


def read_part(
    part: str, cell: Cell, console: Console, chord_tolerance_mm: float, block_delete: bool
) -> Toolpath:
    """Read the G-code of a command, from a file or from standard input."""
    from gcode2krl.gcode import read_gcode, read_stream

    _say_first_run(console)
    size = Path(part).stat().st_size if part != STANDARD and Path(part).is_file() else None
    with console.progress("reading", size) as advance:
        if part == STANDARD:
            return read_stream(
                sys.stdin.buffer, "stdin", cell,
                chord_tolerance_mm=chord_tolerance_mm, block_delete=block_delete, progress=advance,
            )  # fmt: skip
        return read_gcode(
            part, cell, chord_tolerance_mm=chord_tolerance_mm, block_delete=block_delete, progress=advance
        )


def read_cell(path: str | None) -> Cell:
    """Read the cell of a command."""
    return load_cell(path)


def _say_first_run(console: Console) -> None:
    """One line where the compiled kernels are not on this machine yet."""
    from gcode2krl.gcode import machine

    folder = machine.run.stats.cache_path
    if folder and not any(Path(folder).glob("machine.run-*.nbi")):
        console.hint("first run on this machine: compiling, once (some seconds)")


def require_other(output: Path, *inputs: str) -> None:
    """Refuse an output that is one of the inputs, or whose folder does not exist."""
    if not output.parent.is_dir():
        raise input_error(
            "output-unwritable",
            f"the folder {str(output.parent)!r} does not exist",
            "create it first",
            source=str(output),
        )
    if output.is_dir():
        raise input_error(
            "output-unwritable", "this is a folder", "name a file, part.src", source=str(output)
        )
    for path in inputs:
        if path != STANDARD and Path(path).exists() and output.exists() and output.samefile(path):
            raise input_error(
                "output-is-input",
                "the output is the input",
                "choose another name with -o",
                source=str(output),
            )
