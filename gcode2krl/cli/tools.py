"""``gcode2krl tools import FILE --cell cell.toml``: cutters of a CAM system's library become ``[tool.N]``."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from gcode2krl.cell.tool_files import read_tools, sections_of
from gcode2krl.cli.console import Console
from gcode2krl.cli.help_examples import examples
from gcode2krl.errors import Gcode2KrlError, Issue, input_error


@click.group("tools", epilog=examples("gcode2krl tools import library.json --cell cell.toml"))
def command() -> None:
    """Cutters: take them from the library of a CAM system."""


@command.command(
    "import",
    epilog=examples(
        "gcode2krl tools import library.json",
        "gcode2krl tools import library.json --cell cell.toml --set 5.length_mm=98.2",
        "gcode2krl tools import tool.tbl --unit mm --set 1.teeth=3",
    ),
)
@click.argument("file")
@click.option("--cell", "cell_path", metavar="CELL.toml", help="Cell file to which the tools are added.")
@click.option("--unit", type=click.Choice(["mm", "inch"]), default=None, help="Where the file states none.")
@click.option(
    "--set",
    "stated",
    multiple=True,
    metavar="N.KEY=VALUE",
    help="What the file does not state, such as 5.length_mm=98.2; may be repeated.",
)
@click.option("--only", metavar="1,5,7", help="Numbers of the tools to take; default: all.")
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but findings.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object on standard output.")
def import_(
    file: str,
    cell_path: str | None,
    unit: str | None,
    stated: tuple[str, ...],
    only: str | None,
    quiet: bool,
    as_json: bool,
) -> int:
    """Take cutters from a library of Fusion (.json, .tools, .csv), FreeCAD (.fctb, .fctl), LinuxCNC (.tbl).

    Or from the header comments of a program.

    Tools that the cell has already stay as they are; where theirs is another cutter, that is told. The length
    from the spindle's gauge line to the tip is the robot's own: where the library does not have it, a program
    with the tool is refused until it is stated.
    """
    console = Console(quiet, as_json)
    try:
        console.heading.reads(file)
        numbers = _numbers(only)
        tools = [tool for tool in read_tools(Path(file), unit or "") if not numbers or tool.number in numbers]
        sections, issues = sections_of(tools, _pairs(stated), Path(file).name)
        written: list[Path] = []
        there: dict[int, Any] = {}
        if cell_path is not None:
            there, more = _in_cell(sections, cell_path)
            issues += more
            written = _added({n: keys for n, keys in sections.items() if n not in there}, cell_path)
    except Gcode2KrlError as error:
        return console.refused(error, ["tools"], file)
    added = [number for number in sections if number not in there]
    if as_json:
        figures = {
            "tools": {str(n): keys for n, keys in sections.items()},
            "added": added if cell_path else [],
        }
        return console.record(figures, issues, files=written)
    console.findings(issues, file)
    if cell_path is None:
        console.say("\n\n".join(_text(number, keys) for number, keys in sections.items()))
    else:
        names = ", ".join(f"T{number}" for number in added) or "nothing"
        kept = f"; as they were: {', '.join(f'T{number}' for number in there)}" if there else ""
        console.say(f"{file} -> {cell_path}: {names} added{kept}")
    return 0


def _numbers(only: str | None) -> set[int]:
    try:
        return {int(word) for word in only.split(",")} if only else set()
    except ValueError:
        raise input_error("option-value", f"--only {only!r}: no numbers", "--only 1,5,7") from None


def _pairs(words: Sequence[str]) -> dict[int, dict[str, Any]]:
    pairs: dict[int, dict[str, Any]] = {}
    for word in words:
        place, equals, value = word.partition("=")
        number, dot, key = place.partition(".")
        if not equals or not dot or not number.isdigit():
            raise input_error("option-value", f"--set {word!r}: no N.KEY=VALUE", "--set 5.length_mm=98.2")
        try:
            pairs.setdefault(int(number), {})[key] = json.loads(value)
        except ValueError:
            pairs.setdefault(int(number), {})[key] = value
    return pairs


def _in_cell(sections: Mapping[int, Mapping[str, Any]], cell_path: str) -> tuple[dict[int, Any], list[Issue]]:
    """Return the cell's own tools of these numbers, and a finding where theirs is another cutter."""
    from gcode2krl.cell import load_cell
    from gcode2krl.cell.job import differences

    tools = load_cell(cell_path).tool
    there = {number: tools[number] for number in sections if number in tools}
    return there, [issue for n, tool in there.items() for issue in differences(n, tool, sections[n])]


def _added(sections: Mapping[int, Mapping[str, Any]], cell_path: str) -> list[Path]:
    """Add sections at the end of a cell file, where the cell is sound with them."""
    from gcode2krl.cell.library import parse_toml, read_text
    from gcode2krl.cell.loading import resolve_cell
    from gcode2krl.files import write_together

    if not sections:
        return []
    file = Path(cell_path)
    text = read_text(file)
    longer = (
        "\n\n".join([text.rstrip("\n"), *(_text(number, keys) for number, keys in sections.items())]) + "\n"
    )
    resolve_cell(parse_toml(longer, cell_path), folder=file.parent, source=cell_path)
    write_together({file: longer.encode()})
    return [file]


def _text(number: int, keys: Mapping[str, Any]) -> str:
    lines = (f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in keys.items())
    return "\n".join([f"[tool.{number}]", *lines])
