"""``gcode2krl models``: what is in the library, and what a person must confirm of a cell."""

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gcode2krl.cell import library
from gcode2krl.cli import confirm
from gcode2krl.cli.console import Console
from gcode2krl.cli.help_examples import examples
from gcode2krl.errors import Gcode2KrlError, input_error

if TYPE_CHECKING:
    from gcode2krl.cell import Cell


@click.group("models", epilog=examples("gcode2krl models list robots", "gcode2krl models check cell.toml"))
def command() -> None:
    """Robots, controllers, tools and cells: list, show, check, confirm, schema."""


command.add_command(confirm.command)


@command.command("list", epilog=examples("gcode2krl models list", "gcode2krl models list robots --json"))
@click.argument("kind", required=False, type=click.Choice(library.KINDS))
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def list_models(kind: str | None, as_json: bool) -> None:
    """List the models of the library."""
    kinds = [kind] if kind else list(library.KINDS)
    models = {k: list(library.names(k)) for k in kinds}
    if as_json:
        Console(as_json=True).record(models)
        return
    for k, names in models.items():
        click.echo(f"{k}:")
        for name in names:
            click.echo(f"  {name}")


@command.command(
    "show",
    epilog=examples(
        "gcode2krl models show kr300_demonstration > cell.toml", 'gcode2krl models show "KR 210 R2700 prime"'
    ),
)
@click.argument("name")
def show(name: str) -> None:
    """Print a model's file: its values with their source and reliability."""
    for kind in library.KINDS:
        for known, file in library.names(kind).items():
            if "".join(known.split()).casefold() == "".join(name.split()).casefold():
                click.echo(file.read_text(encoding="utf-8"), nl=False)
                return
    raise input_error("model-unknown", f"no model {name!r}", "`gcode2krl models list` lists them")


@command.command(
    "schema",
    epilog=examples(
        "gcode2krl models schema > cell.schema.json",
        "gcode2krl models schema project",
        "gcode2krl models schema result",
    ),
)
@click.argument("what", type=click.Choice(["cell", "project", "result"]), default="cell")
def schema(what: str) -> None:
    """Print the JSON schema of a cell or project file, for editors, or that of what --json prints."""
    from gcode2krl.cell import cell_schema
    from gcode2krl.result.model import result_schema
    from gcode2krl.translation.project_file import project_schema

    schemas = {"cell": cell_schema, "project": project_schema, "result": result_schema}
    click.echo(json.dumps(schemas[what](), indent=2))


@command.command(
    "check", epilog=examples("gcode2krl models check cell.toml", "gcode2krl models check --json")
)
@click.argument("cell_path", required=False, metavar="[CELL.toml]")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def check(cell_path: str | None, as_json: bool) -> int:
    """Check a cell file and list what a person must confirm at the real cell."""
    from gcode2krl.cell import load_cell
    from gcode2krl.cell.key_lines import with_lines
    from gcode2krl.cli.cell_list import findings, missing_keys, to_confirm
    from gcode2krl.krl.provenance import default_values

    console = Console(as_json=as_json)
    console.heading.reads(cell_path)
    try:
        cell = load_cell(cell_path)
    except Gcode2KrlError as error:
        if not as_json:
            raise
        return console.record({"valid": False}, error.issues, exit_code=error.exit_code)
    console.heading.has_cell(cell, cell_path)
    rows = list(to_confirm(cell))
    lacking, issues = missing_keys(cell), findings(cell)
    if cell_path is not None:
        issues = list(with_lines(issues, library.read_text(Path(cell_path))))
    wrong = any(issue.severity == "error" for issue in issues)
    if as_json:
        return console.record(
            {
                "valid": not wrong,
                "verified": cell.is_confirmed,
                "confirm": [dict(zip(("what", "value", "sure"), row, strict=True)) for row in rows],
                "taken_over": [taken.model_dump() for taken in cell.taken_over],
                "defaults": default_values(cell),
                "missing": lacking,
            },
            issues,
            exit_code=1 if wrong else 0,
        )
    name = cell_path or "the demonstration cell"
    console.say(f"{name}: {'refused' if wrong else 'valid'}")
    console.findings(tuple(issues), name)
    _say_verified(console, cell, cell_path)
    width = max(len(what) for what, _, _ in rows)
    for what, value, sure in rows:
        console.say(f"  {what:<{width}}  {value}  ({sure})")
    _say_provenance(console, cell, lacking)
    return 1 if wrong else 0


def _say_verified(console: Console, cell: "Cell", cell_path: str | None) -> None:
    from gcode2krl.cell.confirmation import signers

    if cell.is_confirmed and cell.verified is not None:
        console.say(f"verified by {', by '.join(signers(cell.verified))}")
    elif cell.unconfirmed == ():
        console.say("NOT VERIFIED: the confirmation does not cover what is taken over, see below")
    else:
        console.say("NOT VERIFIED: programs begin with a HALT. Compare each line with the cell, then run")
        console.say(f"  gcode2krl models confirm {cell_path or 'CELL.toml'}")


def _say_provenance(console: Console, cell: "Cell", lacking: list[str]) -> None:
    """List values taken over and their cells, defaults that nobody stated, and what is missing."""
    from gcode2krl.krl.provenance import default_values

    for taken in cell.taken_over:
        whose = f"{taken.source}{', verified there' if taken.verified else ''}"
        console.say(f"  taken over: {taken.key} = {taken.value}  (from {whose})")
    if cell.defaults:
        console.say("  defaults that the cell does not state:")
    for key, value in default_values(cell).items():
        console.say(f"    {key} = {value}")
    for key in lacking:
        console.say(f"  MISSING: {key}")
