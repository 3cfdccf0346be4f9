"""Numbers of the dialects that the core knows: syntax, marks in the stream of words, kinds of statements.

Plain module constants: the compiled core takes their values from here. What a dialect is made of says
`dialects`.
"""

SKIP_LEVEL, HEAD_LINES, DOLLAR_LINES, STATEMENTS, POINTS, MACROS = 1, 2, 4, 8, 16, 32
"""Bits of the syntax: ``/2``, ``:1234`` and ``%name``, ``$H``, ``MSG("…")``, numbers without
a point, ``IF``."""
PROGRAMS_NONE, PROGRAMS_LINUXCNC, PROGRAMS_FANUC, PROGRAMS_SINUMERIK = range(4)
"""How parameters, jumps and subprograms are written: not at all, O-words, custom macro B, R parameters."""

NEXT_ABSOLUTE, NEXT_INCREMENTAL, NEXT_POINTLESS = ord("<"), ord(">"), ord(".")
"""Marks before a word: ``X=AC(5)``, ``X=IC(5)``, a number without a decimal point."""
NEXT_SHORTEST, NEXT_FORWARD, NEXT_BACKWARD = ord("?"), ord(";"), ord("#")
"""Marks before a rotary word: ``C=DC(5)`` the shorter way, ``C=ACP(5)`` and ``C=ACN(5)`` up and down."""
NEXT_VECTOR = ord("*")
"""Mark before A, B or C: a component of the tool vector, ``A3=0.1``."""
TIP_ON, TIP_OFF = ord(","), ord("-")
"""``TRAORI`` and ``TRAFOOF``: X, Y, Z are the tip, and the machine's axes again."""
OTHER_TIP = ord('"')
"""``TRAORI(2)``: another transformation than the first."""
SKIPPED = ord("&")
"""A statement that says nothing to this robot."""
LABEL = ord("0")
"""``START:``, to which jumps lead."""
SHIFT_SET, SHIFT_ADD = ord("="), ord("+")
"""``TRANS`` and ``ATRANS``: the axis words of the block are a shift of the zero, or are added to it."""
CORNER_ROUND, CORNER_SIDE, CORNER_LENGTH = ord("1"), ord("2"), ord("3")
"""The corner to the next block, the value being a radius (``RND=``, ``,R``), how much a chamfer takes of each
side (``CHR=``, ``,C``), or the chamfer's length (``CHF=``)."""
CYCLE, ARGUMENT, MODAL = ord("4"), ord("5"), ord("6")
"""``CYCLE81``, the value being its number; each of its arguments, NaN where it is left out; ``MCALL``."""
TURN_SET, TURN_ADD, TURN_DEG, TURN_OFF = ord("7"), ord("8"), ord("9"), ord("'")
"""``ROT`` and a Fanuc's G68, ``AROT``, ``RPL=`` with its angle, and G69."""
MIRROR_SET, MIRROR_ADD, MIRROR_OFF = 1, 2, 3
"""``MIRROR`` and a Fanuc's G51.1, ``AMIRROR``, and G50.1: axis words name what is mirrored."""
ARC_VIA, ARC_TANGENT, NEXT_VIA = 4, 5, 6
"""``CIP`` and ``CT``: an arc by a point on it (``I1=`` before I, J, K), or touching what leads to it."""
APPROACH_CONTOUR, APPROACH_NORMAL = 7, 8
"""``KONT`` and ``NORM``."""
PROGRAM_NUMBER = ord(":")
"""``O1234`` alone in its line, where a program of that number begins."""

HARMLESS, REFUSED, RADIUS, TURNS, MESSAGE, CODE, ENDS, WHOLE_LINE, SHIFT, JUMP, TIP, FEED_AXES = range(12)
MARKED, CYCLE_CALL, MODAL_CALL, TOOL_NAME, TURN, DEFINE, VARIABLE, NAMED_ARC, APPROACH, ARRAY = range(12, 22)
"""Kinds of statements; a value behind the kind is below `KIND_STEP`."""
KIND_STEP = 32

LEAD_AT_ENTRY, LEAD_TO_CONTOUR, LEAD_BY_CORNER = range(3)
"""How G41 and G42 lead in: to the side of the entry move (LinuxCNC); to that of the first move of the
contour; so
inside of a corner, and else to the side of the entry move, on by a corner."""
D_IS_TOOL, D_IS_RADIUS, D_IS_DIAMETER, D_IS_WEAR = range(4)
"""What D of G41 and G42 says: the tool of that number, or an offset that holds its radius, diameter or
wear."""
AS_WRITTEN, POINT_REQUIRED, THOUSANDTHS, CALCULATOR = range(4)
"""What a number without a decimal point is: units, an error, least increments, or units where it is sure."""
MOST_CODES = 9999
"""Largest G number of a dialect, ten times: G999.9."""
CODE_UNKNOWN, CODE_HARMLESS, CODE_EXACT, CODE_CALL, CODE_NO_OFFSET, CODE_TURN, CODE_TURN_OFF = range(
    -1, -8, -1
)
CODE_OFFSET, CODE_MIRROR, CODE_MIRROR_OFF, CODE_CORNER_ARC, CODE_CORNER_MEETING, CODE_REFUSED = range(
    -8, -14, -1
)
"""Instead of a code of the core; exact stop of one block; call of a subprogram; no work offset is in force;
the coordinates are rotated, and are no more; a further work offset; they are mirrored, and no more; an arc
around corners of a compensated contour, or where its sides meet;
``CODE_REFUSED - k`` for the reason k."""
