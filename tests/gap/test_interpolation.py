"""Signals between samples, their last decimals and bands: against SciPy, NumPy and loops."""

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from gcode2krl.effects import simulate
from gcode2krl.gap.compare.interpolation import (
    Bands,
    LastPath,
    cubic,
    interpolate,
    linear,
    nearest_rows,
    resolution,
    step_of,
    values_of,
)
from tests.gap.constructed import applied, joints, motion, wave

# Signals between samples: against SciPy's Hermite cubics, NumPy's lines and a loop

GENERATOR = np.random.default_rng(1)
OWN_S = np.cumsum(GENERATOR.uniform(0.005, 0.02, 60))
VALUES = GENERATOR.standard_normal((60, 3))
INSIDE_S = GENERATOR.uniform(OWN_S[0], OWN_S[-1], 400)


def test_cubics_are_hermite_with_central_slopes():
    expected = CubicHermiteSpline(OWN_S, VALUES, np.gradient(VALUES, OWN_S, axis=0))(INSIDE_S)
    np.testing.assert_allclose(cubic(INSIDE_S, OWN_S, VALUES), expected, atol=1e-12)


def test_lines_are_lines():
    expected = np.stack([np.interp(INSIDE_S, OWN_S, column) for column in VALUES.T], axis=1)
    np.testing.assert_allclose(linear(INSIDE_S, OWN_S, VALUES), expected, atol=1e-12)


@pytest.mark.parametrize("between", [cubic, linear])
def test_samples_are_met_and_ends_held(between):
    np.testing.assert_allclose(between(OWN_S, OWN_S, VALUES), VALUES, atol=1e-12)
    beyond = between(np.array([OWN_S[0] - 5.0, OWN_S[-1] + 5.0]), OWN_S, VALUES)
    np.testing.assert_allclose(beyond, VALUES[[0, -1]], atol=1e-12)


def test_a_cubic_is_right_between_samples_of_a_smooth_path_where_a_line_is_not():
    inputs = motion()
    times_s = inputs.time_s[1:-2] + 0.01
    exact = joints(times_s)
    assert np.abs(cubic(times_s, inputs.time_s, inputs.q_cmd_rad) - exact)[5:-5].max() < 1e-6
    assert np.abs(linear(times_s, inputs.time_s, inputs.q_cmd_rad) - exact).max() > 2e-5


def test_the_nearest_row_is_that_of_a_loop():
    times_s = np.concatenate([INSIDE_S, [OWN_S[0] - 1.0, OWN_S[-1] + 1.0], OWN_S])
    expected = [int(np.argmin(np.abs(OWN_S - time_s))) for time_s in times_s]
    np.testing.assert_array_equal(nearest_rows(OWN_S, times_s), expected)


def test_the_path_in_a_signal_goes_by_cubics_and_what_deviates_by_lines():
    inputs = motion()
    jagged = wave(12.0)
    signals = simulate(inputs, [applied(jagged, 0.01)])
    times_s = inputs.time_s[5:-5] + 0.007
    added = np.interp(times_s, inputs.time_s, 0.01 * jagged.form(inputs.time_s))
    expected = joints(times_s)
    expected[:, 0] += added
    np.testing.assert_allclose(interpolate(signals, "q_act_rad", times_s), expected, atol=1e-6)
    force = interpolate(signals, "force_meas_base_N", times_s)
    assert force.shape == (len(times_s), 3)


def test_a_path_is_kept_for_its_times_alone():
    """Every later call gets what a first one would, with the same times, others and another path."""
    inputs = motion()
    signals = simulate(inputs, [applied(wave(12.0), 0.01)])
    last, times_s = LastPath(), inputs.time_s[5:-5] + 0.007
    for each in (times_s, times_s.copy(), times_s + 0.003, times_s):
        expected = interpolate(signals, "q_act_rad", each)
        np.testing.assert_array_equal(interpolate(signals, "q_act_rad", each, last), expected)
    kept = last.at(times_s, inputs.time_s, inputs.q_cmd_rad)
    assert last.at(times_s.copy(), inputs.time_s, inputs.q_cmd_rad) is kept
    assert last.at(times_s, inputs.time_s, inputs.q_cmd_rad + 0.1) is not kept


def test_measured_joints_stand_for_those_of_the_model():
    from dataclasses import replace

    inputs = motion()
    measured = inputs.q_cmd_rad + 0.5
    signals = simulate(replace(inputs, q_act_rad=measured))
    assert values_of(signals, "q_act_rad") is measured
    assert values_of(signals, "q_cmd_rad") is inputs.q_cmd_rad


# The power in a band of a spectrum is that of sums over values at any times, wave by wave


@pytest.mark.parametrize("count", [1, 2, 7, 40, 101])
@pytest.mark.parametrize("first_hz", [0.0, 49.7])
def test_sums_are_those_of_each_wave(count, first_hz):
    generator = np.random.default_rng(1)
    time_s = np.sort(generator.uniform(0.0, 20.0, 300))
    values = generator.normal(size=(300, 3))
    bands = Bands(time_s, 0.013, count)
    waves = np.exp(-2j * np.pi * bands.hz(first_hz)[:, None] * time_s)
    assert bands.power(first_hz, values) == pytest.approx(np.abs(waves @ values) ** 2, rel=1e-9)


# The rms of rounding, told from the values themselves


@pytest.mark.parametrize("step", [0.5, 0.01, 1e-5])
def test_rounding_has_the_rms_of_a_uniform_draw(step):
    exact = np.random.default_rng(8).uniform(-200.0 * step, 200.0 * step, 20_000)
    rounded = np.round(exact / step) * step
    assert resolution(rounded) == pytest.approx(step / np.sqrt(12.0), rel=1e-6)
    assert resolution(rounded) == pytest.approx(float(np.std(rounded - exact)), rel=0.02)


def test_a_constant_has_no_last_decimal():
    assert resolution(np.full(50, 3.0)) == 0.0


def test_few_values_are_on_a_ladder_or_on_none():
    values = np.random.default_rng(0).uniform(-500.0, 500.0, 12)
    assert step_of(20.0 * np.round(values / 20.0)) == pytest.approx(20.0)
    assert step_of(np.array([0.37, 20.37, 0.37])) == pytest.approx(20.0)
    assert step_of(np.round(values, 2)) == pytest.approx(0.01)
    assert step_of(values) < 1e-6
