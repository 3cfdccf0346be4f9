"""Offsets that a program sets, and work offsets with a rotation.

Positions are compared with the same program written out: numbers shifted or points rotated by hand.
"""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcode2krl import Cell
from gcode2krl.cell.sections import Frame
from tests.gcode import errors, refusal
from tests.gcode import read as parsed

FRAME = {"x_mm": 0.0, "y_mm": 0.0, "z_mm": 0.0, "a_deg": 0.0, "b_deg": 0.0, "c_deg": 0.0}
HEAD = "G21 G90 G17 F500\nG0 X0 Y0 Z0\n"
number = st.integers(-50000, 50000).map(lambda n: n / 1000)
plane = st.sampled_from(("G17", "G18", "G19"))
IN_PLANE = {"G17": "XYIJ", "G18": "ZXKI", "G19": "YZJK"}


def read(lines, cell=None):
    return parsed(f"{lines}\nM2\n", cell)


def found(lines, cell=None):
    """Return code, severity and line of the findings of a program, whether it is read or not."""
    issues = errors(f"{lines}\nM2\n", cell) or read(lines, cell).issues
    return [(issue.code, issue.severity, issue.line) for issue in issues]


def cell_with(**offsets):
    """Return a cell of nothing but work offsets."""
    frames = {name: Frame(**{**FRAME, **values}) for name, values in offsets.items()}
    return Cell.model_construct(tool={}, work_offsets=frames)


def cell_with_tools(*lengths_mm):
    """Return a cell of nothing but tools 1, 2, ... of such lengths."""
    tools = {k: {"length_mm": mm, "diameter_mm": 6.0, "teeth": 2} for k, mm in enumerate(lengths_mm, start=1)}
    return Cell.model_validate({"tool": tools})


@st.composite
def motions(draw, arcs=True):
    """Draw blocks of straight moves and half circles, absolute or incremental, in any plane."""
    blocks = []
    for _ in range(draw(st.integers(1, 8))):
        kind = draw(st.integers(0, 4 if arcs else 2))
        if kind == 0:
            blocks.append(draw(st.sampled_from(("G90", "G91"))))
        elif kind <= 2:
            letters = draw(st.lists(st.sampled_from("XYZ"), min_size=1, max_size=3, unique=True))
            blocks.append(f"G{kind - 1} " + " ".join(f"{letter}{draw(number):.4f}" for letter in letters))
        else:
            first, second, i, j = IN_PLANE[(name := draw(plane))]
            u, v = draw(number), draw(number.filter(lambda v: abs(v) > 0.01))
            turn, end = draw(st.sampled_from((2, 3))), f"{first}{2 * u:.4f} {second}{2 * v:.4f}"
            blocks.append(f"G91 {name} G{turn} {end} {i}{u:.4f} {j}{v:.4f}")
            blocks.append("G90")
    return blocks


def rotated(points, degrees, about=(0.0, 0.0)):
    """Return points (k, 3) rotated about Z."""
    z = (points[:, 0] - about[0] + 1j * (points[:, 1] - about[1])) * np.exp(1j * math.radians(degrees))
    return np.column_stack((z.real + about[0], z.imag + about[1], points[:, 2]))


@settings(max_examples=60, deadline=None)
@given(blocks=motions(), degrees=st.integers(-360, 360), x=number, y=number, z=number)
def test_a_rotated_program_is_the_program_with_its_points_rotated(blocks, degrees, x, y, z):
    text = "\n".join(blocks)
    plain = read(HEAD + text).position_mm[1:]
    turned = read(f"G21 G10 L2 P1 X{x} Y{y} Z{z} R{degrees}\n{HEAD}{text}").position_mm[1:]
    np.testing.assert_allclose(turned, rotated(plain, degrees) + np.array([x, y, z]), rtol=0, atol=1e-8)


