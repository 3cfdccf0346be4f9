"""Toolpath to Targets: what the KRL program will say."""

from gcode2krl.program.blending import asked_tolerance
from gcode2krl.program.checks import check_toolpath, require_geometry
from gcode2krl.program.doubts import doubtful, feeds_per_tooth
from gcode2krl.program.merging import merged, merging_note
from gcode2krl.program.splines import with_stops
from gcode2krl.program.table import below_table
from gcode2krl.program.targets import Route
from gcode2krl.program.tilts import tilt_issues

__all__ = [
    "Route",
    "asked_tolerance",
    "below_table",
    "check_toolpath",
    "doubtful",
    "feeds_per_tooth",
    "merged",
    "merging_note",
    "require_geometry",
    "tilt_issues",
    "with_stops",
]
