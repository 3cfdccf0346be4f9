"""What can be wrong with an offset: number in the core, then severity, stable code, sentence, remedy.

`gcode2krl.gcode.findings` says how a sentence is filled in; here ``{axes}`` are the letters whose bits are
set in ``b``.
"""

from gcode2krl.errors import Severity

(
    NO_AXES,
    WITHOUT_L,
    UNKNOWN_L,
    WRONG_SYSTEM,
    WRONG_TOOL,
    TOOL_UNDECLARED,
    NO_LENGTH,
    ROTATION_BY_POSITION,
    TOOL_ACROSS,
    ADDED_BY_WORDS,
    ADDED_WITHOUT_H,
    FROM_UNKNOWN,
    AT_START,
    LENGTH_DIFFERS,
    ROTARY,
    ROTATION_WITH_ROTARY,
) = range(220, 236)

TEXTS: dict[int, tuple[Severity, str, str, str]] = {
    NO_AXES: ("error", "offset-no-axes", "G{g} names no axis", "name X, Y or Z with the value"),
    WITHOUT_L: (
        "error",
        "g10-words",
        "G10 without L, which says what it sets",
        "G10 L2 P1 X… sets G54, L20 P1 X… sets it by the position, L1 P5 Z… the length of tool 5",
    ),
    UNKNOWN_L: (
        "error",
        "g10-words",
        "G10 L{a:g} is not read",
        "G10 L1, L10, L11 (tools), L2 and L20 (work offsets) are; state other values in the cell",
    ),
    WRONG_SYSTEM: (
        "error",
        "g10-words",
        "G10 L{a:.0f} needs P, a whole number from 0 (the work offset in force) to 9 (G59.3)",
        "P1 is G54, P2 is G55",
    ),
    WRONG_TOOL: ("error", "g10-words", "G10 L{a:.0f} needs P, the number of a tool", "P5 is tool 5"),
    TOOL_UNDECLARED: (
        "error",
        "g10-words",
        "G10 L{a:.0f} P{b:.0f}: tool {b:.0f} is not declared",
        "add [tool.{b:.0f}] with length_mm to the cell",
    ),
    NO_LENGTH: (
        "error",
        "g10-words",
        "G10 L{a:.0f} sets nothing: no Z and no R",
        "give the length of the tool as Z, its radius as R",
    ),
    ROTATION_BY_POSITION: (
        "error",
        "g10-words",
        "G10 L20 takes no rotation R",
        "set the rotation with G10 L2 P… R…",
    ),
    TOOL_ACROSS: (
        "error",
        "tool-offset-across",
        "{word}{b:g} offsets the tool across its axis",
        "only Z, the length, is read; state the tool's frame in the cell",
    ),
    ADDED_BY_WORDS: (
        "error",
        "g43-2-words",
        "G43.2 adds the length of the tool H, axis words do not belong to it",
        "write G43.2 H…, and the move in a block of its own",
    ),
    ADDED_WITHOUT_H: (
        "error",
        "g43-2-words",
        "G43.2 without H",
        "name the tool whose length is added, G43.2 H10",
    ),
    FROM_UNKNOWN: (
        "warning",
        "offset-from-unknown",
        "G{g} sets the zero by the position, and that of {axes} has not been programmed",
        "move there with G0 first, or state the zero in [work_offsets] of the cell",
    ),
    AT_START: (
        "warning",
        "offset-at-start",
        "G{g} before any move: where the tool stands is not known, so the zero stays that of the work offset",
        "remove it, or state the zero in [work_offsets] of the cell",
    ),
    LENGTH_DIFFERS: (
        "warning",
        "tool-length-differs",
        "the program gives tool {a:.0f} a length of {b:g} mm, {c:g} mm are declared",
        "correct length_mm in [tool.{a:.0f}] of the cell, or the program",
    ),
    ROTARY: (
        "error",
        "rotary-offset",
        "G{h} with {words}: offsets of rotary axes are not read",
        "let the post write the angles themselves",
    ),
    ROTATION_WITH_ROTARY: (
        "error",
        "rotary-offset",
        "G10 L2 R{a:g} rotates a work offset of a machine with rotary axes, which is not read",
        "rotate $BASE of the cell: [frames] base",
    ),
}