@settings(max_examples=40, deadline=None)
@given(blocks=motions(), degrees=st.integers(-360, 360), x=number, y=number)
def test_a_rotation_in_the_cell_is_that_of_g10(blocks, degrees, x, y):
    text = "\n".join(blocks)
    by_cell = read(HEAD + text, cell_with(G54={"x_mm": x, "y_mm": y, "a_deg": float(degrees)}))
    by_g10 = read(f"G21 G10 L2 P1 X{x} Y{y} R{degrees}\n{HEAD}{text}")
    np.testing.assert_allclose(by_cell.position_mm, by_g10.position_mm, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(by_cell.known, by_g10.known)


@settings(max_examples=60, deadline=None)
@given(blocks=motions(), x=number, y=number, z=number)
def test_a_shift_is_the_program_with_shifted_numbers(blocks, x, y, z):
    text = "\n".join(blocks)
    plain = read(HEAD + text).position_mm[1:]
    local = read(f"G21 G52 X{x} Y{y} Z{z}\n{HEAD}{text}").position_mm[1:]
    by_place = read(f"{HEAD}G0 X{x} Y{y} Z{z}\nG92 X0 Y0 Z0\n{HEAD}{text}").position_mm[3:]
    np.testing.assert_allclose(local, plain + np.array([x, y, z]), rtol=0, atol=1e-9)
    np.testing.assert_allclose(by_place, plain + np.array([x, y, z]), rtol=0, atol=1e-9)


@settings(max_examples=40, deadline=None)
@given(blocks=motions(), x=number, y=number, z=number, clear=st.sampled_from(("G92.1", "G92.2")))
def test_g92_and_its_end_leave_things_as_they_were(blocks, x, y, z, clear):
    text = "\n".join(blocks)
    plain = read(HEAD + text)
    shifted = read(f"{HEAD}G92 X{x} Y{y} Z{z}\n{clear}\n{text}")
    np.testing.assert_allclose(shifted.position_mm, plain.position_mm, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(shifted.known, plain.known)


@settings(max_examples=40, deadline=None)
@given(blocks=motions(arcs=False), degrees=st.integers(-180, 180), x=number, y=number)
def test_offsets_in_inches_are_those_in_mm_scaled(blocks, degrees, x, y):
    offsets = f"G10 L2 P1 X{x} Y{y} R{degrees}\nG0 X0 Y0 Z0\nG92 X{y} Z{x}\nG52 Y{x}\n"
    text = offsets + "\n".join(blocks)
    mm = read(f"G21 G90 F500\n{text}").position_mm
    inches = read(f"G20 G90 F500\n{text}").position_mm
    np.testing.assert_allclose(inches, 25.4 * mm, rtol=0, atol=1e-7)


@settings(max_examples=40, deadline=None)
@given(points=st.lists(st.tuples(number, number, number), min_size=1, max_size=6), x=number, y=number)
def test_incremental_moves_are_absolute_ones_under_every_offset(points, x, y):
    offsets = f"{HEAD}G10 L2 P2 X{y} R40\nG92 X{x} Y{y}\nG55\nG0 X0 Y0 Z0\n"
    absolute = "\n".join(f"G1 X{a} Y{b} Z{c}" for a, b, c in points)
    steps = np.diff(np.array([(0.0, 0.0, 0.0), *points]), axis=0)
    incremental = "G91\n" + "\n".join(f"G1 X{a:.6f} Y{b:.6f} Z{c:.6f}" for a, b, c in steps)
    one, other = read(offsets + absolute), read(offsets + incremental)
    np.testing.assert_allclose(one.position_mm, other.position_mm, rtol=0, atol=1e-4)
    np.testing.assert_array_equal(one.known, other.known)


def test_under_a_rotation_an_axis_that_is_not_named_keeps_its_programmed_coordinate():
    positions = read("G21 G10 L2 P1 R90\nG0 X10 Y5 Z0\nY0\nX1").position_mm[1:]
    np.testing.assert_allclose(positions, [[-5, 10, 0], [0, 10, 0], [0, 1, 0]], atol=1e-12)


def test_under_a_rotation_x_is_known_with_y_alone():
    known = read("G21 G10 L2 P1 R30\nG0 X10\nY5\nG10 L2 P1 R0\nX1\nG53 G0 X0\nY0").known[1:]
    np.testing.assert_array_equal(known[:, 0], [False, True, True, False, False])
    np.testing.assert_array_equal(known[:, 1], [False, True, True, True, True])


def test_a_machine_move_under_a_rotation_makes_both_axes_unknown():
    known = read("G21 G10 L2 P1 R30\nG0 X10 Y5 Z1\nG53 G0 X0\nX1\nY1").known[1:]
    np.testing.assert_array_equal(known[:, :2].all(axis=1), [True, False, False, True])


def test_a_rotation_set_while_one_axis_is_known_leaves_none_known():
    known = read("G21 G0 X10\nG10 L2 P1 R30\nY1\nX1").known[1:]
    np.testing.assert_array_equal(known[:, :2].any(axis=1), [True, False, True])


def test_other_rotations_than_about_z_are_refused_by_their_key():
    issue = refusal("G21 G0 X1\nM2\n", cell_with(G55={"b_deg": 5.0}))
    assert (issue.code, "G55" in issue.message) == ("cell-key", True)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("G52 X5", [("program-offset", "note", 3), ("offset-left", "note", 3)]),
        ("G52 X5\nG1 X1\nG52 X0", [("program-offset", "note", 3)]),
        ("G92 X5", [("program-offset", "warning", 3), ("offset-left", "note", 3)]),
        ("G92 X5\nG92.1", [("program-offset", "warning", 3)]),
        ("G92 X0 Y0", []),
        ("G92.1", []),
        ("G10 L2 P1 X0 Y0 Z0", []),
        ("G10 L2 P2 X5", [("program-offset", "warning", 3)]),
        ("G10 L2 P0 R5", [("program-offset", "warning", 3)]),
        ("G10 L20 P1 Z5", [("program-offset", "warning", 3)]),
    ],
)
def test_what_moves_the_zero_is_said_once(text, expected):
    assert found(HEAD + text) == expected


