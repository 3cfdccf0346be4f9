"""``gcode2krl init``: a cell file from answers, at a terminal or in a file, and from an archive."""

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gcode2krl.cli.console import Console
from gcode2krl.cli.help_examples import examples
from gcode2krl.errors import Issue, NotUnderstoodError, RefusedError, input_error

if TYPE_CHECKING:
    from gcode2krl.cell import Cell
    from gcode2krl.cell.setup.controller import ArchivedController

SCHEMA = "gcode2krl-cell.schema.json"
"""Name of the schema that is written beside a cell file, for editors."""
DRAFT = ".answers"
"""Behind the name of a cell file: the answers of a dialogue that was ended."""


@click.command(
    "init",
    epilog=examples(
        "gcode2krl init --questions > answers.toml", "gcode2krl init mine.toml --answers answers.toml"
    ),
)
@click.argument("cell_path", default="cell.toml", metavar="[CELL.toml]", type=click.Path(path_type=Path))
@click.option(
    "--controller",
    "archive",
    type=click.Path(path_type=Path),
    help="Archive of the controller, folder or zip: states robot, limits, frames, load and HOME; or the URDF "
    "or xacro of an arm that is not in the library.",
)
@click.option("--answers", "answers_path", type=click.Path(path_type=Path), help="Answers in a TOML file.")
@click.option("--questions", is_flag=True, help="Print the questions as such a file, to be filled in.")
@click.option("--force", is_flag=True, help="Overwrite the cell file.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def command(
    cell_path: Path,
    archive: Path | None,
    answers_path: Path | None,
    questions: bool,
    force: bool,
    as_json: bool,
) -> int:
    """Write the cell file of your robot from your answers and the controller's archive.

    Each question says where the smartPAD shows the value. What is not answered is left out and named; nothing
    is made up. CELL.toml is cell.toml if it is not given.

    \b
    Examples:
      gcode2krl init
      gcode2krl init --controller archive.zip
      gcode2krl init --controller kr120_r3900.urdf
      gcode2krl init --questions > answers.toml
      gcode2krl init cell.toml --answers answers.toml
    """
    from gcode2krl.cell.setup.answers import completed, left_out, read_answers
    from gcode2krl.cell.setup.cell_text import text_of_cell
    from gcode2krl.cell.setup.controller import ArchivedController, read_controller
    from gcode2krl.cli.cell_list import findings, missing_keys
    from gcode2krl.cli.init_dialogue import questions_text

    if questions:
        click.echo(questions_text(), nl=False)
        return 0
    _refuse_existing(cell_path, force)
    console = Console(as_json=as_json)
    console.heading.reads(answers_path, archive)
    is_asked = answers_path is None
    if is_asked and not (sys.stdin.isatty() and sys.stdout.isatty()):
        sentence = "no terminal to ask questions at, and no --answers FILE"
        raise input_error("init-answer", sentence, "`gcode2krl init --questions` prints such a file")
    controller = read_controller(archive) if archive is not None else ArchivedController(source="")
    _say_read(console, controller)
    draft = cell_path.with_name(f"{cell_path.name}{DRAFT}")
    given = (
        _asked(controller, draft, console) if answers_path is None else read_answers(answers_path, controller)
    )
    answers = completed(given, controller)
    text = text_of_cell(answers, controller, SCHEMA)
    cell = _resolved(text, cell_path)
    console.heading.has_cell(cell, cell_path)
    _write(cell_path, text, [path for path in (answers_path, archive) if path is not None and path.is_file()])

    lacking, issues = missing_keys(cell), findings(cell)
    skipped = [question.key for question in left_out(answers)]
    if is_asked:
        draft.unlink(missing_ok=True)
    if as_json:
        files = (cell_path, cell_path.with_name(SCHEMA))
        return console.record({"missing": lacking, "not_answered": skipped}, issues, files=files)
    console.findings(issues, str(cell_path))
    _say_written(console, cell_path, lacking)
    return 0


