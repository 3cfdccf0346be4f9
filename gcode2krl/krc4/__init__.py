"""What the KRC4 does with LIN motions: corner parabola, time law, look-ahead."""

from gcode2krl.krc4.identify import Estimate, Identification, identify_controller
from gcode2krl.krc4.laws import corner, effective_acceleration, jerk, speed_step
from gcode2krl.krc4.motion import Chain, build_chain, motion_issues, plan, sample_motion, with_speed
from gcode2krl.krc4.trial_program import controller_test_program

__all__ = [
    "Chain",
    "Estimate",
    "Identification",
    "build_chain",
    "controller_test_program",
    "corner",
    "effective_acceleration",
    "identify_controller",
    "jerk",
    "motion_issues",
    "plan",
    "sample_motion",
    "speed_step",
    "with_speed",
]
