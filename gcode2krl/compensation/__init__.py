"""Targets moved against the predicted deflection, so that the part comes out as programmed."""

from gcode2krl.compensation.iteration import Compensated, compensate, keeping_forces

__all__ = ["Compensated", "compensate", "keeping_forces"]
