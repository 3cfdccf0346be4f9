"""Robot kinematics: closed-form forward and inverse, Jacobian, branch, limits, singularities."""

from gcode2krl.robot.joints import (
    Follower,
    angles_near,
    follow,
    follow_motion,
    joints_at,
    joints_from_angles,
    line_angles,
    motion_angles,
    ptp_joints,
    rise_angles,
    target_angles,
    trial_rows,
)
from gcode2krl.robot.poses import flange_frames, forward, inverse, jacobian
from gcode2krl.robot.quality import pose_quality
from gcode2krl.robot.standing import raise_shares

__all__ = [
    "Follower",
    "angles_near",
    "flange_frames",
    "follow",
    "follow_motion",
    "forward",
    "inverse",
    "jacobian",
    "joints_at",
    "joints_from_angles",
    "line_angles",
    "motion_angles",
    "pose_quality",
    "ptp_joints",
    "raise_shares",
    "rise_angles",
    "target_angles",
    "trial_rows",
]
