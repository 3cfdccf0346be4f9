"""Toolpath to Targets: what the KRL program will say."""

from gcode2krl.program.blending import asked_tolerance
from gcode2krl.program.checks import check_toolpath, require_geometry
from gcode2krl.program.doubts import doubtful, feeds_per_tooth
from gcode2krl.program.following import following_deg
from gcode2krl.program.long_moves import between, straight
from gcode2krl.program.merging import merged, merging_note
from gcode2krl.program.orientation import tool_rotation
from gcode2krl.program.places import Range
from gcode2krl.program.spin import smooth_spin, stiffest_spin
from gcode2krl.program.splines import with_stops
from gcode2krl.program.stations import plan_stations
from gcode2krl.program.table import below_table
from gcode2krl.program.targets import SpinOf, plan_targets
from gcode2krl.program.tilts import tilt_issues

__all__ = [
    "Range",
    "SpinOf",
    "asked_tolerance",
    "below_table",
    "between",
    "check_toolpath",
    "doubtful",
    "feeds_per_tooth",
    "following_deg",
    "merged",
    "merging_note",
    "plan_stations",
    "plan_targets",
    "require_geometry",
    "smooth_spin",
    "stiffest_spin",
    "straight",
    "tilt_issues",
    "tool_rotation",
    "with_stops",
]
