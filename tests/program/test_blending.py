"""CDIS at corners: never more than the tolerance, a level, truncated by the lines, zero where it must be."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcode2krl.program.blending import LEVELS_MM, corner_cdis

NO = np.nan
coordinates = st.integers(-50_000, 50_000).map(lambda micrometre: micrometre / 1000)
short_steps = st.integers(-800, 800).map(lambda micrometre: micrometre / 1000)
tolerances = st.one_of(st.just(NO), st.floats(1e-3, 2.0))


def path_of(steps):
    return np.cumsum(np.array(steps, dtype=float), axis=0)


def steps_of(size):
    return st.lists(st.tuples(size, size, size), min_size=3, max_size=30).filter(
        lambda steps: all(any(step) for step in steps)
    )


def corner(path, row):
    """Return the interior angle in rad and the shorter line at a row."""
    before, after = path[row] - path[row - 1], path[row + 1] - path[row]
    lengths = np.linalg.norm(before), np.linalg.norm(after)
    turn = math.atan2(np.linalg.norm(np.cross(before, after)), before @ after)
    return math.pi - turn, min(lengths)


def error_mm(path, row, cdis_mm):
    """Return how far the parabola passes from the corner: d·cos(alpha/2)/2, d at most half of a line."""
    alpha, shorter = corner(path, row)
    return min(cdis_mm, shorter / 2) * math.cos(alpha / 2) / 2


@settings(deadline=None)
@given(st.one_of(steps_of(coordinates), steps_of(short_steps)), st.data())
def test_corner_error_is_within_the_tolerance(steps, data):
    path = path_of(steps)
    tolerance = np.array(data.draw(st.lists(tolerances, min_size=len(path), max_size=len(path))))
    exact = np.array(data.draw(st.lists(st.booleans(), min_size=len(path), max_size=len(path))))
    cdis = corner_cdis(path, tolerance, 0.1, exact)
    levels = {0.0, *LEVELS_MM}
    assert cdis[0] == cdis[-1] == 0
    assert (cdis[exact] == 0).all()
    for row in range(1, len(path) - 1):
        if math.isnan(tolerance[row]):
            assert cdis[row] in (0.0, 0.1)
            continue
        assert cdis[row] in levels
        assert error_mm(path, row, cdis[row]) <= tolerance[row] * (1 + 1e-9)


@settings(deadline=None)
@given(steps_of(coordinates), st.floats(0.005, 1.0))
def test_corner_uses_what_the_tolerance_allows(steps, tolerance):
    """The next level up would be beyond the tolerance, or beyond what half of the line can use."""
    path = path_of(steps)
    cdis = corner_cdis(path, np.full(len(path), tolerance), 0.1, np.zeros(len(path), dtype=bool))
    for row in range(1, len(path) - 1):
        alpha, shorter = corner(path, row)
        if alpha < math.radians(1.01) or cdis[row] == LEVELS_MM[-1]:
            continue
        higher = LEVELS_MM[cdis[row] < LEVELS_MM][0]
        allowed = 2 * tolerance / max(math.cos(alpha / 2), 1e-15)
        assert higher > allowed * (1 - 1e-9) or higher >= shorter / 2


RIGHT_ANGLE = np.array([[0.0, 0, 0], [10, 0, 0], [10, 10, 0]])


@pytest.mark.parametrize(
    ("tolerance", "cdis"),
    [
        (0.02, 0.05),
        (0.05, 0.1),
        (0.1, 0.2),
        (0.4, 1.0),
        (0.0004, 0.001),
        (0.0003, 0.0),
        (50.0, 5.0),
        (NO, 0.1),
    ],
)
def test_right_angle(tolerance, cdis):
    """d = 2·tolerance/cos 45°, rounded down to 1-2-5; beyond half of the line nothing is gained."""
    found = corner_cdis(RIGHT_ANGLE, np.full(3, tolerance), 0.1, np.zeros(3, dtype=bool))
    assert found.tolist() == [0, cdis, 0]


@pytest.mark.parametrize(
    ("angle_deg", "stops"), [(0.0, True), (0.4, True), (0.9, True), (1.1, False), (3.0, False)]
)
@pytest.mark.parametrize("tolerance", [NO, 0.02])
def test_reversal_is_an_exact_stop(angle_deg, stops, tolerance):
    turned = np.radians(angle_deg)
    back = [10 - 10 * np.cos(turned), 10 * np.sin(turned), 0]
    path = np.array([[0.0, 0, 0], [10, 0, 0], back])
    found = corner_cdis(path, np.full(3, tolerance), 0.1, np.zeros(3, dtype=bool))
    assert (found[1] == 0) == stops


def test_no_blending_where_the_cell_has_none():
    assert corner_cdis(RIGHT_ANGLE, np.full(3, NO), 0.0, np.zeros(3, dtype=bool)).tolist() == [0, 0, 0]


def test_straight_on_is_blended():
    path = np.array([[0.0, 0, 0], [10, 0, 0], [20, 0, 0]])
    assert corner_cdis(path, np.full(3, 0.01), 0.1, np.zeros(3, dtype=bool))[1] > 0
