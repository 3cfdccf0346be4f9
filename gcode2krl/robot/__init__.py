"""Robot kinematics: closed-form forward and inverse, Jacobian, branch, limits, singularities."""

from gcode2krl.robot.joints import (
    angles_near,
    follow,
    follow_motion,
    joints_at,
    joints_from_angles,
    motion_angles,
    ptp_joints,
    speed_share,
    target_angles,
)
from gcode2krl.robot.poses import flange_frames, forward, inverse, jacobian
from gcode2krl.robot.quality import pose_quality

__all__ = [
    "angles_near",
    "flange_frames",
    "follow",
    "follow_motion",
    "forward",
    "inverse",
    "jacobian",
    "joints_at",
    "joints_from_angles",
    "motion_angles",
    "pose_quality",
    "ptp_joints",
    "speed_share",
    "target_angles",
]
