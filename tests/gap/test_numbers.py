"""The numbers that a fit moves: from an effect to numbers and back, their ranges, what they cost."""

import math

import numpy as np
import pytest

from gcode2krl.effects import Applied, library
from gcode2krl.gap.posterior.least_squares import Fitted, Numbers, free_of
from tests.gap.constructed import trace

LIBRARY = library()
PRIOR = 3.0
"""A size is expected within so many typical ones."""
GEAR = trace(np.zeros((50, 6)), "gear")


def applied(name, target=None, **values):
    return Applied(LIBRARY[name], target, values)


LAG = applied("servo_lag", "A3", tau_s=0.012)
SWING = applied("transmission", "A2", amplitude_deg=0.006, harmonic=2.0, phase=2.0)
DRIFT = applied(
    "thermal", mm_per_h=0.5, time_constant_h=0.8, direction_x=0.6, direction_y=0.0, direction_z=-0.8
)
FRAME = applied("base_frame", x_mm=0.1, y_mm=-0.2, z_mm=0.3, a_deg=0.01, b_deg=0.0, c_deg=-0.02)


@pytest.mark.parametrize("one", [LAG, SWING, DRIFT, FRAME], ids=lambda one: one.effect.name)
def test_there_and_back(one):
    free = free_of(one, GEAR)
    again = free.applied(free.start(one))
    assert (again.effect, again.target) == (one.effect, one.target)
    assert again.values.keys() == one.values.keys()
    for name, value in one.values.items():
        assert again.values[name] == pytest.approx(value, abs=1e-12)


def test_a_sine_is_two_amplitudes_and_its_count_stands():
    free = free_of(SWING, GEAR)
    a, b = 0.006 * math.cos(2.0), 0.006 * math.sin(2.0)
    assert sorted(free.start(SWING)) == pytest.approx(sorted([a, b]))
    assert len(free.names) == 2
    np.testing.assert_allclose(free.low, -0.02)
    np.testing.assert_allclose(free.high, 0.02)
    turned = free.applied(-free.start(SWING)).values  # the other way: half a turn on
    assert turned["phase"] == pytest.approx(2.0 + math.pi)
    assert (turned["amplitude_deg"], turned["harmonic"]) == (pytest.approx(0.006), 2.0)


def test_a_direction_is_a_vector_of_its_size():
    free = free_of(DRIFT, GEAR)
    start = dict(zip(free.names, free.start(DRIFT), strict=True))
    assert start["direction_x"] == pytest.approx(0.3)
    assert start["direction_z"] == pytest.approx(-0.4)
    assert start["time_constant_h"] == pytest.approx(0.8)
    doubled = np.array([2.0 * v if name.startswith("direction") else v for name, v in start.items()])
    values = free.applied(doubled).values
    assert values["mm_per_h"] == pytest.approx(1.0)
    assert [values[f"direction_{axis}"] for axis in "xyz"] == pytest.approx([0.6, 0.0, -0.8])
    at = free.names.index("direction_x")
    assert (free.low[at], free.high[at]) == (-2.0, 2.0)  # either way along an axis
    nothing = free.applied(np.where([n.startswith("direction") for n in free.names], 0.0, free.start(DRIFT)))
    assert nothing.values["mm_per_h"] == 0.0


def test_a_start_outside_its_range_is_brought_into_it():
    free = free_of(LAG, GEAR)
    assert free.start(applied("servo_lag", "A3", tau_s=7.0)).tolist() == [0.1]
    assert free.start(applied("servo_lag", "A3", tau_s=-1.0)).tolist() == [0.0]


def test_the_scale_of_a_number_is_how_far_the_typical_value_is_from_nominal():
    assert free_of(LAG, GEAR).scale.tolist() == [0.01]
    scale = LIBRARY["stiffness"].parameter("scale")
    free = free_of(applied("stiffness", "A1", scale=0.7), GEAR)
    assert free.scale[0] == pytest.approx(abs(scale.start - scale.nominal))


