"""``gcode2krl models confirm``: a person confirms a cell, section by section, and the cell file is signed."""

import datetime
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gcode2krl.cell import library
from gcode2krl.cli.console import Console
from gcode2krl.cli.help_examples import examples
from gcode2krl.errors import RefusedError, input_error

if TYPE_CHECKING:
    from gcode2krl.cell import Cell
    from gcode2krl.cell.fingerprint import Values

_FRAME_KEYS = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")


@click.command(
    "confirm",
    epilog=examples(
        'gcode2krl models confirm cell.toml --by "J. Smith" --yes',
        'gcode2krl models confirm cell.toml --by "J. Smith" --section clearance --yes',
    ),
)
@click.argument("cell_path", metavar="CELL.toml", type=click.Path(path_type=Path))
@click.option("--by", help="Name of the person who confirms.")
@click.option(
    "--section", "named", multiple=True, help="Confirm this section only, again too; may be repeated."
)
@click.option("--yes", is_flag=True, help="Ask nothing: the person has compared what `check` lists.")
@click.option("--date", "day", help="Day of the confirmation, year-month-day.  [default: today]")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def command(
    cell_path: Path, by: str | None, named: tuple[str, ...], yes: bool, day: str | None, as_json: bool
) -> int:
    """Confirm at the real cell that a cell file is true, and sign the file with what was confirmed.

    It asks for the sections that nobody has confirmed as they are. The signature is [verified], at the end of
    the file; an edit of a value, of the base or of the library undoes it for its section.
    """
    from gcode2krl.cell import load_cell
    from gcode2krl.cell.fingerprint import values_by_section
    from gcode2krl.cli.cell_list import findings

    console = Console(as_json=as_json)
    console.heading.reads(cell_path)
    before = _bytes_of(cell_path)
    cell = load_cell(cell_path)
    console.heading.has_cell(cell, str(cell_path))
    wrong = [issue for issue in findings(cell) if issue.severity == "error"]
    if wrong:
        raise RefusedError(wrong, str(cell_path))
    values = values_by_section(cell)
    sections = _sections_to_ask(cell, values, named)
    _require_answers(cell_path, by, yes, as_json)
    person = by or click.prompt("Who confirms? Your name")
    day = day or str(datetime.date.today())  # where the person is
    confirmed = list(sections) if yes else _asked(console, cell, cell_path, sections, values)
    declined = [section for section in sections if section not in confirmed]
    if confirmed:
        cell = _sign(cell, cell_path, before, person, day, confirmed)
    issues = findings(cell)
    if as_json:
        record: dict[str, Any] = {"confirmed": confirmed, "declined": declined, "verified": cell.is_confirmed}
        return console.record(record, issues, files=(cell_path,) if confirmed else ())
    _say_done(console, cell, cell_path, confirmed, declined)
    return 0


def _bytes_of(path: Path) -> bytes:
    library.read_text(path)  # says what is wrong with it
    return path.read_bytes()


def _sections_to_ask(cell: "Cell", values: "Values", named: Sequence[str]) -> list[str]:
    """Return the sections that are named, or else those that are not confirmed as they are, or are gone."""
    signed = cell.verified.sections if cell.verified is not None else {}
    known = [*values, *(section for section in signed if section not in values)]
    unknown = [section for section in named if section not in known]
    if unknown:
        sentence = f"--section: the cell has no {unknown[0]!r}"
        raise input_error("option-value", sentence, f"name one of {', '.join(known)}")
    if named:
        return list(dict.fromkeys(named))
    if cell.unconfirmed is None:
        return list(values)
    from gcode2krl.cell.fingerprint import section_of

    different = {section_of(one.key) for one in cell.unconfirmed}
    return [section for section in known if section in different]


def _require_answers(cell_path: Path, by: str | None, yes: bool, as_json: bool) -> None:
    """Raise where nobody can answer and nothing says that somebody did."""
    is_terminal = sys.stdin.isatty() and sys.stdout.isatty() and not as_json
    if (yes and by) or (is_terminal and not yes):
        return
    if yes:
        raise input_error("option-value", "--yes without a name: who confirms?", "add --by NAME")
    raise input_error(
        "option-value",
        "nothing is confirmed: there is no terminal to ask at",
        f"run `gcode2krl models confirm {cell_path}` at a terminal; or, once a person has compared what "
        "`gcode2krl models check` lists, add --by NAME --yes",
    )


def _asked(
    console: Console, cell: "Cell", cell_path: Path, sections: Sequence[str], values: "Values"
) -> list[str]:
    """Ask section by section; return those that the person confirms."""
    from gcode2krl.cell.base import stated_keys
    from gcode2krl.cell.confirmation import sentence_of
    from gcode2krl.cell.fingerprint import section_of
    from gcode2krl.cell.key_lines import lines_of_keys

    text = library.read_text(cell_path)
    stated = stated_keys(library.parse_toml(text, str(cell_path)))
    lines = {key: line for key, line in lines_of_keys(text).items() if key in stated}
    console.say("Compare each value with the real cell. Ctrl-C ends without a change of the file.")
    confirmed = []
    for count, section in enumerate(sections, start=1):
        console.say(f"\n[{section}]  {count} of {len(sections)}")
        for value in cell.unconfirmed or ():
            if section_of(value.key) == section and value.kind != "unsigned":
                console.say(f"  ! {sentence_of(value)}")
        for row in _rows(cell, section, values.get(section, {}), lines):
            console.say(f"  {row}")
        if section == "robot" and not _is_this_robot(console, cell):
            continue
        if click.confirm("Is it so at the cell?", default=False):
            confirmed.append(section)
    return confirmed


