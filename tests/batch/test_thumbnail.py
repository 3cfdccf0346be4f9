"""The path from above: few points, none of its corners lost."""

import io

import numpy as np
import pytest

from gcode2krl.batch.work import MOST_POINTS, thumbnail_of
from gcode2krl.gcode import read_stream


def points_of(text):
    found = thumbnail_of(read_stream(io.BytesIO(("G21 G90 G17\n" + text).encode()), "part"))
    return None if found is None else np.array(found)


def test_a_square_has_its_corners():
    found = points_of("G0 X0 Y0 Z5\nG1 Z-1 F500\nX10\nX25\nX40\nY40\nX0\nY0\nG0 Z20\nM2\n")
    np.testing.assert_array_equal(found, [[0, 0], [40, 0], [40, 40], [0, 40], [0, 0]])


def test_a_circle_is_within_a_hundredth():
    found = points_of("G0 X50 Y0 Z5\nG1 Z-1 F500\nG3 X50 Y0 I-50 J0\nM2\n")
    assert 20 < len(found) <= MOST_POINTS
    np.testing.assert_allclose(np.hypot(found[:, 0], found[:, 1]), 50.0, atol=0.01)


def test_a_long_path_keeps_to_its_number_of_points():
    rng = np.random.default_rng(1)
    lines = "".join(f"X{x:.3f} Y{y:.3f}\n" for x, y in rng.uniform(-100, 100, (5000, 2)))
    found = points_of(f"G0 X0 Y0 Z5\nG1 Z-1 F500\n{lines}M2\n")
    assert len(found) == MOST_POINTS
    assert found.min() == pytest.approx(-100, abs=2.0)
    assert found.max() == pytest.approx(100, abs=2.0)


def test_no_feed_move_is_no_picture():
    assert points_of("G0 X0 Y0 Z5\nX10\nM2\n") is None
