"""``gcode2krl inspect PART``: what a program is seen to be, and what it will ask of the cell."""

from dataclasses import asdict
from typing import Any

import click

from gcode2krl.cli.console import Console
from gcode2krl.cli.help_examples import examples
from gcode2krl.cli.inputs import require_part, search_option
from gcode2krl.files.program_names import DIALECT_NAMES


@click.command("inspect", epilog=examples("gcode2krl inspect part.nc", "gcode2krl inspect part.nc --json"))
@click.argument("part", type=click.Path())
@click.option(
    "--dialect",
    type=click.Choice(DIALECT_NAMES),
    help="Read it so; default: as its own marks say, else linuxcnc.",
)
@search_option
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object on standard output.")
def command(part: str, dialect: str | None, search: tuple[str, ...], as_json: bool) -> int:
    """Show what a program is: control, CAM, unit, tools, offsets, extents, what the cell must say.

    Nothing is written, and no cell is needed. The exit code is 2 where the program cannot be read.
    """
    from gcode2krl.gcode.overview import overview_of

    console = Console(as_json=as_json)
    require_part(part)
    console.heading.reads(part)
    seen = overview_of(part, dialect, search)
    record = asdict(seen)
    record.pop("issues")
    if not as_json:
        for name, text in _lines(record):
            console.say(f"  {name:<12}{text}")
    console.findings(seen.issues, part)
    failed = seen.moves is None
    return console.record({"overview": record}, seen.issues, exit_code=2 if failed else 0)


def _lines(seen: dict[str, Any]) -> list[tuple[str, str]]:
    control = f"{seen['control']}: {seen['mark']}" if seen["control"] else "no mark tells"
    lines = [("control", control), ("read as", f"--dialect {seen['dialect']}")]
    if seen["cam"]:
        lines.append(("CAM", seen["cam"]))
    lines += [
        ("unit", seen["unit"] or "not stated; mm"),
        ("tools", ", ".join(seen["tools"]) or "none named"),
        *(("comment", text) for text in seen["comments"]),
        ("offsets", ", ".join(seen["offsets"]) or "none named"),
        ("subprograms", ", ".join(seen["subprograms"]) or "none called"),
    ]
    if seen["moves"] is None:
        lines.append(("moves", "not read, see below"))
    else:
        lines.append(("moves", f"{seen['moves']}"))
    if seen["extent_mm"]:
        spans = (
            f"{axis} {low:g}..{high:g}" for axis, (low, high) in zip("XYZ", seen["extent_mm"], strict=True)
        )
        lines.append(("extent", ", ".join(spans) + " mm, without [work_offsets]"))
    for key, name, unit in (("feeds_mm_min", "feed", "mm/min"), ("speeds_rpm", "spindle", "rpm")):
        if seen[key]:
            low, high = seen[key]
            lines.append((name, f"{low:g}..{high:g} {unit}"))
    return [*lines, *(("cell", text) for text in seen["asked_of_cell"])]
