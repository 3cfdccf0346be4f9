"""Motion and stock to Forces: cutters, height field, engagement, force laws."""

from pathlib import Path

from gcode2krl.cutting.force import Load, cutting_load, mean_force
from gcode2krl.kernel_cache import drop_stale

drop_stale(Path(__file__).parent)  # compiled kernels are looked up when they are first called

__all__ = ["Load", "cutting_load", "mean_force"]
