"""What a cell and a program are accepted with: the path in air, its prediction, a trace, a check list."""

from gcode2krl.runkit.kit import RunKit, make_kit

__all__ = ["RunKit", "make_kit"]
