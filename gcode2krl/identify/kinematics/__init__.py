"""A robot's own geometry from measured poses: frames, zeros, lengths, axes, bending and play at once."""

from gcode2krl.identify.kinematics.arms import Arm, all_arms, arm_named, arm_of
from gcode2krl.identify.kinematics.identification import (
    ArmNumber,
    Geometry,
    Options,
    identify_kinematics,
    tips_of,
)
from gcode2krl.identify.kinematics.parameters import GEOMETRY
from gcode2krl.identify.kinematics.readings import Readings, read_readings

__all__ = [
    "GEOMETRY",
    "Arm",
    "ArmNumber",
    "Geometry",
    "Options",
    "Readings",
    "all_arms",
    "arm_named",
    "arm_of",
    "identify_kinematics",
    "read_readings",
    "tips_of",
]
