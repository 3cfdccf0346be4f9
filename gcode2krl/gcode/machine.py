"""The modal interpreter: words in, rows of straight moves out (``native/gcode/machine.c``).

What of the state a block may change is in `state`, what it hands over beside rows in `reporting`.
"""

from gcode2krl.compiled.core import (
    BYTES,
    FLOAT,
    FLOATS,
    INT,
    INTS32,
    OUT_BOOLS,
    OUT_FLOATS,
    ArrayOf,
    StructOf,
    core_function,
)
from gcode2krl.gcode.columns import ROWS
from gcode2krl.gcode.reporting import COUNTS, EVENT, FOUND
from gcode2krl.gcode.state import MODES, STATE

MACHINE = StructOf(
    state=ArrayOf(STATE, written=True),
    counts=ArrayOf(COUNTS, written=True),
    rows=ROWS,
    events=ArrayOf(EVENT, written=True),
    raised=ArrayOf(FOUND, written=True),
    saved=ArrayOf(MODES, written=True),
    offsets=OUT_FLOATS,
    offset_known=OUT_BOOLS,
    tool_length_mm=OUT_FLOATS,
    tool_diameter_mm=OUT_FLOATS,
    cutter_diameter_mm=FLOATS,
    lead=INT,
    square_corners=INT,
    shifts_alone=INT,
    d_holds=INT,
    programs=INT,
    has_m61_to_m73=INT,
    core_g=INTS32,
    dwell_by_letter=FLOATS,
    points=INT,
    length_by_d=INT,
    cycle_dwell_s=FLOAT,
    repeats_by_k=INT,
    g80_keeps_motion=INT,
    idle_letters=INT,
    end_m=INT,
    whole_dwell_letter=INT,
    group_of_g=INTS32,
    doubt_of_g=INTS32,
    doubt_of_group=INTS32,
    doubt_of_letter=INTS32,
    chord_tolerance_mm=FLOAT,
    block_delete=INT,
    lengths_from_table=INT,
    rotary_axes=INT,
    tcpm=INT,
)
"""What the interpreter goes on with from block to block.

``offsets`` are those of `state.WORK_OFFSETS` (n, 4): X, Y, Z in mm, rotation about Z in degrees. G10
writes to them, and to ``tool_length_mm`` by tool number, NaN where a tool is not declared. ``saved`` are the
modes that M70 and M73 have saved, one row a level of calls. ``lead`` and ``d_holds`` are those of
`dialect_marks`.
"""

run = core_function("gcode_run", MACHINE, BYTES, FLOATS, FLOATS, INTS32, INT, returns=INT)
"""Execute the blocks of words (letter, value, extra, line) from a word on; return the word at which to go on.

It stops early where the next block wants more room: ``rows_wanted`` and ``events_wanted`` say how much.
"""
