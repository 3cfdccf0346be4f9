"""A robot's own geometry from measured poses: frames, zeros, lengths, parallelism, bending and play at once."""

from gcode2krl.identify.kinematics.arms import Arm, arm_of, arms
from gcode2krl.identify.kinematics.identification import (
    Geometry,
    Options,
    identify_kinematics,
)
from gcode2krl.identify.kinematics.readings import Readings, read_readings

__all__ = [
    "Arm",
    "Geometry",
    "Options",
    "Readings",
    "arm_of",
    "arms",
    "identify_kinematics",
    "read_readings",
]
