"""Signatures: columns against the formula of the effect, and back from coefficients to values."""

import numpy as np
import pytest

from gcode2krl.effects import library
from gcode2krl.gap.components import Block, Signatures, blocks_of, strongest_hz
from tests.gap.constructed import Added, Impossible, joints, trace

LIBRARY = library()
GEAR = trace(np.zeros((500, 6)), "gear")
TIP = trace(np.zeros((500, 3)), "mechanics")


def only(effect, target, **shape):
    return next(b for b in blocks_of(LIBRARY[effect], target) if b.shape == shape)


def test_the_strongest_tones_come_first_and_no_neighbour_twice():
    t = np.arange(0.0, 40.0, 0.01)
    generator = np.random.default_rng(1)
    tones = {7.0: 0.5, 12.5: 1.0, 21.0: 0.3}
    signal = sum(size * np.sin(2.0 * np.pi * hz * t + hz) for hz, size in tones.items())
    signals = [np.stack([signal, 0.5 * signal], axis=1) + generator.normal(0, 0.3, (len(t), 2)) for _ in "ab"]
    found = strongest_hz(signals, 0.01, 3.0, 40.0, 3)
    np.testing.assert_allclose(found, [12.5, 7.0, 21.0], atol=0.3)
    assert strongest_hz(signals, 0.01, 15.0, 40.0, 1)[0] == pytest.approx(21.0, abs=0.3)


@pytest.mark.parametrize("hz", [5.03, 8.31, 17.77])
def test_a_steady_tone_s_frequency_is_met_between_the_lines_of_the_spectrum(hz):
    """At 1.1 times the noise in three runs of 15 s: to a fifth of the 0.07 Hz that their lines are apart."""
    t = np.arange(0.0, 15.0, 0.01)
    generator = np.random.default_rng(3)
    runs = [
        1.1 * np.sqrt(2.0) * np.sin(2.0 * np.pi * hz * t + phase)[:, None]
        + generator.normal(0, 1, (len(t), 1))
        for phase in (0.0, 1.0, 4.0)
    ]
    assert strongest_hz(runs, 0.01, 3.0, 40.0, 1)[0] == pytest.approx(hz, abs=0.015)


def test_a_sine_of_the_motors_angle_has_the_columns_sine_and_cosine():
    block = only("transmission", "A2", harmonic=2.0)
    columns = Signatures().columns(block, GEAR)
    ratio = GEAR.inputs.cell.robot.drives.gear_ratio[1]
    turn = 2.0 * ratio * joints(GEAR.time_s)[:, 1]
    size = np.radians(0.004)
    np.testing.assert_allclose(columns[1, :, 0], size * np.sin(turn), atol=1e-12)
    np.testing.assert_allclose(columns[1, :, 1], size * np.cos(turn), atol=1e-12)
    assert not columns[[0, 2, 3, 4, 5]].any()


def test_a_direction_has_a_column_along_each_axis():
    columns = Signatures().columns(only("thermal", None, time_constant_h=0.3), TIP)
    grown = 0.2 * 0.3 * (1.0 - np.exp(-TIP.time_s / 3600.0 / 0.3))
    for i in range(3):
        for j in range(3):
            np.testing.assert_allclose(columns[i, :, j], grown if i == j else 0.0 * grown, atol=1e-9)


@pytest.mark.parametrize(
    ("block", "one", "coefficients"),
    [
        (only("transmission", "A2", harmonic=1.0), GEAR, [0.6, -1.1]),
        (only("thermal", None, time_constant_h=1.0), TIP, [1.0, -2.0, 0.5]),
        (only("base_frame", None), TIP, [0.01, 0.02, -0.03, 0.01, 0.0, 0.02]),
    ],
    ids=["phase", "direction", "frame"],
)
def test_an_effect_is_the_combination_of_its_columns(block, one, coefficients):
    columns = Signatures().columns(block, one)
    made = one.sample([block.applied(np.array(coefficients), one)]) - one.nominal
    expected = np.einsum("knc,c->nk", columns, coefficients)
    np.testing.assert_allclose(made, expected, atol=2e-3 * np.abs(expected).max())


def test_coefficients_are_bounded_by_the_plausible_range_over_the_typical_size():
    for block, one, low, high in (
        (only("servo_lag", "A1"), GEAR, [0.0], [10.0]),  # 0 to 0.1 s, typically 0.01 s
        (only("transmission", "A2", harmonic=1.0), GEAR, [-5.0] * 2, [5.0] * 2),  # to 0.02, typically 0.004
        (only("thermal", None, time_constant_h=1.0), TIP, [-10.0] * 3, [10.0] * 3),  # to 2, typically 0.2
    ):
        found = block.bounds(one)
        np.testing.assert_allclose(found[0], low, atol=1e-12)
        np.testing.assert_allclose(found[1], high)


def test_a_scale_is_nominal_at_one():
    low, high = only("stiffness", "A1").bounds(TIP)
    scale = LIBRARY["stiffness"].parameter("scale")
    nominal, start = scale.nominal, scale.start
    ends = sorted([(scale.low - nominal) / (start - nominal), (scale.high - nominal) / (start - nominal)])
    np.testing.assert_allclose([low[0], high[0]], ends)


def test_columns_of_another_size_are_those_of_the_effect_at_that_size():
    """A play of a twentieth of the typical gap: at most half of it to either side."""
    columns = Signatures().columns(only("backlash", "A3"), GEAR, 0.05)
    assert np.abs(columns[2]).max() == pytest.approx(np.radians(0.01 * 0.05) / 2.0)


def test_each_column_is_simulated_once_and_kept_for_moved_stamps():
    calls = []

    def form(time_s):
        calls.append(1)
        return np.ones_like(time_s)

    one, known = trace(np.zeros((100, 1))), Signatures()
    block = Block(Added("counted", form), "A1")
    known.columns(block, one)
    before = len(calls)
    other = trace(np.zeros((100, 1)), time_s=one.time_s + 1e-3)
    known.same(one, other)
    assert known.columns(block, one) is known.columns(block, other)
    assert len(calls) == before > 0


def test_what_cannot_be_simulated_has_no_columns():
    block = Block(Impossible("impossible", np.sin), "A1")
    assert Signatures().columns(block, trace(np.zeros((100, 1)))).shape == (1, 100, 0)
