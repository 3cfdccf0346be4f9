"""TRAORI, tool vectors and rotary words of a Sinumerik, by hand, by matrices, and as G43.4 and G43.5."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode2krl import load_cell
from tests.cells import over_demonstration
from tests.gcode import Control
from tests.gcode.test_rotary import KINDS, PLACES, machine, tool_in_part

SINUMERIK = Control("G710 G90 G17 G94 F500\nT1 M6\nS1000 M3\nG0 X0 Y0 Z0\n", "M30", "sinumerik")
LINUXCNC = Control("G21 G90 G17 G94 F500\nT1 M6\nG43 H1\nS1000 M3\nG0 X0 Y0 Z0\n", "M30")
TURNS = st.floats(-170.0, 170.0).map(lambda value: round(value, 3))
VECTORS = st.tuples(*[st.floats(-1.0, 1.0)] * 2, st.floats(0.1, 2.0)).map(
    lambda vector: tuple(round(value, 4) for value in vector)
)


def cell_of(made_for=None):
    cell = load_cell()
    return cell if made_for is None else cell.model_copy(update={"machine": made_for})


def read(lines, made_for=None, control=SINUMERIK):
    return control.read(lines, cell_of(made_for))


def refused(lines, made_for=None):
    """Return code and line of the first error behind the head, and its text."""
    first = SINUMERIK.refusal(lines, cell_of(made_for))
    return first.code, first.line, str(first)


@pytest.mark.parametrize("kind", KINDS)
@given(place=PLACES, angles=st.tuples(TURNS, TURNS))
def test_under_traori_the_tip_is_programmed(kind, place, angles):
    made_for = machine(kind, tcpm=False)
    angles_deg = dict(zip(made_for.axes, angles, strict=False))
    x, y, z = place
    words = " ".join(f"{letter}{value}" for letter, value in angles_deg.items())
    toolpath = read(f"TRAORI\nG1 X{x} Y{y} Z{z} {words}\nTRAFOOF", made_for)
    np.testing.assert_allclose(toolpath.position_mm[-1], place, rtol=0, atol=1e-9)
    _, axis = tool_in_part(made_for, place, angles_deg)
    np.testing.assert_allclose(toolpath.axis[-1], axis, rtol=0, atol=1e-12)


@given(vector=VECTORS, place=PLACES)
def test_a_tool_vector_is_the_tool_axis(vector, place):
    x, y, z = place
    words = " ".join(f"{letter}3={value}" for letter, value in zip("ABC", vector, strict=True))
    toolpath = read(f"TRAORI(1)\nG1 X{x} Y=AC({y}) Z{z} {words}\nX=IC(1)", machine("head-head", tcpm=False))
    np.testing.assert_allclose(toolpath.position_mm[-1], [x + 1.0, y, z], rtol=0, atol=1e-9)
    unit = np.array(vector) / np.linalg.norm(vector)
    np.testing.assert_allclose(toolpath.axis[-2:], [unit, unit], rtol=0, atol=1e-12)


def test_it_moves_as_under_g43_4_and_as_a_machine_behind_it():
    made_for = machine("table-head", tcpm=False)
    ours = read(
        "TRAORI\nG1 X10 Y5 Z1 B30 C45\nX20 B=DC(20) C=IC(5)\nG2 X30 Y5 CR=8 C60\n"
        "TRAFOOF\nG1 X1 Y2 Z3 B5 C-10",
        made_for,
    )
    other = read(
        "G43.4 H1\nG1 X10 Y5 Z1 B30 C45\nX20 B20 C50\nG2 X30 Y5 R8 C60\nG43 H1\nG1 X1 Y2 Z3 B5 C-10",
        made_for,
        LINUXCNC,
    )
    np.testing.assert_array_equal(ours.position_mm, other.position_mm)
    np.testing.assert_array_equal(ours.axis, other.axis)


def test_vectors_turn_as_those_of_g43_5():
    made_for = machine("table-table", tcpm=False)
    ours = read("TRAORI\nG1 X10 A3=.3 B3=-.2 C3=.9\nX20 A3=.1 C3=1\nX25", made_for)
    other = read("G43.5 H1\nG1 X10 Y0 Z0 I.3 J-.2 K.9\nX20 I.1 K1\nX25", made_for, LINUXCNC)
    np.testing.assert_array_equal(ours.axis, other.axis)
    np.testing.assert_array_equal(ours.position_mm, other.position_mm)


def test_an_arc_keeps_the_vector_before_it_and_angles_end_it():
    made_for = machine("table-table", tcpm=False)
    toolpath = read("TRAORI\nG0 A3=.1 C3=1\nG2 X10 Y0 CR=6\nG1 X20 A10 C=DC(-350)", made_for)
    unit = np.array([0.1, 0.0, 1.0]) / np.hypot(0.1, 1.0)
    arc = toolpath.arc >= 0
    assert arc.any()
    np.testing.assert_allclose(toolpath.axis[arc], np.broadcast_to(unit, (arc.sum(), 3)), rtol=0, atol=1e-12)
    _, axis = tool_in_part(made_for, (20.0, 0.0, 0.0), {"A": 10.0, "C": 10.0})
    np.testing.assert_allclose(toolpath.axis[-1], axis, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("words", "way_deg"),
    [
        ("C=DC(5)", 5.0),
        ("C350\nC=DC(5)", 365.0),
        ("C350\nC=ACP(5)", 365.0),
        ("C350\nC=ACN(5)", 695.0),
        ("C=ACN(5)", 355.0),
        ("C=ACP(-10)", 350.0),
        ("C20\nC=DC(20)", 20.0),
        ("C20\nC=ACN(20)", 20.0),
        ("C30\nG91 C=AC(10)", 50.0),
        ("C30\nG91 C=DC(300)\nC5", 125.0),
        ("C30\nC=IC(-40)", 70.0),
        ("G91 C=IC(30)\nC=IC(30)", 60.0),
    ],
)
def test_the_way_of_a_rotary_axis(words, way_deg):
    """The tool leans, so that its axis goes around with C: the way is the sum of its turns about Z."""
    made_for = machine("table-head", tcpm=False)
    toolpath = read(f"TRAORI\nG0 B30\nG1 {words}".replace("\nC", "\nG1 C"), made_for)
    x, y, _ = toolpath.axis[toolpath.axis[:, 2] < 0.9].T
    turn = np.diff(np.unwrap(np.arctan2(y, x)))
    assert np.degrees(np.abs(turn).sum()) == pytest.approx(way_deg, abs=1e-6)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("G0 A3=1 C3=1", ("dialect-statement", 1, "TRAORI is not in force")),
        ("TRAORI\nG0 SUPA A3=1 C3=1", ("dialect-statement", 2, "beside SUPA")),
        ("TRAORI\nTRANS A3=1", ("dialect-statement", 2, "beside SUPA or TRANS")),
        ("TRAORI\nG0 A3=1 B40", ("dialect-statement", 2, "beside rotary words")),
        ("TRAORI\nG2 X1 Y1 CR=5 A3=1", ("dialect-statement", 2, "beside an arc")),
        ("TRAORI(2)", ("dialect-statement", 1, "another transformation")),
        ("TRANS X5\nTRAORI", ("dialect-statement", 2, "outlives")),
        ("TRAORI\nTRANS X5\nTRAFOOF", ("dialect-statement", 3, "outlives")),
        ("TRAORI\nG0 A3=0 B3=0 C3=0", ("tool-vector", 2, "no direction")),
        ("TRAORI\nG0 A3=AC(1)", ("dialect-statement", 2, "calculations")),
        ("TRAORI\nG0 A3=1 A3=2", ("repeated-word", 2, "twice")),
        ("TRAORI\nG0 A2=30", ("dialect-statement", 2, "other angles")),
        ("TRAORI\nG0 A33=1", ("dialect-statement", 2, "other angles")),
        ("TRAORI\nG0 X1 LEAD=5", ("dialect-statement", 2, "by the surface")),
        ("TRAORI\nG0 A3=1 C3=1\nB10", ("rotary-unknown", 3, "where C stands")),
        ("TRAORI\nG0 A3=1 C3=1\nTRAFOOF\nG0 X1 Y1 Z1", ("rotary-unknown", 4, "B and C")),
        ("TRAORI\nG0 A3=1 C3=1\nB0 C=IC(3)", ("undefined-position", 3, "C counts from")),
        ("TRAORI\nG0 A3=1 C3=1\nG91 B0 C=DC(3)", ("undefined-position", 3, "C counts from")),
        ("FGROUP(X,Y,Z,C)", ("dialect-statement", 1, "rotary axes too")),
        ("G0 X=DC(5)", ("dialect-statement", 1, "calculations")),
        ("G0 C=EC(5)", ("dialect-statement", 1, "calculations")),
    ],
)
def test_what_is_refused(text, found):
    code, line, message = refused(text, machine("table-head", tcpm=False))
    assert (code, line) == found[:2]
    assert found[2] in message


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("TRAORI\nG1 X1", 2),
        ("TRAORI\nG54 G1 X1\nTRAFOOF\nG0 SUPA Z0\nG0 X2", 5),
        ("TRAORI\nG0 B5 C=DC(3)\nG1 A3=1 C3=1", 3),
        ("TRAORI\nG54\nG1 X1\nTRAFOOF\nG0 SUPA Z0\nG55\nG0 X2 Y2 Z2", None),
        ("TRAFOOF\nG1 X1", None),
    ],
)
def test_the_control_may_have_dropped_the_work_offset(text, line):
    offset = dict(zip(("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg"), [5.0, *[0.0] * 5], strict=True))
    cell = over_demonstration({"work_offsets": {"G54": offset, "G55": offset}})
    cell = cell.model_copy(update={"machine": machine("table-head", tcpm=False)})
    found = SINUMERIK.errors(text, cell)
    assert [issue.line for issue in found][:1] == ([] if line is None else [line])
    assert all("work offset outlives" in issue.message for issue in found)


def test_without_a_machine_zero_is_no_motion_and_the_rest_is_refused():
    toolpath = read("TRAORI\nG1 X1 A0 C=DC(0)\nTRAFOOF")
    assert {issue.code for issue in toolpath.issues} == {"rotary-zero", "dialect-harmless"}
    assert refused("TRAORI\nG1 X1 A5")[:2] == ("rotary-axis", 2)
    assert refused("TRAORI\nG1 X1 A3=0 B3=0 C3=1")[:2] == ("machine-missing", 2)


def test_a_vector_by_r_parameters():
    toolpath = read("R1=.5\nTRAORI\nG0 A3=R1 C3=R1*2 X=R1", machine("head-head", tcpm=False))
    np.testing.assert_allclose(toolpath.axis[-1], np.array([1.0, 0.0, 2.0]) / np.sqrt(5.0), atol=1e-12)


def test_feed_axes_that_are_those_of_the_path_say_nothing():
    text = "FGROUP(X,Y,Z)\nFGROUP()\nFGREF[C]=10\nG1 X1"
    assert {issue.code for issue in read(text).issues} == {"dialect-harmless"}
