"""What the robot is free to choose: the turn about the tool axis, and where rails and tables stand."""

from gcode2krl.pose.spin import SpinMap, spin_map, tool_rotation
from gcode2krl.pose.targets import posed_targets

__all__ = ["SpinMap", "posed_targets", "spin_map", "tool_rotation"]
