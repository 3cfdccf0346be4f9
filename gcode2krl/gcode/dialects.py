"""Dialects as tables of differences from LinuxCNC's RS274/NGC, which the core speaks.

A dialect is no interpreter of its own. Its G numbers are replaced by those of the core, its statements become
words (``CR=5`` is R5), its words the core's (G4 X2. is a dwell of 2 s); what the core has no meaning for is
refused with a reason, and what says nothing to a robot is noted once. The tables say what is commonly
documented of Fanuc milling, Grbl 1.1 and Sinumerik 840D sl / 828D; none has been checked on a control. Where
what a control does depends on its parameters, or is in doubt, the block is refused.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Floats, Ints32
from gcode2krl.errors import input_error
from gcode2krl.files.program_names import DIALECT_NAMES
from gcode2krl.gcode import dialect_marks as d
from gcode2krl.gcode import vocabulary as v
from gcode2krl.gcode.program_tables import FIRST_REAL

_CAM = "let the CAM post write G0, G1, G2 and G3 in the part's frame"
REASONS: Final = (
    ("tilted working plane", f"{_CAM}: output without 3+2 cycles"),
    ("rotated coordinates", _CAM),
    ("scaling", _CAM),
    ("polar coordinates", _CAM),
    ("fine boring and back boring move the tool sideways in the hole", "mill the hole, or bore with G85"),
    ("probing or a skip signal is not a motion this program can make", "probe on the controller"),
    ("threading needs a spindle geared to the motion", "mill the thread"),
    ("G54.1 needs P, a whole number from 1 to 300", "write G54.1 P1"),
    ("a cycle of the control", "let the post write the cycle out in G0 and G1"),
    ("jumps, loops and subprograms of this control are not read", "let the post write the program out"),
    ("variables and calculations of this control are not read", "let the post write plain numbers"),
    (
        "the tool's direction by other angles than those of its axes, or by the surface",
        "let the post write the tool vector A3, B3, C3, or the angles of the machine's axes",
    ),
    ("moves the machine by hand", "remove the line"),
    ("a setting of the machine", "remove the line; the robot's settings are in the cell"),
    ("the arc by its opening angle", "let the post write I and J, or CR="),
    ("smooth approach and retract", "let the post write them as G1, G2 and G3"),
    ("splines are not read", "let the post write G1, G2 and G3"),
    (
        "no tool of the cell has this name",
        'state name = "…" in [tool.N] of the cell, or let the post write the tool\'s number',
    ),
    ("return from the reference point", "write G0 to the point"),
    ("a point of the machine", "remove the line: the robot goes to HOME by itself"),
    (
        "an offset of the zero in the program",
        "let the post write final coordinates, or state the zero in [work_offsets] of the cell",
    ),
    ("a code that says nothing to a robot shares its block with axis words", "give it a block of its own"),
    ("a cutting edge beyond the first", "the cell's tool has one length: use D1"),
    (
        "variables, jumps and subprograms of LinuxCNC are not read in this dialect",
        "let the post write the program out in plain numbers",
    ),
    (
        "it sets offsets by this control's own numbers",
        "remove the block; state them in [work_offsets] and [tool.N] of the cell",
    ),
    ("it converts lengths to inches, but not feeds", "let the post write G700, or mm with G710"),
    (
        "how this control leads in and out, and what D holds, are parameters of the control",
        'state lead_in = "a", "b", "c-a" or "c-b" and d = "radius", "diameter" or "wear" in [program.cutter]'
        " of the cell,"
        " or let the post write the path of the tool's centre",
    ),
    (
        "the spindle stands still, so its turns take no time",
        "start the spindle, or write G4 F in seconds",
    ),
    ("a dwell counted twice, or a part of its unit", "write one word with a whole number of units"),
    ("a word that counts for itself beside a code that moves the zero", "give the code a block of its own"),
    ("not known to this control", "write G20 for inches, G21 for mm"),
    ("a message in a line that computes", "give MSG a line of its own, with plain text"),
    ("TRANS and ATRANS stand beside another code that moves the zero", "give each a block of its own"),
    (
        "a modal call runs its macro behind each move that follows",
        "call the macro with G65 where it is meant",
    ),
    ("a tool vector where TRAORI is not in force, or beside SUPA or TRANS", "write TRAORI before it"),
    ("a tool vector beside rotary words", "write one of the two"),
    ("a tool vector beside an arc", "let the post write G1"),
    ("another transformation than the first", "write TRAORI or TRAORI(1)"),
    (
        "whether TRANS outlives TRAORI and TRAFOOF is a setting of the control",
        "clear the shift by TRANS alone before it, and write it again behind it",
    ),
    (
        "whether the work offset outlives TRAORI and TRAFOOF is a setting of the control",
        "write G54 to G57 again behind them, before the next motion",
    ),
    ("F would count rotary axes too", "let the post write FGROUP(X,Y,Z), or the feed by G93"),
    ("parentheses are no comment on this control", "write the comment at the end of the line, behind ;"),
    (
        "; ends a block on this control, and a word stands behind it",
        "write a comment in ( ), a block in a line of its own",
    ),
    (
        "a corner is rounded or chamfered where a G1 in the plane follows another in the very next block,"
        " both longer than the corner and with one feed, and under G41 and G42 neither leads in or out",
        "let the post write the corner as G1, G2 and G3",
    ),
    (
        "0 repeats store the cycle and drill nothing, and whether the tool goes to X and Y is not sure",
        "leave X and Y out of this block, and write both in that of the first hole",
    ),
    (
        "G10 is read as G10 L2 P1 to P6 with X, Y and Z, under G90 alone",
        "write it so, or remove the block and state offsets in [work_offsets] and [tool.N] of the cell",
    ),
    (
        "corners that are all rounded alike, or have a feed of their own",
        "write RND= in the block before each corner, and its feed as F",
    ),
    ("a cycle, and MCALL, stand in a block of their own", "give it a block of its own"),
    (
        "of a drilling cycle are read RTP at or above RFP plus SDIS, one depth, DP or DPR, below RFP, a dwell"
        " of a spindle that turns or in seconds, and modes that name G17, the tip and these",
        "write CYCLE81(RTP,RFP,SDIS,DP), or let the post write the cycle out in G0 and G1",
    ),
    (
        "behind G500 no work offset is in force, and the machine's own zero is not that of the part",
        "write G54 to G57 again before the next motion; SUPA moves without one",
    ),
    ("under MCALL the cycle is drilled behind each move, behind this one too", "write MCALL alone before it"),
    (
        "a rotation is read in G17, about Z: ROT and AROT with RPL= or Z, G68 with X, Y and R under G90"
        " where none is in force, in a block of its own",
        _CAM,
    ),
    (
        "while the coordinates are rotated or mirrored the zero and the plane stay",
        "end it before this block (G69, G50.1; ROT, MIRROR), or write this block first",
    ),
    (
        "behind G68, G69, G51.1 and G50.1 the first move across the tool names X and Y under G90",
        "write both coordinates in it",
    ),
    (
        "of CYCLE83 are read one first depth, FDEP or FDPR, FRF above 0 and up to 1, VARI 0 or 1, and the"
        " tool's axis of G17",
        "write CYCLE83(RTP,RFP,SDIS,DP,,,FDPR,0,0,0,1,1), or let the post write the cycle out in G0 and G1",
    ),
    (
        "of CYCLE84 are read the pitch PIT in mm, the speed SST and what the spindle does then, SDAC 3 to 5,"
        " in one cut",
        "write CYCLE84(RTP,RFP,SDIS,DP,,,5,,PIT,,SST), or mill the thread",
    ),
    (
        "mirroring is read in G17, of X and Y: MIRROR X0, AMIRROR Y0, G51.1 X10. in a block of its own, where"
        " the program has not mirrored before",
        _CAM,
    ),
    (
        "an arc by a point on it has both coordinates of it (CIP X Y I1= J1=), off the chord and at its "
        "height; one"
        " that touches what leads to it (CT) stands behind a move in the plane that it leaves at an angle, "
        "without"
        " rotations, and under G41 behind the move that leads in",
        "let the post write G2 and G3",
    ),
    (
        "between two moves of a compensated contour stand blocks without a move in its plane, and how many "
        "the"
        " control looks past to see the corner is a parameter",
        "write them before or behind the contour",
    ),
    (
        "compensation begins with an arc, which is an alarm on this control",
        "lead in with G1",
    ),
    (
        "behind G40 the first move leads along the tool, and where the control then takes the offset off is "
        "not sure",
        "move in X or Y first, away from the contour",
    ),
    (
        "D names another offset than that of the tool in the spindle, or none was named",
        "write D with the tool's number; D0 for no compensation",
    ),
    (
        "KONT leads to and from a compensated contour by ways of its own, and DISC around its corners",
        "write NORM and G450 without DISC, which are the start-up settings, or G451",
    ),
    (
        "G10 L10 to L13 set what the cell states: R has to be length (L10) and size (L12) of the tool P "
        "there, 0 as"
        " wear (L11, L13), under G90, with d in [program.cutter]",
        "remove the block, or correct [tool.N] of the cell",
    ),
    ("a contour of free programming (FK)", "let the post write L, C, CR and CT"),
    (
        "whether F is in inches or tenths of them a minute is not sure",
        "let the post write mm: BEGIN PGM … MM",
    ),
    (
        "of TOOL CALL are read the tool, the axis Z, S and F, and DL and DR of 0",
        "state lengths and diameters in [tool.N] of the cell",
    ),
    (
        "a label that is called stands once in the program, and a called subprogram ends with LBL 0",
        "add LBL 0",
    ),
    (
        "the pole CC is read with absolute X and Y before what counts from it; LP with PR and PA, a part of "
        "a turn where"
        " the tool's place is known",
        "let the post write X and Y",
    ),
    (
        "of arcs are read C with X, Y and DR, CR with R and DR, CT, CP with PA or IPA of the sign of DR",
        "let the post write them so",
    ),
    ("a word that is not read in this block", "check the word, or let the post write another"),
    ("this M-code changes how the control moves", "let the post leave it out, or write what it stands for"),
    (
        "of drilling cycles are read 1 at a stated Z, 200, 201, 203 without Q212 and Q213 and out at FMAX or "
        "in one stroke, 207 behind a TOOL CALL with S, with Q200 to Q206 stated, defined before the call",
        "let the post write L, or cycle 200 with its Q words",
    ),
    ("of CYCLE85 are read both feeds, FFR in and RFF out, under G94", "write both feeds"),
    (
        "of CYCLE86 is read SDIR 3 or 4 without RPA, RPO and RPAP: no robot's spindle stops at an angle, by"
        " which the tool could be moved aside in the hole",
        "write CYCLE86(RTP,RFP,SDIS,DP,,0,3), or mill the hole",
    ),
    (
        "under G451 the offset sides of an outside corner do not meet",
        "write G450 before the contour",
    ),
    (
        "G41, G42 and G40 in a block without a move shift the tool at once (type C), and what they then do"
        " beside a move along the tool, an arc, or with another block before the contour is not sure",
        "write G41 and G42 in the block before the contour, and G40 right behind it",
    ),
    (
        "HOLES1, HOLES2 and CYCLE801 are read under MCALL with a cycle, in G17 and G90, from where X and Y"
        " are known: the arguments that place the holes alone, at most 10000 holes, in less than a turn",
        "write MCALL CYCLE81(…) before it, or let the post write X and Y of each hole",
    ),
)
"""What is refused in a dialect: reason and remedy, by their number."""
_TILTED, _ROTATED, _SCALED, _POLAR, _BORING, _PROBING, _THREAD, _OFFSETS, _CYCLE, _FLOW = range(10)
_VALUES, _VECTORS, _JOG, _SETTING, _ANGLE, _SMOOTH, _SPLINE, _TOOL_NAME, _RETURN = range(10, 19)
_HOME, _SHIFT, _BESIDE, _EDGE = range(19, 23)
REASON_TILTED, REASON_POLAR, REASON_OFFSET = _TILTED, _POLAR, _OFFSETS
REASON_SETTING, REASON_JOG, REASON_TOOL_NAME, REASON_VALUES = _SETTING, _JOG, _TOOL_NAME, _VALUES
_PROGRAM, _NUMBERS, _INCHES, _LEAD, _STILL, _TWICE, _MOVED, _NO_UNIT = range(23, 31)
_MESSAGE, _SHIFT_BESIDE, _MODAL_CALL = 31, 32, 33
REASON_NO_TIP, REASON_VECTOR_AND_ANGLE, REASON_VECTOR_ARC, REASON_OTHER_TIP = range(34, 38)
REASON_SHIFT_AND_TIP, REASON_ZERO_AND_TIP, REASON_FEED_AXES = range(38, 41)
REASON_PARENTHESES, REASON_SEMICOLON = 41, 42
REASON_CORNER, REASON_STORED, REASON_G10 = 43, 44, 45
_CORNERS, REASON_CYCLE_BESIDE, REASON_HEIGHTS, REASON_NO_OFFSET, REASON_MODAL_ZERO = range(46, 51)
REASON_TURN, REASON_TURNED, REASON_FIRST_TURNED = range(51, 54)
REASON_PECKS, REASON_PITCH, REASON_MIRROR, REASON_NAMED_ARC, REASON_LOOK_AHEAD = range(54, 59)
REASON_ENTRY_ARC, REASON_LEAD_OUT, REASON_D, REASON_KONT, REASON_TOOL_OFFSET = range(59, 64)
REASON_FREE_CONTOUR, REASON_TNC_INCHES, REASON_TOOL_CALL, REASON_TNC_LABEL, REASON_TNC_POLE = range(64, 69)
REASON_TNC_ARC, REASON_TNC_WORD, REASON_TNC_M, REASON_HOLE, REASON_REAM, REASON_BORE = range(69, 75)
REASON_NO_MEETING, REASON_SHIFT_ALONE, REASON_PATTERN = 75, 76, 77
REASON_ROTATED, REASON_SCALED, REASON_BORING, REASON_PROBING = _ROTATED, _SCALED, _BORING, _PROBING
REASON_CYCLE, REASON_SMOOTH, REASON_SHIFT = _CYCLE, _SMOOTH, _SHIFT
FIRST_VARIABLE = FIRST_REAL
REASON_EDGE, REASON_FLOW, REASON_BESIDE, REASON_VECTORS = _EDGE, _FLOW, _BESIDE, _VECTORS
REASON_SHIFT_BESIDE, REASON_MESSAGE = _SHIFT_BESIDE, _MESSAGE
REASON_PROGRAM, REASON_STILL, REASON_TWICE, REASON_MOVED = _PROGRAM, _STILL, _TWICE, _MOVED


@dataclass(frozen=True)
class Dialect:
    """What a dialect has beside, and other than, LinuxCNC's."""

    name: str
    title: str
    syntax: int = 0
    """Bits of `dialect_marks`: what of its text is no word."""
    programs: int = d.PROGRAMS_NONE
    """How parameters, jumps and subprograms are written; LinuxCNC's go with its polar words @ and ^."""
    has_m61_to_m73: bool = False
    """M61 to M73 are LinuxCNC's (tool number, outputs, saved modes), not the machine builder's."""
    own_codes: tuple[float, ...] = ()
    """The only G numbers that are those of the core; empty: all that it does not read otherwise."""
    same: Mapping[int, int] = field(default_factory=dict)
    """G numbers that are others of the core: 710 is 21."""
    exact: tuple[float, ...] = ()
    """G numbers of an exact stop in their block alone."""
    offsets: tuple[float, ...] = ()
    """G numbers of work offsets beyond those of LinuxCNC: G505 to G599, G54.1 with P."""
    no_offset: tuple[float, ...] = ()
    """G numbers after which no work offset is in force."""
    turn: tuple[float, ...] = ()
    """G numbers that rotate the coordinates about a point, and those that end it."""
    turn_off: tuple[float, ...] = ()
    mirror: tuple[float, ...] = ()
    """G numbers that mirror axes at a point, and those that end it."""
    mirror_off: tuple[float, ...] = ()
    corner_arc: tuple[float, ...] = ()
    """G numbers that lead around corners of a compensated contour by an arc, and to where its sides meet."""
    corner_meeting: tuple[float, ...] = ()
    harmless: tuple[float, ...] = ()
    """G numbers that say nothing to this robot."""
    calls: tuple[float, ...] = ()
    """G numbers that call a subprogram."""
    refused: Mapping[int, tuple[float, ...]] = field(default_factory=dict)
    """Number of the reason: G numbers that are refused for it."""
    dwell_s: Mapping[str, float] = field(default_factory=lambda: {"P": 1.0})
    """Letters of a dwell in G4: seconds of one unit."""
    dwell_turns: str = ""
    """Letter of a dwell in turns of the spindle."""
    points: int = d.AS_WRITTEN
    statements: Mapping[int, tuple[str, ...]] = field(default_factory=dict)
    """Kind of `dialect_marks`, with its value: names."""
    end_m: int = -1
    """M number that ends the program beside M2 and M30."""
    repeats_by_k: bool = False
    """K of a drilling cycle is the number of holes, as L is in LinuxCNC."""
    g80_keeps_motion: bool = False
    """G80 ends a cycle alone: of G0 to G3, a group of their own, the last is in force again."""
    idle_letters: str = ""
    """Letters that say nothing to what is read of this control: D, which G41 and G42 alone use."""
    length_by_d: bool = False
    """The tool's length applies with the tool, D0 ends it and D1 begins it; there is no G43."""
    lead: int = d.LEAD_AT_ENTRY
    """How G41 and G42 lead in, of `dialect_marks`."""
    shifts_alone: bool = False
    """G41, G42 and G40 in a block without a move shift the tool by themselves."""
    square_corners: bool = False
    """Outside corners of a compensated contour are straight moves."""
    d_holds: int = d.D_IS_TOOL
    """What D of G41 and G42 says, of `dialect_marks`."""
    start: Mapping[str, float] = field(default_factory=dict)
    """State at the start, where it is stated by the control."""
    is_conversational: bool = False
    """Its text is translated into that of a Sinumerik before it is read (`heidenhain`)."""
    tool_names: Mapping[str, int] = field(default_factory=dict)
    """Numbers of the cell's tools by their names in capitals, where no other tool has the same."""
    variables: Mapping[str, int] = field(default_factory=dict)
    """Numbers, as parameters, of the variables that the program defines, by their names in capitals."""
    arrays: Mapping[str, tuple[int, int, int]] = field(default_factory=dict)
    """Of its arrays the number of the first element and the sizes, 0 for none, by their names in capitals."""

    def syntax_bits(self) -> int:
        """Return the bits of what of its text is no plain word."""
        return self.syntax | (0 if self.points == d.AS_WRITTEN else d.POINTS)

    def core_g(self) -> Ints32:
        """Return the core's G number by that of the dialect, both ten times, (10000,); below 0: none."""
        table = np.full(d.MOST_CODES + 1, d.CODE_UNKNOWN, np.int32)
        kept = (
            np.array([_tenfold(code) for code in self.own_codes])
            if self.own_codes
            else np.arange(v.LARGEST_G + 1)
        )
        table[kept] = kept
        for special, codes in (
            (d.CODE_HARMLESS, self.harmless),
            (d.CODE_EXACT, self.exact),
            (d.CODE_CALL, self.calls),
            (d.CODE_OFFSET, self.offsets),
            (d.CODE_NO_OFFSET, self.no_offset),
            (d.CODE_TURN, self.turn),
            (d.CODE_TURN_OFF, self.turn_off),
            (d.CODE_MIRROR, self.mirror),
            (d.CODE_MIRROR_OFF, self.mirror_off),
            (d.CODE_CORNER_ARC, self.corner_arc),
            (d.CODE_CORNER_MEETING, self.corner_meeting),
        ):
            for code in codes:
                table[_tenfold(code)] = special
        for reason, codes in self.refused.items():
            for code in codes:
                table[_tenfold(code)] = d.CODE_REFUSED - reason
        for code, other in self.same.items():
            table[_tenfold(code)] = _tenfold(other)
        return table

    def dwell_by_letter(self) -> Floats:
        """Return seconds of one unit by letter (28,), NaN where it is none of a dwell, -1 for turns."""
        table = np.full(v.LETTERS, np.nan)
        for letter, seconds in self.dwell_s.items():
            table[v.index_of(letter)] = seconds
        if self.dwell_turns:
            table[v.index_of(self.dwell_turns)] = -1.0
        return table

    def names(self) -> tuple[NDArray[np.uint8], Ints32]:
        """Return the names of the statements, each with a line end behind it, and their kinds."""
        pairs = [(name, kind) for kind, names in self.statements.items() for name in names]
        pairs += [(f'"{name}"', _kind(d.TOOL_NAME, number)) for name, number in self.tool_names.items()]
        pairs += [(name, _kind(d.VARIABLE, number)) for name, number in self.variables.items()]
        pairs += [(f"{name}[", _kind(d.ARRAY, number)) for number, name in enumerate(self.arrays)]
        text = "".join(f"{name}\n" for name, _ in pairs).encode()
        return np.frombuffer(text, np.uint8).copy(), np.array([kind for _, kind in pairs], np.int32)

    def settings(self) -> dict[str, Any]:
        """Return what the interpreter is given."""
        return {
            "programs": self.programs,
            "has_m61_to_m73": int(self.has_m61_to_m73),
            "core_g": self.core_g(),
            "dwell_by_letter": self.dwell_by_letter(),
            "points": self.points,
            "length_by_d": int(self.length_by_d),
            "cycle_dwell_s": self.dwell_s.get("P", 1.0),
            "repeats_by_k": int(self.repeats_by_k),
            "g80_keeps_motion": int(self.g80_keeps_motion),
            "idle_letters": sum(1 << v.index_of(letter) for letter in self.idle_letters),
            "end_m": self.end_m,
            "lead": self.lead,
            "shifts_alone": int(self.shifts_alone),
            "square_corners": int(self.square_corners),
            "d_holds": self.d_holds,
            "whole_dwell_letter": v.index_of("P") if self.dwell_s.get("P", 1.0) < 1.0 else -1,
        }


