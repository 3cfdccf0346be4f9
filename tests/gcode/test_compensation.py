"""Cutter compensation: properties of the path, and what it must not stand beside."""

import io
import itertools
import math
from pathlib import Path

import numpy as np
import pytest

from gcode2krl import Cell, Gcode2KrlError, load_cell, read_gcode
from gcode2krl.cell.sections import Frame
from gcode2krl.gcode import read_stream

CHORD_MM = 0.01
CELL = Cell.model_construct(tool={}, work_offsets={})


def _read(tmp_path, text, cell=CELL):
    """Return the toolpath of a program's text."""
    path = tmp_path / "part.ngc"
    path.write_text(text, encoding="ascii")
    return read_gcode(path, cell, chord_tolerance_mm=CHORD_MM)


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
def test_the_path_stays_a_radius_beside_a_convex_contour(tmp_path, seed, code):
    corners = _contour(np.random.default_rng(seed))
    path_mm = _read(tmp_path, _program(corners, code, 6.0)).position_mm[:, :2]
    beside = _along(path_mm[4:-1])  # behind the start, the rapid moves and the entry
    distance_mm = _distance_mm(beside, corners)
    assert distance_mm.max() < 3.0 + 1e-6
    assert distance_mm.min() > 3.0 - 1.1 * CHORD_MM


