"""Motion and stock to Forces: cutters, height field, engagement, force laws."""

from gcode2krl.cutting.entry import depth_in_material, free_above_mm
from gcode2krl.cutting.force import ToolLoad, cutting_load, mean_force
from gcode2krl.cutting.history import history_of
from gcode2krl.cutting.milling import (
    Approach,
    Contact,
    Milling,
    RawBox,
    Removal,
    cut,
    force_basis,
    mean_cut,
    no_forces,
    raw_material,
    remove,
)
from gcode2krl.cutting.outlook import Outlook, Watch, outlook_of

__all__ = [
    "Approach",
    "Contact",
    "Milling",
    "Outlook",
    "RawBox",
    "Removal",
    "ToolLoad",
    "Watch",
    "cut",
    "cutting_load",
    "depth_in_material",
    "force_basis",
    "free_above_mm",
    "history_of",
    "mean_cut",
    "mean_force",
    "no_forces",
    "outlook_of",
    "raw_material",
    "remove",
]
