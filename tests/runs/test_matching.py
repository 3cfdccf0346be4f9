"""The arithmetic behind the checks, against closed forms and other libraries."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from gcode2krl.runs import matching
from gcode2krl.runs.matching import _shares, explained


def signals(seed, columns=3):
    t = np.arange(0.0, 20.0, 0.02)
    rng = np.random.default_rng(seed)
    hz, phase = rng.uniform(0.05, 0.4, (2, columns)), rng.uniform(0.0, 6.0, (2, columns))
    size = rng.uniform(5.0, 80.0, (2, columns))
    return t, sum(size[i] * np.sin(2 * np.pi * hz[i] * t[:, None] + phase[i]) for i in range(2))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.permutations(range(3)))
def test_a_permutation_is_found_and_undone(seed, order):
    _, reference = signals(seed)
    measured = reference[:, order] + 7.0
    odd = matching.odd_columns(reference, measured, 0.2, matching.LENGTH_FACTORS)
    assert {each.column: each.other for each in odd} == {
        column: other for column, other in enumerate(order) if column != other
    }
    assert np.allclose(matching.corrected(measured, odd), reference + 7.0)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.integers(0, 2), st.sampled_from([1e-3, 1e3, 1 / 25.4, 25.4, -1.0, -1e-3]))
def test_a_factor_is_found_and_undone(seed, column, factor):
    _, reference = signals(seed)
    measured = reference * np.where(np.arange(3) == column, factor, 1.0)
    (odd,) = matching.odd_columns(reference, measured, 0.2, matching.LENGTH_FACTORS)
    assert (odd.column, odd.other) == (column, column)
    assert odd.kind == ("sign" if factor == -1.0 else "unit")
    assert odd.factor == pytest.approx(factor)
    assert np.allclose(matching.corrected(measured, [odd]), reference)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.floats(0.0, 0.2))
def test_noise_and_lag_make_no_odd_column(seed, share):
    t, reference = signals(seed)
    late = matching.at(t - 0.05, t, reference)
    noise = np.random.default_rng(seed).normal(0.0, share, reference.shape) * reference.std(axis=0)
    assert matching.odd_columns(reference, late + noise, 0.2, matching.LENGTH_FACTORS) == []


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.floats(-4.0, 4.0))
def test_the_shift_is_found_through_units_and_frames(seed, seconds):
    t, reference = signals(seed)
    turn = Rotation.random(random_state=seed % 1000).as_matrix()
    measured = np.stack([np.interp(t - seconds, t, column) for column in reference.T], axis=1)
    inside = (t - seconds >= 0.0) & (t - seconds <= t[-1])
    measured = (measured @ turn.T) * [1.0, 1e-3, 1.0] + 400.0
    shift = matching.best_shift(t, reference, t[inside], measured[inside], 6.0)
    assert shift.seconds == pytest.approx(seconds, abs=0.002)
    assert shift.share > 0.999


def test_of_equal_shifts_the_smallest_is_taken():
    t = np.arange(0.0, 20.0, 0.02)
    reference = np.stack([30.0 * np.sin(np.pi * t), 20.0 * np.cos(np.pi * t), 0.0 * t], axis=1)  # period 2 s
    measured = np.stack([np.interp(t - 0.6, t, column) for column in reference.T], axis=1)
    assert abs(matching.best_shift(t, reference, t[40:], measured[40:], 6.0).seconds) < 1.1


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 10**6))
def test_the_rotation_is_that_of_another_library(seed):
    _, reference = signals(seed)
    turn = Rotation.random(random_state=seed % 5000)
    rng = np.random.default_rng(seed)
    measured = rng.normal(turn.apply(reference) + np.array([900.0, -20.0, 5.0]), 0.5)
    rotation, shift = matching.rotation_between(reference, measured)
    oracle, _ = Rotation.align_vectors(measured - measured.mean(axis=0), reference - reference.mean(axis=0))
    assert np.allclose(rotation, oracle.as_matrix(), atol=1e-9)
    assert np.allclose(reference.mean(axis=0) @ rotation.T + shift, measured.mean(axis=0))


def test_a_mirror_is_no_rotation():
    _, reference = signals(3)
    rotation, _ = matching.rotation_between(reference, reference * [1, 1, -1])
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    assert not matching.agree(reference @ rotation.T, reference * [1, 1, -1], 0.15)


def test_explained_share_is_r_squared():
    _, reference = signals(8)
    rng = np.random.default_rng(1)
    noise = rng.normal(0.0, 20.0, reference.shape)
    measured = reference @ rng.normal(size=(3, 3)) + noise
    columns = np.column_stack([reference, np.ones(len(reference))])
    rest = measured - columns @ np.linalg.lstsq(columns, measured, rcond=None)[0]
    expected = 1.0 - rest.var(axis=0).sum() / measured.var(axis=0).sum()
    assert matching.explained(reference, measured) == pytest.approx(expected, rel=1e-9)
    assert matching.explained(reference, np.ones_like(reference)) == 0.0


def test_the_course_has_speed_and_direction():
    t = np.arange(0.0, 10.0, 0.01)
    position = np.stack([3.0 * t, 4.0 * t, 0 * t], axis=1)
    course = matching.course(t, position, 100)
    assert np.allclose(course.speed, 5.0)
    assert np.allclose(course.direction, [0.6, 0.8, 0.0])
    assert 50 <= len(course.position) <= 100


def test_nearest_against_every_distance():
    rng = np.random.default_rng(2)
    points, others = rng.normal(size=(40, 3)), rng.normal(size=(70, 3))
    index, far = matching.nearest(points, others)
    every = np.linalg.norm(points[:, None] - others[None], axis=2)
    assert np.array_equal(index, every.argmin(axis=1))
    assert np.allclose(far, every.min(axis=1))


GENERATOR = np.random.default_rng(1)
REFERENCE = np.cumsum(GENERATOR.standard_normal((200, 3)), axis=0)
MEASURED = np.cumsum(GENERATOR.standard_normal((260, 2)), axis=0)


@pytest.mark.parametrize("every", [1, 3])
def test_shares_are_those_of_the_chosen_rows(every):
    inside = (np.arange(260) >= 30) & (np.arange(260) < 240)
    found = _shares(REFERENCE, MEASURED, inside, every, least=175)
    for step, share in enumerate(found):
        both = np.flatnonzero(inside[step : step + 200])
        if len(both) < 175:
            assert share == -1.0
            continue
        chosen = both[::every]
        assert share == pytest.approx(explained(REFERENCE[chosen], MEASURED[step + chosen]), abs=1e-9)
    assert np.any(found == -1.0)
    assert np.any(found > 0.0)


def test_what_stands_still_is_explained_by_nothing():
    still = np.zeros((260, 2))
    still[:100] = 0.3
    found = _shares(REFERENCE[:50], still, np.ones(260, dtype=bool), 1, least=10)
    assert found[0] == 0.0
    assert found[80] > 0.0
