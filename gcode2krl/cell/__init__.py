"""The cell file and the model library: everything the planner knows about robot, tools and program."""

from gcode2krl.cell.definition import (
    CODES_WITHOUT_SIGNALS,
    Cell,
    as_toml,
    cell_from_resolved,
    cell_schema,
    controller_axes,
    load_cell,
    plain_view,
    resolve_cell,
)

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
