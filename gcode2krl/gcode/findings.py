"""What can be wrong with a line of G-code: number in the core, stable code, sentence, remedy.

The compiled core reports a finding as (number, line, a, b, c); ``sentences.py`` fills the sentence in. In it
``{a}``, ``{b}`` and ``{c}`` are numbers, ``{word}`` is the letter whose code is ``a``, ``{words}`` are the
letters whose bits are set in ``a``, ``{g}`` and ``{h}`` are G or M numbers given as ten times their value,
``{state}`` names the modal state that led there.
"""

from typing import NamedTuple

from gcode2krl.errors import Severity
from gcode2krl.gcode import cycle_findings as of_cycles
from gcode2krl.gcode import mode_findings as of_modes
from gcode2krl.gcode import offset_findings as of_offsets
from gcode2krl.gcode import polar_findings as of_polar


class Finding(NamedTuple):
    """Text of one kind of finding."""

    severity: Severity
    code: str
    sentence: str
    remedy: str


(
    OK,
    BAD_CHARACTER,
    NO_NUMBER,
    NUMBER_TOO_LONG,
    COMMENT_OPEN,
    COMMENT_NESTED,
    EXPRESSION,
    O_WORD,
    LINE_TOO_LONG,
    UNKNOWN_LETTER,
    ROTARY_WORD,
    REPEATED_WORD,
    SAME_GROUP_G,
    SAME_GROUP_M,
    UNKNOWN_G,
    UNSUPPORTED_G,
    UNSUPPORTED_M,
    BAD_M,
    NO_FEED,
    NEGATIVE_FEED,
    NO_INVERSE_TIME,
    FEED_PER_REV_STOPPED,
    NO_MOTION_MODE,
    TWO_AXIS_CODES,
    UNUSED_WORD,
    ARC_NO_CENTRE,
    ARC_BOTH_FORMATS,
    ARC_RADIUS_MISMATCH,
    ARC_RADIUS_TOO_SMALL,
    ARC_R_FULL_CIRCLE,
    ARC_ZERO_RADIUS,
    ARC_WRONG_OFFSET,
    ARC_TURNS,
    ARC_NEEDS_OFFSETS,
    DWELL_NO_P,
    DWELL_NEGATIVE,
    TOOL_NOT_SELECTED,
    BAD_INTEGER,
    G53_NEEDS_RAPID_OR_FEED,
    G53_INCREMENTAL,
    NEGATIVE_TOLERANCE,
    NEGATIVE_SPEED,
    TOO_FAR,
    TOOL_UNDECLARED,
    H_DIFFERS,
    OFFSET_UNKNOWN,
    N_NOT_FIRST,
    TOO_MANY_M,
    DWELL_WITH_ARC,
    BAD_LINE_NUMBER,
    UNKNOWN_START,
    ARC_TOO_LONG,
    DIALECT_CODE,
    DIALECT_STATEMENT,
    NO_POINT,
    COUNTED_FROM_UNKNOWN,
    EXPRESSION_VALUE,
    PARAMETER_UNDEFINED,
    PARAMETER_NUMBER,
    PARAMETER_READ_ONLY,
    SUBPROGRAM_MISSING,
    CALLS_TOO_DEEP,
    TOO_MANY_STEPS,
    LOOP_WITHOUT_CHANGE,
    TOO_MANY_ROWS,
    NO_MACHINE,
    ROTARY_UNKNOWN,
    VECTOR_NO_MACHINE,
    VECTOR_ZERO,
    VECTOR_AND_ANGLE,
    VECTOR_ARC,
    TURN_PER_REV,
    TURN_TOO_FAR,
    CYCLE_TURNED,
    CUTTER_ON,
    CUTTER_PLANE,
    CUTTER_NO_D,
    CUTTER_NO_TOOL,
    CUTTER_NO_DIAMETER,
    CUTTER_LATHE,
    CUTTER_DIFFERS,
    CUTTER_ENTRY,
    CUTTER_ENTRY_ARC,
    CUTTER_EXIT_ARC,
    CUTTER_ARC,
    CUTTER_CORNER,
    CUTTER_SHORT,
    CUTTER_ROTATED,
    CUTTER_TURNED,
    CUTTER_PARAMETER,
) = range(90)

