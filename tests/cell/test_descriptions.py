"""Every key of a cell file has a description, a unit and an example that is allowed; the page shows them."""

import json
import re
import tomllib
from importlib import resources
from typing import Annotated

from pydantic import TypeAdapter

from docs import make_cell
from gcode2krl.cell import cell_schema
from gcode2krl.cell.definition import Cell
from gcode2krl.cell.descriptions import _all_sections, descriptions_of, sections_in
from gcode2krl.cell.ranges import all_ranges
from gcode2krl.cell.setup.cell_text import toml_value

SECTIONS = _all_sections(Cell)
KEYS = [(section, key) for section in SECTIONS for key in descriptions_of(section)]
UNITS = {
    "mm": "mm", "deg": "deg", "s": "s", "N": "N", "Nm": "N·m", "W": "W", "rpm": "rpm", "kg": "kg", "hz": "Hz",
    "mb": "MB", "percent": "%", "kgm2": "kg·m²", "deg_s": "deg/s", "deg_s2": "deg/s²", "m_s": "m/s",
    "m_s2": "m/s²", "mm_s": "mm/s", "mm_s2": "mm/s²", "1_s": "1/s", "Nm_A": "N·m/A", "N_mm": "N/mm",
}  # fmt: skip
"""What the end of a key says of its unit."""
NO_UNITS = ("k_s", "i_1_s", "d_s")
"""Symbols: their ends are no units."""


def test_nothing_is_described_that_does_not_exist():
    text = resources.files("gcode2krl.cell").joinpath("descriptions.toml").read_text(encoding="utf-8")
    for name, keys in tomllib.loads(text).items():
        owners = [section for section in SECTIONS if name in [kind.__name__ for kind in section.__mro__]]
        assert owners, name
        for key in keys:
            assert any(key in section.model_fields for section in owners), f"{name}.{key}"


def test_a_key_has_a_description_and_an_example_that_is_allowed():
    for section, key in KEYS:
        known, field = descriptions_of(section)[key], section.model_fields[key]
        assert len(known.text) > 8, key
        assert not known.text.endswith("."), key
        if known.example is None:
            assert list(sections_in(field.annotation)), f"{key}: only a table of further keys has no example"
            continue
        kind = Annotated[field.annotation, *field.metadata] if field.metadata else field.annotation
        stated = tomllib.loads(f"value = {toml_value(known.example)}")["value"]
        TypeAdapter(kind).validate_python(stated)


def test_the_unit_is_that_of_the_name():
    for section, key in KEYS:
        parts, unit = key.split("_"), descriptions_of(section)[key].unit
        ends = ["_".join(parts[-count:]) for count in (2, 1) if len(parts) > count]
        meant = next((UNITS[end] for end in ends if end in UNITS), unit)
        assert unit if key in NO_UNITS else unit == meant, key


def test_examples_are_usual():
    """An example beyond the usual range would be copied with its warning."""
    for place, section in make_cell._places():
        for key, known in descriptions_of(section).items():
            name = re.sub(r"<\w+>", "*", f"{place}.{key}")
            usual = all_ranges().get(name)
            if usual is not None and known.example not in ("auto", "none"):
                low, high = usual.plausible
                for number in re.findall(r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?", toml_value(known.example)):
                    assert low <= float(number) <= high, name


def test_the_schema_shows_them():
    schema = cell_schema()
    assert schema["$defs"]["Tool"]["properties"]["length_mm"]["description"] == (
        "From the gauge line of the spindle to the tip [mm]"
    )
    for name, node in {"Cell": schema, **schema["$defs"]}.items():
        for key, value in node["properties"].items():
            assert value.get("description"), f"{name}.{key}"
    assert "TakenOver" not in json.dumps(schema)


def test_the_page_is_up_to_date():
    """Else run docs/make_cell.py."""
    assert make_cell.PAGE.read_text(encoding="utf-8") == make_cell.page()
