"""Robot kinematics: closed-form forward and inverse, Jacobian, branch, limits, singularities."""

from gcode2krl.cell.carried import at_rest, from_rest, to_rest
from gcode2krl.robot.joints import (
    Follower,
    Places,
    angles_along,
    angles_near,
    follow,
    follow_motion,
    joints_from_angles,
    line_angles,
    motion_angles,
    places_between,
    ptp_joints,
    rise_angles,
    target_angles,
    trial_rows,
)
from gcode2krl.robot.poses import flange_frames, forward, inverse, jacobian
from gcode2krl.robot.standing import limit_margin, pose_margins, raise_shares

__all__ = [
    "Follower",
    "Places",
    "angles_along",
    "angles_near",
    "at_rest",
    "flange_frames",
    "follow",
    "follow_motion",
    "forward",
    "from_rest",
    "inverse",
    "jacobian",
    "joints_from_angles",
    "limit_margin",
    "line_angles",
    "motion_angles",
    "places_between",
    "pose_margins",
    "ptp_joints",
    "raise_shares",
    "rise_angles",
    "target_angles",
    "to_rest",
    "trial_rows",
]
