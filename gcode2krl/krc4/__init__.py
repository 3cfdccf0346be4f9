"""What the KRC4 does with LIN motions: corner parabola, time law, look-ahead."""

from gcode2krl.krc4.corner_doubts import corner_issues
from gcode2krl.krc4.course import Course, sample_motion
from gcode2krl.krc4.laws import corner, effective_acceleration, jerk, speed_step
from gcode2krl.krc4.motion import Chain, build_chain, motion_issues, plan, with_speed

__all__ = [
    "Chain",
    "Course",
    "build_chain",
    "corner",
    "corner_issues",
    "effective_acceleration",
    "jerk",
    "motion_issues",
    "plan",
    "sample_motion",
    "speed_step",
    "with_speed",
]
