"""G-code to Toolpath: a compiled scanner, a modal interpreter, arcs to chords."""

from pathlib import Path

from gcode2krl.compiled.kernel_cache import drop_stale, load_numba
from gcode2krl.gcode.read import CHORD_TOLERANCE_MM, read_gcode, read_stream

__all__ = ["CHORD_TOLERANCE_MM", "read_gcode", "read_stream"]

load_numba()  # what the first kernel needs
# compiled kernels are looked up when they are first called
drop_stale(
    Path(__file__).parent,
    "../ascii_codes.py",
    "../units.py",
    "arcs.py",
    "findings.py",
    "block_words.py",
    "motion.py",
    "reporting.py",
    "rows.py",
    "settings.py",
    "state.py",
    "vocabulary.py",
    "words.py",
)
