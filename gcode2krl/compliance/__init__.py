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
from gcode2krl.compliance.model import missing_stiffness
from gcode2krl.compliance.projection import project_normal

__all__ = [
    "deflect",
    "deflect_at",
    "deflection_magnitude",
    "deflection_of",
    "displace",
    "feed_direction",
    "joint_shares",
    "missing_stiffness",
    "project_normal",
    "tip_position",
    "tip_velocity",
]
