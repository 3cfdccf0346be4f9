"""The tables of a program with parameters and O-words, for the core (``native/gcode/execute.c``).

A marked line is one with an expression, a parameter or an O-word: the scanner leaves it as one word
`vocabulary.PROGRAM_LINE` whose value is its row in `LINE`, and it is read whenever it is executed.
"""

import numpy as np

from gcode2krl.compiled.core import (
    BYTES,
    INT,
    INTS32,
    OUT_BYTES,
    OUT_FLOATS,
    OUT_INTS,
    OUT_INTS32,
    ArrayOf,
    StructOf,
)
from gcode2krl.gcode.state import STATE
from gcode2krl.gcode.vocabulary import LINE_LIMIT

MOST_PARAMETERS = 5602
"""LinuxCNC's parameters are #1 to #5601, and 0 is none."""
LOCAL_PARAMETERS = 30
"""#1 to #30 are the arguments of a subprogram; each call has its own."""
MOST_R = 100
"""R0 to R99 are there on every Sinumerik; more are a setting of the machine."""
FIRST_REAL, FIRST_INT, FIRST_BOOL = 100, 2000, 4000
"""Where the variables of a Sinumerik's program (DEF) stand among the parameters, by their type."""
MOST_FORMALS = 33
"""Parameters that a subprogram of a Sinumerik may have."""
MACRO_LOCALS = 33
"""#1 to #33 are those of a macro on a Fanuc."""
MACRO_COMMON, MACRO_KEPT, MACRO_END = (100, 199), (500, 999), 1000
"""First and last of the common variables of a Fanuc, and the first of the control's own."""
FRAMES = 10
"""Levels of calls, the main program among them, as in LinuxCNC."""
MOST_NAMES = 10_000
"""Different names of parameters in a program."""
MOST_REPEATS = 256
"""Repeat loops that may be within each other, over all levels."""
LONGEST_NAME = 255
ROOM_OF_LINE = 2 * (LINE_LIMIT + 1)
"""Words of one line: a byte makes at most two."""

(
    KIND_BLOCK,
    KIND_NOTHING,
    KIND_O_WORD,
    KIND_SUB,
    KIND_ENDSUB,
    KIND_RETURN,
    KIND_CALL,
    KIND_IF,
    KIND_ELSEIF,
    KIND_ELSE,
    KIND_ENDIF,
    KIND_WHILE,
    KIND_JUMP,
    KIND_DO_WHILE,
    KIND_REPEAT,
    KIND_PROGRAM_NUMBER,
    KIND_END_OF_FILE,
    KIND_FAULT,
    KIND_GOTO,
    KIND_MACRO_IF,
    KIND_MACRO_WHILE,
    KIND_SIEMENS_IF,
    KIND_FOR,
    KIND_ENDFOR,
    KIND_UNTIL,
    KIND_SECTION,
    KIND_SIEMENS_CALL,
    KIND_CASE,
) = range(28)
"""What a marked line is: a block, an O-line that says nothing here, one that has not been looked at, …"""

