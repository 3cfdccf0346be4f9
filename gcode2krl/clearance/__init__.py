"""Collisions along all that a program does: joints, targets and removal with the stage `collision`."""

from gcode2krl.clearance.arm_in_stock import ArmInStock, Inside
from gcode2krl.clearance.beside import (
    collisions_beside,
    moves_watched_at_targets,
    shown_otherwise,
    watch_of,
)

__all__ = [
    "ArmInStock",
    "Inside",
    "collisions_beside",
    "moves_watched_at_targets",
    "shown_otherwise",
    "watch_of",
]
