"""The resolved values of a cell by section, and a hash of each section.

What a person confirms, what a program's header remembers, and what `verify` compares are these values: of the
cell file, its base, the library and the documented defaults together, so that a change in any of them shows.
"""

import hashlib
import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from gcode2krl.cell.definition import Cell, as_toml
from gcode2krl.cell.descriptions import NOT_OF_A_FILE
from gcode2krl.files.there import is_there

Values = dict[str, dict[str, Any]]
"""Section (``frames``, ``tool.1``, ``m_code``) → dotted key → plain value."""

_NOT_OF_THE_CELL = frozenset({"name", "based_on", "verified", *NOT_OF_A_FILE})
"""Who confirmed what, and where values came from, is not itself a value."""
_PROVENANCE = frozenset(
    {"source", "sure", "note", "robot_source", "robot_sure", "trafo_source", "trafo_sure"}
)
_HASH_DIGITS = 12
_NAMES_FILE = re.compile(r"\.(?:model|mesh|calibration)$")


def values_by_section(cell: Cell) -> Values:
    """Return section → dotted key → value of everything that a cell states or takes over.

    Each tool is a section of its own. A key on the top level (``tool_change``) is a section with itself as
    its only key. Sources and notes are left out: they change no motion.
    """
    record = as_toml(cell)
    tools = record.pop("tool")
    sections = {**record, **{f"tool.{number}": tool for number, tool in tools.items()}}
    values = {
        section: dict(_leaves(section, content))
        for section, content in sorted(sections.items())
        if section not in _NOT_OF_THE_CELL
    }
    return {section: leaves for section, leaves in values.items() if leaves}


def section_hashes(values: Values) -> dict[str, str]:
    """Return section → the first 12 hexadecimal digits of the SHA-256 of its values as canonical JSON."""
    return {
        section: hashlib.sha256(json.dumps(leaves, sort_keys=True).encode()).hexdigest()[:_HASH_DIGITS]
        for section, leaves in values.items()
    }


def section_of(key: str) -> str:
    """Return the section of a dotted key, or of a section itself."""
    first, _, inner = key.partition(".")
    return f"{first}.{inner.partition('.')[0]}" if first == "tool" else first


def _leaves(key: str, content: Any) -> Iterator[tuple[str, Any]]:
    """Yield the dotted key of each plain value; the items of a list of tables are numbered from 1."""
    if isinstance(content, Mapping):
        for name, inner in content.items():
            if name not in _PROVENANCE:
                yield from _leaves(f"{key}.{name}", inner)
    elif isinstance(content, list) and content and all(isinstance(item, Mapping) for item in content):
        for number, item in enumerate(content, start=1):
            yield from _leaves(f"{key}.{number}", item)
    elif content != []:
        yield key, _wherever_it_lies(key, content)


def _wherever_it_lies(key: str, value: Any) -> Any:
    """Return a value as it is on every machine: of a file its name, and what is in it."""
    if not isinstance(value, str) or not _NAMES_FILE.search(key) or not Path(value).is_absolute():
        return value
    file = Path(value)
    if key.endswith(".model") or not is_there(file):  # the values of a model stand in its section
        return file.name
    with file.open("rb") as stream:
        return f"{file.name} {hashlib.file_digest(stream, 'sha256').hexdigest()[:_HASH_DIGITS]}"