LINE = np.dtype(
    [
        ("start", "i8"),  # byte in the text
        ("target", "i8"),  # word at which to go on: where a test fails, or a jump leads
        ("end", "i8"),  # word behind the end of what an elseif or else belongs to
        ("expression", "i8"),  # byte at which the expressions of an O-line begin
        ("kind", "i4"),  # KIND_…
        ("subprogram", "i4"),  # row of SUBPROGRAM: which is called, -1 = its number is computed
        ("first_message", "i4"),  # number of the first message comment of the line
        ("fault", "i4"),  # FAULT_… of KIND_FAULT
        ("segment", "i4"),  # which program of a Fanuc the line is in
    ],
    align=True,
)
SUBPROGRAM = np.dtype(
    [
        ("number", "i8"),  # -1 where it has a name
        ("entry", "i8"),  # word of its first line, -1 = not known
        ("is_ready", "i4"),  # not 0 once a call may go to the entry
        ("is_program", "i4"),  # not 0 for O1000 … M99, called by M98
        ("given", "i8"),  # bits of the arguments that its calls give: bit 1 is #1
        ("given_line", "i4"),  # of the call that gives the last of them
        ("missing", "i4"),  # number of an argument that is read and not given, 0 = none
        ("missing_line", "i4"),  # of its first call that does not give one
        ("missing_read", "i4"),  # line that reads it
        ("missing_given", "i8"),  # bits of the arguments of that call
        ("formal", "i4", MOST_FORMALS),  # parameters of the Sinumerik's variables that take its arguments
        ("formals", "i4"),
        ("fault", "i4"),  # FAULT_… for which it is not entered, 0 = none
    ],
    align=True,
)
NAME = np.dtype([("hash", "i8"), ("start", "i4"), ("length", "i4"), ("value", "f8"), ("is_set", "i8")])
FRAME = np.dtype(
    [
        ("return_to", "i8"),  # word behind the call
        ("times", "i8"),  # further runs of M98 L
        ("generation", "i8"),  # which names of the frame's row are its own
        ("entry", "i8"),
        ("until", "i8"),  # word before which a section of a program that is repeated ends, 0 = none
        ("is_program", "i4"),
        ("has_arguments", "i4"),  # its parameters are its own
        ("main_line", "i4"),  # of the main program's file: the line of the call, 0 = this is that file
        ("repeats", "i4"),  # loops that were begun before the call
        ("given", "i8"),  # bits of its arguments
        ("assigned", "i8"),  # bits of the arguments that it has set itself
        ("subprogram", "i4"),  # its row of SUBPROGRAM
        ("call_line", "i4"),
        ("parameters", "f8", MACRO_LOCALS),  # of the caller
    ],
    align=True,
)
REPEAT = np.dtype([("word", "i8"), ("end", "i8"), ("left", "i8")])
ASSIGNMENT = np.dtype([("name", "i8"), ("number", "i8"), ("value", "f8")])
LABEL = np.dtype(
    [
        ("segment", "i8"),
        ("number", "i8"),
        ("word", "i8"),  # at which GOTO goes on
        ("loop_first", "i8"),  # words of the innermost loop that it is in, -1 = none
        ("loop_last", "i8"),
    ]
)
"""N and its number, for GOTO, sorted by segment, number, word; or a number of CASE in its line's segment."""
ARRAY = np.dtype([("first", "i8"), ("rows", "i8"), ("columns", "i8")])
"""An array of a Sinumerik: the parameter of its first element, and its sizes; columns 0 = it has one."""
COURSE = np.dtype(
    [
        ("steps", "i8"),  # lines executed
        ("most_steps", "i8"),
        ("most_rows", "i8"),
        ("frame", "i8"),  # level of the calls, 0 = main program
        ("generation", "i8"),
        ("repeats", "i8"),
        ("names", "i8"),
        ("pool", "i8"),  # bytes of names
        ("assignments", "i8"),
        ("words", "i8"),  # of the line at hand
        ("marks", "i8"),
        ("is_testing", "i8"),  # an elseif is reached by a test that failed
        ("wanted", "i8"),  # row of the subprogram that has to be found, -1 = none, -2 = it has no row yet
        ("wanted_number", "i8"),  # its number then
        ("wanted_word", "i8"),  # where it is called
        ("main_words", "i8"),  # words of the main program's file, which is the first
        ("is_stopped", "i8"),  # by an error, or by the end of the file
        ("return_value", "f8"),
        ("value_returned", "i8"),
        ("subprograms", "i8"),
        ("changes", "i8"),  # of parameters, repeats, calls and tables so far
        ("laps", "i8"),  # jumps backwards
        ("laps_until", "i8"),  # at which the next one is kept; then of the one that is kept:
        ("lap_word", "i8"),
        ("lap_frame", "i8"),
        ("lap_changes", "i8"),
    ]
)
PROGRAM = StructOf(
    text=BYTES,
    lines=ArrayOf(LINE, written=True),
    subprograms=ArrayOf(SUBPROGRAM, written=True),
    names=ArrayOf(NAME, written=True),
    name_slots=OUT_INTS32,
    pool=OUT_BYTES,
    local_value=OUT_FLOATS,
    local_generation=OUT_INTS,
    parameters=OUT_FLOATS,
    frames=ArrayOf(FRAME, written=True),
    repeats=ArrayOf(REPEAT, written=True),
    assignments=ArrayOf(ASSIGNMENT, written=True),
    course=ArrayOf(COURSE, written=True),
    lap=ArrayOf(STATE, written=True),
    letter=OUT_BYTES,
    value=OUT_FLOATS,
    line=OUT_INTS32,
    extra=OUT_FLOATS,
    labels=ArrayOf(LABEL),
    statement_names=BYTES,
    statement_kinds=INTS32,
    arrays=ArrayOf(ARRAY),
    syntax=INT,
    language=INT,
)
