"""Compensated contours with rounded and chamfered corners: against a second reading, and in closed form."""

import math
from itertools import pairwise

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

from tests.cells import over_demonstration
from tests.gcode import Control
from tests.gcode import read as parsed
from tests.reference import contour, controls

RADIUS_MM = 5.0
TOOLS = {"tool": {1: {"diameter_mm": 2 * RADIUS_MM, "teeth": 2, "length_mm": 60.0}}}
CELL = over_demonstration(TOOLS)
CONTROLS = {
    "fanuc": Control("G21 G90 G17 G94\nT1 M6\nS1000 M3\nG0 X-40. Y-40. Z5.\nG1 Z0 F600\n", "M30", "fanuc"),
    "sinumerik": Control(
        "G710 G90 G17 G94 G54\nT1 M6 D1\nS1000 M3\nG0 X-40 Y-40 Z5\nG1 Z0 F600\n", "M30", "sinumerik"
    ),
    "heidenhain": Control(
        "0 BEGIN PGM A MM\n1 TOOL CALL 1 Z S900 F100\n2 L X-40 Y-40 Z+5 R0 FMAX M3\n3 L Z+0\n",
        "99 L M30",
        "heidenhain",
    ),
}


READERS = {"sinumerik": "siemens", "heidenhain": "heidenhain"}
"""Names of the second readings."""


def way(lines, dialect="sinumerik", cell=CELL):
    """Return X and Y of the rows behind the head."""
    return CONTROLS[dialect].read(lines, cell).position_mm[3:, :2]


def assert_read_twice(lines, dialect="sinumerik"):
    """Assert that the second reading leads to the same places; return how many there are."""
    text = CONTROLS[dialect].text(lines)
    ours = controls.columns(controls.places_of(parsed(text, CELL, dialect=dialect)))
    theirs = controls.columns(getattr(controls, READERS[dialect])(text, radius=RADIUS_MM))
    assert controls.difference(ours, theirs) is None, (ours, theirs)
    return len(ours)


def refused(lines):
    """Return line and message of the first error behind the head."""
    first = CONTROLS["sinumerik"].errors(lines, CELL)[0]
    return first.line, first.message


SQUARE = "G42 G1 X0 Y-20\nY0\nX50 {}\nY50 {}\nX0 {}\nY0\nG40 X-40"


@pytest.mark.parametrize("code", ["G450", "G451"])
@pytest.mark.parametrize("side", ["G41", "G42"])
@pytest.mark.parametrize("corner", ["RND=7", "CHR=6", "CHF=6", ""])
def test_corners_of_a_compensated_contour_against_a_second_reading(code, side, corner):
    assert_read_twice(SQUARE.format(corner, corner, corner).replace("G42", f"{side} {code}"))


turns_deg = st.integers(-150, 150).filter(lambda deg: abs(deg) > 3)
corner_words = st.sampled_from(["", "RND=2", "RND=9", "CHR=3", "CHF=4"])


@given(
    st.lists(st.tuples(turns_deg, corner_words), min_size=2, max_size=5),
    st.sampled_from(["G41", "G42"]),
    st.sampled_from(["G450", "G451"]),
)
@settings(max_examples=150, deadline=None)
def test_drawn_contours_are_the_same_in_both_readings_or_refused(bends, side, code):
    """Long moves that turn by any angle: refused is a corner with no room for the tool or the rounding."""
    heading, at, lines = 0.0, complex(0, 0), [f"{side} {code} G1 X0 Y0"]
    for turn, word in [*bends, (0, "")]:
        at += 90 * complex(math.cos(heading), math.sin(heading))
        lines.append(f"X{at.real:.9f} Y{at.imag:.9f} {word}")
        heading += math.radians(turn)
    program = "\n".join([*lines, "G40 X500"])
    found = {issue.code for issue in CONTROLS["sinumerik"].errors(program, CELL)}
    assert found <= {"cutter-arc", "cutter-gouge", "dialect-statement", "end-missing"}
    if not found:
        assert_read_twice(program)


