"""Toolpath to Targets: what the KRL program will say."""

from gcode2krl.program.blending import asked_tolerance
from gcode2krl.program.checks import check_toolpath, require_geometry
from gcode2krl.program.doubts import doubtful, feeds_per_tooth
from gcode2krl.program.merging import merged, merging_note
from gcode2krl.program.restart import (
    approached_row,
    begun_at,
    begun_row,
    row_before,
    state_words,
)
from gcode2krl.program.splines import with_stops
from gcode2krl.program.table import below_table
from gcode2krl.program.targets import Route
from gcode2krl.program.tilts import tilt_issues

__all__ = [
    "Route",
    "approached_row",
    "asked_tolerance",
    "begun_at",
    "begun_row",
    "below_table",
    "check_toolpath",
    "doubtful",
    "feeds_per_tooth",
    "merged",
    "merging_note",
    "require_geometry",
    "row_before",
    "state_words",
    "tilt_issues",
    "with_stops",
]
