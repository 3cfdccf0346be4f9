"""What can be wrong with a canned cycle: number in the core, then severity, stable code, sentence, remedy.

`gcode2krl.gcode.findings` says how a sentence is filled in; here ``{letter}`` is
the axis of the tool, whose code is ``b``.
"""

from gcode2krl.errors import Severity

(
    NO_AXES,
    INVERSE_TIME,
    MODES_CHANGED,
    NO_R,
    NO_DEPTH,
    DISTANCE_CHANGED,
    R_BELOW_DEPTH,
    REPEATS,
    NO_DWELL,
    DWELL_NEGATIVE,
    NO_PECK,
    PECK_NOT_POSITIVE,
    CLEARANCE_NEGATIVE,
    SPINDLE_OFF,
    SPINDLE_DIRECTION,
    TOO_LONG,
) = range(200, 216)

TEXTS: dict[int, tuple[Severity, str, str, str]] = {
    NO_AXES: (
        "error",
        "cycle-no-axes",
        "G{g} without X, Y or Z: a cycle drills where an axis word stands",
        "write X and Y of the hole",
    ),
    INVERSE_TIME: (
        "error",
        "cycle-inverse-time",
        "G{g} under G93 of line {b:.0f}: inverse time gives the moves of a cycle no feed",
        "write G94 and F before the cycle",
    ),
    MODES_CHANGED: (
        "error",
        "cycle-modes-changed",
        "the plane or the unit has changed since the cycle of line {a:.0f}, on whose height this one rests",
        "write G80 before the change, and all words of the cycle behind it",
    ),
    NO_R: (
        "error",
        "cycle-no-r",
        "G{g} without R, the height to which the tool moves at rapid speed",
        "write R in the first block of the cycle",
    ),
    NO_DEPTH: (
        "error",
        "cycle-no-depth",
        "G{g} without {letter}, the depth of the hole under G{c:.0f}",
        "write {letter} in the first block of the cycle",
    ),
    DISTANCE_CHANGED: (
        "error",
        "cycle-distance-changed",
        "R and {letter} of the cycle of line {a:.0f} hold no longer: G90 or G91 has changed in line {c:.0f}, "
        "and controls differ in what they now mean",
        "write R and {letter} in this block too",
    ),
    R_BELOW_DEPTH: (
        "error",
        "cycle-r-below-depth",
        "R {a:g} lies below the depth of the hole, {letter} {c:g}",
        "check R and {letter}, their signs, and G90/G91",
    ),
    REPEATS: (
        "error",
        "cycle-repeats",
        "L{a:g} of a cycle is not a whole number from 1 to 99999",
        "correct L, or remove it for one hole",
    ),
    NO_DWELL: (
        "error",
        "cycle-no-dwell",
        "G{g} without P, the dwell at the bottom",
        "write P in seconds in the first block of the cycle; G81 and G85 do not dwell",
    ),
    DWELL_NEGATIVE: (
        "error",
        "dwell-negative",
        "P{a:g} of a cycle is negative",
        "a dwell is zero or more seconds",
    ),
    NO_PECK: (
        "error",
        "cycle-no-peck",
        "G{g} without Q, the depth of a peck",
        "write Q in the first block of the cycle; G81 drills without pecks",
    ),
    PECK_NOT_POSITIVE: (
        "error",
        "cycle-peck",
        "Q{a:g}: the depth of a peck must be above zero",
        "write the depth of a peck as a positive number",
    ),
    CLEARANCE_NEGATIVE: (
        "error",
        "cycle-clearance",
        "D{a:g}: the tool would move at rapid speed into the material below the last peck",
        "write D as a positive number, or remove it (0.254 mm)",
    ),
    SPINDLE_OFF: (
        "error",
        "cycle-spindle-off",
        "G{g} needs a turning spindle",
        "write S and M3 (G74: M4) before the cycle",
    ),
    SPINDLE_DIRECTION: (
        "error",
        "cycle-spindle-direction",
        "G{g} under M{b:.0f}: the tap would turn against its thread",
        "write M{c:.0f} before the cycle; G84 taps right-hand threads, G74 left-hand ones",
    ),
    TOO_LONG: (
        "error",
        "cycle-too-long",
        "G{g} takes more than a million moves",
        "check Q (the depth of a peck), L (the number of holes) and the unit",
    ),
}
