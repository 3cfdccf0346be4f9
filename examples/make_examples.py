"""Write the example G-code programs.

    python examples/make_examples.py                          the four example files, always the same bytes
    python examples/make_examples.py --out DIR                the same, elsewhere
    python examples/make_examples.py --raster-lines 1000000   one raster of about so many lines instead
    python examples/make_examples.py --pocket                 an adaptive pocket of 15,000 lines instead

Positions are those of the tool tip in $BASE, in mm, feeds in mm/min; tool numbers are the default cell's.
"""

import argparse
import math
import re
from collections.abc import Iterable
from pathlib import Path

from make_pocket import long_pocket
from make_raster import long_raster, raster_finish

# --- what the LinuxCNC-style programs share ----------------------------------------------------

SAFE_Z_MM = 20.0  # rapids from one feature to the next
NEAR_Z_MM = 2.0  # from here down at feed
SPEED_RPM = 13000
FEED = 1500  # the paper's 25 mm/s


def begin(*comments: str) -> list[str]:
    """Head of a program: comments, then the modes."""
    modes = ["G21 G90 G91.1 G17 G40 G49 G80 G94", "G54", "G64 P0.02"]
    return ["%", *(f"({comment})" for comment in comments), *modes]


def take(tool: int, speed_rpm: int) -> list[str]:
    """Tool change, spindle, coolant, up to the safe height with the tool's length."""
    return [f"T{tool} M6", f"S{speed_rpm} M3", "M8", f"G0 G43 H{tool} Z{SAFE_Z_MM:.3f}"]


def feature(name: str, x: float, y: float, cuts: Iterable[str]) -> list[str]:
    """Rapid over (x, y) and down to just over the block, the cuts, rapid up."""
    over = [f"G0 X{x:z.3f} Y{y:z.3f}", f"G0 Z{NEAR_Z_MM:.3f}"]
    return [f"({name})", *over, *cuts, f"G0 Z{SAFE_Z_MM:.3f}"]


def blocks(text: str) -> list[str]:
    """The blocks of a literal text, one a line."""
    return [line.strip() for line in text.strip().splitlines()]


END = ["M9", "M5", "M30", "%"]

# --- 1. the paper's test piece: block x 0..300, y -100..100, z -30..0 -------------------------------

BLOCK_LENGTH_X_MM = 300.0
BLOCK_HALF_WIDTH_Y_MM = 100.0
OVERRUN_MM = 20.0  # from the block's edge to the tool's centre where the tool stands in air
GROOVE_DEPTH_MM = 8.95
GROOVES_ALONG_X_AT_Y_MM = (-80.0, -50.0)
GROOVE_ALONG_Y_AT_X_MM = 150.0  # between the ramps
RAMPS_AT_Y_MM = -20.0
RAMP_LENGTH_MM = 130.0  # 3.9 degrees
POCKET_CENTRE_MM = (75.0, 50.0)
POCKET_DEPTH_MM = 6.0
POCKET_PATH_RADIUS_MM = 22.0  # pocket 60 mm, tool 16 mm
POCKET_STEPOVER_MM = 6.0  # a turn of the spiral
POCKET_FIRST_RADIUS_MM = 4.0

FAR_X_MM, FAR_Y_MM = BLOCK_LENGTH_X_MM + OVERRUN_MM, BLOCK_HALF_WIDTH_Y_MM + OVERRUN_MM
TO_DEPTH = f"G1 Z{-GROOVE_DEPTH_MM:.3f} F{FEED}"
TO_TOP = f"G1 Z0.000 F{FEED}"


def groove_along_x(y: float) -> list[str]:
    """Full slot from air through the block into air."""
    cuts = [TO_DEPTH, f"G1 X{FAR_X_MM:.3f}"]
    return feature(f"GROOVE ALONG +X AT Y{y:.0f}, FULL SLOT", -OVERRUN_MM, y, cuts)


def groove_along_y() -> list[str]:
    """Full slot that begins in the last groove along x, so that the tool goes down in air."""
    cuts = [TO_DEPTH, f"G1 Y{FAR_Y_MM:.3f}"]
    x, y = GROOVE_ALONG_Y_AT_X_MM, GROOVES_ALONG_X_AT_Y_MM[-1]
    return feature("GROOVE ALONG +Y, OUT OF THE LAST ONE AND THROUGH THE FAR SIDE", x, y, cuts)