FINDINGS: dict[int, Finding] = {
    BAD_CHARACTER: Finding(
        "error",
        "bad-character",
        "character {char} has no meaning here",
        "{replacement}",
    ),
    NO_NUMBER: Finding(
        "error", "no-number", "{word} is not followed by a number", "write the number, or remove the letter"
    ),
    NUMBER_TOO_LONG: Finding(
        "error", "number-too-long", "the number after {word} has too many digits", "write at most 15 digits"
    ),
    COMMENT_OPEN: Finding("error", "comment-open", "the comment is not closed", "add )"),
    COMMENT_NESTED: Finding(
        "error", "comment-nested", "a comment in a comment", "write it without the inner ( and )"
    ),
    EXPRESSION: Finding("error", "expression", "{fault}", "{remedy}"),
    O_WORD: Finding("error", "o-word", "{fault}", "{remedy}"),
    EXPRESSION_VALUE: Finding("error", "expression-value", "{fault}", "{remedy}"),
    PARAMETER_UNDEFINED: Finding(
        "error",
        "parameter-undefined",
        "the named parameter has not been set",
        "set it before; a name without _ is known in its own subprogram only",
    ),
    PARAMETER_NUMBER: Finding(
        "error",
        "parameter-number",
        "{a:g} is not the number of a parameter",
        "parameters are #1 to #5601, whole numbers",
    ),
    PARAMETER_READ_ONLY: Finding(
        "error",
        "parameter-read-only",
        "this parameter shows the state of the machine and cannot be set",
        "use another; offsets are set by G10 and G92, or in [work_offsets] of the cell",
    ),
    SUBPROGRAM_MISSING: Finding(
        "error",
        "subprogram-missing",
        "the subprogram is neither in this program nor a file",
        "put its file (label.ngc, for a Fanuc O1234.nc) beside the program, or name its folder: --search",
    ),
    CALLS_TOO_DEEP: Finding(
        "error",
        "calls-too-deep",
        "subprograms call each other more than {a:.0f} levels deep",
        "does one call itself without end?",
    ),
    LOOP_WITHOUT_CHANGE: Finding(
        "error",
        "endless-loop",
        "the program jumps back and nothing has changed since it was there: the loop has no end",
        "let the loop count or move on, or remove the jump",
    ),
    TOO_MANY_STEPS: Finding(
        "error",
        "endless-loop",
        "the program has run {a:,.0f} lines and is not at its end",
        "does the loop end? check its condition",
    ),
    TOO_MANY_ROWS: Finding(
        "error",
        "endless-loop",
        "the program has made {a:,.0f} moves and is not at its end",
        "does the loop end? check its condition",
    ),
    LINE_TOO_LONG: Finding(
        "error",
        "line-too-long",
        "the line is longer than {a:.0f} characters",
        "break the line; is this a G-code file?",
    ),
    UNKNOWN_LETTER: Finding("error", "unknown-letter", "{word} is not a word of this dialect", "remove it"),
    ROTARY_WORD: Finding(
        "error",
        "rotary-axis",
        "{word} is a rotary or secondary axis, here at {b:g}, and the cell declares no machine",
        "leave {word} at 0, or declare the machine that the program is for: [machine] in the cell",
    ),
    REPEATED_WORD: Finding("error", "repeated-word", "{word} stands twice in the block", "keep one"),
    SAME_GROUP_G: Finding(
        "error",
        "same-group",
        "G{g} and G{h} exclude each other in one block",
        "write them in separate blocks",
    ),
    SAME_GROUP_M: Finding(
        "error",
        "same-group",
        "M{g} and M{h} exclude each other in one block",
        "write them in separate blocks",
    ),
    UNKNOWN_G: Finding(
        "error", "unknown-g", "G{g} is not a G-code of this dialect", "check the dialect of the post"
    ),
    UNSUPPORTED_G: Finding("error", "unsupported-g", "G{g}: {reason}", "{remedy}"),
    UNSUPPORTED_M: Finding("error", "unsupported-m", "M{g}: {reason}", "{remedy}"),
    BAD_M: Finding("error", "bad-m", "M{a:g} is not a whole number from 0 to 9999", "check the line"),
    NO_FEED: Finding(
        "error",
        "no-feed",
        "feed move without a feed: no F above 0 since {state}",
        "program F before the first G1, G2 or G3",
    ),
    NEGATIVE_FEED: Finding("error", "negative-feed", "F{a:g} is negative", "feeds are positive"),
    NO_INVERSE_TIME: Finding(
        "error",
        "no-inverse-time-feed",
        "feed move without F under G93 of line {a:.0f}",
        "inverse time needs F in every feed block",
    ),
    FEED_PER_REV_STOPPED: Finding(
        "error",
        "feed-per-rev-stopped",
        "feed per revolution (G95 of line {a:.0f}) with the spindle speed at zero",
        "program S and M3 first",
    ),
    NO_MOTION_MODE: Finding(
        "error",
        "no-motion-mode",
        "axis words without G0, G1, G2 or G3: {state}",
        "program a motion mode",
    ),
    TWO_AXIS_CODES: Finding(
        "error",
        "two-axis-codes",
        "G{g} and G{h} both claim the axis words of this block",
        "write them in separate blocks",
    ),
    UNUSED_WORD: Finding(
        "error",
        "unused-word",
        "nothing in this block uses {words}{state}",
        "remove it, or add the code it belongs to",
    ),
    ARC_NO_CENTRE: Finding(
        "error",
        "arc-no-centre",
        "G{g} without I, J, K or R{state}",
        "give the centre or the radius; a straight move needs G1",
    ),
    ARC_BOTH_FORMATS: Finding(
        "error", "arc-both-formats", "the arc has R and a centre (I, J, K)", "keep one of them"
    ),
    ARC_RADIUS_MISMATCH: Finding(
        "error",
        "arc-radius-mismatch",
        "arc: radius {a:.4f} mm at the start and {b:.4f} mm at the end differ by {difference:.4f} mm",
        "check I, J, K, the plane (G17-G19) and G90.1/G91.1; the post must write {decimals} decimals",
    ),
    ARC_RADIUS_TOO_SMALL: Finding(
        "error",
        "arc-radius-too-small",
        "arc: R {a:.4f} mm is too small, the end point is {b:.4f} mm away",
        "R must be at least half that distance",
    ),
    ARC_R_FULL_CIRCLE: Finding(
        "error",
        "arc-r-full-circle",
        "an arc given by R ends where it starts",
        "give a full circle by its centre (I, J, K)",
    ),
    ARC_ZERO_RADIUS: Finding("error", "arc-zero-radius", "the arc has radius zero", "check I, J, K and R"),
    ARC_WRONG_OFFSET: Finding(
        "error",
        "arc-wrong-offset",
        "{word}{b:g} is not in the plane of this arc (G{c:.0f})",
        "check the plane (G17: I J, G18: I K, G19: J K)",
    ),
    ARC_TURNS: Finding("error", "arc-turns", "P{a:g} turns: not a whole number from 1 to 1000", "check P"),
    ARC_NEEDS_OFFSETS: Finding(
        "error",
        "arc-needs-offsets",
        "G90.1 needs both centre words of the plane",
        "give both, or switch to G91.1",
    ),
    DWELL_NO_P: Finding("error", "dwell-no-p", "G4 without P", "give the dwell in seconds, G4 P0.5"),
    DWELL_NEGATIVE: Finding(
        "error", "dwell-negative", "G4 P{a:g} is negative", "a dwell is zero or more seconds"
    ),
    TOOL_NOT_SELECTED: Finding(
        "error", "tool-not-selected", "M6 without a T before it", "program T with or before M6"
    ),
    BAD_INTEGER: Finding(
        "error", "bad-integer", "{word} must be a whole number from 0 to 99999", "check the word"
    ),
    G53_NEEDS_RAPID_OR_FEED: Finding(
        "error", "g53-motion", "G53 works with G0 and G1 and axis words only", "write G53 G0 Z0"
    ),
    G53_INCREMENTAL: Finding("error", "g53-incremental", "G53 under G91", "switch to G90 first"),
    NEGATIVE_TOLERANCE: Finding(
        "error", "negative-tolerance", "G64 P{a:g} is negative", "a tolerance is zero or more"
    ),
    NEGATIVE_SPEED: Finding(
        "error", "negative-speed", "S{a:g} is negative", "use M4 for the other direction"
    ),
    TOO_FAR: Finding(
        "error", "too-far", "a coordinate of {a:g} mm is beyond 1000 m", "check the number and the unit"
    ),
    ARC_TOO_LONG: Finding(
        "error",
        "too-far",
        "the arc of radius {a:g} mm takes more than a million chords",
        "check the number, the unit and --chord-tolerance",
    ),
    TOOL_UNDECLARED: Finding(
        "warning",
        "tool-undeclared",
        "tool {a:.0f} is not declared; its length is taken as 0",
        "add [tool.{a:.0f}] with length_mm to the cell",
    ),
    H_DIFFERS: Finding(
        "warning",
        "h-differs",
        "H{a:.0f} while tool {b:.0f} is in the spindle",
        "use the H of the tool, or G43 without H; if the tool is wrong, M6 may be missing",
    ),
    OFFSET_UNKNOWN: Finding(
        "warning",
        "work-offset-unknown",
        "G{g} is selected but its offset is not known; taken as zero",
        "add it to [work_offsets] of the cell",
    ),
    N_NOT_FIRST: Finding(
        "error",
        "n-not-first",
        "a line number N inside a block",
        "N stands at the start of the line, also before comments",
    ),
    DWELL_WITH_ARC: Finding(
        "error",
        "two-uses",
        "G4 and an arc or a cycle share one block, so P would mean two things",
        "write them in separate blocks",
    ),
    BAD_LINE_NUMBER: Finding(
        "error",
        "bad-line-number",
        "N is not followed by a plain number",
        "write N and digits before a word of its own, or remove it",
    ),
    UNKNOWN_START: Finding(
        "error",
        "undefined-position",
        "feed move from a position that has not been programmed{state}; arcs after it cannot fit",
        "program X, Y and Z with G0 (and G90) first",
    ),
    DIALECT_CODE: Finding("error", "dialect-code", "G{h}: {reason}", "{remedy}"),
    DIALECT_STATEMENT: Finding("error", "dialect-statement", "this statement: {reason}", "{remedy}"),
    NO_POINT: Finding(
        "error",
        "decimal-point",
        "{word}{b:g} has no decimal point: on a Fanuc it is {b:g} or a thousandth of it, by a parameter",
        "write {word}{b:g}. in the post, or say --dialect fanuc-calculator ({b:g}) or fanuc-increments "
        "(1/1000)",
    ),
    COUNTED_FROM_UNKNOWN: Finding(
        "error",
        "undefined-position",
        "{word} counts from a position that has not been programmed",
        "program {word} with G0 and G90 first",
    ),
    CUTTER_ON: Finding(
        "error",
        "cutter-on",
        "{code} while cutter compensation is on (G{h} of line {c:.0f})",
        "write G40 and a straight move before it",
    ),
    CUTTER_PLANE: Finding(
        "error",
        "cutter-plane",
        "G{g} in the plane of G19",
        "cutter compensation works in G17 and G18",
    ),
    CUTTER_NO_D: Finding(
        "error",
        "cutter-diameter",
        "G{g} without D",
        "give the diameter of the cutter, G{g} D6.0; G41 and G42 take that of a tool",
    ),
    CUTTER_NO_TOOL: Finding(
        "error",
        "cutter-diameter",
        "G{g} without D, and no tool is in the spindle",
        "program T and M6 first, or name the tool by D",
    ),
    CUTTER_NO_DIAMETER: Finding(
        "error",
        "cutter-diameter",
        "G{g} takes the diameter of tool {b:.0f}, which is not declared",
        "add [tool.{b:.0f}] with diameter_mm to the cell, or a D to its line of the tool table",
    ),
    CUTTER_LATHE: Finding(
        "error",
        "cutter-lathe",
        "L names the orientation of a lathe tool",
        "remove L: this is a milling translator",
    ),
    CUTTER_DIFFERS: Finding(
        "warning",
        "cutter-differs",
        "G{g} compensates for a diameter of {b:.4f} mm, the tool in the spindle has {c:.4f} mm in the cell: "
        "the cut contour is {half:.4f} mm off the programmed one",
        "nothing to do where wear is meant, or for a path of the centre; else use the D of the tool",
    ),
    CUTTER_ENTRY: Finding(
        "error",
        "cutter-entry",
        "the entry move of cutter compensation is {a:.4f} mm long in its plane, not more than the radius "
        "{b:.4f} mm of the tool",
        "begin farther away from the contour; move along the tool before G41 or G42",
    ),
    CUTTER_ENTRY_ARC: Finding(
        "error",
        "cutter-entry",
        "the entry arc of cutter compensation is too short for the radius {b:.4f} mm of the tool",
        "begin with a straight move, or with a longer arc",
    ),
    CUTTER_EXIT_ARC: Finding(
        "error",
        "cutter-exit-arc",
        "an arc as the first move after G40",
        "leave cutter compensation with a straight move",
    ),
    CUTTER_ARC: Finding(
        "error",
        "cutter-arc",
        "the arc of radius {a:.4f} mm is too small for the radius {b:.4f} mm of the tool inside it",
        "use a smaller tool, or a larger radius",
    ),
    CUTTER_CORNER: Finding(
        "error",
        "cutter-gouge",
        "the tool of radius {b:.4f} mm cannot reach the inside corner where this block begins",
        "use a smaller tool, or round the corner with a larger radius",
    ),
    CUTTER_SHORT: Finding(
        "error",
        "cutter-gouge",
        "the move of line {a:.0f} is too short for the tool of radius {b:.4f} mm between its inside corners",
        "use a smaller tool, or leave the detail out",
    ),
    CUTTER_ROTATED: Finding(
        "error",
        "cutter-frame",
        "G{g} under a rotated work offset (G10 L2 R, or rotation_deg of the cell)",
        "rotate the part's frame in the cell instead, or let the CAM compensate the radius",
    ),
    CUTTER_TURNED: Finding(
        "error",
        "cutter-frame",
        "cutter compensation (G{g}) with rotary axes that are turned or move, or with tool vectors",
        "turn to zero before G41 or G42, or let the CAM compensate the radius",
    ),
    CUTTER_PARAMETER: Finding(
        "error",
        "cutter-parameter",
        "the diameter of the tool, or its place under cutter compensation, is not read from a parameter",
        "write the number into the program, or read the place before G41 or G42",
    ),
    NO_MACHINE: Finding(
        "error",
        "machine-missing",
        "G{g} programs the tip of a machine with rotary axes, and the cell declares no machine",
        "declare the machine that the program is for: [machine] in the cell",
    ),
    VECTOR_NO_MACHINE: Finding(
        "error",
        "machine-missing",
        "a tool vector turns the tool, and the cell declares no machine",
        "declare the machine that the program is for: [machine] in the cell",
    ),
    ROTARY_UNKNOWN: Finding(
        "error",
        "rotary-unknown",
        "where {words} stands is not known since tool vectors turned the tool",
        "program {words} in absolute angles (G90), or G28, behind the tool vectors",
    ),
    VECTOR_ZERO: Finding(
        "error",
        "tool-vector",
        "the tool vector {a:g}, {b:g}, {c:g} has no direction",
        "give the direction from the tip to the holder",
    ),
    VECTOR_AND_ANGLE: Finding(
        "error",
        "tool-vector",
        "{words} under G43.5, where I, J and K say how the tool stands",
        "use G43.4 for rotary words",
    ),
    VECTOR_ARC: Finding(
        "error",
        "tool-vector",
        "an arc under G43.5, where I, J and K are the tool vector",
        "let the post write G1, or use G43.4",
    ),
    TURN_PER_REV: Finding(
        "error",
        "turn-per-rev",
        "rotary axes alone under G95 of line {a:.0f}: degrees a revolution of the spindle have no use",
        "use G93 or G94",
    ),
    CYCLE_TURNED: Finding(
        "error",
        "cycle-turned",
        "G{g} moves along Z, and rotary axes turn in it or have turned the tool away from Z",
        "turn before the cycle, without G43.4; or let the post write the cycle out in G0 and G1",
    ),
    TURN_TOO_FAR: Finding(
        "error", "too-far", "a rotary axis at {a:g} degrees is beyond 1000 turns", "check the number"
    ),
    TOO_MANY_M: Finding(
        "error", "too-many-m", "more than four M-codes in one block", "write them in separate blocks"
    ),
}
FINDINGS |= {number: Finding(*text) for number, text in of_offsets.TEXTS.items()}
FINDINGS |= {number: Finding(*text) for number, text in of_cycles.TEXTS.items()}
FINDINGS |= {number: Finding(*text) for number, text in of_polar.TEXTS.items()}
FINDINGS |= {number: Finding(*text) for number, text in of_modes.TEXTS.items()}

WITH_COLUMN = {
    *(EXPRESSION, O_WORD, EXPRESSION_VALUE, PARAMETER_UNDEFINED, PARAMETER_NUMBER, PARAMETER_READ_ONLY),
    *(SUBPROGRAM_MISSING, CALLS_TOO_DEEP, CUTTER_PARAMETER),
}
"""Findings whose third number is the column of the culprit, -1 = not told."""
