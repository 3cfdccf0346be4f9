"""Pulses: hardly ever in noise of any kind, and found to the row where there is one."""

import numpy as np
import pytest

from gcode2krl.gap.compare.events import pulse_rows
from gcode2krl.gap.noise.short import Noise, Slow, drawn_noise

SECONDS = 15.0
STATED = 0.01
"""Of runs with a pulse by chance: what the threshold's reason says, with room for its own chance."""


def of(values, step_s, least=0.0):
    time_s = step_s * np.arange(len(values))
    return pulse_rows(time_s, values[:, None], np.array([least]))


def drawn(kind, count, step_s, generator):
    short = drawn_noise(Noise(np.array([0.5, 0.0, 0.0]), 1.0, 1.15), count, generator)
    if kind == "slow":
        return short + drawn_noise(
            Noise(np.zeros(3), 1e-9, 1e-9, (Slow(np.exp(-step_s / 0.3), 2.0),)), count, generator
        )
    if kind == "heavy tails":
        return short + 1.5 * generator.standard_t(3.0, count) / np.sqrt(3.0)
    if kind == "bursts":
        for at_s in generator.uniform(0.0, SECONDS, 5):
            loud = np.exp(-0.5 * ((step_s * np.arange(count) - at_s) / 0.15) ** 2)
            short = short + 4.0 * loud * generator.standard_normal(count)
    return np.round(short) if kind == "decimals" else short


@pytest.mark.parametrize("kind", ["short", "slow", "heavy tails", "bursts", "decimals"])
def test_noise_of_any_kind_hardly_ever_has_one(kind):
    draws, alarms = 60, 0
    for seed in range(draws):
        step_s = (0.004, 0.012)[seed % 2]
        values = drawn(kind, round(SECONDS / step_s), step_s, np.random.default_rng(seed))
        alarms += bool(of(values, step_s, 0.3 if kind == "decimals" else 0.0).any())
    # five kinds: three hundred draws; one each is the most that one in a hundred makes likely
    assert alarms <= 1 + STATED * draws


@pytest.mark.parametrize(
    ("step_s", "lasts_s", "height"),
    [(0.004, 0.03, 40.0), (0.004, 0.06, 40.0), (0.008, 0.06, 40.0), (0.008, 0.03, 150.0)],
)
def test_a_blow_is_found_where_it_is(step_s, lasts_s, height):
    time_s = step_s * np.arange(round(SECONDS / step_s))
    for seed in range(10):
        values = drawn("short", len(time_s), step_s, np.random.default_rng(seed))
        since = (time_s - 7.3) / lasts_s
        values += height * np.where((since > 0.0) & (since < 1.0), np.sin(np.pi * since), 0.0)
        found = time_s[of(values, step_s)]
        assert len(found)
        assert 7.3 - step_s < found.mean() < 7.3 + lasts_s + step_s
        assert found.max() - found.min() < lasts_s + 0.1  # the widest that is looked for


def test_a_step_is_none():
    values = drawn("short", 3000, 0.004, np.random.default_rng(1))
    values[1500:] += 60.0
    assert not of(values, 0.004).any()