def ramps() -> list[str]:
    """Two ramps from full depth in air up to the top: no flat bottom has to cut on the way down."""
    up = [TO_DEPTH, "G1 X0.000", f"G1 X{RAMP_LENGTH_MM:.3f} Z0.000"]
    back = [TO_DEPTH, f"G1 X{BLOCK_LENGTH_X_MM:.3f}", f"G1 X{BLOCK_LENGTH_X_MM - RAMP_LENGTH_MM:.3f} Z0.000"]
    return [
        *feature("RAMP ALONG +X", -OVERRUN_MM, RAMPS_AT_Y_MM, up),
        *feature("RAMP ALONG -X", FAR_X_MM, RAMPS_AT_Y_MM, back),
    ]


def pocket_arc(x_from_centre: float, radius_mm: float, z: float = -POCKET_DEPTH_MM) -> str:
    """G3 to a point on the pocket's x axis, about a point `radius_mm` from the start along x."""
    x, y = POCKET_CENTRE_MM
    return f"G3 X{x + x_from_centre:.3f} Y{y:.3f} Z{z:.3f} I{radius_mm:.3f} J0.000"


def circular_pocket() -> list[str]:
    """In from the groove along y, spiral of half circles, wall, out on a quarter circle."""
    (x, y), radius, wall, leave_mm = POCKET_CENTRE_MM, POCKET_FIRST_RADIUS_MM, POCKET_PATH_RADIUS_MM, 5.0
    cuts = [f"G1 Z{-POCKET_DEPTH_MM:.3f} F{FEED}", f"G1 X{x + radius:.3f}", pocket_arc(radius, -radius)]
    side, reached = 1, radius
    while reached < wall:
        grown = reached + POCKET_STEPOVER_MM / 2
        cuts.append(pocket_arc(-side * grown, -side * (reached + grown) / 2))
        side, reached = -side, grown
    cuts.append(pocket_arc(wall, -wall))
    cuts.append(f"G3 X{x + wall - leave_mm:.3f} Y{y + leave_mm:.3f} I{-leave_mm:.3f} J0.000")
    return feature(
        "CIRCULAR POCKET D60, 6 MM DEEP, IN FROM THE GROOVE", GROOVE_ALONG_Y_AT_X_MM, y, [*cuts, "G1 Z0.000"]
    )


def test_piece() -> list[str]:
    """Grooves, ramps and a circular pocket, after section 3.2 of Haehn and Weigold 2020."""
    head = begin(
        "TEST PIECE: GROOVES, RAMPS AND A CIRCULAR POCKET",
        "AFTER HAEHN AND WEIGOLD 2020, SECTION 3.2",
        "STOCK: BLOCK X0..300 Y-100..100 Z-30..0, ALUMINIUM AW2017",
        "T1 END MILL D16, 3 FLUTES, 25 MM/S, 13000 RPM",
        f"GROOVE DEPTH {GROOVE_DEPTH_MM} MM IS OUR ASSUMPTION, THE PAPER GIVES NONE:",
        "BY THE FORCE COEFFICIENTS OF AW7075 A FULL SLOT THIS DEEP GIVES THE 546 N MEASURED THERE",
        "LAYOUT AND POCKET SIZE ARE OUR ASSUMPTIONS TOO",
    )
    grooves = [line for y in GROOVES_ALONG_X_AT_Y_MM for line in groove_along_x(y)]
    return [*head, *take(1, SPEED_RPM), *grooves, *groove_along_y(), *ramps(), *circular_pocket(), *END]


# --- 3. contour with arcs: a plate x 20..140, y 20..80 with corners R12 and a notch R12 -------------

PLATE_CONTOUR = """
    G2 X32.000 Y86.000 I18.000 J0.000\nG1 X68.000
    G2 X74.000 Y80.000 I0.000 J-6.000
    G3 X86.000 Y80.000 I6.000 J0.000
    G2 X92.000 Y86.000 I6.000 J0.000\nG1 X128.000
    G2 X146.000 Y68.000 I0.000 J-18.000\nG1 Y32.000
    G2 X128.000 Y14.000 I-18.000 J0.000\nG1 X32.000
    G2 X14.000 Y32.000 I0.000 J18.000"""


