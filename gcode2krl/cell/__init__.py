"""The cell file and the model library: everything the planner knows about robot, tools and program."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gcode2krl.cell.definition import (
        CODES_WITHOUT_SIGNALS,
        Cell,
        as_toml,
        cell_schema,
        controller_axes,
        plain_view,
    )
    from gcode2krl.cell.loading import cell_from_resolved, load_cell, resolve_cell

__all__ = [
    "CODES_WITHOUT_SIGNALS",
    "Cell",
    "as_toml",
    "cell_from_resolved",
    "cell_schema",
    "controller_axes",
    "load_cell",
    "plain_view",
    "resolve_cell",
]
_LOADING = ("cell_from_resolved", "load_cell", "resolve_cell")


def __getattr__(name: str) -> Any:
    """Import a public name on first use: the model library is read without the definition of a cell."""
    if name not in __all__:
        raise AttributeError(f"module 'gcode2krl.cell' has no attribute {name!r}")
    from gcode2krl.cell import definition, loading

    return getattr(loading if name in _LOADING else definition, name)
