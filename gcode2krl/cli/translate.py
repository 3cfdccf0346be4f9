"""``gcode2krl translate part.nc -o part.src``, the default command: options, `carry_out`, a summary."""

from collections.abc import Iterator
from typing import Any

import click
import numpy as np

from gcode2krl import krl_words as w
from gcode2krl.cell import Cell
from gcode2krl.cell.checked_parts import collision_scope
from gcode2krl.chain import Plan
from gcode2krl.cli.console import Console
from gcode2krl.cli.help_examples import examples
from gcode2krl.cli.inputs import (
    STANDARD,
    common_options,
    gcode_options,
    job_option,
    options_of_project,
    simplify_option,
)
from gcode2krl.cli.loads import load_lines
from gcode2krl.cli.restart import from_line_option, restart_words
from gcode2krl.cli.standard_files import write_bytes
from gcode2krl.errors import input_error
from gcode2krl.krl import WrittenProgram
from gcode2krl.krl.external_words import axes_words
from gcode2krl.prediction.forecast import Forecast
from gcode2krl.translation import Attempt, Order, carry_out
from gcode2krl.translation.quantity import band_words, quantities
from gcode2krl.units import BYTES_PER_MB, DEG_PER_RAD, MM_PER_M, S_PER_MIN


def summary_lines(
    part: str, plan: Plan, forecast: Forecast, corner_mm: float, written: WrittenProgram
) -> Iterator[str]:
    """Yield the lines of the summary; ``corner_mm`` is the largest corner error."""
    toolpath, targets, joints, cell = plan.toolpath, plan.targets, plan.joints, plan.cell
    size_mb = written.size_bytes / BYTES_PER_MB
    report = written.report
    lin = ~targets.ptp
    steps_m = np.zeros(len(targets))
    steps_m[1:] = np.linalg.norm(np.diff(targets.position_mm, axis=0), axis=1) / MM_PER_M
    rapid = lin & (targets.speed_mm_s == cell.controller.rapid_m_s * MM_PER_M)
    feed = lin & ~rapid
    blended = targets.cdis_mm > 0
    away = ~targets.home
    lines = _span(targets.source_line[targets.source_line > 0], 0)
    x, y, z = (_span(targets.position_mm[lin, k], 2) for k in range(3))
    tools = [f"T{n} {cell.tool[n].model}".rstrip() for n in np.unique(targets.tool[lin]).tolist()]
    wrist_deg = np.degrees(np.abs(joints.q_rad[away, 4]).min())
    limit_deg = joints.limit_margin_rad[away].min() * DEG_PER_RAD
    read_back = f"{report.max_deviation_mm:.4f} mm, {report.max_rotation_deg:.4f} deg"
    speed_off = report.max_speed_difference_mm_min

    yield f"{part} -> {_files(written)} ({size_mb:.2f} MB)"
    yield f"  program    {written.name}: {len(toolpath) - 1} moves, {len(targets)} motions, lines {lines}"
    yield from (f"  name       {issue.message}" for issue in written.issues if issue.code == "krl-name")
    yield f"  time       {_duration(forecast.time_s)} of motion, without spindle and tools"
    yield f"  path       {steps_m[feed].sum():.3f} m at feed, {steps_m[rapid].sum():.3f} m rapid"
    yield f"  feed       {_span(targets.speed_mm_s[feed] * S_PER_MIN, 0)} mm/min"
    yield f"  extent     X {x}, Y {y}, Z {z} mm in $BASE"
    yield f"  tools      {', '.join(tools)}"
    yield f"  blending   {np.count_nonzero(blended)} corners, CDIS {_span(targets.cdis_mm[blended], 3)} mm"
    yield f"  corners    off by at most {corner_mm:.4f} mm"
    yield f"  standstill {np.count_nonzero(lin & ~blended)} exact stops, {targets.wait_s.sum():.1f} s dwell"
    yield f"  robot      {cell.robot.title}, status S = {joints.status[away][0]}"
    yield f"  joints     nearest limit {limit_deg:.1f} deg, |A5| at least {wrist_deg:.1f} deg"
    yield from (f"  external   {words}" for words in axes_words(targets, cell))
    yield f"  read back  {report.motions} motions, off by {read_back}, {speed_off:.2f} mm/min"
    yield from load_lines(forecast.loads, cell)
    known = quantities(forecast.loads, forecast.time_s, targets, cell)
    yield from (f"  band       {words}" for words in band_words(known))
    yield from _collisions(cell, np.unique(targets.tool).tolist(), is_cut=forecast.has_forces)


def _collisions(cell: Cell, tools: list[int], *, is_cut: bool) -> Iterator[str]:
    """Yield what was checked for collisions and what was not."""
    scope = collision_scope(cell, tools, is_cut=is_cut)
    if scope is None:
        yield "  not known  collision of arm, spindle and cables, and chatter, are not checked"
        return
    yield f"  collisions none: {', '.join(scope.movers)}"
    yield f"             against {', '.join(scope.obstacles) or 'nothing that the cell states'}"
    yield f"  not known  collision of {', '.join(scope.unchecked)}; chatter"


def _duration(seconds: float) -> str:
    minutes, seconds_left = divmod(float(seconds), S_PER_MIN)
    return f"{int(minutes)} min {seconds_left:.1f} s" if minutes else f"{seconds_left:.2f} s"


def _files(written: WrittenProgram) -> str:
    first, *further = [str(file) for file in written.files]
    parts = [name for name in further if name.endswith(".src")]
    others = [name for name in further if not name.endswith(".src")]
    if len(parts) > 2:
        parts = [f"{len(parts)} parts {parts[0]} ... {parts[-1]}"]
    return ", ".join([first, *parts, *others])


def _span(values: "np.ndarray[tuple[int], np.dtype[np.float64 | np.int32]]", decimals: int) -> str:
    if len(values) == 0:
        return "none"
    low, high = float(values.min()), float(values.max())
    return f"{low:.{decimals}f}" if low == high else f"{low:.{decimals}f}..{high:.{decimals}f}"


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
@click.option(
    "--allow",
    multiple=True,
    metavar="CODE[:[FILE:]LINE]",
    help="Allow one finding, or all of a code; may be repeated.",
)
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
    from gcode2krl.cli.translate import summary_lines

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