def with_radius(text: str) -> str:
    """The same arcs with R instead of I and J."""
    return re.sub(r"I(\S+) J(\S+)", lambda m: f"R{math.hypot(float(m[1]), float(m[2])):.3f}", text)


def plate_contour(depth_mm: float, contour: str) -> list[str]:
    """Once around with T7 (radius 6), on and off on quarter circles that begin and end in air."""
    on = [f"G1 Z{-depth_mm:.3f} F1000", f"G3 X14.000 Y50.000 I0.000 J10.000 F{FEED}", "G1 Y68.000"]
    off = ["G1 Y50.000", "G3 X4.000 Y60.000 I-10.000 J0.000"]
    return feature(f"CONTOUR AT Z-{depth_mm:.0f}", 4, 40, [*on, *blocks(contour), *off])


def helical_bore(x: float, y: float, depth_mm: int = 10, path_radius_mm: float = 5.0) -> list[str]:
    """A bore of 22 mm with T7: a helix of 1 mm a turn, a full circle on the floor, out at the centre."""
    circle = f"I{-path_radius_mm:.3f} J0.000"
    start = f"X{x + path_radius_mm:.3f} Y{y:.3f}"
    helix = [f"G3 {start} Z{-turn:.3f} {circle}" for turn in range(1, depth_mm + 1)]
    cuts = ["G1 Z0.000 F1000", *helix, f"G3 {circle}", f"G1 X{x:.3f}", "G1 Z0.000"]
    return feature("BORE D22: HELIX AND FULL CIRCLE", x + path_radius_mm, y, cuts)


def trough(plane: str, x: float, y: float, rows: int = 17) -> list[str]:
    """Zigzag arcs, 20 mm wide, 2 mm deep, radius 26, rows 1 mm apart: G18 with I K, G19 with R.

    (x, y) is the middle of the first row, which runs along x in G18 and along y in G19.
    """
    cuts = ["G1 Z0.000 F1000", plane]
    for row in range(rows):
        side_mm = -10 if row % 2 else 10
        if plane == "G18":
            code, step = ("G2" if side_mm > 0 else "G3"), f"G1 Y{y + row:.3f}"
            arc = f"{code} X{x + side_mm:.3f} Z0.000 I{side_mm:.3f} K24.000 F1200"
        else:
            code, step = ("G3" if side_mm > 0 else "G2"), f"G1 X{x + row:.3f}"
            arc = f"{code} Y{y + side_mm:.3f} Z0.000 R26.000 F1200"
        cuts += [step, arc] if row else [arc]
    start = (x - 10, y) if plane == "G18" else (x, y - 10)
    return feature(f"TROUGH, ARCS IN {plane}", *start, [*cuts, "G17"])


def contour_arcs() -> list[str]:
    """Outer contour and bore with an end mill, two troughs with a ball nose."""
    head = begin(
        "CONTOUR WITH ARCS IN ALL PLANES, TWO TOOLS",
        "STOCK: BLOCK X17..143 Y17..83 Z-20..0, ALUMINIUM",
        "T7 END MILL D12, T14 BALL NOSE D10",
    )
    levels = [(4, PLATE_CONTOUR), (8, with_radius(PLATE_CONTOUR)), (12, PLATE_CONTOUR)]
    contour = [line for depth_mm, text in levels for line in plate_contour(depth_mm, text)]
    change = ["G0 Z50.000", "M9", "M5", *take(14, SPEED_RPM)]
    troughs = [*trough("G18", 110, 28), *trough("G19", 68, 40)]
    return [*head, *take(7, 10000), *contour, *helical_bore(45, 50), *change, *troughs, *END]


# --- 4. as a Fanuc-style CAM post writes it: plate x 0..120, y 0..80 with corners R10 ---------------

CAM_HEAD = """
    (CAM STYLE)
    (STOCK: BLOCK X-5..125 Y-5..85 Z-25..1, ALUMINIUM)
    (T4 D=6. CR=0. - ZMIN=-12. - FLAT END MILL, CENTRE CUTTING)
    (T6 D=10. CR=0. - ZMIN=-15. - FLAT END MILL)
    (T10 D=25. CR=0. - ZMIN=0. - FLAT END MILL)
    G90 G94 G17 G21 G49 G40 G80\nG28 G91 Z0.\nG90"""
CAM_FACE = """
    X142. F1200.
    G3 Y18.5 J9.5\nG1 X-22.
    G2 Y37.5 J9.5\nG1 X142.
    G3 Y56.5 J9.5\nG1 X-22.
    G2 Y75.5 J9.5\nG1 X142."""
