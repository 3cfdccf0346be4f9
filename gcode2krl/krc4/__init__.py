"""What the KRC4 does with LIN motions: corner parabola, time law, look-ahead."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

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

_OF_IDENTIFICATION = ("Estimate", "Identification", "identify_controller")

if TYPE_CHECKING:
    from gcode2krl.krc4.identify import Estimate, Identification, identify_controller


def __getattr__(name: str) -> Any:
    """Import what only the identification needs on its first use."""
    if name in _OF_IDENTIFICATION:
        return getattr(import_module("gcode2krl.krc4.identify"), name)
    raise AttributeError(f"module 'gcode2krl.krc4' has no attribute {name!r}")
