"""The modal state of the interpreter, and which G-code belongs to which modal group.

The state is one numpy record, so that compiled code can read and write it and a run can stop and go on
between pieces of a file. All lengths in it are mm; the position is the tool tip in the part frame, before the
rotation of the work offset in force: rows get the rotated one (``native/gcode/offsets.h``).

After a block that was not understood some of the state is in *doubt*: a bit of ``doubt`` for each thing that
the block might have set. A finding that rests on doubtful state is a consequence: it is counted, not
reported. What is stated anew is out of doubt. Doubt begins only with an error, so it never hides the first.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Ints32
from gcode2krl.gcode import vocabulary as v
from gcode2krl.units import MM_PER_INCH

STATE = np.dtype(
    [
        ("x", "f8"),
        ("y", "f8"),
        ("z", "f8"),
        ("known_x", "i1"),
        ("known_y", "i1"),
        ("known_z", "i1"),
        ("unit_mm", "f8"),  # mm per programmed unit
        ("absolute", "i1"),
        ("arc_absolute", "i1"),
        ("plane", "i4"),  # PLANE_…
        ("motion", "i4"),  # MOTION_…
        ("motion_beside_cycles", "i4"),  # the last that was no cycle
        ("feed_mode", "i4"),  # INVERSE_TIME, PER_MINUTE or PER_REVOLUTION
        ("feed", "f8"),  # mm/min, mm/rev; 0 = none yet
        ("feed_of_other_unit", "f8"),  # the feed when G20 or G21 last changed the unit
        ("rpm", "f8"),
        ("direction", "i4"),  # 1 = M3, -1 = M4, 0 = off
        ("tool", "i4"),  # in the spindle: the cell's mounted tool until M6; 0 = none
        ("selected_tool", "i4"),  # -1 = none yet
        ("selected_line", "i4"),  # where it was named
        ("length_offset", "f8"),  # NaN = G49
        ("offset_tool", "i4"),  # whose length it is, -1 = G49
        ("exact_stop", "i1"),
        ("tolerance", "f8"),  # NaN = none
        ("work_offset", "i4"),  # its place in WORK_OFFSETS
        ("base_mm", "f8", 3),  # zero of the programmed numbers: work offset plus shift, before its rotation
        ("shift_mm", "f8", 3),  # by G52 and G92, in force
        ("shift_kept_mm", "f8", 3),  # what G92.3 restores
        ("turned_under_shift", "i1"),  # by G10: until X and Y are programmed, controls differ about the place
        ("shift_line", "i4"),  # where the shift was set last, 0 = nowhere
        ("pivot_mm", "f8", 2),  # about which the work offset in force is rotated
        ("rotation_cos", "f8"),
        ("rotation_sin", "f8"),
        ("rotated", "i1"),  # the work offset in force is rotated
        ("turned_deg", "f8"),  # by the program itself: ROT, G68
        ("turned_about_mm", "f8", 2),  # the programmed point that stays
        ("mirrored", "i4"),  # bits of X and Y, mirrored by the program at that point
        ("flipped", "i4"),  # the same, of the zero in force
        ("turned_anew", "i1"),  # a Fanuc's next move names X and Y
        ("offsets_taken", "i1"),  # the offsets of the start are in force
        ("home_28", "f8", 3),  # machine coordinates, mm
        ("home_30", "f8", 3),
        ("rotary_deg", "f8", 3),  # A, B, C
        ("rotary_unknown", "i4"),  # bits of those that nobody has stated since tool vectors moved them
        ("home_28_deg", "f8", 3),
        ("home_30_deg", "f8", 3),
        ("tool_vector", "f8", 3),  # I, J, K under G43.5
        ("has_vector", "i1"),
        ("traori", "i1"),  # a Sinumerik's transformation is on: X, Y, Z are the tip
        ("zero_in_doubt", "i1"),  # ZERO_DROPPED, ZERO_OFF: which zero is in force is not known; 0 = it is
        ("length_code", "i4"),  # G43, G43.4, G43.5 or G49, tenfold
        ("feed_word", "f8"),  # F as written: degrees a minute of a turn alone
        ("arcs", "i4"),
        ("arc_end", "f8", 2),  # direction in the plane in which the last arc ends
        ("arc_end_rows", "i8"),  # rows behind it
        ("mist", "i1"),
        ("flood", "i1"),
        ("ended", "i1"),
        ("end_line", "i4"),
        ("tape_marks", "i4"),
        ("unit_named", "i1"),
        ("blocks", "i8"),
        ("level", "i4"),  # of the calls of subprograms, 0 = main program
        ("largest_mm", "f8"),
        ("unknown_feed_line", "i4"),  # first feed move from a position not programmed
        ("unknown_reported", "i1"),
        ("doubt", "i4"),  # bits of what a block that was not understood may have set
        ("motion_line", "i4"),  # where the motion mode was named, 0 = nowhere
        ("distance_line", "i4"),  # where G90 or G91 was named last, 0 = nowhere
        ("distance_unnamed_line", "i4"),  # first move of a Fanuc before G90 or G91, 0 = nowhere
        ("feed_mode_line", "i4"),  # where G93, G94 or G95 was named last, 0 = nowhere
        ("rotary_refused", "i4"),  # bits of the rotary letters that were refused
        ("note_count", "i4", 10),  # blocks with something harmless, by NOTE_…
        ("note_line", "i4", 10),  # the first of them
        ("note_word", "i4", 10),
        ("moved_mm", "f8", 9),  # how far the first of each of NOTE_LOCAL, … moves the zero
        ("misfits", "i4"),  # arcs whose radii differ too much
        ("misfits_other_centre", "i4"),  # of them: those that would fit in the other centre mode
        ("misfits_reversed", "i4"),  # that would fit with the other signs of I, J, K
        ("misfits_exchanged", "i4"),  # that would fit with the two centre words exchanged
        ("spirals", "i4"),  # arcs that are read although their radii differ
        ("spiral_line", "i4"),  # the worst of them
        ("spiral_start", "f8"),
        ("spiral_end", "f8"),
        ("spiral_unit_mm", "f8"),
        ("cutter_mode", "i4"),  # bits, CUTTER_…: what plain blocks must not pass by
        ("cutter_side", "i4"),  # 1 = tool left of the path (G41), -1 = right; a negative diameter swaps them
        ("cutter_code", "i4"),  # ten times the number of the G-code in force
        ("cutter_line", "i4"),  # where it stands
        ("cutter_radius_mm", "f8"),
        ("cutter_other_mm", "f8", 2),  # diameters of G41 and of the tool that cuts, until it is told; else 0
        ("cutter_entered", "i1"),  # the entry move has been made
        ("cutter_led", "i1"),  # the move behind it too, to which a control other than LinuxCNC leads
        ("cutter_idle", "i4"),  # blocks without a move in the plane since the last one
        ("cutter_d", "i4"),  # D that a Fanuc's G41 takes, -1 = none yet
        ("cutter_ways", "i4"),  # bits, WAY_…: how a Sinumerik leads in and around corners
        ("cutter_shift_mm_s", "f8"),  # speed of the shift that G41 alone owes, 0 = none
        ("cutter_failed", "i1"),  # a corner has been reported: further ones are consequences
        ("cutter_normal", "f8", 2),  # in the plane, from the programmed point (x, y, z) to the tool
        ("held_turn", "i4"),  # the element before this one: 1 = arc ccw, -1 = arc cw, 0 = line
        ("held_line", "i4"),  # its line in the file
        ("held_from", "f8", 2),  # where the tool begins it
        ("held_along", "f8", 2),  # direction of a line that may not become shorter than nothing
        ("held_centre", "f8", 2),
        ("held_w", "f8", 2),  # along the tool, at its start and end
        ("held_sweep", "f8"),  # rad of an arc before its end is moved, above 0
        ("held_rows", "i8", 2),  # its first row, and the one behind its last
        ("cutter_rows_removed", "i8"),  # rows of held arcs that have been taken away again, in all
        ("held_events", "i8"),  # events before it
        ("corner", "i4"),  # CORNER_… that the next block has to make, 0 = none
        ("corner_line", "i4"),
        ("corner_mm", "f8"),
        ("corner_from_mm", "f8", 3),  # where the move that leads to the corner begins
        ("corner_mm_s", "f8"),
        ("corner_rows", "i8"),  # rows and events behind that move: nothing may follow it
        ("corner_events", "i8"),
        ("retract", "i4"),  # ten times 98 or 99
        ("retract_line", "i4"),  # where G98 or G99 was named last, 0 = nowhere, -1 = at the start
        ("unset_parameter", "i4"),  # the first numbered parameter that was read before it was set
        ("unset_line", "i4"),  # where, 0 = nowhere
        ("retract_unnamed_line", "i4"),  # the first cycle that retracts to R without G98 or G99
        ("in_cycles", "i1"),  # a row of cycles has begun and no other motion has ended it
        ("cycle_level_mm", "f8"),  # programmed height along the tool where it began, to which G98 leads back
        ("cycle_level_known", "i1"),
        ("cycle_r", "f8"),  # words of the last cycle, which hold for the next; programmed units
        ("cycle_depth", "f8"),
        ("cycle_q", "f8"),
        ("cycle_p", "f8"),
        ("cycle_line", "i4"),  # the last cycle, and the modes under which it stood
        ("cycle_plane", "i4"),
        ("cycle_unit_mm", "f8"),
        ("cycle_absolute", "i1"),
        ("modal_call", "i4"),  # number of the cycle behind each move that follows (MCALL), 0 = none
        ("modal_arguments", "i4"),  # how many it has, and which, in a unit
        ("modal_argument", "f8", v.CYCLE_ARGUMENTS),
        ("modal_unit_mm", "f8"),
    ],
    align=True,  # as C lays it out
)

MODES = np.dtype(
    [
        ("is_saved", "i4"),  # by M70 or M73
        ("restored_on_return", "i4"),  # by M73
        ("unit_mm", "f8"),
        ("absolute", "i4"),
        ("arc_absolute", "i4"),
        ("plane", "i4"),
        ("feed_mode", "i4"),
        ("feed", "f8"),
        ("feed_of_other_unit", "f8"),
        ("feed_word", "f8"),
        ("rpm", "f8"),
        ("direction", "i4"),
        ("mist", "i4"),
        ("flood", "i4"),
        ("length_offset", "f8"),
        ("offset_tool", "i4"),
        ("length_code", "i4"),
        ("exact_stop", "i4"),
        ("tolerance", "f8"),
        ("work_offset", "i4"),
        ("retract", "i4"),
        ("cutter_mode", "i4"),
    ],
    align=True,
)
"""What M70 saves: all modes but that of motion; the shift of G52 and G92 is no mode."""

ZERO_DROPPED, ZERO_OFF = 1, 2
"""The tip's transformation was switched under a work offset, which the control may have dropped; G500."""
WAY_MEETING, WAY_KONT = 1, 2
"""G451 and KONT of a Sinumerik."""
CUTTER_ON, CUTTER_BESIDE = 1, 2
"""Cutter compensation is on; G40 has left the tool beside the programmed point, until a straight move."""
DOUBT_X, DOUBT_Y, DOUBT_Z, DOUBT_MOTION, DOUBT_FEED, DOUBT_UNIT = (1 << k for k in range(6))
DOUBT_PLANE, DOUBT_DISTANCE, DOUBT_CENTRE, DOUBT_FEED_MODE, DOUBT_TOOL, DOUBT_SPEED = (
    1 << k for k in range(6, 12)
)
DOUBT_POSITION = DOUBT_X | DOUBT_Y | DOUBT_Z
DOUBT_ALL = (1 << 12) - 1
NOTE_ROTARY, NOTE_CENTRE, NOTE_HOME, NOTE_OVERRIDE, NOTE_LOCAL, NOTE_SHIFT, NOTE_TABLE = range(7)
NOTE_CODE, NOTE_STATEMENT, NOTE_SMALL_ARC = 7, 8, 9


