"""Cutter compensation: properties of the path, and what it must not stand beside."""

import itertools
import math
from pathlib import Path

import numpy as np
import pytest

from gcode2krl import Cell, load_cell, read_gcode
from gcode2krl.cell.sections import Frame
from tests.gcode import Control, read, refusal

CHORD_MM = 0.01
CELL = Cell.model_construct(tool={}, work_offsets={})


def _read(text, cell=CELL):
    return read(text, cell, "part.ngc", chord_tolerance_mm=CHORD_MM)


def _contour(rng):
    """Return the corners (n, 2) of a random convex contour, counterclockwise."""
    angles = np.sort(rng.uniform(0.0, 2.0 * math.pi, 12))
    angles = angles[np.diff(angles, append=angles[0] + 2.0 * math.pi) > 0.25]
    return 60.0 * np.column_stack([np.cos(angles), np.sin(angles)])


def _program(corners, code, diameter, *, inch=False):
    """Return a program that cuts a closed contour: in along its first side, and out in the middle of that."""
    scale = 1.0 / 25.4 if inch else 1.0
    along = (corners[1] - corners[0]) / np.linalg.norm(corners[1] - corners[0])
    start = corners[0] - 30.0 * along
    lines = [f"{'G20' if inch else 'G21'} G17 G90 G94 F{500.0 * scale:.9f}", "G0 Z0"]
    lines += [f"G0 X{start[0] * scale:.9f} Y{start[1] * scale:.9f}", f"{code} D{diameter * scale:.9f}"]
    lines += [
        f"G1 X{x * scale:.9f} Y{y * scale:.9f}"
        for x, y in [*corners, corners[0], 0.5 * (corners[0] + corners[1])]
    ]
    return "\n".join([*lines, "G40", f"G1 X{200.0 * scale:.9f} Y{200.0 * scale:.9f}", "M2", ""])


def _distance_mm(points, corners):
    """Return the distance (n,) of points from a closed contour."""
    ends = np.roll(corners, -1, axis=0)
    way = ends - corners
    part = np.einsum("nij,ij->ni", points[:, None] - corners, way) / np.einsum("ij,ij->i", way, way)
    foot = corners + np.clip(part, 0.0, 1.0)[..., None] * way
    return np.linalg.norm(points[:, None] - foot, axis=2).min(axis=1)


def _along(path_mm):
    """Return points (m, 2) all along a path."""
    part = np.linspace(0.0, 1.0, 20)[:, None]
    pieces = [a + part * (b - a) for a, b in itertools.pairwise(path_mm)]
    return np.concatenate(pieces)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("code", ["G41.1", "G42.1"])
def test_the_path_stays_a_radius_beside_a_convex_contour(seed, code):
    corners = _contour(np.random.default_rng(seed))
    path_mm = _read(_program(corners, code, 6.0)).position_mm[:, :2]
    beside = _along(path_mm[4:-1])  # behind the start, the rapid moves and the entry
    distance_mm = _distance_mm(beside, corners)
    assert distance_mm.max() < 3.0 + 1e-6
    assert distance_mm.min() > 3.0 - 1.1 * CHORD_MM


