"""What a Fanuc's parameters decide and the cell states: cutter compensation, start-up modes, G10 L10 to L13.

Places are worked out by hand for a tool of 10 mm, from the figures of the operator's manual.
"""

import numpy as np
import pytest

from gcode2krl import Gcode2KrlError
from tests.cells import over_demonstration
from tests.gcode import Control
from tests.gcode import read as parsed

CONTROLS = {
    "fanuc": Control("G21 G90 G17 G94\nT1 M6\nG43 H1\nS1000 M3\nG0 X0. Y0. Z5.\nF100\n", "M30", "fanuc"),
    "sinumerik": Control(
        "G710 G90 G17 G94 G54\nT1 D1 M6\nD1\nS1000 M3\nG0 X0 Y0 Z5\nF100\n", "M30", "sinumerik"
    ),
}
TOOL = {1: {"diameter_mm": 10.0, "teeth": 2, "length_mm": 60.0}}


def cell_of(lead_in="a", holds="radius", **program):
    cutter = {"cutter": {"lead_in": lead_in, "d": holds}} if lead_in else {}
    return over_demonstration({"program": cutter | program, "tool": TOOL})


def read(lines, *stated, dialect="fanuc"):
    return CONTROLS[dialect].read(lines, cell_of(*stated))


def way(lines, *stated, **more):
    """Return X and Y of the rows behind the head."""
    return read(lines, *stated, **more).position_mm[2:, :2].round(9).tolist()


def errors(lines, *stated):
    """Return code and line of each error, lines counted behind the head."""
    return [(i.code, i.line) for i in CONTROLS["fanuc"].errors(lines, cell_of(*stated))]


INSIDE = "G41 D1 G1 X20.\nY20.\nX0.\nG40 Y0."
OUTSIDE = "G42 D1 G1 X20.\nY20.\nX50.\nG40 Y0."
SHARP = "G42 D1 G1 X20.\nX10. Y10.\nG40 X30."


@pytest.mark.parametrize("lead_in", ["a", "b"])
def test_inside_of_a_corner_a_fanuc_leads_to_the_side_of_the_contour(lead_in):
    assert way(INSIDE, lead_in) == [[15, 0], [15, 15], [0, 15], [0, 0]]


def test_type_a_leads_at_right_angles_to_the_contour():
    assert way(OUTSIDE) == [[25, 0], [25, 15], [50, 15], [50, 0]]
    half = 5 * 0.5**0.5
    np.testing.assert_allclose(way(SHARP)[0], [20 + half, half], atol=1e-9)
    np.testing.assert_allclose(way(SHARP)[1:], [[10 + half, 10 + half], [30, 10]], atol=1e-9)


def test_type_b_goes_around_the_corner():
    """The corner at (20, 0) turns by 90 degrees, where the moves meet; that of 135 has two corners more."""
    assert way(OUTSIDE, "b") == [[20, -5], [25, -5], [25, 15], [50, 15], [50, 0]]
    half = 5 * 0.5**0.5
    expected = [
        *([20, -5], [25, -5], [20 + half + half, half - half], [10 + half, 10 + half]),
        *([10, 10 + 2 * half], [5, 15], [5, 5]),
    ]
    np.testing.assert_allclose(way(SHARP, "b")[:4], expected[:4], atol=1e-9)


@pytest.mark.parametrize(("lead_in", "corner"), [("c-a", []), ("c-b", [[20, -5], [25, -5]])])
def test_type_c_shifts_the_tool_by_itself_where_its_block_has_no_move(lead_in, corner):
    """At right angles to the next and the last block, by the motion code of G41 and G40; else as A or B."""
    alone = read("G42 D1\nG1 X20.\nY20.\nG40\nZ9.", lead_in)
    expected = [[0, -5, 5], [20, -5, 5], [25, -5, 5], [25, 20, 5], [20, 20, 5], [20, 20, 9]]
    np.testing.assert_allclose(alone.position_mm[2:], expected, atol=1e-9)
    assert np.isinf(alone.feed_mm_s[2:]).tolist() == [True, *5 * [False]]
    assert alone.source_line[2:].tolist() == [7, 8, 9, 9, 10, 11]
    around = read("G42 D1\nG2 X10. Y-10. J-10.\nG1 G40", lead_in).position_mm[2:-1, :2]
    np.testing.assert_allclose(np.hypot(*(around[:-1] - [0, -10]).T), 5, atol=1e-9)
    np.testing.assert_allclose(around[-2:], [[5, -10], [10, -10]], atol=1e-9)
    assert way(OUTSIDE, lead_in)[: len(corner)] == corner
    assert way(OUTSIDE, lead_in) == way(OUTSIDE, lead_in[-1])


def test_an_outside_corner_of_a_fanuc_has_no_arc():
    contour = "G42 D1 G1 X20.\nY20.\nX0.\nG40 Y40."
    assert way(contour)[1:3] == [[25, 20], [25, 25]]
    arc = way("G42 D1 G1 X20.\nX50.\nG2 X60. Y-10. J-10.\nG1 X70.\nG40 Y0.", "a")
    np.testing.assert_allclose(arc[-4:], [[55, -10], [55, -15], [70, -15], [70, 0]], atol=1e-9)


