"""What can be wrong with polar words: number in the core, then severity, stable code, sentence, remedy."""

from gcode2krl.errors import Severity

PLANE, WITH_AXIS, G53, AT_ZERO = range(240, 244)
TEXTS: dict[int, tuple[Severity, str, str, str]] = {
    PLANE: (
        "error",
        "polar-plane",
        "polar words (@ ^) under G{a:.0f}: they lie in the plane of X and Y",
        "write G17 before them, or X, Y and Z",
    ),
    WITH_AXIS: (
        "error",
        "polar-and-axis",
        "polar words (@ ^) and {word} share one block, and both say where X and Y lead",
        "write @ and ^, or X and Y",
    ),
    G53: (
        "error",
        "polar-and-axis",
        "polar words (@ ^) beside G53: machine coordinates have no pole",
        "write X and Y of the machine",
    ),
    AT_ZERO: (
        "error",
        "polar-zero",
        "the tool stands at the zero, from which @ alone has no direction and ^ alone no distance",
        "write @ and ^, both, under G90",
    ),
}
