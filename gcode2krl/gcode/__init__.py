"""G-code to Toolpath: a compiled scanner, a modal interpreter, arcs to chords."""

from pathlib import Path

from gcode2krl.kernel_cache import drop_stale

drop_stale(Path(__file__).parent)

from gcode2krl.gcode.read import (  # noqa: E402 - kernels are loaded by this import
    CHORD_TOLERANCE_MM,
    read_gcode,
    read_stream,
)

__all__ = ["CHORD_TOLERANCE_MM", "read_gcode", "read_stream"]
