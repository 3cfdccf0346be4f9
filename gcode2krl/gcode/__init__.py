"""G-code to Toolpath: a compiled scanner, a modal interpreter, arcs to chords."""

from gcode2krl.gcode.dialects import DEFAULT as DEFAULT_DIALECT
from gcode2krl.gcode.read import CHORD_TOLERANCE_MM, read_gcode, read_stream

__all__ = ["CHORD_TOLERANCE_MM", "DEFAULT_DIALECT", "read_gcode", "read_stream"]