def distance_to(point, start, end):
    """Return how far a point is from a straight piece."""
    along = (end - start) / abs(end - start)
    t = min(max(((point - start) * along.conjugate()).real, 0.0), abs(end - start))
    return abs(point - start - t * along)


@pytest.mark.parametrize("corner", ["RND=7", "CHR=6", "CHF=6"])
def test_the_tool_stays_a_radius_beside_the_rounded_contour(corner):
    """Outside at its radius, but for the chords; a rounding is a circle of 7 + 5 mm about its centre."""
    path = [complex(*p) for p in way(SQUARE.format(corner, corner, corner))][2:-1]
    square = [contour.line(a, b) for a, b in ((0, 50), (50, 50 + 50j), (50 + 50j, 50j), (50j, 0))]
    kind, value = corner.split("=")
    made = contour.rounded(square, [(kind, float(value))] * 3 + [None])
    chords = [(a, b) for start, end, centre, _ in made if centre is None for a, b in ((start, end),)]
    for start, end, centre, _ in made:
        if centre is not None:
            points = [
                centre + (start - centre) * np.exp(1j * a)
                for a in np.linspace(0, np.angle((end - centre) / (start - centre)), 4000)
            ]
            chords += pairwise(points)
    off = [min(distance_to(p, a, b) for a, b in chords) for p in path]
    np.testing.assert_allclose(off, RADIUS_MM, atol=1e-5)
    if kind == "RND":
        round_one = [p for p in path if p.real > 43 - 1e-9 and p.imag < 7 + 1e-9]
        np.testing.assert_allclose([abs(p - (43 + 7j)) for p in round_one], 12.0, atol=1e-9)
        assert len(round_one) > 10


def test_the_rounding_of_an_inside_corner_is_smaller_by_the_radius():
    path = way("G41 G1 X0 Y-20\nY0\nX50 RND=8\nY50\nG40 X0")
    arc = [p for p in path if p[0] > 42 - 1e-9 and 5 - 1e-9 <= p[1] <= 8 + 1e-9]
    np.testing.assert_allclose(np.hypot(*(np.array(arc) - [42, 8]).T), 3.0, atol=1e-9)
    np.testing.assert_allclose(arc[0], [42, 5], atol=1e-9)
    np.testing.assert_allclose(arc[-1], [45, 8], atol=1e-9)
    assert refused("G41 G1 X0 Y-20\nY0\nX50 RND=4\nY50\nG40 X0") == (
        3,
        "the arc of radius 4.0000 mm is too small for the radius 5.0000 mm of the tool inside it",
    )


def test_g451_goes_to_where_the_sides_meet_and_around_pointed_corners_by_an_arc():
    """A corner of 90 degrees has its point a diagonal away, one of 135 an arc (MD20210 is 100)."""
    path = way("G42 G451 G1 X0 Y-20\nY0\nX50\nY50\nX90 Y90\nX-20\nG40 Y-40").tolist()
    assert [55.0, -5.0] in path
    corner = 90 + 90j
    near = [abs(complex(*p) - corner) for p in path if p[0] > 90 and p[1] > 80]
    np.testing.assert_allclose(near, RADIUS_MM, atol=1e-9)
    assert len(near) > 5


def test_g451_prolongs_arcs():
    """A line along y = -5, and a circle about (50, 15) that the contour enters at (60, 0), at 34 degrees."""
    radius = math.hypot(10, 15)
    path = way(f"G42 G451 G1 X-30 Y-20\nY0\nX60 Y0\nG3 X50 Y{15 + radius:.9f} I-10 J15\nG1 X20\nG40 Y-40")
    meeting = 50 + math.sqrt((radius + 5) ** 2 - 20**2)
    assert np.min(np.hypot(*(path - [meeting, -5]).T)) < 1e-9
    behind = path[int(np.argmin(np.hypot(*(path - [meeting, -5]).T))) : -2]
    np.testing.assert_allclose(np.hypot(*(behind - [50, 15]).T), radius + 5, atol=1e-6)


