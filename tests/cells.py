"""Cells for tests: one that states everything itself, and partial cells over the demonstration."""

from gcode2krl.cell import Cell, library, resolve_cell

_DEMONSTRATION = library.read_model("cells", "kr300_demonstration")
OWN_CELL = {key: value for key, value in _DEMONSTRATION.items() if key != "model"} | {"based_on": ""}
"""All values of the demonstration cell, stated by the cell itself: nothing is taken over."""


def over_demonstration(data: dict | None = None) -> Cell:
    """Return the demonstration cell with some keys of its own."""
    return resolve_cell({"based_on": "demonstration", **(data or {})})