def _asked(controller: "ArchivedController", draft: Path, console: Console) -> dict[str, Any]:
    """Ask the questions, from a draft on where one was left; Ctrl-C leaves one."""
    import tomli_w

    from gcode2krl.cell.library import read_toml
    from gcode2krl.cli.init_dialogue import Stopped, ask
    from gcode2krl.files import write_together

    known = read_toml(draft) if draft.exists() else {}
    if known:
        console.hint(f"{draft}: the answers of before are proposed")
    try:
        return ask(controller, known)
    except Stopped as stopped:
        tools = [_stated(tool) for tool in stopped.answers["tools"]]
        answers = {**known, **_stated(stopped.answers), "tools": [tool for tool in tools if tool]}
        write_together({draft: tomli_w.dumps(answers).encode("utf-8")})
        console.hint(f"\nanswers kept in {draft}: the same command goes on")
        raise KeyboardInterrupt from None


def _stated(answers: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in answers.items() if value is not None}


def _refuse_existing(cell_path: Path, force: bool) -> None:
    """Raise before the first question where the file could not be written in the end."""
    if not cell_path.parent.is_dir():
        sentence = f"no folder {str(cell_path.parent)!r}"
        raise input_error("output-unwritable", sentence, "make the folder first", source=str(cell_path))
    if cell_path.is_dir():
        raise input_error("output-unwritable", "this is a folder", "name a file", source=str(cell_path))
    if cell_path.exists() and not force:
        sentence = "is there already, and nothing is overwritten"
        raise input_error("output-exists", sentence, "choose another name, or --force", source=str(cell_path))
    schema = cell_path.with_name(SCHEMA)
    if schema.exists() and not force and not _is_our_schema(schema):
        sentence = "is there already and is not the schema of a cell file"
        raise input_error("output-exists", sentence, "choose another folder, or --force", source=str(schema))


def _is_our_schema(path: Path) -> bool:
    try:
        schema = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return isinstance(schema, dict) and schema.get("title") == "gcode2krl cell file"


def _resolved(text: str, cell_path: Path) -> "Cell":
    """Return the cell of the text; raises where answers contradict each other, with the lines of the text."""
    from gcode2krl.cell import resolve_cell
    from gcode2krl.cell.key_lines import with_lines
    from gcode2krl.cell.library import parse_toml

    try:
        return resolve_cell(parse_toml(text, str(cell_path)), folder=cell_path.parent, source=str(cell_path))
    except NotUnderstoodError as error:
        issues = _quoted(with_lines(error.issues, text), text)
        raise RefusedError(issues, f"{cell_path}, not written") from None


def _quoted(issues: tuple[Issue, ...], text: str) -> list[Issue]:
    """Return findings with the line that they mean as excerpt: the file is not written."""
    from dataclasses import replace

    lines = text.split("\n")
    excerpts = [lines[issue.line - 1].strip()[:100] if issue.line else "" for issue in issues]
    return [replace(issue, line=0, excerpt=text) for issue, text in zip(issues, excerpts, strict=True)]


def _write(cell_path: Path, text: str, inputs: list[Path]) -> None:
    from gcode2krl.cell import cell_schema
    from gcode2krl.files import write_together

    schema = json.dumps(cell_schema(), indent=2) + "\n"
    files: dict[Path, Any] = {
        cell_path: text.encode("utf-8"),
        cell_path.with_name(SCHEMA): schema.encode("ascii"),
    }
    write_together(files, inputs)


def _say_read(console: Console, controller: "ArchivedController") -> None:
    """Say what the archive states, and what of it no cell file can carry."""
    if not controller.source:
        return
    if controller.is_description:
        lengths = " ".join(f"{mm:g}" for mm in controller.lengths_mm or ())
        console.hint(f"{controller.source}: a1 a2 c1 c2 c3 c4 = {lengths} mm")
        return
    robot = controller.model or "not in the library"
    console.hint(f"{controller.source}: {controller.trafo_name or 'no name of the robot'} ({robot})")
    counts = (
        f"{len(controller.tools)} tools, {len(controller.bases)} bases, {len(controller.loads or {})} loads"
    )
    console.hint(f"  {counts}")
    if controller.externals:
        names = ", ".join(f"E{axis.number}" for axis in controller.externals)
        console.hint(f"  external axes {names}: in comments, as no archive says where they stand")


def _say_written(console: Console, cell_path: Path, lacking: list[str]) -> None:
    console.say(f"wrote {cell_path} and {SCHEMA}")
    for key in lacking:
        console.say(f"  MISSING: {key}")
    console.say(f"next, at the cell: gcode2krl models confirm {cell_path}")
