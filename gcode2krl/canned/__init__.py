"""Canned test programs: air moves, each of which separates causes that look alike elsewhere."""

from gcode2krl.canned.catalogue import NAMES, PROGRAMS, REPEAT, CannedProgram
from gcode2krl.canned.draft import Draft, around_minutes
from gcode2krl.canned.place import ProgramPlace, place_of
from gcode2krl.canned.program import draft_of, gcode_of, minutes_of, predicted, targets_of

__all__ = [
    "NAMES",
    "PROGRAMS",
    "REPEAT",
    "CannedProgram",
    "Draft",
    "ProgramPlace",
    "around_minutes",
    "draft_of",
    "gcode_of",
    "minutes_of",
    "place_of",
    "predicted",
    "targets_of",
]
