"""What a Fanuc or a Sinumerik alone has: places worked out by hand, or from the geometry of the corner."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.cells import over_demonstration
from tests.gcode import Control, refusal

CONTROLS = {
    "fanuc": Control("G21 G90 G17 G94\nG0 X0. Y0. Z5.\nF100\n", "M30", "fanuc"),
    "sinumerik": Control("G710 G90 G17 G94 G54\nG0 X0 Y0 Z5\nF100\n", "M30", "sinumerik"),
}


def read(lines, dialect="sinumerik", cell=None):
    return CONTROLS[dialect.partition("-")[0]].read(lines, cell, dialect=dialect)


def way(lines, dialect="sinumerik", cell=None):
    """Return the places behind the head, (n, 3)."""
    return read(lines, dialect, cell).position_mm[2:]


def errors(lines, dialect="sinumerik", cell=None):
    """Return the errors, lines counted behind the head."""
    return CONTROLS[dialect.partition("-")[0]].errors(lines, cell, dialect=dialect)


HALF = math.sqrt(0.5)


@pytest.mark.parametrize(
    ("word", "begin", "end"),
    [
        ("CHR=2", [8, 0, 5], [10, 2, 5]),
        ("CHF=2", [10 - 2 * HALF, 0, 5], [10, 2 * HALF, 5]),
        ("RND=2", [8, 0, 5], [10, 2, 5]),
        ("RND=R1", [8, 0, 5], [10, 2, 5]),
    ],
)
def test_a_sinumerik_cuts_a_corner_off(word, begin, end):
    found = read(f"R1=2\nG1 X10 {word}\nY20")
    places = found.position_mm[2:]
    np.testing.assert_allclose(places[[0, -2, -1]], [begin, end, [10, 20, 5]], atol=1e-12)
    assert len(places) == 3 or word.startswith("RND")
    assert (found.source_line[2:-1] == 5).all()
    assert found.source_line[-1] == 6


@pytest.mark.parametrize(
    ("text", "dialect", "begin"),
    [
        ("G1 X10. ,R2.\nY20.", "fanuc", [8, 0, 5]),
        ("G1 X10. , C3.\nG91 Y20.", "fanuc", [7, 0, 5]),
        ("G1 X10. ,C1500\nY20.", "fanuc-increments", [8.5, 0, 5]),
        ("G1 X10. ,C3\nY20.", "fanuc-calculator", [7, 0, 5]),
        ("G20\nF10.\nG1 X1. ,C.1\nY2.", "fanuc", [25.4 - 2.54, 0, 5]),
    ],
)
def test_a_fanuc_cuts_a_corner_off(text, dialect, begin):
    np.testing.assert_allclose(way(text, dialect)[0], begin, atol=1e-12)


@settings(max_examples=60)
@given(
    st.floats(-179, 179),
    st.floats(2, 170),
    st.sampled_from([-1, 1]),
    st.floats(0.1, 5),
    st.sampled_from(["RND", "CHR", "CHF"]),
)
def test_a_corner_touches_both_of_its_moves(towards, bend, side, size, word):
    """A rounding lies on the circle that touches both moves, a chamfer has its length."""
    reach = 400.0
    first, second = math.radians(towards), math.radians(towards + side * bend)
    corner = reach * np.array([math.cos(first), math.sin(first)])
    end = corner + reach * np.array([math.cos(second), math.sin(second)])
    text = f"G1 X{corner[0]:.9f} Y{corner[1]:.9f} {word}={size:.9f}\nX{end[0]:.9f} Y{end[1]:.9f}"
    places = way(text)[:, :2]
    begin, last = places[0], places[-2]
    taken = np.linalg.norm(begin - corner)
    assert taken == pytest.approx(np.linalg.norm(last - corner), abs=1e-6)
    assert begin[0] * corner[1] - begin[1] * corner[0] == pytest.approx(0.0, abs=1e-4)
    if word == "CHR":
        assert taken == pytest.approx(size, abs=1e-6)
    elif word == "CHF":
        assert np.linalg.norm(last - begin) == pytest.approx(size, abs=1e-6)
    else:
        inside = 0.5 * (begin + last) - corner  # along the bisector; the centre is r / cos(bend / 2) away
        centre = corner + inside / np.linalg.norm(inside) * size / math.cos(math.radians(bend / 2))
        np.testing.assert_allclose(np.linalg.norm(places[:-1] - centre, axis=1), size, atol=1e-5)


@pytest.mark.parametrize(
    "lines",
    [
        *("G1 X10 RND=2", "G1 X10 RND=2\nM8\nY20", "G1 X10 RND=2\nG4 F1\nY20", "G1 X10 RND=2\nY20 F300"),
        *(
            "G1 X10 RND=2\nG0 Y20",
            "G1 X10 RND=2\nY1",
            "G1 X1 RND=2\nY20",
            "G1 X10 RND=2\nX20",
            "G0 X10 RND=2\nG1 Y20",
        ),
        *(
            "G1 X10 RND=2\nY20 Z1",
            "G1 X10 Z1 RND=2\nY20",
            "G1 X10 RND=0\nY20",
            "G1 X10 RND=-1\nY20",
            "RND=2\nG1 X1",
        ),
        *(
            "G1 X10 RND=2 CHF=1\nY20",
            "G1 X10 RND=2\nG18 Y20",
            "G1 X10 RND=2\nSUPA Y20",
            "G93\nG1 X10 F1 RND=2\nY20 F1",
        ),
        "G1 X10 RND=2\nY10 RND=9\nX0",
    ],
)
def test_a_corner_that_is_none_is_refused_where_it_is_named(lines):
    found = errors(lines)
    assert found
    assert "corner" in found[0].message
    named = next(k for k, line in enumerate(lines.split("\n")) if "RND" in line)
    assert found[0].line == 1 + named + (1 if "RND=9" in lines else 0)


def test_a_file_that_ends_behind_a_corner_is_refused():
    text = CONTROLS["sinumerik"].text("G1 X10 RND=2").removesuffix("M30\n")
    assert "corner" in refusal(text, dialect="sinumerik").message


HOLE = [[4, 3, 2], [4, 3, -8], [4, 3, 10]]


@pytest.mark.parametrize(
    "cycle",
    [
        "CYCLE81(10,0,2,-8)",
        "CYCLE81(10, 0, 2, , 8)",
        "CYCLE81(10,0,2,-8,8)",
        "CYCLE82(10,0,2,-8,,0)",
        "CYCLE82(10,0,2,-8,,0,0,0,10)",
        "CYCLE81(R1*2,0,2,-R2)",
    ],
)
def test_a_drilling_cycle_of_a_sinumerik(cycle):
    once = way(f"R1=5 R2=8\nG0 X4 Y3\n{cycle}")
    np.testing.assert_allclose(once, [[4, 3, 5], *HOLE], atol=1e-12)
    found = read(f"R1=5 R2=8\nMCALL {cycle}\nX4 Y3\nM8\nX9\nMCALL\nX0")
    second = [[9, 3, 10], [9, 3, 2], [9, 3, -8], [9, 3, 10]]
    np.testing.assert_allclose(found.position_mm[2:], [[4, 3, 5], *HOLE, *second, [0, 3, 10]], atol=1e-12)
    np.testing.assert_array_equal(found.rapid[2:], [True, True, False, True, True, True, False, True, True])
    assert found.exact_stop[3:6].all()
    assert not found.exact_stop[-1]


def test_cycle82_waits_at_the_bottom_and_cycles_count_in_the_unit_and_the_shifted_zero():
    found = read("TRANS Z1\nG700\nF10\nMCALL CYCLE82(1,0,0.1,-0.5,,0.25)\nX1\nMCALL")
    np.testing.assert_allclose(found.position_mm[-3:, 2], [3.54, 1 - 12.7, 26.4], atol=1e-12)
    assert found.dwell_s[-2] == 0.25
    assert found.dwell_s.sum() == 0.25


@pytest.mark.parametrize(
    "line",
    [
        *(
            "CYCLE81(10,0,2)",
            "CYCLE81(10,0,2,-8,9)",
            "CYCLE81(1,0,2,-8)",
            "CYCLE81(10,0,2,1)",
            "CYCLE81(10,0,-2,-8)",
        ),
        *(
            "CYCLE81(10,0,2,-8,,1)",
            "CYCLE82(10,0,2,-8,,-1)",
            "CYCLE82(10,0,2,-8,,1,1)",
            "CYCLE82(10,0,2,-8,,1,0,0,20)",
        ),
        *("CYCLE81", "CYCLE81()", "CYCLE81(10,0,2,-8", "CYCLE81(10,0,2,-8) X1", "G0 MCALL", "MCALL MCALL"),
        *(
            "CYCLE81(10,0,2,-8) CYCLE81(10,0,2,-8)",
            "CYCLE82(1,1,1,1,1,1,1,1,1,1)",
            "CYCLE81(10,0,2,-1E9)",
            "MCALL HOLE",
        ),
        *("CYCLE84(10,0,2,-8)", "CYCLE86(10,0,2,-8)", "CYCLE83(10,0,2,-8)"),
    ],
)
def test_a_cycle_that_says_anything_else_is_refused(line):
    found = errors(f"{line}\nG0 X1")
    assert {issue.code for issue in found} == {"dialect-statement"}
    assert found[0].line == 1


def test_a_cycle_without_a_feed_has_no_feed():
    text = "G710 G90 G17 G94\nG0 X0 Y0 Z5\nMCALL CYCLE81(10,0,2,-8)\nX1\nX2\nM30\n"
    found = refusal(text, dialect="sinumerik")
    assert (found.code, found.line) == ("no-feed", 4)


def tool_named(name):
    return {"name": name, "diameter_mm": 6.0, "teeth": 2, "length_mm": 60.0}


NAMES = over_demonstration(
    {"tool": {7: tool_named("Mill 6"), 8: tool_named("twice"), 9: tool_named("TWICE")}}
)


def test_a_tool_has_its_name_from_the_cell():
    assert read('T="MILL 6" D1 M6\nG0 X1', cell=NAMES).tool[-1] == 7


@pytest.mark.parametrize("name", ["twice", "OTHER", ""])
def test_a_name_that_leads_to_no_tool_is_refused(name):
    assert "no tool of the cell has this name" in errors(f'T="{name}" M6', cell=NAMES)[0].message


@pytest.mark.parametrize(
    ("lines", "dialect", "last"),
    [
        ("ROT RPL=90\nX10 Y1", "sinumerik", [-1, 10, 5]),
        ("ROT Z90\nX10 Y1\nROT\nX3 Y4", "sinumerik", [3, 4, 5]),
        ("TRANS X100\nAROT RPL=60\nAROT Z30\nX10 Y1", "sinumerik", [99, 10, 5]),
        ("TRANS X100\nROT RPL=90\nX10 Y1", "sinumerik", [-1, 10, 5]),
        ("ROT RPL=90\nTRANS X100\nX10 Y1", "sinumerik", [110, 1, 5]),
        ("ROT RPL=R1+90\nX10\nY1", "sinumerik", [-1, 10, 5]),
        ("ROT RPL=90\nMCALL CYCLE81(10,0,2,-8)\nX10 Y1\nMCALL", "sinumerik", [-1, 10, 10]),
        ("ROT RPL=90\nG2 X10 Y0 I5 J0", "sinumerik", [0, 10, 5]),
        ("ROT RPL=90\nG1 X10 CHR=2\nY9", "sinumerik", [-9, 10, 5]),
        ("G68 X10. Y0. R90.\nG0 X20. Y1.", "fanuc", [9, 10, 5]),
        ("G52 X100.\nG68 X10. Y0. R90.\nX20. Y1.\nX10.", "fanuc", [109, 0, 5]),
        ("G68 X10. Y0. R90.\nX20. Y1.\nG69\nX3. Y4.", "fanuc", [3, 4, 5]),
        ("G68 X10. Y0. R90.\nZ7.\nX20. Y1.\nG69 X3. Y4.", "fanuc", [3, 4, 7]),
        ("G68 X10. Y0. R90\nX20. Y1.", "fanuc-calculator", [9, 10, 5]),
        ("G99 G81 Z-5. R1. L0\nX2. Y1.", "fanuc", [2, 1, 1]),
    ],
)
def test_rotations_of_the_program_and_stored_cycles(lines, dialect, last):
    np.testing.assert_allclose(way(lines, dialect)[-1], last, atol=1e-12)


@pytest.mark.parametrize(
    ("lines", "dialect"),
    [
        *(
            (line, "sinumerik")
            for line in (
                "ROT X90",
                "ROT Y1",
                "AROT",
                "ROT RPL=30 X1",
                "ROT RPL=30 Z30",
                "RPL=30",
                "G18\nROT RPL=30",
            )
        ),
        *(
            (line, "sinumerik")
            for line in (
                "ROT AROT Z1",
                "ROT RPL=30\nATRANS X1",
                "ROT RPL=30\nG19",
                "G0 ROT RPL=3",
                "ROT Z=IC(3)",
            )
        ),
        *(
            (line, "fanuc")
            for line in ("G68 R90.", "G68 X0. Y0.", "G91 G68 X0. Y0. R90.", "G68 X0. Y0. R90. Z1.")
        ),
        *(
            (f"G68 X0. Y0. R90.\n{line}", "fanuc")
            for line in (
                "X1.",
                "G91 X1. Y1.",
                "G68 X0. Y0. R9.",
                "G52 X1.",
                "G28 Z0.",
                "G55",
                "G18",
                "G10 L2 P1 X1.",
                "G53 Z0.",
            )
        ),
        ("G68 X0. Y0. R90.\nX1. Y1.\nG69\nX5.", "fanuc"),
        ("G68 X0. Y0. R90", "fanuc-increments"),
    ],
)
def test_a_rotation_that_says_anything_else_is_refused(lines, dialect):
    assert errors(lines, dialect)


def test_no_zero_is_in_force_behind_g500():
    assert way("G500\nSUPA G0 Z0\nG54\nG0 X1 Y2 Z3")[-1].tolist() == [1.0, 2.0, 3.0]
    assert [(i.code, i.line) for i in errors("G500\nX1\nX2")] == [("dialect-statement", 2)]


@pytest.mark.parametrize(
    ("lines", "places"),
    [
        ("M97 P100\nX9.\nM30\nN100 X1.\nY2.\nM99", [[1, 0, 5], [1, 2, 5], [9, 2, 5]]),
        ("G91\nM97 P100 L3\nM30\nN100 X1.\nM99", [[1, 0, 5], [2, 0, 5], [3, 0, 5]]),
        ("X4. M97 P12000\nM30\nN12000 Y2. M99", [[4, 0, 5], [4, 2, 5]]),
        ("#1=7.\nM97 P10\nM30\nN10 X#1\nM97 P20\nM99\nN20 Y#1\n#1=8.\nM99", [[7, 0, 5], [7, 7, 5]]),
        ("M98 P50\nM30\nO50\nM97 P10\nM99\nN10 X3.\nM99", [[3, 0, 5]]),
    ],
)
def test_m97_calls_lines_of_its_own_program(lines, places):
    np.testing.assert_allclose(way(lines, "fanuc"), places, atol=1e-12)


@pytest.mark.parametrize(
    "lines",
    [
        *(
            "M97 P100\nM30",
            "M97\nM30\nN100 X1.\nM99",
            "M97 P10\nM30\nN10 X1.\nM99\nN10 X2.\nM99",
            "M97 P10 Q2\nM30\nN10 M99",
        ),
        *(
            "M97 P1.5\nM30\nN1 M99",
            "M97 P10\nM30\nN10 M97 P10\nM99",
            "M97 P10\nM30\nWHILE [1 EQ 1] DO1\nN10 X1.\nM99\nEND1",
        ),
    ],
)
def test_an_m97_that_leads_nowhere_sure_is_refused(lines):
    assert errors(lines, "fanuc")


def _zero(x_mm):
    return {"x_mm": x_mm, **dict.fromkeys(("y_mm", "z_mm", "a_deg", "b_deg", "c_deg"), 0.0)}


def test_further_work_offsets_stand_in_the_cell():
    zeros = {"G505": _zero(10.0), "G599": _zero(99.0), "G54.1P3": _zero(30.0), "G54.1P300": _zero(300.0)}
    cell = over_demonstration({"work_offsets": zeros})
    assert way("G505 X1\nG599 X1\nG54 X1", cell=cell)[:, 0].tolist() == [11.0, 100.0, 1.0]
    assert way("G54.1 P3 X1.\nG54.1 P300\nX2.", "fanuc", cell)[:, 0].tolist() == [31.0, 302.0]
    found = read("G506 X1", cell=cell).issues
    assert [i.message.split()[0] for i in found if i.code == "work-offset-unknown"] == ["G506"]
    for line in ("G54.1 X1.", "G54.1 P0 X1.", "G54.1 P301 X1.", "G54.1 P1.5 X1.", "G54 G54.1 P1"):
        assert errors(line, "fanuc")
