"""What the data could have shown: the smallest size by hand, and that such a size is found."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.effects import Parameter, Role, library
from gcode2krl.gap.posterior.examination import observable
from gcode2krl.gap.posterior.selection import threshold
from tests.gap.constructed import examined, motion, noise, question, trace, wave

COUNT, SIGMA = 500, 1e-4
LEAST_RATIO = 0.08
"""Least effect in units of the noise (docs/thresholds.md)."""
TIME_S = motion().time_s
EFFECTS = [wave(2.0), wave(3.0), wave(5.0)]
POWER = COUNT / 2.0 / SIGMA**2
"""Of a sine of size 1 over whole turns, in units of the noise's variance."""


def entries(y=None, effects=EFFECTS, sigma=SIGMA):
    data = noise(COUNT, 1, sigma)[:, 0] if y is None else y
    return {each["effect"]: each for each in observable(examined([trace(data[:, None])], effects, sigma))}


def test_the_smallest_size_is_that_whose_gain_is_the_threshold():
    """chi2 falls by size²·power; it must fall by twice the level, and by a share of the noise's own."""
    needed = max(2.0 * threshold(3), LEAST_RATIO**2 * COUNT)
    for entry in entries().values():
        assert entry["smallest"] == pytest.approx(np.sqrt(needed / POWER), rel=1e-3)
        assert (entry["link"], entry["target"], entry["parameter"]) == ("servo", "A1", "size_rad")
        assert entry["seen"] is True


def test_less_noise_shows_less():
    assert entries(sigma=SIGMA / 5.0)["wave_2"]["smallest"] == pytest.approx(
        entries()["wave_2"]["smallest"] / 5.0, rel=1e-3
    )


@pytest.mark.parametrize(("factor", "least", "most"), [(0.5, 0, 2), (2.0, 12, 12)])
def test_twice_the_smallest_is_found_and_half_of_it_is_not(factor, least, most):
    smallest, form = entries()["wave_2"]["smallest"], EFFECTS[0].form(TIME_S)
    data = [trace((factor * smallest * form)[:, None] + noise(COUNT, seed, SIGMA)) for seed in range(2, 14)]
    assert least <= sum(bool(examined([one], EFFECTS, SIGMA).applied) for one in data) <= most


def test_what_mismatch_could_do_is_not_seen():
    """A lag of half a millisecond is usual; beside little noise all of a lag is hidden by it."""
    lag = library()["servo_lag"]
    asked = replace(question([lag, EFFECTS[1]]), library={"servo_lag": lag})
    made = examined([trace(noise(COUNT, 3, 1e-6))], asked, 1e-6)
    found = {each["effect"]: each["seen"] for each in observable(made)}
    assert found == {"servo_lag": False, "wave_3": True}


class Turns(type(EFFECTS[0])):
    """A wave with a grid of frequencies of which the higher one is ten times weaker."""

    def __init__(self):
        super().__init__("turns", np.sin)
        turns = Parameter("turns", "1/s", 1.0, 9.0, nominal=None, start=2.0, grid=(3.0, 2.0), source="a test")
        self.parameters = (*self.parameters, turns)

    def servo(self, q_act_rad, inputs, applied):
        q, turns = np.array(q_act_rad), applied["turns"]
        weight = 1.0 if turns == 2.0 else 0.1
        q[:, 0] += applied["size_rad"] * weight * np.sin(2.0 * np.pi * turns * inputs.time_s)
        return q


def test_of_several_shapes_the_one_that_shows_best_is_said():
    """Two blocks, so that the level is that of two."""
    entry = entries(effects=[Turns()])["turns"]
    assert entry["smallest"] == pytest.approx(np.sqrt(2.0 * threshold(2) / POWER), rel=1e-3)


def test_an_effect_of_several_numbers_has_no_smallest_one():
    pair = Turns()
    pair.parameters = tuple(
        replace(p, name=n, nominal=0.0, role=Role.SIZE)
        for p, n in zip(pair.parameters, ("size_rad", "turns"), strict=True)
    )
    assert "turns" not in entries(effects=[pair, *EFFECTS])
