"""Collisions: whether arm, spindle and tool hit what stands in the cell, along every way they go."""

from gcode2krl.collision.surroundings import ReadMesh
from gcode2krl.collision.watch import HORIZON_MM, Watch

__all__ = ["HORIZON_MM", "ReadMesh", "Watch"]