def _is_this_robot(console: Console, cell: "Cell") -> bool:
    """Ask what the controller shows, and tell whether the guard of a program would accept it."""
    if not cell.robot.trafo_name:
        console.say("  no program can tell whether it runs on this robot: state [robot] trafo_name")
        return True
    where = "What does $TRAFONAME[] show (Display > Variable > Single)? Enter: not read"
    shown = click.prompt(where, default="", show_default=False)
    if cell.robot.is_named(shown):
        return True
    if shown:
        console.say(
            f"  this is not {cell.robot.trafo_name!r}, and the guard of each program would stop there"
        )
        name = shown.strip().removeprefix("#")
        console.say(f'  if it is the right robot, write into the cell file: [robot] trafo_name = "{name}"')
    console.say("  [robot] is not confirmed")
    return False


def _rows(cell: "Cell", section: str, values: dict[str, Any], lines: dict[str, int]) -> list[str]:
    """Return key, value, unit and source of what a person is shown of a section."""
    from gcode2krl.cell import Cell as AnyCell
    from gcode2krl.cell.confirmation import is_shown
    from gcode2krl.cell.descriptions import unit_of
    from gcode2krl.cli.cell_list import origin_of, switched

    rows: list[str] = []
    frames: set[str] = set()
    hidden = [key for key in values if not is_shown(key)]
    effects = switched(cell)
    for key, value in values.items():
        above, _, last = key.rpartition(".")
        is_frame = last in _FRAME_KEYS and all(f"{above}.{name}" in values for name in _FRAME_KEYS)
        origin = origin_of(cell, key, lines)
        if key in hidden:
            continue
        if is_frame and above not in frames:
            frames.add(above)
            place = " ".join(f"{k[0].upper()} {values[f'{above}.{k}']:g}" for k in _FRAME_KEYS)
            rows.append(f"{above} = {place} mm, deg  ({origin})")
        elif not is_frame:
            unit = unit_of(AnyCell, key)
            words = f"{key} = {_words(value)}{f' {unit}' if unit else ''}  ({origin})"
            rows.append(words + (f"\n      {effects[key]}" if key in effects else ""))
    source = _source(cell, section)
    if hidden:
        tables = ", ".join(dict.fromkeys(key[len(section) + 1 :].partition(".")[0] for key in hidden))
        rows.append(f"and {len(hidden)} values of {tables}: not listed, the signature keeps a hash of each")
    return rows + ([f"source: {source}"] if source else [])


def _words(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else " / ".join(str(value).split("\n"))


def _source(cell: "Cell", section: str) -> str:
    """Return where a section's values come from, and how sure they are, as it says itself."""
    name, _, number = section.partition(".")
    table = getattr(cell, name)
    table = table.get(int(number)) if number else table
    source, sure = getattr(table, "source", ""), getattr(table, "sure", "")
    return f"{source or 'not stated'} ({sure})" if sure else ""


def _sign(cell: "Cell", cell_path: Path, before: bytes, by: str, day: str, sections: Sequence[str]) -> "Cell":
    """Write the signature into the cell file, and return the cell as it is read then."""
    from pydantic import ValidationError

    from gcode2krl.cell import resolve_cell
    from gcode2krl.cell.confirmation import signed
    from gcode2krl.cell.fingerprint import section_of
    from gcode2krl.cell.signature_text import with_signature
    from gcode2krl.files import write_together

    try:
        signature = signed(cell, by, day, sections)
    except ValidationError as error:
        detail = error.errors(include_url=False)[0]
        which = "--date" if "date" in detail["loc"] else "--by"
        raise input_error(
            "option-value", f"{which}: {detail['msg']}", "--by NAME --date 2026-11-28"
        ) from None
    text = with_signature(before.decode("utf-8"), signature.model_dump(mode="json", exclude_none=True))
    data = library.parse_toml(text.removeprefix("\ufeff"), str(cell_path))
    as_signed = resolve_cell(data, folder=cell_path.parent, source=str(cell_path))
    different = {section_of(one.key) for one in as_signed.unconfirmed or ()} & set(sections)
    if different or as_signed.unconfirmed is None:
        raise RuntimeError(f"the signature of {cell_path} does not fit what it signs: {sorted(different)}")
    if cell_path.read_bytes() != before:
        sentence = "the file was edited while it was being confirmed: nothing was written"
        raise input_error("output-exists", sentence, "confirm it again", source=str(cell_path))
    write_together({cell_path.resolve(): text.encode("utf-8")})
    return as_signed


def _say_done(
    console: Console, cell: "Cell", cell_path: Path, confirmed: Sequence[str], declined: Sequence[str]
) -> None:
    if confirmed:
        console.say(f"{cell_path}: confirmed and signed: {', '.join(confirmed)}")
    elif not declined:
        console.say(f"{cell_path}: every value is as it was confirmed; --section NAME confirms one again")
    if declined:
        console.say(f"NOT CONFIRMED: {', '.join(declined)}; programs begin with a HALT")
    if cell.taken_over:
        count = len(cell.taken_over)
        console.say(f"NOT COVERED: {count} values taken over from another cell; programs begin with a HALT")
