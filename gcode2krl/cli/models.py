"""``gcode2krl models``: what is in the library, and what a person must confirm of a cell."""

import json
from collections.abc import Iterator
from typing import Any

import click

from gcode2krl import library
from gcode2krl.cell import Cell, cell_schema, load_cell
from gcode2krl.cli.console import Console, issue_dicts
from gcode2krl.errors import Gcode2KrlError, input_error


@click.group("models")
def command() -> None:
    """Robots, controllers, tools and cells: list, show, check, schema."""


@command.command("list")
@click.argument("kind", required=False, type=click.Choice(library.KINDS))
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def list_models(kind: str | None, as_json: bool) -> None:
    """List the models of the library."""
    kinds = [kind] if kind else list(library.KINDS)
    found = {k: list(library.names(k)) for k in kinds}
    if as_json:
        click.echo(json.dumps(found, indent=2))
        return
    for k, names in found.items():
        click.echo(f"{k}:")
        for name in names:
            click.echo(f"  {name}")


@command.command("show")
@click.argument("name")
def show(name: str) -> None:
    """Print a model's file: its values, each with source and how sure."""
    for kind in library.KINDS:
        for known, file in library.names(kind).items():
            if "".join(known.split()).casefold() == "".join(name.split()).casefold():
                click.echo(file.read_text(encoding="utf-8"), nl=False)
                return
    raise input_error("model-unknown", f"no model {name!r}", "`gcode2krl models list` lists them")


@command.command("schema")
def schema() -> None:
    """Print the JSON schema of a cell file, for editors."""
    click.echo(json.dumps(cell_schema(), indent=2))


@command.command("check")
@click.argument("cell_path", required=False, metavar="[CELL.toml]")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def check(cell_path: str | None, as_json: bool) -> int:
    """Check a cell file and list what a person must confirm at the real cell."""
    console = Console(as_json=as_json)
    try:
        cell = load_cell(cell_path)
    except Gcode2KrlError as error:
        if not as_json:
            raise
        console.json({"valid": False, "issues": issue_dicts(error.issues)})
        return error.exit_code
    confirm = list(_to_confirm(cell))
    if as_json:
        console.json(
            {
                "valid": True,
                "verified": cell.verified is not None,
                "confirm": [dict(zip(("what", "value", "sure"), row, strict=True)) for row in confirm],
            }
        )
        return 0
    console.say(f"{cell_path or 'the default cell'}: valid")
    if cell.verified:
        console.say(f"verified by {cell.verified.by} on {cell.verified.date}")
    else:
        console.say(
            "NOT VERIFIED: programs begin with a HALT. Confirm each line at the cell, then add to its file:"
        )
        console.say('  verified = { by = "your name", date = "YYYY-MM-DD" }')
    width = max(len(what) for what, _, _ in confirm)
    for what, value, sure in confirm:
        console.say(f"  {what:<{width}}  {value}  ({sure})")
    return 0


def _to_confirm(cell: Cell) -> Iterator[tuple[str, str, str]]:
    """Yield (what, value, how sure) of everything a person must confirm."""
    robot = cell.robot
    yield "robot", robot.model, robot.geometry.sure
    yield "$TRAFONAME[] contains", robot.trafo_name or "not compared", "memory"
    yield "joint limits", _pairs(robot.limits.q_deg), robot.limits.sure
    yield "joint speeds", _list(robot.speeds.qd_deg_s, "deg/s"), robot.speeds.sure
    yield "$BASE", _frame(cell.frames.base) + _number("BASE_DATA", cell.frames.base_data), cell.frames.sure
    yield (
        "$TOOL (reference tool)",
        f"{_frame(cell.frames.tool)}, length {cell.frames.tool_length_mm:g} mm",
        cell.frames.sure,
    )
    for number, tool in sorted(cell.tool.items()):
        length = f"{tool.length_mm:g} mm" if tool.length_mm is not None else "no length"
        yield (
            f"tool T{number}",
            f"{tool.model or tool.kind} D{tool.diameter_mm:g} {length}{_number('TOOL_DATA', tool.tool_data)}",
            tool.sure,
        )
    yield (
        "$LOAD",
        f"{cell.load.mass_kg:g} kg at X {cell.load.x_mm:g} Y {cell.load.y_mm:g} Z {cell.load.z_mm:g}",
        cell.load.sure,
    )
    yield "HOME", _list(cell.home.q_deg, "deg"), "assumption"
    yield (
        "clearance plane",
        f"Z {cell.clearance.z_mm} mm in $BASE, free of obstacles all the way",
        "assumption",
    )
    spindle = cell.spindle
    yield (
        "spindle",
        f"$OUT[{spindle.run_cw_output}] cw, $OUT[{spindle.run_ccw_output}] ccw, "
        f"$ANOUT[{spindle.speed_analog_output}] = rpm/{spindle.max_rpm:g}",
        spindle.sure,
    )
    ready = (
        f"$IN[{spindle.at_speed_input}]"
        if spindle.at_speed_input
        else f"none, {spindle.start_s:g} s are waited"
    )
    yield "spindle at speed", ready, spindle.sure
    yield "coolant", f"$OUT[{spindle.flood_output}] flood, $OUT[{spindle.mist_output}] mist", spindle.sure
    for item in cell.guard_inputs:
        yield f"$IN[{item.number}]", f"{item.meaning} = {item.value}", "assumption"
    link = cell.online.link
    yield (
        "RSI",
        f"$OUT[{link.t1_output}] on in T1, $OUT[{link.ready_output}] free, PC {link.address}:{link.port}",
        "memory",
    )
    yield "M-codes", ", ".join(cell.m_code), "assumption"


def _frame(frame: Any) -> str:
    place = f"X {frame.x_mm:g} Y {frame.y_mm:g} Z {frame.z_mm:g}"
    return f"{place} A {frame.a_deg:g} B {frame.b_deg:g} C {frame.c_deg:g}"


def _number(name: str, number: int | None) -> str:
    return f" = {name}[{number}]" if number is not None else ""


def _pairs(pairs: tuple[tuple[float, float], ...] | None) -> str:
    return (
        "unknown: translation refuses"
        if pairs is None
        else ", ".join(f"{a:g}..{b:g}" for a, b in pairs) + " deg"
    )


def _list(values: tuple[float, ...] | None, unit: str) -> str:
    return "unknown" if values is None else f"{', '.join(f'{v:g}' for v in values)} {unit}"
