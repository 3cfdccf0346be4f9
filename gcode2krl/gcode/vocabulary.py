"""The words of the dialect (LinuxCNC's RS274/NGC) by name: letters, G and M numbers, modal groups.

Plain module constants: the compiled core takes their values from here. In it a G number is ten times its
value, so that G28.1 is a whole number, 281; an M number is its value.
"""

from gcode2krl.ascii_codes import CASE_BIT

LINE_LIMIT = 4096
"""Longest line that is read, in bytes; a part program has none that long."""
MARK = ord("!")
"""Stands in the column of letters where something cannot be read."""
PROGRAM_LINE = ord("$")
"""Stands for a whole line with an expression, a parameter or an O-word."""
UNREAD_NUMBER = CASE_BIT
"""Added to a letter whose value cannot be read: the small letter."""

ALPHABET = "ABCDEFGHIJKLMNOPQRSTUVWXYZ@^"
"""Letters of words in the order of arrays by letter; the last two are polar words."""
LETTERS = 28


def index_of(letter: str) -> int:
    """Return the place of a letter in arrays by letter (28,): A is 0."""
    return ALPHABET.index(letter)


WORD_D, WORD_E, WORD_F, WORD_H, WORD_L, WORD_P, WORD_Q, WORD_R, WORD_S, WORD_T = (
    index_of(letter) for letter in "DEFHLPQRST"
)
WORD_I, WORD_J, WORD_K = (index_of(letter) for letter in "IJK")
WORD_X, WORD_Y, WORD_Z = (index_of(letter) for letter in "XYZ")
WORD_RADIUS, WORD_ANGLE = index_of("@"), index_of("^")
WORD_A = index_of("A")
"""The first rotary axis; B and C follow."""
OTHER_AXES = tuple(index_of(letter) for letter in "ABCUVW")
"""Rotary and secondary axes."""
ROTARY_AXES = 3
"""The first of them."""

TENFOLD = 10
LARGEST_G = 999
"""Largest G number in the core, G99.9."""
LARGEST_M = 9999

G0 = 0
G4 = 40  # dwell
G10 = 100  # offsets
G20 = 200  # inch; else mm
G28, G28_1, G30, G30_1 = 280, 281, 300, 301  # go to, and set, the two homes
G40, G41, G41_1, G42, G42_1 = 400, 410, 411, 420, 421  # cutter radius compensation off, left, right
G43, G49 = 430, 490  # tool length offset on, off
G43_1, G43_2 = 431, 432  # given by words, added
G43_4, G43_5 = 434, 435  # the tip is programmed: with rotary words, with tool vectors I J K
G52, G53 = 520, 530  # local offset, machine coordinates
G54, G59 = 540, 590  # the first work offset, and the last before G59.1
G64 = 640  # blending; else exact stop
G70, G71 = 700, 710  # of Mach3: inch and mm, as G20 and G21
G80 = 800  # ends the motion mode
G90 = 900  # absolute distances; else incremental
G90_1, G91_1 = 901, 911  # absolute, incremental centres of arcs
G92, G92_1, G92_2, G92_3 = 920, 921, 922, 923  # coordinate shift: set, clear, suspend, restore
G98, G99 = 980, 990  # retract of a canned cycle to where it began; to R

M0, M1, M2, M17, M30, M60 = 0, 1, 2, 17, 30, 60  # stop, optional stop, end, end (Sinumerik), end, pallet
M3, M4, M5 = 3, 4, 5  # spindle clockwise, counter-clockwise, off
M6 = 6  # tool change
M7, M9 = 7, 9  # mist, both off; M8 between them is flood
M19 = 19  # spindle orientation
M48, M53 = 48, 53  # overrides, M48 to M53
M61, M66 = 61, 66  # tool number, wait for an input
M62, M63, M64, M65, M67, M68 = 62, 63, 64, 65, 67, 68  # outputs: on, off, on, off; values
M70, M71, M72, M73 = 70, 71, 72, 73  # modal state: save, forget, restore, save and restore on return
M97, M98, M99 = 97, 98, 99  # subprograms, M97 those of a Haas within its program

L_TOOL, L_OFFSET, L_TOOL_FROM_POSITION, L_TOOL_FROM_FIXTURE, L_OFFSET_FROM_POSITION = 1, 2, 10, 11, 20
"""What G10 sets, its word L."""

MOTION_CANCELLED, MOTION_RAPID, MOTION_LINE, MOTION_ARC_CW, MOTION_ARC_CCW = -1, 0, 1, 2, 3
"""Motion modes of the state: none after G80 and before the first motion code, else the G number."""
FIRST_CYCLE, CYCLE_CHIP, CYCLE_TAP_LEFT, CYCLE_DRILL, CYCLE_DWELL, CYCLE_PECK = 73, 73, 74, 81, 82, 83
CYCLE_TAP, CYCLE_REAM, CYCLE_BORE_STOP, CYCLE_BORE = 84, 85, 86, 89
"""Canned cycles among the motion modes; no other mode has a number as large as the first."""
CYCLE_SWIVEL = 800
"""Of a Sinumerik, CYCLE800."""
CYCLE_ROW, CYCLE_CIRCLE, CYCLE_GRID = 1001, 1002, 801
"""HOLES1, HOLES2 and CYCLE801 of a Sinumerik."""
CYCLE_BEHIND = 1000
"""A hole behind the move of its block: the arguments are kind and feed, and then those of the cycle of
that kind."""
CYCLE_ARGUMENTS = 26
"""Arguments of a Sinumerik's CYCLE84, which has most, and these two."""
PLANE_XY, PLANE_ZX, PLANE_YZ = 17, 18, 19
"""Planes of the state: the G number."""
INVERSE_TIME, PER_MINUTE, PER_REVOLUTION = 93, 94, 95
"""Feed modes of the state: the G number."""
TURN_MACHINE, TURN_TIP, TURN_VECTOR = range(3)
"""What X, Y, Z and the turn of a row mean: machine axes, tip and angles, tip and tool vector."""

NON_MODAL, MOTION, PLANE, DISTANCE, CENTRE, FEED_MODE, UNIT = range(7)
RADIUS_COMPENSATION, LENGTH_OFFSET, RETRACT, WORK_OFFSET, PATH_CONTROL, SPINDLE_MODE = range(7, 13)
SHIFT_STATE = 13
GROUPS = 14
"""Modal groups of G-codes, numbered in the order of the tables in `state`."""
M_STOP, M_IO, M_TOOL_CHANGE, M_SPINDLE, M_COOLANT, M_OVERRIDE = 4, 5, 6, 7, 8, 9
"""Modal groups of M-codes as RS274/NGC numbers them; M-codes of no group are 0."""
M_CODES = 4
"""M-codes that a block may have."""
