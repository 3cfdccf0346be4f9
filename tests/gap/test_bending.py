"""A force that bends the arm is there; one that the sensor alone shows is the sensor's, noise or error."""

import numpy as np
import pytest

from gcode2krl.gap import diagnosis
from gcode2krl.gap.diagnosis import diagnose
from tests.gap.synthetic import bent, prediction, runs

pytestmark = pytest.mark.slow
SIGMA_N = 30.0


def wander(time_s, number):
    """Return a slow force (n, 3) in the cut, which forgets within a second, another one in each run."""
    generator = np.random.default_rng(50 + number)
    hats_s = np.arange(0.0, time_s[-1] + 1.0, 0.5)
    values = SIGMA_N * generator.standard_normal((len(hats_s), 3))
    return np.stack([np.interp(time_s, hats_s, column) for column in values.T], axis=1)


def added(*, bends):
    """Return what is added to the tables of a run: the force shows the wander, the tip where it bends."""

    def extra(name, values, stamps, signals, number):
        if name == "force_N":
            return values + wander(stamps, number)
        if name != "position_mm" or not bends:
            return values
        return bent(values, stamps, signals, wander(signals.time_s, number))

    return extra


@pytest.fixture(scope="module", params=[True, False], ids=["a force", "the sensor"])
def case(request):
    gains = []
    with pytest.MonkeyPatch.context() as patch:
        followed = diagnosis._followed

        def kept(*given):
            gains.append(followed(*given))
            return gains[-1]

        patch.setattr(diagnosis, "_followed", kept)
        gap = diagnose(prediction(), runs([], extra=added(bends=request.param)))
    return request.param, gap, gains


def link(gap, name):
    return next(each for each in gap.links if each.link == name)


def test_the_tip_does_what_a_force_says_and_nothing_of_what_its_sensor_says(case):
    bends, _, gains = case
    assert gains, "the slow part of the noise was not asked about"
    gain, nats, _ = max(gains, key=lambda each: each[1])
    assert gain == pytest.approx(1.0, abs=0.3) if bends else abs(gain) < 0.3
    assert (nats > 100.0) == bends


def test_slow_noise_that_bends_the_arm_is_no_noise(case):
    bends, gap, _ = case
    assert (link(gap, "force").floor < SIGMA_N) == bends
    assert link(gap, "force").verdict == "unexplained"


def test_the_tip_is_not_told_of_what_is_the_forces_or_the_sensors(case):
    """The measured load explains the tip where it is a force, and is not taken where it is the sensor's."""
    _, gap, _ = case
    tip = link(gap, "mechanics")
    assert tip.rms_before == pytest.approx(tip.floor, rel=0.05)
