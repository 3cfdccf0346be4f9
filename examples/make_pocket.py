"""An adaptive pocket with a contour around it, two tools, four levels: `make_examples.py` writes it.

The cutter goes in circles that advance along a lane, as adaptive strategies do, so that a program of half an
hour has some 15,000 short lines, and every level passes over the place of the one above it.
"""

import math
from collections.abc import Iterator

LEVELS_MM = (-5.0, -10.0, -15.0, -20.0)
LANES_Y_MM = (-20.0, 20.0)
LANE_X_MM = (50.0, 250.0)
CIRCLE_MM = 20.0
"""Radius of the circles of the cutter's centre."""
ADVANCE_MM = 2.5
CHORDS = 20
HALF_X_MM, HALF_Y_MM, MIDDLE_X_MM = 128.0, 48.0, 150.0
"""The pocket's half sizes for the cutter of 16 mm, and its middle."""
CORNER_MM = 14.0
FINISH_MM = 3.0
"""Half the difference of both cutters: the finisher runs this much farther out."""
CONTOUR_MM = 24.0
"""The contour around the pocket runs this far outside the roughing."""

Point = tuple[float, float]


def rounded(out_mm: float, step_mm: float = 1.5) -> Iterator[Point]:
    """Points of the pocket's rounded rectangle, moved outwards, closed, climb milling inside."""
    half_x, half_y, radius = HALF_X_MM + out_mm, HALF_Y_MM + out_mm, CORNER_MM + max(out_mm, 0.0)
    centres = [(1, -1, -90), (1, 1, 0), (-1, 1, 90), (-1, -1, 180)]
    first: Point | None = None
    for sign_x, sign_y, from_deg in centres:
        chords = max(6, round(math.pi / 2 * radius / step_mm))
        for chord in range(chords + 1):
            angle = math.radians(from_deg + 90 * chord / chords)
            x = MIDDLE_X_MM + sign_x * (half_x - radius) + radius * math.cos(angle)
            y = sign_y * (half_y - radius) + radius * math.sin(angle)
            first = first or (x, y)
            yield x, y
    if first:
        yield first


def blocks(points: Iterator[Point]) -> Iterator[str]:
    """One short line a point."""
    for x, y in points:
        yield f"X{x:z.3f} Y{y:z.3f}"


def lane(y_mm: float) -> Iterator[Point]:
    """Circles of the cutter's centre, each a little farther along the lane."""
    circles = round((LANE_X_MM[1] - LANE_X_MM[0]) / ADVANCE_MM)
    for number in range(circles * CHORDS):
        angle = math.tau * number / CHORDS
        x = LANE_X_MM[0] + ADVANCE_MM * number / CHORDS + CIRCLE_MM * math.cos(angle)
        yield x, y_mm + CIRCLE_MM * math.sin(angle)


def helix(y_mm: float, from_mm: float, to_mm: float) -> Iterator[str]:
    """Down on the first circle."""
    turns = 5
    for number in range(turns * CHORDS + 1):
        angle = math.tau * number / CHORDS
        z = from_mm + (to_mm - from_mm) * number / (turns * CHORDS)
        x = LANE_X_MM[0] + CIRCLE_MM * math.cos(angle)
        yield f"X{x:z.3f} Y{y_mm + CIRCLE_MM * math.sin(angle):z.3f} Z{z:.3f}"


def over(point: Point, z_mm: float) -> list[str]:
    """Rapid over a point, down at feed."""
    return [f"G0 X{point[0]:z.3f} Y{point[1]:z.3f}", "G0 Z2.000", f"G1 Z{z_mm:.3f} F600"]


def roughing() -> Iterator[str]:
    """Lanes of circles at every level, then the wall, with the large cutter."""
    top_mm = 0.0
    for level_mm in LEVELS_MM:
        yield f"(LEVEL {level_mm:.0f})"
        for y_mm in LANES_Y_MM:
            start = (LANE_X_MM[0] + CIRCLE_MM, y_mm)
            yield from (f"G0 X{start[0]:.3f} Y{start[1]:z.3f}", "G0 Z2.000", f"G1 Z{top_mm:.3f} F1000")
            yield from helix(y_mm, top_mm, level_mm)
            yield "F3000"
            yield from blocks(lane(y_mm))
            yield "G0 Z20.000"
        yield from over((LANE_X_MM[0], LANES_Y_MM[0]), level_mm)
        yield "G1 F1500"
        yield from blocks(rounded(0.0))
        yield "G0 Z20.000"
        top_mm = level_mm


def contour() -> Iterator[str]:
    """A full slot around the pocket, level by level, and a last pass over it that cuts next to nothing."""
    path = list(rounded(CONTOUR_MM))
    for number, level_mm in enumerate((*LEVELS_MM[:3], LEVELS_MM[2])):
        yield "(CONTOUR, LAST PASS)" if number == 3 else f"(CONTOUR {level_mm:.0f})"
        yield from over(path[0], level_mm)
        yield "G1 F1500"
        yield from blocks(iter(path))
        yield "G0 Z20.000"


def finishing() -> Iterator[str]:
    """The wall at two depths with the small cutter."""
    for level_mm in (LEVELS_MM[1], LEVELS_MM[3]):
        yield f"(WALL {level_mm:.0f})"
        yield from over((LANE_X_MM[0], LANES_Y_MM[0]), level_mm)
        yield "G1 F2000"
        yield from blocks(rounded(FINISH_MM + 0.3, 0.8))
        yield "G0 Z20.000"


def long_pocket() -> Iterator[str]:
    """The whole program."""
    yield from (
        "%",
        "(ADAPTIVE POCKET AND CONTOUR, TWO TOOLS, FOUR LEVELS)",
        "(STOCK: BLOCK X0..300 Y-100..100 Z-30..0, ALUMINIUM)",
        *("G21 G90 G17 G40 G49 G80 G94", "G54", "G64 P0.02"),
        *("T1 M6", "S13000 M3", "M8", "G0 G43 H1 Z20.000"),
    )
    yield from roughing()
    yield from contour()
    yield from ("M9", "M5", "T6 M6", "S16000 M3", "M8", "G0 G43 H6 Z20.000")
    yield from finishing()
    yield from ("M9", "M5", "M30", "%")
