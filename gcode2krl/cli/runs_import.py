"""``gcode2krl runs import my.csv -o run/``: a log of another program becomes a run."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gcode2krl.cli.console import Console
from gcode2krl.cli.help_examples import examples
from gcode2krl.cli.inputs import common_options, named_values
from gcode2krl.errors import Gcode2KrlError, Issue, input_error

if TYPE_CHECKING:
    from gcode2krl.runs.foreign import Guess


@click.command(
    "import",
    epilog=examples(
        "gcode2krl runs import my.csv -o my-run/ --unit angle=deg",
        "gcode2krl runs import my.csv -o my-run/ --prediction prediction/ --yes",
        "gcode2krl runs import my.csv -o my-run/ --columns Axis1=q1_act_deg --unit angle=deg --yes",
    ),
)
@click.argument("log", metavar="LOG")
@click.option("-o", "--output", metavar="RUN", help="Folder of the run; default: the log's name beside it.")
@click.option(
    "--columns", multiple=True, metavar="NAME=OURS", help="What a column is; OURS empty: leave out."
)
@click.option(
    "--unit", multiple=True, metavar="WHAT=UNIT", help="Unit of a column, or of time, angle, length …"
)
@click.option(
    "--order", default="", metavar="ORDER", help="Of an orientation: zyx, xyz, xyz-fixed, zyz, rotvec."
)
@click.option(
    "--joints", default="", metavar="321456", help="Axes in the order in which the log counts joints."
)
@click.option("--prediction", metavar="FOLDER", help="Of the program that ran: settles units and orders.")
@click.option("--like", metavar="RUN", help="Take the columns as in this run.  [default: a run beside RUN]")
@click.option("--yes", is_flag=True, help="Ask nothing: the columns are right as they are shown.")
@common_options
def command(
    log: str,
    output: str | None,
    columns: tuple[str, ...],
    unit: tuple[str, ...],
    order: str,
    joints: str,
    prediction: str | None,
    like: str | None,
    yes: bool,
    cell_path: str | None,
    as_json: bool,
    quiet: bool,
) -> int:
    """Make a run of a log: CSV of any kind, Excel, Parquet, MATLAB v5, RSI telegrams, a KRC trace.

    It guesses what each column is and in which unit, and shows why. What it cannot know is a question, with
    the option that answers it. run.toml keeps the answers: the next log with these columns needs none.
    """
    console = Console(quiet, as_json)
    source = Path(log)
    folder = Path(output) if output is not None else source.with_suffix("")
    try:
        console.heading.reads(log)
        from gcode2krl.runs.foreign import is_native, write_native, write_run

        named = os.path.relpath(prediction, folder) if prediction is not None else ""
        if is_native(source):
            written, issues = write_native(source, folder, named)
            console.findings(issues, log)
            console.say(f"{log} -> {folder}: its format states what each column is")
            return console.record({}, issues, files=written) if as_json else 0
        guess = _guess(source, folder, columns, unit, order, joints, prediction, like)
        console.say("\n".join(shown(guess)))
        guess.require_certain(f"gcode2krl runs import {log} -o {folder}/")
        if not yes and not as_json and sys.stdin.isatty() and not click.confirm("Is each column right?"):
            raise input_error("run-layout", "nothing was written", "--columns NAME=OURS, --unit WHAT=UNIT")
        written = write_run(guess, folder, named)
    except Gcode2KrlError as error:
        return console.refused(error, ["columns"])
    notes = tuple(Issue("note", "run-layout", 0, note) for note in _notes(guess))
    if as_json:
        return console.record({"columns": _record(guess)}, notes, files=written)
    console.findings(notes, log)
    console.say(f"{log} -> {folder}")
    return 0


def _guess(
    source: Path,
    folder: Path,
    columns: Sequence[str],
    units: Sequence[str],
    order: str,
    joints: str,
    prediction: str | None,
    like: str | None,
) -> "Guess":
    from gcode2krl.prediction import Prediction
    from gcode2krl.runs.foreign import earlier_layout, guess_of, read_table
    from gcode2krl.runs.head import read_head

    table = read_table(source)
    earlier = earlier_layout(folder, table)
    layout = read_head(Path(like) / "run.toml")[0].layout if like is not None else earlier and earlier[0]
    return guess_of(
        table,
        like=layout,
        columns=named_values(columns, "--columns"),
        units=named_values(units, "--unit"),
        order=order,
        joints=joints,
        prediction=Prediction.load(prediction) if prediction is not None else None,
    )


def shown(guess: "Guess") -> list[str]:
    """Return the table that a person looks at: column, what it is, its range, its unit and why."""
    head = ("column", "is", "min", "max", "unit", "why")
    rows = [
        (e.name[:40], e.target, f"{e.low:.6g}", f"{e.high:.6g}", e.unit or "?", e.why) for e in guess.entries
    ]
    widths = [max(len(row[column]) for row in (head, *rows)) for column in range(len(head))]
    lines = [
        "  ".join(cell.ljust(width) for cell, width in zip(r, widths, strict=True)) for r in (head, *rows)
    ]
    return [f"{guess.table.source}: {guess.table.how}", *(line.rstrip() for line in lines)]


def _notes(guess: "Guess") -> list[str]:
    """Return what a person should know of the run: what was left out, and what is not there."""
    from gcode2krl.runs.foreign import absences, sheets_of, told

    missing = absences(sheets_of(guess))
    return [*told(guess), *([missing] if missing else [])]


def _record(guess: "Guess") -> list[dict[str, Any]]:
    return [
        {"name": e.name, "is": e.target, "min": e.low, "max": e.high, "unit": e.unit, "why": e.why}
        for e in guess.entries
    ]