def test_a_sinumerik_leads_in_at_right_angles_and_goes_around_corners_by_an_arc():
    """NORM and G450, which the control starts with."""
    assert way("G42 G1 X20\nY-20\nX50\nG40 Y0", None, dialect="sinumerik")[:2] == [[15, 0], [15, -20]]
    around = np.array(way("G42 G1 X20\nY20\nX0\nG40 X-20", None, dialect="sinumerik"))
    corner = around[(around[:, 0] > 20) & (around[:, 1] > 20 + 1e-9)]
    assert len(corner) > 10
    np.testing.assert_allclose(np.hypot(*(corner - [20, 20]).T), 5, atol=1e-6)


def test_d_holds_radius_diameter_or_wear():
    named_before = "D1\n" + OUTSIDE.replace(" D1", "")
    assert way(OUTSIDE, "a", "radius") == way(OUTSIDE, "a", "diameter") == way(named_before)
    unmoved = [[20, 0], [20, 20], [50, 20], [50, 0]]
    assert way(OUTSIDE, "a", "wear") == way(OUTSIDE.replace("D1", "D0"), "a") == unmoved


@pytest.mark.parametrize(
    ("lines", "stated", "found"),
    [
        (OUTSIDE, (None,), ("dialect-code", 1)),
        (OUTSIDE.replace("D1", "D2"), (), ("dialect-statement", 1)),
        (OUTSIDE.replace(" D1", ""), (), ("dialect-statement", 1)),
        ("G42 D1 G1 X20.\nY20.\nM8\nM9\nX50.", (), ("dialect-statement", 5)),
        ("G42 D1 G1 X20.\nM8\nM9\nY20.", (), ("dialect-statement", 4)),
        ("G42 D1 G1 X20.\nY20.\nG40\nZ9.", (), ("dialect-statement", 4)),
        ("G42 D1 G2 X20. Y0. I10.", (), ("dialect-statement", 1)),
        ("G42 D1 G1 X20.\nG2 X24. I2.\nG1 Y9.", (), ("cutter-arc", 2)),
        ("G1\nG42 D1\nM8\nX20.", ("c-a",), ("dialect-statement", 4)),
        ("G1\nG42 D1 Z1.\nX20.", ("c-a",), ("dialect-statement", 2)),
        ("G1\nG42 D1\nX20.\nG40 Z9.", ("c-a",), ("dialect-statement", 4)),
        ("G1\nG42 D1\nG40\nX20.", ("c-a",), ("dialect-statement", 3)),
        ("G1\nG42 D1\nG2 X20. I10.\nG40", ("c-a",), ("dialect-statement", 4)),
        ("G10 L12 P1 R5.1", (), ("dialect-code", 1)),
        ("G10 L12 P1 R5.", (None,), ("dialect-code", 1)),
        ("G10 L11 P1 R1.", (), ("dialect-code", 1)),
        ("G10 L10 P1 R50.", (), ("dialect-code", 1)),
        ("G10 L12 P1 R5.", ("a", "wear"), ("dialect-code", 1)),
        ("G41.1 D10. G1 X20.", (), ("dialect-code", 1)),
    ],
)
def test_what_hangs_on_parameters_that_nobody_stated_is_refused(lines, stated, found):
    assert errors(lines, *stated)[0] == found


@pytest.mark.parametrize("cycle", ["G82", "G86", "G89"])
def test_a_cycle_of_a_fanuc_without_p_does_not_dwell(cycle):
    hole = f"G98 {cycle} X5. Y5. Z-5. R1."
    assert read(hole).dwell_s.sum() == read(f"{hole}\nX9.").dwell_s.sum() == 0.0
    assert read(f"{hole} P500\nX9.").dwell_s.sum() == 1.0
    kept = errors(f"G98 G82 X5. Y5. Z-5. R1. P500\n{hole[4:]}")
    assert bool(kept) == (cycle == "G89")


def test_g10_may_set_what_the_cell_states():
    lines = "G10 L10 P1 R60.\nG10 L12 P1 R{}\nG10 L11 P1 R0.\nG10 L13 P1 R0.\nG1 X1."
    assert way(lines.format("5."), "a", "radius") == way(lines.format("10."), "a", "diameter") == [[1, 0]]
    assert way(lines.format("0."), "a", "wear") == [[1, 0]]


def started(**start):
    cell = over_demonstration({"program": {"start": start}, "tool": TOOL})
    text = "T1 M6\nG43 H1\nS9 M3\nX1. Y1. Z1.\nG1 X2. F10.\nG81 Z0. R.5\nX3.\nM30\n"
    return parsed(text, cell, dialect="fanuc")


@pytest.mark.parametrize(
    ("start", "end_mm", "unnamed"),
    [
        ({"unit": "G20", "distance": "G90", "retract": "G99"}, [3 * 25.4, 25.4, 0.5 * 25.4], set()),
        ({"retract": "G98"}, [3, 1, 1], {"start-unnamed", "unit-unnamed"}),
    ],
)
def test_the_cell_states_how_the_control_starts(start, end_mm, unnamed):
    found = started(motion="G0", **start)
    np.testing.assert_allclose(found.position_mm[-1], end_mm)
    codes = {issue.code for issue in found.issues}
    assert codes & {"start-unnamed", "unit-unnamed", "retract-unnamed"} == unnamed


def test_without_a_motion_mode_nothing_moves():
    with pytest.raises(Gcode2KrlError, match="motion mode"):
        started(unit="G21")
