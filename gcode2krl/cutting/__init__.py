"""Motion and stock to Forces: cutters, height field, engagement, force laws."""

from pathlib import Path

from gcode2krl.compiled.kernel_cache import drop_stale
from gcode2krl.cutting.force import Load, cutting_load, mean_force
from gcode2krl.cutting.milling import Removal, cut, force_basis, mean_cut, no_forces, remove

# compiled kernels are looked up when they are first called
drop_stale(
    Path(__file__).parent,
    "edge.py",
    "kernels.py",
    "removal.py",
    "rings.py",
    "slices.py",
    "sweep.py",
    "walls.py",
)

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
