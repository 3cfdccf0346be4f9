"""``gcode2krl runs``: measured runs as people have them; a file for each command."""

import click

from gcode2krl.cli.help_examples import examples
from gcode2krl.cli.on_use import CommandsOnUse

_WHAT = {
    "import": "Make a run of a log: CSV of any kind, Excel, Parquet, MATLAB v5, RSI telegrams, a KRC trace."
}


@click.command(
    "runs",
    epilog=examples("gcode2krl runs import my.csv -o my-run/ --unit angle=deg"),
    cls=CommandsOnUse,
    summaries=_WHAT,
    module="gcode2krl.cli.runs_{}",
)
def command() -> None:
    """Measured runs: make one of a log."""
