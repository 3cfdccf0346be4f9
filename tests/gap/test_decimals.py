"""The rms of rounding, told from the values themselves."""

import numpy as np
import pytest

from gcode2krl.gap.compare.interpolation import resolution, step_of


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
