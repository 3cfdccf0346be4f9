"""``gcode2krl translate part.nc -o part.src``, the default command: options, `carry_out`, a summary."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import click

from gcode2krl import krl_words as w
from gcode2krl.cli.console import Console
from gcode2krl.cli.help_examples import examples
from gcode2krl.cli.inputs import (
    STANDARD,
    allow_option,
    common_options,
    gcode_options,
    job_option,
    options_of_project,
    simplify_option,
)
from gcode2krl.cli.restart import from_line_option, restart_words
from gcode2krl.cli.standard_files import write_bytes
from gcode2krl.errors import input_error
from gcode2krl.translation import Attempt, Order, carry_out

if TYPE_CHECKING:
    from gcode2krl.krl import WrittenProgram


@click.command(
    "translate",
    epilog=examples(
        "gcode2krl part.nc -o part.src",
        "gcode2krl part.nc --cell cell.toml -o part.src --tolerance 0.05 --simplify 0.01",
        "cat part.nc | gcode2krl - -o - --name PART > part.src",
        "gcode2krl part.nc --cell cell.toml --compensate offline --json",
    ),
)
@click.argument("part")
@click.option(
    "-o",
    "--output",
    metavar="PART.src",
    help="Output, or its folder; default: beside the input. - is stdout.",
)
@common_options
@gcode_options
@simplify_option
@job_option
@click.option("--name", help="Program name, where -o names no file; a controller needs both alike.")
@allow_option
@click.option("--strict", is_flag=True, help="Warnings refuse the program too.")
@click.option("--no-guard", is_flag=True, help="Leave out the checks at the program's start.")
@click.option(
    "--split",
    type=click.Choice(["defs", "files"]),
    default="defs",
    show_default=True,
    help="How a long program is split.",
)
@click.option("--max-lines", type=click.IntRange(100), help="Motions in a part; default: the cell's.")
@click.option(
    "--compensate", type=click.Choice(["offline"]), help="Move the targets against the predicted deflection."
)
@click.option("--compensate-plot", metavar="FIGURE.png", help="Draw the path before and after it.")
@click.option(
    "--no-forces", is_flag=True, help="Leave out material removal, forces, deflection and their findings."
)
@click.option(
    "--pilot",
    type=click.Choice(["index", "values", "none"]),
    help="How the program carries the pilot force; default: the cell's, none on standard output.",
)
@click.option(
    "--online",
    metavar="NAME",
    help="Correct online by RSI: switch it in the program, write NAME.rsi.xml or .rsix and more beside.",
)
@click.option(
    "--both", is_flag=True, help="--online on top of --compensate offline: the server knows of the offset."
)
@click.option("--report", metavar="PART.html", help="Write a page to look at, also of a refused program.")
@click.option(
    "--comment-every", type=click.IntRange(0, 10**9), help="Motions between comments with the G-code line."
)
@from_line_option
@options_of_project
def command(as_json: bool, quiet: bool, **options: Any) -> int:
    """Translate G-code into a KRL program, verify it, and print a summary.

    Exit code 0: written (warnings allowed); 1: understood and refused; 2: not understood.
    """
    order = Order(**options)
    console = Console(quiet or order.output == STANDARD, as_json)
    attempt = _attempt(order, console)
    if attempt.page is not None:
        console.hint(f"{attempt.page} written: open it in a browser")
    if as_json:
        console.json(attempt.record)
    elif attempt.error is not None:
        attempt.error.source = attempt.error.source or str(order.part)
        raise attempt.error
    else:
        _tell(attempt, console)
    return attempt.exit_code


def _attempt(order: Order, console: Console) -> Attempt:
    """Carry an order out, with a bar a stage on a terminal."""
    if console.as_json and order.output == STANDARD:
        sentence = "--json and -o - both claim standard output"
        return Attempt(order, input_error("option-value", sentence, "choose one"))
    with console.stages() as begin:
        return carry_out(order, begin)


def _tell(attempt: Attempt, console: Console) -> None:
    """Print the findings of a written program, and its text or its summary."""
    order, written = attempt.order, attempt.written
    plan, forecast, corner_mm = attempt.plan, attempt.forecast, attempt.corner_mm
    if written is None or plan is None or forecast is None or corner_mm is None:
        raise AssertionError("a written program has run every stage")
    if order.output == STANDARD:
        write_bytes(written.texts[f"{written.name}.src"])
        console.findings(written.issues, str(order.part))
        return
    console.findings(written.issues, str(order.part))
    from gcode2krl.cli.summary import summary_lines

    lines = [
        *summary_lines(str(order.part), plan, forecast, corner_mm, written),
        *restart_words(plan.toolpath),
        *(_online_lines(written) if order.online is not None else ()),
    ]
    for line in lines:
        console.say(line)


def _online_lines(written: "WrittenProgram") -> Iterator[str]:
    """Yield what to do with the RSI files."""
    endings = (w.ETHERNET_SUFFIX, *w.SIGNAL_FLOW_SUFFIXES.values())
    files = " and ".join(file.name for file in written.files if file.name.endswith(endings))
    yield f"  online     {files} belong into SensorInterface; docs/online.md lists what to confirm there"
    pilot = "".join(f" --pilot {file}" for file in written.files if file.suffix == ".csv")
    tool = int(written.targets.tool[~written.targets.home][-1])
    yield f"  server     gcode2krl online serve --tool {tool}{pilot} must listen before RSI_ON"
