"""Joints and Forces to Deflection: the elastic chain of Haehn & Weigold 2020, and its identification."""

from gcode2krl.compliance.deflection import (
    deflection_magnitude,
    deflection_of,
    displace,
    feed_direction,
    joint_shares,
    tip_position,
    tip_velocity,
)
from gcode2krl.compliance.deflection_table import deflect, deflect_at
from gcode2krl.compliance.model import assumed_stiffness, missing_stiffness, stiffness
from gcode2krl.compliance.projection import project_normal

__all__ = [
    "assumed_stiffness",
    "deflect",
    "deflect_at",
    "deflection_magnitude",
    "deflection_of",
    "displace",
    "feed_direction",
    "joint_shares",
    "missing_stiffness",
    "project_normal",
    "stiffness",
    "tip_position",
    "tip_velocity",
]
