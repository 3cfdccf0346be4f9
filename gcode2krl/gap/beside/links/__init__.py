"""The links of the measuring chain, in its order."""

from gcode2krl.gap.beside.links.base import Link
from gcode2krl.gap.beside.links.joints import GearLink, PathLink, ServoLink
from gcode2krl.gap.beside.links.surface import SurfaceLink
from gcode2krl.gap.beside.links.timing import TimingLink
from gcode2krl.gap.beside.links.traces import JOINTS
from gcode2krl.gap.beside.links.vectors import ForceLink, MechanicsLink
from gcode2krl.gap.beside.verdict import Verdict, is_lost

TIMING, PATH, SERVO, GEAR = TimingLink(), PathLink(), ServoLink(), GearLink()
FORCE, MECHANICS, PART = ForceLink(), MechanicsLink(), SurfaceLink()
LINKS: tuple[Link, ...] = (TIMING, PATH, SERVO, GEAR, FORCE, MECHANICS, PART)
SIGNALS: tuple[Link, ...] = (PATH, SERVO, GEAR, FORCE, MECHANICS)
"""Those with a signal in time and a model of their own."""

__all__ = [
    "FORCE",
    "GEAR",
    "JOINTS",
    "LINKS",
    "MECHANICS",
    "PART",
    "PATH",
    "SERVO",
    "SIGNALS",
    "TIMING",
    "Link",
    "Verdict",
    "is_lost",
]
