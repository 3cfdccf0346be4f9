"""How a deviation goes over its input: which input, in which unit, at which points."""

import numpy as np
import pytest

from gcode2krl.effects.dependence import Dependence
from gcode2krl.gap.answer.causes import course_of
from gcode2krl.gap.compare.inputs import Admissible
from tests.gap import constructed as c

TRACE = c.trace(np.zeros((500, 3)), "mechanics")
OWN = Admissible(TRACE)


@pytest.mark.parametrize(
    ("on", "joint", "over", "unit", "x"),
    [
        (Dependence.RUN_START, None, "time in the run", "s", OWN.since_start_s),
        (Dependence.PLACE, None, "place along y", "mm", OWN.position_mm[:, 1]),
        (Dependence.VELOCITY, None, "velocity along x", "mm/s", OWN.velocity_mm_s[:, 0]),
        (Dependence.OWN_ANGLE, 1, "angle of A2", "deg", np.degrees(OWN.q_rad[:, 1])),
        (Dependence.VELOCITY, 1, "velocity of A2", "deg/s", np.degrees(OWN.rate_rad_s[:, 1])),
    ],
)
def test_a_deviation_is_told_over_the_input_that_it_follows(on, joint, over, unit, x):
    """A straight line over the input stays one, at points within its range."""
    line = 0.01 + 0.2 * (x - x.min()) / np.ptp(x)
    told = course_of([TRACE], [line], on, joint, "mm")
    assert (told.over, told.over_unit, told.unit, told.run) == (over, unit, "mm", None)
    at, off = np.transpose(told.points)
    assert 2 <= len(at) <= 7
    assert np.all(np.diff(at) > 0.0)
    assert x.min() <= at[0] < at[-1] <= x.max()
    assert off == pytest.approx(0.01 + 0.2 * (at - x.min()) / np.ptp(x), abs=1e-9)


def test_what_each_run_has_of_its_own_is_told_of_the_run_that_is_off_most():
    t = OWN.since_start_s
    other = c.trace(np.zeros((500, 3)), "mechanics", 1)
    told = course_of([TRACE, other], [0.01 * t, -0.03 * t], Dependence.RUN_TIME, None, "mm")
    assert told.run == other.run
    assert told.points[-1][1] == pytest.approx(-0.03 * told.points[-1][0])


@pytest.mark.parametrize(
    "on", [Dependence.CONSTANT, Dependence.TONE, Dependence.RUN_TIME_STEP, Dependence.REVERSALS]
)
def test_what_is_no_function_of_an_input_has_no_course(on):
    assert course_of([TRACE], [np.ones(500)], on, 1, "mm") is None


def test_an_input_that_never_changes_has_no_course():
    assert course_of([TRACE], [np.ones(500)], Dependence.SPINDLE_SPEED, None, "mm") is None