@pytest.mark.parametrize("seed", range(5))
def test_a_diameter_of_zero_is_the_contour(tmp_path, seed):
    corners = _contour(np.random.default_rng(seed))
    plain = _program(corners, "G40", 0.0).replace("G40 D0.000000000\n", "")
    shifted = _read(tmp_path, _program(corners, "G41.1", 0.0)).position_mm
    np.testing.assert_allclose(shifted, _read(tmp_path, plain).position_mm, atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_the_mirror_image_of_left_is_right(tmp_path, seed):
    corners = _contour(np.random.default_rng(seed))
    left = _read(tmp_path, _program(corners, "G41.1", 6.0)).position_mm
    right = _read(tmp_path, _program(corners * [1.0, -1.0], "G42.1", 6.0)).position_mm
    np.testing.assert_allclose(left[:-1], (right * [1.0, -1.0, 1.0])[:-1], atol=1e-6)
    negative = _read(tmp_path, _program(corners, "G42.1", -6.0)).position_mm
    np.testing.assert_allclose(left, negative, atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_inches_are_millimetres(tmp_path, seed):
    corners = _contour(np.random.default_rng(seed))
    mm = _read(tmp_path, _program(corners, "G42.1", 6.0)).position_mm
    inch = _read(tmp_path, _program(corners, "G42.1", 6.0, inch=True)).position_mm
    np.testing.assert_allclose(mm, inch, atol=1e-6)


HEAD = "G21 G90 G17 F100\nG0 X0 Y0 Z0\n"
ON = HEAD + "G41.1 D2\nG1 X10\n"
TAIL = "G1 X20\nG40\nG1 X40\nM2\n"


@pytest.mark.parametrize(
    ("text", "code", "line"),
    [
        (ON + "G10 L2 P2 X5\n" + TAIL, "cutter-on", 5),
        (ON + "G52 X5\n" + TAIL, "cutter-on", 5),
        (ON + "G92 X5\n" + TAIL, "cutter-on", 5),
        (ON + "G92.1\n" + TAIL, "cutter-on", 5),
        (ON + "G92.3\n" + TAIL, "cutter-on", 5),
        (ON + "G43.1 Z5\n" + TAIL, "cutter-on", 5),
        (ON + "G55\n" + TAIL, "cutter-on", 5),
        (ON + "G28.1\n" + TAIL, "cutter-on", 5),
        (ON + "G81 X20 Z-5 R2\n" + TAIL, "cutter-on", 5),
        (ON + "G1 X15 Z#5421\n" + TAIL, "cutter-parameter", 5),
        (ON + "#<a> = #<_x>\n" + TAIL, "cutter-parameter", 5),
        (HEAD + "G20\nG41.1 D#5410\n" + TAIL, "cutter-parameter", 4),
        (HEAD + "G10 L2 P1 R30\nG41.1 D2\n" + TAIL, "cutter-frame", 4),
    ],
)
def test_what_is_refused(tmp_path, text, code, line):
    with pytest.raises(Gcode2KrlError) as error:
        _read(tmp_path, text)
    assert (error.value.issues[0].code, error.value.issues[0].line) == (code, line)


def test_a_rotated_work_offset_of_the_cell_is_refused(tmp_path):
    frame = Frame(x_mm=5.0, y_mm=0.0, z_mm=0.0, a_deg=30.0, b_deg=0.0, c_deg=0.0)
    cell = Cell.model_construct(tool={}, work_offsets={"G54": frame})
    with pytest.raises(Gcode2KrlError, match="rotated work offset"):
        _read(tmp_path, HEAD + "G41.1 D2\n" + TAIL, cell)


def test_a_contour_of_a_subprogram_is_that_of_the_plain_blocks(tmp_path):
    moves = "G1 X20 Y0\nG3 X30 Y10 I0 J10\nG1 Y30\nX15\nG2 X10 Y25 J-5\nG1 Y4\n"
    plain = HEAD + "G41.1 D4\n" + moves + "G40\nG1 X0 Y50\nM2\n"
    called = HEAD + "o1 sub\n" + moves + "o1 endsub\nG41.1 D4\no1 call\nG40\nG1 X0 Y50\nM2\n"
    (tmp_path / "contour.ngc").write_text(f"o<contour> sub\n{moves}o<contour> endsub\n", encoding="ascii")
    in_file = HEAD + "G41.1 D4\no<contour> call\nG40\nG1 X0 Y50\nM2\n"
    expected = _read(tmp_path, plain).position_mm
    np.testing.assert_allclose(_read(tmp_path, called).position_mm, expected, atol=1e-12)
    of_file = _read(tmp_path, in_file)
    np.testing.assert_allclose(of_file.position_mm, expected, atol=1e-12)
    assert set(of_file.source_line[3:-1]) == {4}  # the call


def test_a_loop_under_compensation(tmp_path):
    looped = HEAD + "G41.1 D2\n#1 = 0\no1 while [#1 LT 4]\nG91\nG1 X20\nG1 Y20\no1 endwhile\nG90\nG40\nM2\n"
    steps = looped.replace("o1 while", "#1 = [#1 + 1]\no1 while")  # a value that changes within the loop
    steps = steps.replace("G1 Y20\n", "G1 Y20\n#1 = [#1 + 1]\n")
    plain = HEAD + "G41.1 D2\nG91\n" + "G1 X20\nG1 Y20\n" * 3 + "G90\nG40\nM2\n"
    np.testing.assert_allclose(
        _read(tmp_path, steps).position_mm, _read(tmp_path, plain).position_mm, atol=1e-12
    )


def test_a_machine_with_rotary_axes_that_stand_changes_nothing(tmp_path):
    cell = load_cell(Path(__file__).parents[2] / "examples" / "five_axis" / "cell.toml")
    moves = "G1 X20 Y0\nG3 X30 Y10 I0 J10\nM8\nG1 X10\nY30\nG40\nG1 X0 Y50\nM2\n"
    text = HEAD + "G41.1 D4\n" + moves
    turned = _read(tmp_path, text, cell)
    np.testing.assert_allclose(turned.position_mm, _read(tmp_path, text).position_mm, atol=1e-9)
    for wrong in (text.replace("G1 X10\n", "G1 X10 A5\n"), text.replace("G41.1", "G0 A5\nG41.1")):
        with pytest.raises(Gcode2KrlError, match="rotary axes"):
            _read(tmp_path, wrong, cell)


def test_a_tool_change_behind_g40_goes_on_from_where_the_tool_stands():
    """As LinuxCNC: Z alone then moves along the tool, and does not lead back to the contour."""
    head = "G21 G90 G17\nT1 M6\nG43 H1\nG0 X0 Y0 Z2\nG41 D1\nG1 X20 Y0 F500\nX50\nG40\n"
    text = head + "{}G0 Z30\nG1 X60 Y20\nM2\n"
    changed = read_stream(io.BytesIO(text.format("T1 M6\nG43 H1\n").encode()), "part.nc", load_cell())
    assert changed.position_mm[-2:].tolist() == [[50.0, 8.0, 30.0], [60.0, 20.0, 30.0]]
    kept = read_stream(io.BytesIO(text.format("").encode()), "part.nc", load_cell())
    assert kept.position_mm[-2].tolist() == [50.0, 0.0, 30.0]


@pytest.mark.parametrize(("move", "told"), [("G4 P1", False), ("G1 X40 F300", True), ("", False)])
def test_another_diameter_is_told_where_something_is_cut_with_it(move, told):
    text = f"G21 G90 G17\nT1 M6\nG43 H1\nG0 X0 Y0 Z2\nG41.1 D10\n{move}\nG40\nG1 X90 F500\nM2\n"
    toolpath = read_stream(io.BytesIO(text.encode()), "part.nc", load_cell())
    assert [i.line for i in toolpath.issues if i.code == "cutter-differs"] == ([5] if told else [])


def test_the_diameter_of_the_tool_in_the_spindle_is_a_parameter_in_mm():
    """LinuxCNC's #5410; tool 1 of the demonstration cell has 16 mm."""
    text = "G21 G90 G17\nT1 M6\nG43 H1\nS900 M3\nG0 X0 Y0 Z0\nF100\nG41.1 D#5410\nG1 X20\nG40\nM2\n"
    toolpath = read_stream(io.BytesIO(text.encode()), "part.ngc", load_cell())
    assert toolpath.position_mm[-1].tolist() == [20, 8, 0]
    assert "cutter-differs" not in {issue.code for issue in toolpath.issues}


def test_another_diameter_is_told_where_it_cuts():
    head = "G21 G90 G17\nT1 M6\nG43 H1\nS900 M3\nG0 X0 Y0 Z5\nF100\nG41.1 D12\n"

    def codes(lines):
        toolpath = read_stream(io.BytesIO(f"{head}{lines}\nM2\n".encode()), "part.ngc", load_cell())
        return {issue.code for issue in toolpath.issues}

    assert "cutter-differs" not in codes("G0 X20\nG40")
    assert "cutter-differs" in codes("G0 X20\nG1 Y20\nG40")
