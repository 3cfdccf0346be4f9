"""Motion and stock to Forces: cutters, height field, engagement, force laws."""

from gcode2krl.cutting.force import Load, cutting_load, mean_force
from gcode2krl.cutting.milling import Milling, Removal, cut, force_basis, mean_cut, no_forces, remove
from gcode2krl.cutting.outlook import Outlook, Watch, outlook_of

__all__ = [
    "Load",
    "Milling",
    "Outlook",
    "Removal",
    "Watch",
    "cut",
    "cutting_load",
    "force_basis",
    "mean_cut",
    "mean_force",
    "no_forces",
    "outlook_of",
    "remove",
]