def test_a_size_at_an_end_of_its_range_is_at_a_bound_and_a_shape_is_not():
    lag = free_of(LAG, GEAR)
    assert lag.at_bound(np.array([0.1]))
    assert lag.at_bound(np.array([0.1 - 0.5e-4]))  # a thousandth of the range
    assert not lag.at_bound(np.array([0.1 - 2e-4]))
    assert lag.at_bound(np.array([0.0]))
    drift = free_of(DRIFT, GEAR)
    x = drift.start(DRIFT)
    x[drift.names.index("time_constant_h")] = 5.0
    assert not drift.at_bound(x)


def test_of_a_positive_range_the_ends_are_near_by_ratios():
    """Two seconds are four times the least time constant, and a two-thousandth of the longest."""
    growth = free_of(applied("spindle_growth", um_per_krpm=5.0, time_constant_s=2.0), GEAR)
    at = growth.names.index("time_constant_s")
    ends = {}
    for seconds in (0.5, 0.502, 2.0, 3590.0, 3600.0):
        x = growth.start(applied("spindle_growth", um_per_krpm=5.0, time_constant_s=2.0))
        x[at] = seconds
        ends[seconds] = bool(growth.shapes_at_end(x))
    assert ends == {0.5: True, 0.502: True, 2.0: False, 3590.0: True, 3600.0: True}


def fitted(*effects, information):
    numbers = Numbers.of(effects, GEAR)
    return Fitted(tuple(effects), 10.0, numbers, numbers.start(effects), np.asarray(information))


def test_numbers_cost_by_how_far_data_narrow_what_was_expected():
    """Laplace: twice the log of prior width over posterior width, and half a unit each."""
    information = np.diag([400.0, 0.0, 25.0])
    two = fitted(LAG, SWING, information=information)
    expected = sum(math.log(1.0 + PRIOR**2 * value) for value in (400.0, 0.0, 25.0)) + 3 * 0.5
    assert two.occam == pytest.approx(expected)
    blind = fitted(LAG, information=[[0.0]])
    assert blind.occam == pytest.approx(0.5)  # what data do not see costs next to nothing


def test_correlated_numbers_cost_by_their_determinant():
    information = np.array([[100.0, 99.0], [99.0, 100.0]])
    expected = math.log(np.linalg.det(np.eye(2) + PRIOR**2 * information)) + 2 * 0.5
    assert fitted(SWING, information=information).occam == pytest.approx(expected)


@pytest.mark.parametrize(("percent", "sign"), [(50.0, -1.0), (99.0, 1.0)])
def test_gross_slips_are_likely_and_slight_ones_are_not(percent, sign):
    """Twice log 100, for or against."""
    slip = applied("override", percent=percent)
    assert fitted(slip, information=[[0.0]]).occam == pytest.approx(0.5 + sign * 9.2)


def test_deviations_are_those_of_each_effects_own_numbers():
    scale = Numbers.of((LAG, SWING), GEAR).box.scale
    covariance = np.array([[4.0, 1.0, 0.0], [1.0, 9.0, 2.0], [0.0, 2.0, 16.0]])
    found = fitted(LAG, SWING, information=np.linalg.inv(covariance) * np.outer(scale, scale))
    np.testing.assert_allclose(found.covariance, covariance, atol=1e-9)
    assert found.deviations(0) == {"tau_s": pytest.approx(2.0)}
    assert sorted(found.deviations(1).values()) == pytest.approx([3.0, 4.0])


def test_numbers_of_several_effects_stand_one_effect_after_the_other():
    numbers = Numbers.of((SWING, LAG), GEAR)
    x = numbers.start((SWING, LAG))
    assert len(numbers) == len(x) == 3
    assert [list(range(3))[at] for at in numbers.slices] == [[0, 1], [2]]
    assert numbers.without((0,)).tolist() == [2]
    assert numbers.without(()).tolist() == [0, 1, 2]
    swing, lag = numbers.applied(x)
    assert lag == LAG
    assert swing.values == pytest.approx(SWING.values)
    assert numbers.at_bound(np.r_[x[:2], numbers.box.high[2]]) == (False, True)
