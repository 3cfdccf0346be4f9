"""Robot kinematics: closed-form forward and inverse, Jacobian, branch, limits, singularities."""

from gcode2krl.robot.joints import follow, follow_motion, joint_findings, motion_angles, ptp_joints
from gcode2krl.robot.poses import flange_frames, forward, inverse, jacobian
from gcode2krl.robot.quality import pose_quality

__all__ = [
    "flange_frames",
    "follow",
    "follow_motion",
    "forward",
    "inverse",
    "jacobian",
    "joint_findings",
    "motion_angles",
    "pose_quality",
    "ptp_joints",
]
