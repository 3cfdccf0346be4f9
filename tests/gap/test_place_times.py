"""Times at which places are reached: ways by hand, and a time law that comes back."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.effects import Parameter
from gcode2krl.gap.compare.clocks import gone
from gcode2krl.gap.posterior.examination import PlaceTimes
from tests.gap.constructed import Added, Impossible, applied, joints, motion, trace


class Slower(Added):
    """The same path in (1 + share) of the time."""

    def __init__(self):
        super().__init__("slower", np.sin)
        shape = {"nominal": 0.0, "start": 0.1, "source": "a test"}
        self.parameters = (Parameter("share", "", -0.5, 2.0, **shape),)

    def replan(self, inputs, applied):
        return replace(inputs, time_s=inputs.time_s * (1.0 + applied["share"]))


SLOWER = Slower()


def run(share, clock_s=0.0, noise_rad=0.0):
    """Return the path of a run that takes longer by a share, on a clock of its own."""
    inputs = motion()
    time_s = np.arange(0.0, inputs.time_s[-1] * (1.0 + share), 0.012)
    q_rad = joints(time_s / (1.0 + share)) + noise_rad * np.random.default_rng(1).standard_normal(
        (len(time_s), 6)
    )
    stamps = {"time_s": time_s + clock_s, "segments": np.array([[0, len(time_s)]])}
    return replace(trace(np.zeros((500, 6)), "path"), measured=q_rad, **stamps)


def test_the_way_along_a_circle_is_its_arc():
    t = np.linspace(0.0, 2.0, 2001)
    time_s, way = gone(t, np.stack([np.cos(t), np.sin(t)], axis=1), 0.0)
    np.testing.assert_allclose(way, t, atol=1e-6)
    assert (time_s == t).all()


def test_ways_too_short_are_added_up_and_counted_together():
    t = np.arange(11.0)
    time_s, way = gone(t, 0.2 * t[:, None], 0.5)
    np.testing.assert_array_equal(time_s, [0, 3, 6, 9])  # each 0.6 from the one before
    np.testing.assert_allclose(way, [0.0, 0.6, 1.2, 1.8])


def test_standing_in_noise_is_no_way():
    t = np.arange(500.0)
    noisy = np.random.default_rng(2).uniform(-0.1, 0.1, (500, 2))
    assert gone(t, noisy, 0.0)[1][-1] > 10.0
    assert gone(t, noisy, 0.5)[1][-1] == 0.0


def test_a_run_as_planned_is_not_late_whatever_its_clock_says():
    times = PlaceTimes([run(0.0, clock_s=3.0)])
    assert times.size(()) < 2e-4


@pytest.mark.parametrize("share", [0.2, -0.1])
def test_lateness_grows_with_the_time_at_which_a_place_is_reached(share):
    """Of places evenly along the way, each is late by share·t; the mean is the clock's."""
    times = PlaceTimes([run(share)])
    inputs = motion()
    way = gone(inputs.time_s, inputs.q_cmd_rad, 0.0)[1]
    places = way[-1] * (np.arange(400) + 0.5) / 400
    t = np.interp(places, way, inputs.time_s)
    np.testing.assert_allclose(times.late(()), share * (t - t.mean()), atol=5e-3)
    assert times.size([applied(SLOWER, share)]) < 2e-3


def test_numbers_of_a_time_law_are_found_from_far_away():
    times = PlaceTimes([run(0.35), run(0.35, clock_s=1.0)])
    found = times.fitted((), applied(SLOWER, 0.05))
    assert found.values["share"] == pytest.approx(0.35, abs=2e-3)


def test_noise_at_the_bound_of_the_instrument_hardly_moves_them():
    times = PlaceTimes([run(0.35, noise_rad=1e-5)])
    assert times.fitted((), applied(SLOWER, 0.05)).values["share"] == pytest.approx(0.35, abs=4e-3)


def test_what_cannot_be_planned_is_infinitely_late():
    class Unplannable(Impossible):
        def replan(self, inputs, applied):
            return self.servo(None, inputs, applied)

    assert PlaceTimes([run(0.0)]).size([applied(Unplannable("unplannable", np.sin), 1.0)]) == np.inf