@pytest.mark.parametrize("seed", range(5))
def test_a_diameter_of_zero_is_the_contour(seed):
    corners = _contour(np.random.default_rng(seed))
    plain = _program(corners, "G40", 0.0).replace("G40 D0.000000000\n", "")
    shifted = _read(_program(corners, "G41.1", 0.0)).position_mm
    np.testing.assert_allclose(shifted, _read(plain).position_mm, atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_the_mirror_image_of_left_is_right(seed):
    corners = _contour(np.random.default_rng(seed))
    left = _read(_program(corners, "G41.1", 6.0)).position_mm
    right = _read(_program(corners * [1.0, -1.0], "G42.1", 6.0)).position_mm
    np.testing.assert_allclose(left[:-1], (right * [1.0, -1.0, 1.0])[:-1], atol=1e-6)
    negative = _read(_program(corners, "G42.1", -6.0)).position_mm
    np.testing.assert_allclose(left, negative, atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_inches_are_millimetres(seed):
    corners = _contour(np.random.default_rng(seed))
    mm = _read(_program(corners, "G42.1", 6.0)).position_mm
    inch = _read(_program(corners, "G42.1", 6.0, inch=True)).position_mm
    np.testing.assert_allclose(mm, inch, atol=1e-6)


LINUXCNC = Control("G21 G90 G17 F100\nG0 X0 Y0 Z0\n")
HEAD = LINUXCNC.head


@pytest.mark.parametrize(
    ("lines", "code", "line"),
    [
        *(
            (f"G41.1 D2\nG1 X10\n{block}", "cutter-on", 3)
            for block in ("G10 L2 P2 X5", "G52 X5", "G92 X5", "G92.1", "G92.3", "G43.1 Z5", "G55", "G28.1")
        ),
        ("G41.1 D2\nG1 X10\nG81 X20 Z-5 R2", "cutter-on", 3),
        ("G41.1 D2\nG1 X10\nG1 X15 Z#5421", "cutter-parameter", 3),
        ("G41.1 D2\nG1 X10\n#<a> = #<_x>", "cutter-parameter", 3),
        ("G20\nG41.1 D#5410", "cutter-parameter", 2),
        ("G10 L2 P1 R30\nG41.1 D2", "cutter-frame", 2),
    ],
)
def test_what_is_refused(lines, code, line):
    assert LINUXCNC.refused(f"{lines}\nG1 X20\nG40\nG1 X40", CELL) == (code, line)


def test_a_rotated_work_offset_of_the_cell_is_refused():
    frame = Frame(x_mm=5.0, y_mm=0.0, z_mm=0.0, a_deg=30.0, b_deg=0.0, c_deg=0.0)
    cell = Cell.model_construct(tool={}, work_offsets={"G54": frame})
    assert "rotated work offset" in LINUXCNC.refusal("G41.1 D2\nG1 X20\nG40", cell).message


@pytest.mark.parametrize("where", ["in the file", "beside it"])
def test_a_contour_of_a_subprogram_is_that_of_the_plain_blocks(tmp_path, where):
    moves = "G1 X20 Y0\nG3 X30 Y10 I0 J10\nG1 Y30\nX15\nG2 X10 Y25 J-5\nG1 Y4\n"
    sub = f"o<contour> sub\n{moves}o<contour> endsub\n"
    around = HEAD + "{}G41.1 D4\n{}G40\nG1 X0 Y50\nM2\n"
    expected = _read(around.format("", moves)).position_mm
    (tmp_path / "contour.ngc").write_text(sub, encoding="ascii")
    (tmp_path / "part.ngc").write_text(
        around.format(sub if where == "in the file" else "", "o<contour> call\n")
    )
    called = read_gcode(tmp_path / "part.ngc", CELL, chord_tolerance_mm=CHORD_MM)
    np.testing.assert_allclose(called.position_mm, expected, atol=1e-12)
    assert where == "in the file" or set(called.source_line[3:-1]) == {4}  # the call


def test_a_loop_under_compensation():
    steps = (
        f"{HEAD}G41.1 D2\n#1 = 0\no1 while [#1 LT 4]\nG91\nG1 X20\n#1 = [#1 + 1]\nG1 Y20\n"
        "#1 = [#1 + 1]\no1 endwhile\nG90\nG40\nM2\n"
    )
    plain = HEAD + "G41.1 D2\nG91\n" + "G1 X20\nG1 Y20\n" * 2 + "G90\nG40\nM2\n"
    np.testing.assert_allclose(_read(steps).position_mm, _read(plain).position_mm, atol=1e-12)


FIVE_AXES = load_cell(Path(__file__).parents[2] / "examples" / "five_axis" / "cell.toml")
STANDING = f"{HEAD}G41.1 D4\nG1 X20 Y0\nG3 X30 Y10 I0 J10\nM8\nG1 X10\nY30\nG40\nG1 X0 Y50\nM2\n"


def test_a_machine_with_rotary_axes_that_stand_changes_nothing():
    turned, plain = _read(STANDING, FIVE_AXES), _read(STANDING)
    np.testing.assert_allclose(turned.position_mm, plain.position_mm, atol=1e-9)


@pytest.mark.parametrize(("old", "new"), [("G1 X10\n", "G1 X10 A5\n"), ("G41.1", "G0 A5\nG41.1")])
def test_rotary_axes_that_turn_under_compensation_are_refused(old, new):
    assert "rotary axes" in refusal(STANDING.replace(old, new), FIVE_AXES).message


MILL = Control("G21 G90 G17\nT1 M6\nG43 H1\nS900 M3\nG0 X0 Y0 Z2\nF100\n", cell=load_cell())


@pytest.mark.parametrize(("change", "last_mm"), [("T1 M6\nG43 H1\n", [50, 8, 30]), ("", [50, 0, 30])])
def test_a_tool_change_behind_g40_goes_on_from_where_the_tool_stands(change, last_mm):
    """As LinuxCNC: Z alone then moves along the tool, and does not lead back to the contour."""
    found = MILL.places(f"G41 D1\nG1 X20 Y0 F500\nX50\nG40\n{change}G0 Z30\nG1 X60 Y20")
    assert found[-2:].tolist() == [last_mm, [60, 20, 30]]


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        ("G41.1 D10\nG4 P1\nG40\nG1 X90", []),
        ("G41.1 D10\nG1 X40 F300\nG40\nG1 X90", [1]),
        ("G41.1 D10\nG40\nG1 X90", []),
        ("G41.1 D12\nG0 X20\nG40", []),
        ("G41.1 D12\nG0 X20\nG1 Y20\nG40", [1]),
        ("G41.1 D#5410\nG1 X20\nG40", []),
    ],
)
def test_another_diameter_is_told_where_something_is_cut_with_it(lines, told):
    issues = MILL.read(lines).issues
    assert [i.line - MILL.head.count("\n") for i in issues if i.code == "cutter-differs"] == told


def test_the_diameter_of_the_tool_in_the_spindle_is_a_parameter_in_mm():
    """LinuxCNC's #5410; tool 1 of the demonstration cell has 16 mm."""
    assert MILL.places("G41.1 D#5410\nG1 X20\nG40")[-1].tolist() == [20, 8, 2]