def initial_state() -> NDArray[np.void]:
    """Return the state (1,) at the start of a program: mm, absolute, G17, G94, G54, no motion mode."""
    state = np.zeros(1, dtype=STATE)
    state["unit_mm"] = 1.0
    state["absolute"] = 1
    state["plane"] = v.PLANE_XY
    state["motion"] = state["motion_beside_cycles"] = v.MOTION_CANCELLED
    state["feed_mode"] = v.PER_MINUTE
    state["selected_tool"] = state["cutter_d"] = -1
    state["length_offset"] = np.nan
    state["offset_tool"] = -1
    state["tolerance"] = np.nan
    state["retract"] = v.G99
    return state


KNOWN_AXES = ("known_x", "known_y", "known_z")
"""Fields of the state: whether an axis has a place that is stated."""
AT_START = -1
"""Instead of a line: the control starts so."""


def start_of(modes: Mapping[str, str]) -> dict[str, float]:
    """Return fields of the state for modes at the start, G-codes by their group: ``{"distance": "G90"}``."""
    code = {group: int(name[1:]) for group, name in modes.items()}
    start: dict[str, float] = {}
    if "motion" in code:
        start |= {"motion": code["motion"], "motion_beside_cycles": code["motion"]}
    if "plane" in code:
        start["plane"] = code["plane"]
    if "unit" in code:
        start |= {"unit_mm": MM_PER_INCH if code["unit"] == v.G20 // v.TENFOLD else 1.0, "unit_named": 1}
    if "distance" in code:
        start |= {"absolute": code["distance"] == v.G90 // v.TENFOLD, "distance_line": AT_START}
    if "feed" in code:
        start["feed_mode"] = code["feed"]
    if "retract" in code:
        start |= {"retract": code["retract"] * v.TENFOLD, "retract_line": AT_START}
    return start


UNKNOWN_GROUP, UNSUPPORTED_GROUP = -1, -2


_GROUPS: dict[int, tuple[float, ...]] = {
    v.NON_MODAL: (4, 10, 28, 28.1, 30, 30.1, 52, 53, 92),
    v.MOTION: (0, 1, 2, 3, 73, 74, 80, 81, 82, 83, 84, 85, 86, 89),
    v.PLANE: (17, 18, 19),
    v.DISTANCE: (90, 91),
    v.CENTRE: (90.1, 91.1),
    v.FEED_MODE: (93, 94, 95),
    v.UNIT: (20, 21),
    v.RADIUS_COMPENSATION: (40, 41, 41.1, 42, 42.1),
    v.LENGTH_OFFSET: (43, 43.1, 43.2, 43.4, 43.5, 49),
    v.RETRACT: (98, 99),
    v.WORK_OFFSET: (54, 55, 56, 57, 58, 59, 59.1, 59.2, 59.3),
    v.PATH_CONTROL: (61, 61.1, 64),
    v.SPINDLE_MODE: (97,),
    v.SHIFT_STATE: (92.1, 92.2, 92.3),
}
"""Modal group: the G-codes in it that are read."""
_UNSUPPORTED = (
    *(5, 5.1, 5.2, 5.3, 6, 6.1, 6.2, 6.3, 7, 8, 33, 33.1, 38.2, 38.3, 38.4, 38.5),
    *(70, 71, 71.1, 71.2, 72, 72.1, 72.2, 76, 87, 88, 96),
)
"""G-codes of this and other dialects that are known and not read."""


def _group_table() -> Ints32:
    table = np.full(v.LARGEST_G + 1, UNKNOWN_GROUP, dtype=np.int32)
    for group, codes in _GROUPS.items():
        for code in codes:
            table[round(code * v.TENFOLD)] = group
    for code in _UNSUPPORTED:
        table[round(code * v.TENFOLD)] = UNSUPPORTED_GROUP
    return table


GROUP_OF_G = _group_table()
"""Modal group of a G-code given as ten times its number, (1000,)."""
_DOUBTS: dict[int, tuple[float, ...]] = {
    DOUBT_X: (7, 8),
    DOUBT_SPEED: (96,),
}
"""What is in doubt: after which G-codes that are not read."""


def _doubt_table() -> Ints32:
    of_unknown = DOUBT_MOTION | DOUBT_POSITION
    table = np.full(v.LARGEST_G + 1, of_unknown, dtype=np.int32)
    for doubt, codes in _DOUBTS.items():
        for code in codes:
            table[round(code * v.TENFOLD)] = doubt
    return table


DOUBT_OF_G = _doubt_table()
"""What is in doubt after a G-code that is not read, given as ten times its number, (1000,)."""
_DOUBTS_OF_GROUP = {
    v.NON_MODAL: DOUBT_POSITION,
    v.MOTION: DOUBT_MOTION,
    v.PLANE: DOUBT_PLANE,
    v.DISTANCE: DOUBT_DISTANCE,
    v.CENTRE: DOUBT_CENTRE,
    v.FEED_MODE: DOUBT_FEED_MODE | DOUBT_FEED,
    v.UNIT: DOUBT_UNIT,
    v.LENGTH_OFFSET: DOUBT_Z,
    v.WORK_OFFSET: DOUBT_POSITION,
    v.SPINDLE_MODE: DOUBT_SPEED,
    v.SHIFT_STATE: DOUBT_POSITION,
}
DOUBT_OF_GROUP = np.array([_DOUBTS_OF_GROUP.get(group, 0) for group in range(v.GROUPS)], dtype=np.int32)
"""What is in doubt after two codes of one modal group, (GROUPS,)."""
_DOUBTS_OF_LETTER = {
    "X": DOUBT_X,
    "Y": DOUBT_Y,
    "Z": DOUBT_Z,
    "F": DOUBT_FEED,
    "S": DOUBT_SPEED,
    "T": DOUBT_TOOL,
    "G": DOUBT_ALL,
    "M": DOUBT_ALL,
    "O": DOUBT_ALL,
    "@": DOUBT_X | DOUBT_Y,
    "^": DOUBT_X | DOUBT_Y,
}
DOUBT_OF_LETTER = np.array([_DOUBTS_OF_LETTER.get(letter, 0) for letter in v.ALPHABET], dtype=np.int32)
"""What is in doubt after a word whose value cannot be read, by its letter, (28,)."""
FIRST_G505, FIRST_G54_1, FURTHER_OFFSETS = 9, 104, 300
"""Places of a Sinumerik's G505 and a Fanuc's G54.1 P1 among the work offsets, and how many P there are."""
WORK_OFFSETS = (
    *("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"),
    *(f"G{number}" for number in range(505, 600)),
    *(f"G54.1P{number}" for number in range(1, FURTHER_OFFSETS + 1)),
)
EVENT_TOOL, EVENT_SPINDLE, EVENT_COOLANT, EVENT_M, EVENT_TEXT = 0, 1, 2, 4, 5
IMPLIED_M5 = -5
"""M number of a spindle stop that a tool change brings about."""
OF_CYCLE = 1000
"""In a spindle event of a canned cycle the cycle's number stands before that of the M-code, times this."""