def test_the_move_of_the_zero_is_told_in_mm():
    (issue, left) = read(HEAD + "G20 G92 X-1 Z2\nG92 X5").issues
    assert "by X25.4 Z-50.8 mm; 2 blocks" in issue.message
    assert "X-127 Z-50.8 mm" in left.message


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("G92 X0 Y0 Z0", "offset-at-start"),
        ("G10 L20 P1 X0 Y0 Z0", "offset-at-start"),
        ("G92 Z5", "offset-from-unknown"),
        ("G28\nG92 X0", "offset-from-unknown"),
        ("G0 X1 Y1\nG92 Z0", "offset-from-unknown"),
        ("G0 X1 Y1 Z1\nG28 Z1\nG92 X5 Z0", "offset-from-unknown"),
        ("G0 X1 Y1 Z1\nG53 G0 X4\nG10 L20 P1 X5", "offset-from-unknown"),
        ("G0 X1 Y1 Z1\nG10 L2 P1 R9\nG53 G0 X4\nG10 L20 P1 Y5", "offset-from-unknown"),
        ("G0 X1 Y1\nG10 L11 P1 Z1", "offset-from-unknown"),
    ],
)
def test_a_zero_set_by_an_unknown_position_is_found(text, code):
    cell = cell_with_tools(10.0)
    assert code in [name for name, _, _ in found("G21\n" + text, cell)]


def test_a_zero_set_by_a_known_axis_needs_no_other():
    assert found("G21\nG0 X1\nG92 X5\nG92.1") == [("program-offset", "warning", 3)]


@pytest.mark.parametrize(
    ("text", "differs"),
    [
        ("G10 L1 P1 Z11", True),
        ("T1 M6\nG43.1 Z9", True),
        ("T1 M6\nG43\nG43.2 H1", True),
        ("G10 L1 P1 Z-10", True),
        ("G10 L1 P1 Z10", False),
        ("T1 M6\nG43.1 Z10", False),
        ("G20 G10 L1 P1 Z.3937", False),
        ("G43.2 H1", False),
    ],
)
def test_another_length_than_the_declared_is_found(text, differs):
    codes = [name for name, _, _ in found(HEAD + text, cell_with_tools(10.0))]
    assert ("tool-length-differs" in codes) == differs