def _tenfold(code: float) -> int:
    return round(code * v.TENFOLD)


def _kind(kind: int, value: int = 0) -> int:
    return kind + d.KIND_STEP * value


_FANUC_REFUSED = {
    _TILTED: (53.1, 53.6, 54.2, 68.2, 68.3, 68.4),
    _SCALED: (51,),
    _POLAR: (12.1, 112, 16),
    _BORING: (76, 87),
    _PROBING: (31, 37),
    _THREAD: (33,),
    _MODAL_CALL: (66, 66.1),
    _SPLINE: (6.2, 5.2),
    _RETURN: (29,),
    _HOME: (27,),
    _SETTING: (22,),
    _NUMBERS: (11, 43.1, 43.2, 59.1, 59.2, 59.3, 92, 92.1, 92.2, 92.3),
    _LEAD: (41, 41.1, 42, 42.1),
    _CYCLE: (70, 71, 72, 75, 77, 78, 79),
}
_FANUC: dict[str, Any] = {
    "programs": d.PROGRAMS_FANUC,
    "syntax": d.SKIP_LEVEL | d.HEAD_LINES | d.MACROS,
    "calls": (65,),
    "offsets": (54.1,),
    "turn": (68,),
    "turn_off": (69,),
    "mirror": (51.1,),
    "mirror_off": (50.1,),
    "same": {63: 64, 62: 64},
    "exact": (9,),
    "harmless": (5, 5.1, 8, 13.1, 113, 15, 23, 25, 26, 50, 67, 69.1, 103, 187),
    "refused": _FANUC_REFUSED,
    "dwell_s": {"P": 0.001, "X": 1.0, "U": 1.0},
    "repeats_by_k": True,
    "g80_keeps_motion": True,
    "start": {"retract": v.G98, "retract_line": -1},
    "idle_letters": "D",
}
_SINUMERIK_STATEMENTS = {
    _kind(d.RADIUS): ("CR",),
    _kind(d.TURNS): ("TURN",),
    _kind(d.MESSAGE): ("MSG",),
    _kind(d.CODE, v.G53 // v.TENFOLD): ("SUPA",),
    _kind(d.ENDS): ("RET",),
    _kind(d.HARMLESS): (
        *("ADIS", "ADISPOS", "COMPCAD", "COMPCURV", "COMPON", "COMPOF", "COMPSURF", "CYCLE832", "WORKPIECE"),
        *("FFWON", "FFWOF", "SOFT", "BRISK", "DRIVE", "STOPRE", "FIFOCTRL", "STARTFIFO", "STOPFIFO"),
        *("DYNNORM", "DYNPOS", "DYNROUGH", "DYNSEMIFIN", "DYNFINISH", "DYNPREC", "UPATH", "SPATH"),
        *("ORIWKS", "ORIMKS", "ORIAXES", "ORIVECT", "ORIEULER", "ORIRPY", "ORISOF", "ORISON", "ORIRESET"),
        *("CFC", "CFTCP", "CFIN", "CUT2D", "CUT2DF", "CDOF", "CDON", "CDOF2"),
        *("DIAMOF", "SPOS", "GROUP_BEGIN", "GROUP_END", "EXTCALL_END", "FNORM", "FLIN", "RTLIOF"),
        *("RTLION", "WALIMON", "WALIMOF", "CTOL", "OTOL", "ATOL", "OST", "CPRECON", "CPRECOF", "SPOF"),
        *("FGREF", "SETMS"),
    ),
    _kind(d.TIP, 1): ("TRAORI",),
    _kind(d.TIP, 0): ("TRAFOOF",),
    _kind(d.FEED_AXES): ("FGROUP",),
    _kind(d.WHOLE_LINE): ("PROC", "EXTERN", "SETAL"),
    _kind(d.REFUSED, _TILTED): ("TOROT", "TOFRAME", "TCARR"),
    _kind(d.SHIFT, 0): ("TRANS",),
    _kind(d.JUMP): (
        *("GOTO", "GOTOF", "GOTOB", "IF", "ELSE", "ENDIF", "LOOP", "ENDLOOP", "FOR", "ENDFOR", "WHILE"),
        *("ENDWHILE", "REPEAT", "REPEATB", "UNTIL", "CASE", "GOTOC"),
    ),
    _kind(d.DEFINE): ("DEF",),
    _kind(d.SHIFT, 1): ("ATRANS",),
    _kind(d.TURN, 0): ("ROT",),
    _kind(d.TURN, 1): ("AROT",),
    _kind(d.APPROACH, 0): ("KONT",),
    _kind(d.APPROACH, 1): ("NORM",),
    _kind(d.NAMED_ARC, 0): ("CIP",),
    _kind(d.NAMED_ARC, 1): ("CT",),
    _kind(d.TURN, 2): ("MIRROR",),
    _kind(d.TURN, 3): ("AMIRROR",),
    _kind(d.REFUSED, _ROTATED): ("ROTS", "AROTS", "CROT", "CROTS"),
    _kind(d.REFUSED, _SCALED): ("SCALE", "ASCALE"),
    _kind(d.REFUSED, _POLAR): ("AP", "RP", "TRANSMIT", "TRACYL"),
    _kind(d.REFUSED, _CYCLE): (
        *(
            "POCKET1",
            "POCKET2",
            "POCKET3",
            "POCKET4",
            "SLOT1",
            "SLOT2",
            "LONGHOLE",
            "CYCLE60",
            "CYCLE61",
            "CYCLE62",
            "CYCLE63",
            "CYCLE64",
            "CYCLE70",
            "CYCLE71",
            "CYCLE72",
        ),
        *("CYCLE76", "CYCLE77", "CYCLE78", "CYCLE79"),
        *("CYCLE87", "CYCLE88", "CYCLE802"),
    ),
    **{_kind(d.CYCLE_CALL, number): (f"CYCLE{number}",) for number in (81, 82, 83, 84, 85, 86, 89, 800, 801)},
    _kind(d.CYCLE_CALL, v.CYCLE_ROW): ("HOLES1",),
    _kind(d.CYCLE_CALL, v.CYCLE_CIRCLE): ("HOLES2",),
    _kind(d.MODAL_CALL): ("MCALL",),
    _kind(d.REFUSED, _THREAD): ("CYCLE840",),
    _kind(d.REFUSED, _FLOW): (
        *("GOTOS", "CALL", "EXTCALL", "WHEN"),
        *("WHENEVER", "EVERY", "DO", "ID", "IDS", "SAVE"),
    ),
    _kind(d.REFUSED, _VECTORS): ("LEAD", "TILT", "THETA", "PSI"),
    _kind(d.REFUSED, _VALUES): ("REDEF", "SET"),
    _kind(d.MARKED, d.CORNER_ROUND - d.CORNER_ROUND): ("RND",),
    _kind(d.MARKED, d.CORNER_SIDE - d.CORNER_ROUND): ("CHR",),
    _kind(d.MARKED, d.CORNER_LENGTH - d.CORNER_ROUND): ("CHF",),
    _kind(d.MARKED, d.TURN_DEG - d.CORNER_ROUND): ("RPL",),
    _kind(d.REFUSED, _CORNERS): ("RNDM", "FRC", "FRCM"),
    _kind(d.REFUSED, REASON_KONT): ("DISC",),
    _kind(d.REFUSED, _ANGLE): ("AR", "INVCW", "INVCCW"),
    _kind(d.REFUSED, _SPLINE): ("ASPLINE", "BSPLINE", "CSPLINE", "POLY"),
    _kind(d.REFUSED, _PROBING): ("MEAS", "MEAW", "CYCLE977", "CYCLE978", "CYCLE971"),
}
_LIST: Final = (
    Dialect("linuxcnc", "LinuxCNC's RS274/NGC", programs=d.PROGRAMS_LINUXCNC, has_m61_to_m73=True),
    Dialect("fanuc", "Fanuc milling; a number without a point is refused", **_FANUC, points=d.POINT_REQUIRED),
    Dialect("fanuc-calculator", "Fanuc milling; X100 is 100 mm", **_FANUC, points=d.CALCULATOR),
    Dialect("fanuc-increments", "Fanuc milling; X100 is 0.1 mm", **_FANUC, points=d.THOUSANDTHS),
    Dialect(
        "grbl",
        "Grbl 1.1: G0, G21 at the start, $ lines",
        syntax=d.DOLLAR_LINES,
        has_m61_to_m73=True,
        refused={_LEAD: (41, 41.1, 42, 42.1), _NO_UNIT: (70, 71)},
        start={"motion": v.MOTION_RAPID, "unit_named": 1},
    ),
    Dialect(
        "sinumerik",
        "Sinumerik 840D sl, as CAM posts write it",
        programs=d.PROGRAMS_SINUMERIK,
        syntax=d.SKIP_LEVEL | d.HEAD_LINES | d.STATEMENTS,
        own_codes=(0, 1, 2, 3, 4, 17, 18, 19, 40, 41, 42, 53, 54, 55, 56, 57, 64, 90, 91, 93, 94, 95, 96, 97),
        same={700: 20, 710: 21, 71: 21, 60: 61, 641: 64, 642: 64, 643: 64, 644: 64, 645: 64, 153: 53},
        exact=(9,),
        no_offset=(500,),
        offsets=tuple(range(505, 600)),
        corner_arc=(450,),
        corner_meeting=(451,),
        lead=d.LEAD_TO_CONTOUR,
        harmless=(5, 601, 602, 603, 290, 460, 461, 462, 810, 811, 812, 621, 62),
        refused={
            _THREAD: (33, 34, 35, 331, 332, 63),
            _POLAR: (110, 111, 112),
            _SMOOTH: (140, 141, 142, 143, 147, 148, 247, 248, 340, 341, 347, 348),
            _HOME: (74, 75),
            _SHIFT: (58, 59),
            _SETTING: (25, 26),
            _INCHES: (70,),
        },
        dwell_s={"F": 1.0},
        dwell_turns="S",
        statements=_SINUMERIK_STATEMENTS,
        end_m=17,
        length_by_d=True,
    ),
)
_OF_TNC = {
    _kind(d.HARMLESS): ("NOTED",),
    _kind(d.CYCLE_CALL, v.CYCLE_BEHIND): ("HOLE",),
    **{_kind(d.REFUSED, reason): (f"REFUSED_{reason}",) for reason in range(len(REASONS))},
}
_SINUMERIK = next(dialect for dialect in _LIST if dialect.name == "sinumerik")
_HEIDENHAIN = replace(
    _SINUMERIK,
    name="heidenhain",
    title="Heidenhain's conversational programs, as CAM posts write them",
    syntax=d.STATEMENTS,
    statements={
        kind: (*_SINUMERIK.statements.get(kind, ()), *_OF_TNC.get(kind, ()))
        for kind in (*_SINUMERIK.statements, *_OF_TNC)
    },
    is_conversational=True,
)
DIALECTS: Final[Mapping[str, Dialect]] = {dialect.name: dialect for dialect in (*_LIST, _HEIDENHAIN)}
"""The dialects by their names, the default first."""
DEFAULT: Final = DIALECT_NAMES[0]
OTHER_POST: Final = "export the part again with a post for LinuxCNC, Fanuc or Sinumerik"


_LEADS: Final = {"a": d.LEAD_TO_CONTOUR, "b": d.LEAD_BY_CORNER}
"""By the last letter of ``lead_in``: type C, ``c-a`` and ``c-b``, leads so where its block moves."""
_D_HOLDS: Final = {"radius": d.D_IS_RADIUS, "diameter": d.D_IS_DIAMETER, "wear": d.D_IS_WEAR}


def with_cutter(dialect: Dialect, lead_in: str | None, holds: str | None) -> Dialect:
    """Return a Fanuc's dialect with G41 and G42, where the cell states how they lead in and what D holds."""
    if dialect.programs != d.PROGRAMS_FANUC or lead_in is None or holds is None:
        return dialect
    return replace(
        dialect,
        refused={**dialect.refused, _LEAD: (41.1, 42.1)},
        lead=_LEADS[lead_in[-1]],
        shifts_alone=lead_in.startswith("c"),
        square_corners=True,
        d_holds=_D_HOLDS[holds],
    )


def dialect_of(name: str, source: str) -> Dialect:
    """Return a dialect by its name; raises `NotUnderstoodError` where it is none that is read."""
    if name in DIALECTS:
        return DIALECTS[name]
    allowed = ", ".join(DIALECTS)
    raise input_error("dialect-unknown", f"dialect {name!r}; allowed: {allowed}", source=source)
