"""What each key of a cell file means, in which unit, with an example: from ``descriptions.toml``."""

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from typing import Any, get_args

from pydantic import BaseModel

NOT_OF_A_FILE = ("taken_over", "defaults", "unconfirmed")
"""Keys that only a resolved cell has."""


@dataclass(frozen=True)
class Description:
    """What a key means; ``example`` is None for a table of further keys."""

    text: str
    unit: str
    example: Any

    def sentence(self) -> str:
        """Return text and unit on one line."""
        return f"{self.text} [{self.unit}]" if self.unit else self.text


@lru_cache(maxsize=1)
def _table() -> Mapping[str, Mapping[str, Any]]:
    text = resources.files("gcode2krl.cell").joinpath("descriptions.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def descriptions_of(section: type[BaseModel]) -> dict[str, Description]:
    """Return key → description of a section, in the section's order; a key without one is a `KeyError`."""
    known: dict[str, Any] = {}
    for kind in reversed(section.__mro__):
        known |= _table().get(kind.__name__, {})
    return {
        key: Description(known[key]["text"], known[key].get("unit", ""), known[key].get("example"))
        for key in section.model_fields
        if key not in NOT_OF_A_FILE
    }


def unit_of(cell: type[BaseModel], key: str) -> str:
    """Return the unit of a dotted key of a cell, ``tool.1.length_mm``; empty where it has none."""
    kinds: list[type[BaseModel]] = [cell]
    unit = ""
    for step in key.split("."):
        having = [kind for kind in kinds if step in kind.model_fields]
        if having:  # else the number of a tool, an entry of a list or the name of a work offset
            unit = descriptions_of(having[0])[step].unit
            kinds = [model for kind in having for model in sections_in(kind.model_fields[step].annotation)]
    return unit


def sections_in(annotation: Any) -> Iterator[type[BaseModel]]:
    """Yield the sections that a value of this type may be or hold."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from sections_in(part)


def described_schema(cell: type[BaseModel]) -> dict[str, Any]:
    """Return the JSON schema of a cell, each key with its description, unit and example."""
    sections = _all_sections(cell)
    for section in sections:  # a default value can be written once its section's schema is built
        section.model_rebuild()
    schema = cell.model_json_schema()
    schema["properties"] = {
        key: value for key, value in schema["properties"].items() if key not in NOT_OF_A_FILE
    }
    for section in sections:
        node = schema if section is cell else schema["$defs"].get(section.__name__)
        for key, description in descriptions_of(section).items() if node else ():
            node["properties"][key]["description"] = description.sentence()
            if description.example is not None:
                node["properties"][key]["examples"] = [description.example]
    _drop_unused(schema)
    return schema


def _all_sections(cell: type[BaseModel]) -> list[type[BaseModel]]:
    """Return the sections of a cell as far as a file can state them, the cell first."""
    models = [cell]
    for section in models:  # grows while it is read
        for key, field in section.model_fields.items():
            if key not in NOT_OF_A_FILE:
                models += [one for one in dict.fromkeys(sections_in(field.annotation)) if one not in models]
    return models


def _drop_unused(schema: dict[str, Any]) -> None:
    """Leave out the definitions that only keys of a resolved cell refer to."""
    text = repr({key: value for key, value in schema.items() if key != "$defs"}) + repr(schema["$defs"])
    schema["$defs"] = {name: value for name, value in schema["$defs"].items() if f"'#/$defs/{name}'" in text}
