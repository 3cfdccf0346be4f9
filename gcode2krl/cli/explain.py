"""``gcode2krl explain CODE``: what a finding means and what to do about it."""

from dataclasses import asdict
from textwrap import TextWrapper, shorten

import click

from gcode2krl.cli.console import Console
from gcode2krl.cli.help_examples import examples
from gcode2krl.codes import Code, all_codes, closest
from gcode2krl.errors import Gcode2KrlError, input_error

_WIDTH = 100
_FIELDS = ("why", "example", "remedy", "allow")


@click.command("explain", epilog=examples("gcode2krl explain spindle-off", "gcode2krl explain"))
@click.argument("code", required=False, metavar="[CODE]")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object on standard output.")
def command(code: str | None, as_json: bool) -> int:
    """Explain a finding by its code, as printed: spindle-off or spindle-off:12.

    Says why it matters on the robot, what causes it, what to do, and when a person may allow it with
    --allow. Without CODE all codes are listed.
    """
    console = Console(as_json=as_json)
    try:
        entries = tuple(all_codes().values()) if code is None else (_entry(code),)
    except Gcode2KrlError as error:
        if not as_json:
            raise
        return console.record({"codes": []}, error.issues, exit_code=error.exit_code)
    if as_json:
        return console.record({"codes": [_record(entry) for entry in entries]})
    if code is None:
        for entry in entries:
            console.say(_brief(entry))
    else:
        for line in _explained(entries[0]):
            console.say(line)
    return 0


def _entry(word: str) -> Code:
    """Return the entry of a code as a person writes it, with or without its line or brackets."""
    name = word.strip("[] ").partition(":")[0].lower()
    known = all_codes()
    if name not in known:
        near = closest(name, known)
        remedy = f"did you mean {near!r}?" if near else "`gcode2krl explain` lists all"
        raise input_error("code-unknown", f"no finding has the code {word!r}", remedy)
    return known[name]


def _record(entry: Code) -> dict[str, object]:
    record = asdict(entry)
    return {"code": record.pop("name"), **record}


def _brief(entry: Code) -> str:
    width = max(len(name) for name in all_codes())
    return f"{entry.name:<{width}}  {shorten(entry.why, _WIDTH - width, placeholder=' …')}"


def _explained(entry: Code) -> list[str]:
    lines = [f"{entry.name}: {entry.severity}"]
    for field in _FIELDS:
        wrapper = TextWrapper(_WIDTH, initial_indent=f"  {field:<9}", subsequent_indent=" " * 11)
        lines += wrapper.wrap(getattr(entry, field))
    return lines
