"""Targets moved against the predicted deflection, so that the part comes out as programmed."""

from gcode2krl.compensation.iteration import Compensated, compensate

__all__ = ["Compensated", "compensate"]
