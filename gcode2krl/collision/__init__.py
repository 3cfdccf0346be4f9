"""Collisions: whether arm, spindle and tool hit what stands in the cell, along every way they go."""

from gcode2krl.collision.carried import Carried, Dips
from gcode2krl.collision.contacts import Contacts, Touch
from gcode2krl.collision.surroundings import STOCK, ReadMesh
from gcode2krl.collision.watch import HORIZON_MM, Watch

__all__ = ["HORIZON_MM", "STOCK", "Carried", "Contacts", "Dips", "ReadMesh", "Touch", "Watch"]
