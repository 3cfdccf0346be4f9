"""Projection normal to the feed: eq. 10-11 as a matrix, and feeds of any length."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcode2krl.compliance import project_normal

finite = st.floats(-1e6, 1e6, allow_subnormal=True)
feeds = st.lists(
    st.one_of(st.floats(-1e150, 1e150, allow_subnormal=True), st.just(0.0)), min_size=3, max_size=3
)


def test_is_the_projector_of_the_plane():
    random = np.random.default_rng(0)
    r, v = random.normal(size=(1000, 3)), random.normal(size=(1000, 3))
    for k in range(1000):
        projector = np.eye(3) - np.outer(v[k], v[k]) / np.dot(v[k], v[k])
        np.testing.assert_allclose(project_normal(r[k : k + 1], v[k]), [projector @ r[k]], rtol=0, atol=1e-14)
    np.testing.assert_allclose(project_normal(r, v)[17], project_normal(r[17:18], v[17])[0], rtol=0, atol=0)


def test_by_hand():
    r = np.array([[1.0, 2.0, 3.0]] * 3)
    v = [[25.0, 0.0, 0.0], [0.0, 0.0, -0.001], [1.0, 1.0, 0.0]]
    np.testing.assert_allclose(project_normal(r, v), [[0, 2, 3], [1, 2, 0], [-0.5, 0.5, 3]], atol=1e-15)


def test_a_standstill_leaves_rows_as_they_are():
    r = np.array([[1.0, -2.0, 3.0], [1.0, -2.0, 3.0]])
    found = project_normal(r, [[0.0, 0.0, 0.0], [0.0, 1.0, -0.0]])
    np.testing.assert_array_equal(found, [[1, -2, 3], [1, 0, 3]])
    np.testing.assert_array_equal(project_normal(r, np.zeros(3)), r)


@pytest.mark.parametrize("size", [5e-324, 1e-310, 2.3e-308, 1e-200, 1e-160, 1.0, 1e160, 1.7e308])
def test_the_length_of_the_feed_does_not_matter(size):
    found = project_normal([[1.0, 2.0, 3.0]], [[size, 0.0, -size]])
    np.testing.assert_allclose(found, [[2.0, 2.0, 2.0]], rtol=1e-15)


@settings(max_examples=300, deadline=None)
@given(st.lists(finite, min_size=3, max_size=3), feeds)
def test_properties(r, v):
    """Normal to v, never longer than r, unchanged by a second projection, never NaN."""
    r = np.array([r])
    once = project_normal(r, v)
    rounding = 1e-14 * np.abs(r).max() + 1e-300  # norms underflow below
    assert np.isfinite(once).all()
    assert np.linalg.norm(once) <= np.linalg.norm(r) + rounding
    largest = np.abs(v).max()
    if largest > 0:
        direction = np.array(v) / largest
        assert abs(once @ direction)[0] <= rounding
        np.testing.assert_allclose(project_normal(once, v), once, rtol=0, atol=rounding)
    else:
        np.testing.assert_array_equal(once, r)


def test_wrong_shapes():
    with pytest.raises(ValueError, match=r"r has shape \(3,\), not \(n, 3\)"):
        project_normal([1.0, 2.0, 3.0], [1.0, 0.0, 0.0])
    with pytest.raises(ValueError, match=r"v has shape \(2, 3\), not \(3, 3\)"):
        project_normal(np.zeros((3, 3)), np.zeros((2, 3)))


def test_inputs_stay_as_they_were():
    r, v = np.ones((2, 3)), np.ones((2, 3))
    result = project_normal(r, v)
    assert r.flags.writeable
    result += 1.0
    assert (r == 1).all()
    assert (v == 1).all()