@pytest.mark.parametrize(
    ("block", "code"),
    [
        ("G92", "offset-no-axes"),
        ("G52 F100", "offset-no-axes"),
        ("G10 P1 X1", "g10-words"),
        ("G10 L0", "g10-words"),
        ("G10 L2 X1", "g10-words"),
        ("G10 L2 P1.5 X1", "g10-words"),
        ("G10 L20 P1 R5", "g10-words"),
        ("G10 L1 P9 Z1", "g10-words"),
        ("G10 L1 P1 X2", "tool-offset-across"),
        ("G43.1 X1 Z2", "tool-offset-across"),
        ("G43.2 Z2", "g43-2-words"),
        ("G43.2", "g43-2-words"),
        ("G0 G92 X1", "two-axis-codes"),
        ("G0 G43.1 Z1", "two-axis-codes"),
        ("G43.1 Z1 G92 X2", "two-axis-codes"),
        ("G43.1 Z1 G28", "two-axis-codes"),
        ("G53 G43.1 Z1", "g53-motion"),
        ("G92 X1 P2", "unused-word"),
        ("G10 L2 P1 X1 Q2", "unused-word"),
        ("G92 X1 I2", "unused-word"),
    ],
)
def test_what_is_not_understood_is_one_finding_at_its_line(block, code):
    found = errors(f"{HEAD}{block}\nG0 X1 Y1 Z1\nM2\n", cell_with_tools(10.0))
    assert [(issue.code, issue.line) for issue in found] == [(code, 3)]


SHIFTS = pytest.mark.parametrize("shift", [f"{HEAD}G52 X24\n", f"{HEAD}G92 Y3\n"])
TURNED = "G10 L2 P1 R90\n"


@SHIFTS
@pytest.mark.parametrize(
    ("block", "known"),
    [("G0 X1", [0, 0, 1]), ("G91 G0 X1 Y2", [0, 0, 1]), ("G0 X1 Y2", [1, 1, 1])],
)
def test_behind_a_rotation_under_a_shift_the_place_is_unknown(shift, block, known):
    """LinuxCNC takes the tool to stand elsewhere: an axis that the next block does not name would jump."""
    assert read(shift + TURNED + block).known[-1].tolist() == known


@SHIFTS
@pytest.mark.parametrize(
    ("block", "refused"),
    [("G0 X#5420 Y1", 1), ("G0 X#<_y> Y1", 1), ("G0 X1\nG0 Y#5421", 1), ("G0 X1 Y2\nX#5420", 0)],
)
def test_there_its_parameters_have_no_value(shift, block, refused):
    codes = [issue.code for issue in errors(f"{shift}{TURNED}{block}\nM2\n")]
    assert ("expression-value" in codes) == bool(codes) == bool(refused)


@SHIFTS
@pytest.mark.parametrize(
    "turn", ["G10 L2 P1 R0", "G10 L2 P2 R90", "G10 L2 P1 X5", "G92.1\n" + TURNED, "G52 X0 Y0\n" + TURNED]
)
def test_other_offsets_under_a_shift_leave_the_place_known(shift, turn):
    assert read(f"{shift}{turn}\nG0 Z1").known[-1].all()


def test_rs274_loses_a_length_in_inches_and_this_reader_does_not():
    """``G20 G43 H2 / G21 / G49``: stand-alone rs274 forgets to convert the length in force, 48 mm here."""
    cell = cell_with_tools(10.0, 50.8)
    tip = read("G20 G43 H2\nG0 Z1\nG21\nG49\nG0 X1", cell).position_mm[-1]
    assert tip[2] == pytest.approx(25.4 + 50.8)


def test_a_change_of_length_that_no_move_has_followed_survives_a_tool_change():
    """After M6 rs274 forgets it; the machine stood still, so the tip is where both changes leave it."""
    cell = cell_with_tools(10.0, 25.0)
    tip = read("G21 T1 M6 G43\nG0 Z5\nG43 H2\nT2 M6\nG0 X1", cell).position_mm[-1]
    assert tip[2] == pytest.approx(5 + 10 - 25)