@pytest.mark.parametrize(
    ("lines", "line"),
    [
        ("G42 G1 X0 Y-20 RND=2\nY0\nX50\nG40 X-40", 1),
        ("G42 G1 X0 Y-20\nY0\nX50 RND=2\nG40 X60 Y-40", 3),
        ("G42 G1 X0 Y-20\nY0\nX50 RND=2\nM8\nY50\nG40 X60 Y-40", 3),
        ("G1 X0 Y-20 RND=2\nG42 G1 Y0\nX50\nY50\nG40 X60 Y-40", 1),
    ],
)
def test_a_corner_of_the_move_that_leads_in_or_out_is_refused(lines, line):
    found, message = refused(lines)
    assert found == line
    assert "neither leads in or out" in message


def test_kont_is_refused_where_it_leads_out_too():
    assert refused("G42 G1 X0 Y-20\nY0\nX50\nKONT\nG40 X60 Y-40")[0] == 5
    assert "KONT" in refused("G450 DISC=50")[1]


def test_heidenhain_rounds_compensated_contours():
    lines = (
        "4 L X+0 Y-20 RR F100\n5 L Y+0\n6 L X+50\n7 RND R6\n8 L Y+50\n9 CHF 4\n10 L X+0\n11 RND R3\n"
        "12 L Y+0\n13 L X-40 R0"
    )
    assert assert_read_twice(lines, "heidenhain") > 12


def test_an_arc_that_touches_what_leads_to_it_leaves_a_compensated_contour_so():
    """Along y = 0 to x = 50, and on by a quarter about (50, 20), beside which the tool has 20 - 5 mm."""
    found = way(
        "4 L X+0 Y-20 RL F100\n5 L Y+0\n6 L X+50\n7 CT X+70 Y+20\n8 L Y+60\n9 L X+40 R0", "heidenhain"
    )
    around = [p for p in found if p[0] > 50 + 1e-9 and p[1] < 20 - 1e-9]
    np.testing.assert_allclose(np.hypot(*(np.array(around) - [50, 20]).T), 15, atol=1e-9)
    assert len(around) > 5
    assert way("G41 G1 X0 Y-20\nY0\nX50\nCT X70 Y20\nG1 Y60\nG40 X40").tolist() == found.tolist()


def test_fanuc_rounds_compensated_contours():
    cell = over_demonstration(TOOLS | {"program": {"cutter": {"lead_in": "a", "d": "radius"}}})
    path = way("G42 D1 G1 X0. Y-20.\nY0.\nX50. ,R6.\nY50. ,C4.\nX0.\nG40 X-40.", "fanuc", cell)
    assert path[2].tolist() == [44, -5]
    corner = np.array([p for p in path if p[0] > 44 and p[1] < 6 - 1e-9])
    np.testing.assert_allclose(np.hypot(*(corner - [44, 6]).T), 11.0, atol=1e-9)
    out, side = 5 * math.tan(math.pi / 8), 5 * 0.5**0.5
    chamfer = [[55, 46], [55, 46 + out], [46 + side, 50 + side], [46 + out, 55], [0, 55], [-40, 50]]
    np.testing.assert_allclose(path[-6:], chamfer, atol=1e-9)


def test_many_corners_are_made_alike_however_much_room_there_is():
    """The table of rows grows while the contour goes on: each round of a square has the rows of the last."""
    lap = "X50 RND=7\nY50 CHR=6\nX0 RND=7\nY0 RND=9\n"
    path = way(f"G42 G451 G1 X0 Y-20\nY0\n{lap * 400}X50\nG40 Y-40")
    rows = (len(path) - 4) // 400
    laps = path[2 : 2 + 399 * rows].reshape(399, rows, 2)
    np.testing.assert_allclose(laps[1:], np.broadcast_to(laps[1], laps[1:].shape), atol=1e-9)
