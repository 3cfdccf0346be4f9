"""G-codes that LinuxCNC reads and this reader never will: why they make no robot program, and what does.

Keys are ten times the number of a G-code; a reason holds up to the next one.
"""

_SPLINE_REMEDY = "let the post write the curve as G1, G2 and G3 (no splines or NURBS)"
_LATHE_REMEDY = "this translates for milling; use a post for milling"
NEVER_READ: dict[int, tuple[str, str]] = {
    50: ("a cubic spline is not broken down into straight moves", _SPLINE_REMEDY),
    51: ("a quadratic spline is not broken down into straight moves", _SPLINE_REMEDY),
    52: ("a NURBS curve (G5.2 to G5.3) is not broken down into straight moves", _SPLINE_REMEDY),
    60: ("a spline with given directions is not broken down into straight moves", _SPLINE_REMEDY),
    62: ("a NURBS curve (G6.2 to G6.3) is not broken down into straight moves", _SPLINE_REMEDY),
    70: ("X would be a diameter, as on a lathe", "write X as a coordinate, without G7"),
    80: ("X would be a radius, as on a lathe", "write X as a coordinate, without G8"),
    330: (
        "the feed would follow the turning of the spindle, to which a robot is not coupled",
        "mill the thread",
    ),
    331: (
        "rigid tapping couples the feed to the turning of the spindle, which a robot cannot do",
        "mill the thread (G2 or G3 helix)",
    ),
    382: (
        "a probing move ends where the part is touched, which is not known when the program is translated",
        "probe on the controller, and put the result into [work_offsets] or $BASE",
    ),
    700: ("the finishing cycle of a lathe follows a turned contour", _LATHE_REMEDY),
    710: ("the roughing cycle of a lathe along the part clears a turned contour", _LATHE_REMEDY),
    720: ("the roughing cycle of a lathe across the part clears a turned contour", _LATHE_REMEDY),
    760: ("the threading cycle of a lathe couples the feed to the turning of the part", "mill the thread"),
    870: (
        "back boring orients the spindle and moves the tool off centre through the hole",
        "bore from the other side, or let the post write the moves out",
    ),
    880: (
        "the operator retracts the tool by hand, which a robot's program cannot wait for",
        "use G86 or G89, or let the post write the cycle out",
    ),
    960: (
        "the speed of the spindle would follow X, the radius of a turned part, as on a lathe",
        "write G97 and S in rpm",
    ),
}
