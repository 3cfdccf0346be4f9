"""Motion and stock to Forces: cutters, height field, engagement, force laws."""

from gcode2krl.cutting.force import Load, cutting_load, mean_force
from gcode2krl.cutting.milling import Removal, cut, force_basis, mean_cut, no_forces, remove

__all__ = [
    "Load",
    "Removal",
    "cut",
    "cutting_load",
    "force_basis",
    "mean_cut",
    "mean_force",
    "no_forces",
    "remove",
]