CAM_CONTOUR = """
    G3 X-5. Y40. J10. F1350.\nG1 Y70.
    G2 X10. Y85. I15.\nG1 X110.
    G2 X125. Y70. J-15.\nG1 Y10.
    G2 X110. Y-5. I-15.\nG1 X10.
    G2 X-5. Y10. J15.\nG1 Y40.
    G3 X-15. Y50. I-10."""
CAM_RETRACT = ["G0 Z15.", "M9", "M5", "G28 G91 Z0.", "G90"]
CAM_HOLES = ["X12.5 Y12.5", "X60.", "X107.5", "Y67.5", "X60.", "X12.5"]


def cam_tool(name: str, tool: int, next_tool: int, speed_rpm: int, at: str) -> list[str]:
    """Tool change with the next tool called up in advance."""
    change = [f"T{tool} M6", f"T{next_tool}", f"S{speed_rpm} M3", "G54", "M8"]
    return ["", f"({name})", *change, f"G0 {at}", f"G43 Z15. H{tool}"]


def cam_face() -> list[str]:
    """The raw top off in two levels; rows linked by half circles in air."""
    first, last = (["Z3.", f"G1 {z} F400.", *blocks(CAM_FACE)] for z in ("Z.5", "Z0."))
    return [*first, "G0 Z15.", "X-22. Y-.5", *last]


def cam_contour() -> list[str]:
    """Three levels; on and off on quarter circles in air."""
    levels = (["Z3.", f"G1 Z-{z}. F600.", *blocks(CAM_CONTOUR), "G0 Z15.", "Y30."] for z in (5, 10, 15))
    return [line for level in levels for line in level][:-2]


def cam_pecks() -> list[str]:
    """Holes 12 mm deep, 3 mm a peck, out to the raw top each time; inside a hole nothing is rapid."""
    pecks = ["Z3.", "G1 Z-3. F180.", "Z1. F1000."]
    for depth_mm in (6, 9, 12):
        pecks += [f"Z-{depth_mm - 4}.5", f"Z-{depth_mm}. F180.", "Z1. F1000."]
    return [*pecks, *(line for hole in CAM_HOLES[1:] for line in ["G0 Z15.", hole, *pecks])]


def cam_style() -> list[str]:
    """Facing, contour and pecked holes, blocks numbered by tens."""
    lines = [
        *blocks(CAM_HEAD),
        *cam_tool("FACE1", 10, 6, 8000, "X-22. Y-.5"),
        *cam_face(),
        *CAM_RETRACT,
        "M1",
        *cam_tool("2D CONTOUR1", 6, 4, 12000, "X-15. Y30."),
        *cam_contour(),
        *CAM_RETRACT,
        "M1",
        *cam_tool("PECKED HOLES1", 4, 10, 6000, CAM_HOLES[0]),
        *cam_pecks(),
        *CAM_RETRACT,
        "G28 G91 X0. Y0.",
        "G90",
        "M30",
    ]
    number = iter(range(10, 10 * len(lines) + 10, 10))
    return ["%", *(line if line[:1] in ("", "(") else f"N{next(number)} {line}" for line in lines), "%"]


# --- files ------------------------------------------------------------------------------------------

EXAMPLES = {
    f"{program.__name__}.nc": program for program in (test_piece, raster_finish, contour_arcs, cam_style)
}


def write(path: Path, lines: Iterable[str]) -> None:
    """Write ASCII with LF line ends."""
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.writelines(line + "\n" for line in lines)
    print(path)


def main() -> None:
    """Read the options and write."""
    parser = argparse.ArgumentParser(description="Write the example G-code programs.")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, help="folder, made if missing")
    parser.add_argument("--raster-lines", type=int, metavar="N", help="write only raster_N.nc, about N lines")
    parser.add_argument("--pocket", action="store_true", help="write only adaptive_pocket.nc, 15,000 lines")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    if options.raster_lines is not None:
        write(options.out / f"raster_{options.raster_lines}.nc", long_raster(options.raster_lines))
        return
    if options.pocket:
        write(options.out / "adaptive_pocket.nc", long_pocket())
        return
    for name, lines in EXAMPLES.items():
        write(options.out / name, lines())


if __name__ == "__main__":
    main()
