"""Cells for tests: one that states everything itself, and partial cells over the demonstration."""

import json
from functools import cache
from pathlib import Path

from gcode2krl.cell import Cell, confirmation, library, resolve_cell
from gcode2krl.cell.fingerprint import values_by_section

_DEMONSTRATION = library.read_model("cells", "kr300_demonstration")
OWN_CELL = {key: value for key, value in _DEMONSTRATION.items() if key != "model"} | {"based_on": ""}
"""All values of the demonstration cell, stated by the cell itself: nothing is taken over."""


def over_demonstration(data: dict | None = None) -> Cell:
    """Return the demonstration cell with some keys of its own; what is asked for again is the same object."""
    return _resolved(json.dumps({"based_on": "demonstration", **(data or {})}))


@cache
def _resolved(text: str) -> Cell:
    return resolve_cell(json.loads(text))


def signed(data: dict, by: str = "A. Person", date: str = "2026-01-31", beside: Path | None = None) -> dict:
    """Return a cell file whose every section a person confirmed."""
    cell = resolve_cell(data, beside)
    signature = confirmation.signed(cell, by, date, values_by_section(cell))
    return {**data, "verified": signature.model_dump(mode="json", exclude_none=True)}
