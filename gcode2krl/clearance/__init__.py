"""Collisions along all that a program does: joints, targets and removal with the stage `collision`."""

from gcode2krl.clearance.arm_in_stock import ArmInStock, Inside
from gcode2krl.clearance.beside import collisions_beside, watch_of
from gcode2krl.clearance.meshes import obstacle_meshes
from gcode2krl.clearance.retracts import collisions_on_retracts
from gcode2krl.clearance.ways import Beside, moves_watched_at_targets, shown_otherwise, ways_beside

__all__ = [
    "ArmInStock",
    "Beside",
    "Inside",
    "collisions_beside",
    "collisions_on_retracts",
    "moves_watched_at_targets",
    "obstacle_meshes",
    "shown_otherwise",
    "watch_of",
    "ways_beside",
]
