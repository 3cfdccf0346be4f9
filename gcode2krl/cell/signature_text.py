"""The signature of a cell in the text of its file: taken out, and written anew at the end."""

import re
from typing import Any

from gcode2krl.cell.key_lines import lines_of_table

TABLE = "verified"
_HEAD = (
    "# What a person confirmed, by `gcode2krl models confirm`. An edit here or of a value above undoes it."
)


def with_signature(text: str, signature: dict[str, Any]) -> str:
    """Return the text of a cell file with a signature at its end, in place of the one that it has.

    ``signature`` is ``[verified]`` as plain values. All other lines stay as they are, to the byte.
    """
    newline = "\r\n" if "\r\n" in text[: text.find("\n") + 1] else "\n"
    kept = without_signature(text)
    if kept and not kept.endswith("\n"):
        kept += newline
    lines = ["", _HEAD, *_tables(signature)]
    return kept + "".join(line + newline for line in lines)


def without_signature(text: str) -> str:
    """Return the text without the lines of ``[verified]`` or ``verified = …``, and its comment."""
    lines = re.findall(r"[^\n]*\n|[^\n]+", text)
    removed = lines_of_table(text, TABLE)
    first = min(removed, default=0)
    blank = {number for number, line in enumerate(lines, start=1) if not line.strip()}
    removed |= {number for number in blank if {number - 1, number + 1} <= removed}
    if first > 1 and lines[first - 2].strip() == _HEAD:
        removed |= {first - 1, *({first - 2} & blank)}
    return "".join(line for number, line in enumerate(lines, start=1) if number not in removed)


def _tables(signature: dict[str, Any]) -> list[str]:
    """Return the lines of the tables; a section's signature, and a confirmed value, is one line."""
    import tomli_w

    lines = [f"[{TABLE}]"]
    tables = {name: value for name, value in signature.items() if isinstance(value, dict)}
    plain = {name: value for name, value in signature.items() if name not in tables}
    lines += tomli_w.dumps(plain).rstrip("\n").split("\n")
    for name, table in tables.items():
        if not table:
            continue
        lines += ["", f"[{TABLE}.{name}]"]
        for key, value in table.items():
            name = key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else _toml(key)
            lines.append(f"{name} = {_toml(value)}")
    return lines


def _toml(value: Any) -> str:
    """Return a value on one line."""
    import tomli_w

    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_toml(inner)}" for key, inner in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return tomli_w.dumps({"x": value}).rstrip("\n").removeprefix("x = ")
