"""A tracker knows nothing of the cut: a tip that is louder there shakes, and that is no noise."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.gap.noise.source import noise_of
from gcode2krl.gap.posterior.examination import size_of_gap
from tests.gap.constructed import motion, noise, trace

SIGMA_MM = 0.02
SECONDS, STEP_S = 20.0, 0.01
COUNT = round(SECONDS / STEP_S)
INPUTS = motion(SECONDS, STEP_S)
CUTS = INPUTS.time_s > 0.4 * SECONDS
IN_CUT = replace(INPUTS, force_base_N=CUTS[:, None] * np.array([100.0, 0.0, 0.0]))


def gap_of(more):
    """Return the size of the gap of three runs; ``more`` (n,) is added along z."""
    traces = []
    for number in range(3):
        residual = noise(COUNT, number, SIGMA_MM, 3)
        residual[:, 2] += more(np.random.default_rng(number))
        traces.append(trace(residual, number=number, link="mechanics", inputs=IN_CUT))
    nothing = [np.zeros((3, COUNT, 0))] * 3
    return size_of_gap(traces, [()] * 3, noise_of(traces, nothing, [()] * 3), ())


def shakes(generator):
    """Around 25 Hz, as a robot that chatters: it looks like noise of that colour."""
    ringing = np.convolve(generator.standard_normal(COUNT), [0.5, 0.0, -0.5] * 3, mode="same")
    return CUTS * 2.0 * SIGMA_MM * ringing


def bursts(generator):
    """As loud, at times of their own."""
    loud = sum(np.abs(INPUTS.time_s - at) < 1.5 for at in generator.uniform(0.0, SECONDS, 4)) > 0
    return loud * 3.0 * SIGMA_MM * generator.standard_normal(COUNT)


def calm(generator):
    return np.zeros(COUNT)


@pytest.mark.parametrize(("more", "is_gap"), [(shakes, True), (bursts, False), (calm, False)])
def test_what_is_louder_in_the_cut_alone_is_a_gap(more, is_gap):
    assert gap_of(more).significant == is_gap


def test_what_is_loud_for_a_moment_alone_is_asked_about_and_no_gap_by_itself():
    """A burst of one instrument, or what another one tells of."""

    def burst(generator):
        return 8.0 * SIGMA_MM * (np.abs(INPUTS.time_s - 5.0) < 0.4) * generator.standard_normal(COUNT)

    size = gap_of(burst)
    assert size.is_loud
    assert not size.significant
    assert not gap_of(calm).is_loud
