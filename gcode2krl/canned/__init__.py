"""Canned test programs: air moves, each of which separates causes that look alike elsewhere."""

from gcode2krl.canned.catalogue import NAMES, PROGRAMS, CannedProgram
from gcode2krl.canned.draft import Draft
from gcode2krl.canned.place import Place, place_of
from gcode2krl.canned.program import draft_of, gcode_of, minutes_of, predicted, targets_of

__all__ = [
    "NAMES",
    "PROGRAMS",
    "CannedProgram",
    "Draft",
    "Place",
    "draft_of",
    "gcode_of",
    "minutes_of",
    "place_of",
    "predicted",
    "targets_of",
]
