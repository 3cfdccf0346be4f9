"""What a family shows in a program before it has run, beside what it was made of."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.effects.dependence import Dependence
from gcode2krl.gap.posterior.judgement import judge
from gcode2krl.gap.posterior.next_run import Foretold, foretold_of
from tests.gap import constructed as c

SIGMA = 1e-4
TIME_S = c.motion().time_s


def evidence(on, form, runs=2):
    """Return what a family says of servo traces of A1 that have a form (n,) of run number and time."""
    traces = [
        c.trace(
            SIGMA * form(number, TIME_S)[:, None] + c.noise(500, number, SIGMA),
            number=number,
            declared_sigma=SIGMA,
        )
        for number in range(runs)
    ]
    found = judge(c.LINK["servo"], traces, [], c.question([]))
    return next(each for each in found.rest.study.evidences if each.on is on), found.every


def trial(hours=1.0, times=1.0):
    """Return a trace of the same way at another speed, in which nothing has been measured yet."""
    own = c.motion()
    inputs = replace(own, time_s=own.time_s * times, hours=hours)
    return replace(c.trace(np.zeros((500, 1)), inputs=inputs), time_s=inputs.time_s, run="trial")


def rate(inputs):
    return np.gradient(inputs.q_cmd_rad[:, 0], inputs.time_s)


def test_a_function_of_velocity_is_foretold_at_other_speeds():
    most = np.abs(rate(c.motion())).max()
    own, traces = evidence(Dependence.VELOCITY, lambda run, t: 20.0 * rate(c.motion()) / most)
    slow = trial(times=2.0)
    told = foretold_of(own, traces, slow, [SIGMA])
    assert not told.is_open
    assert told.mean[:, 0] == pytest.approx(20.0 * SIGMA * rate(slow.inputs) / most, abs=1.5 * SIGMA)


def test_a_step_has_happened_in_every_later_run():
    own, traces = evidence(Dependence.RUN_TIME_STEP, lambda run, t: 6.0 * ((t > 6.2) | (run > 0)))
    told = foretold_of(own, traces, trial(), [SIGMA])
    assert not told.is_open
    assert told.mean[:, 0] == pytest.approx(np.full(500, 6.0 * SIGMA), rel=0.1)


@pytest.mark.parametrize(
    ("on", "form"),
    [
        (Dependence.TONE, lambda run, t: 5.0 * np.sin(2.0 * np.pi * 5.3 * t + run)),
        (Dependence.RUN_TIME, lambda run, t: (6.0 if run else -6.0) * np.sin(t / 2.0)),
    ],
)
def test_what_each_run_has_of_its_own_is_open_and_within_what_was_seen(on, form):
    own, traces = evidence(on, form)
    told = foretold_of(own, traces, trial(), [SIGMA])
    assert told.is_open
    assert np.abs(told.mean).max() < 0.5 * SIGMA
    assert 2.0 * SIGMA < max(told.value(row, 0, False) for row in range(0, 500, 10)) < 40.0 * SIGMA
    ways = told.ways()
    assert len(ways) == 4
    assert ways[0].mean == pytest.approx(-ways[1].mean, abs=0.5 * SIGMA)


def test_what_has_no_numbers_is_what_it_is():
    fixed = Foretold(np.ones((5, 2)), np.zeros((2, 5, 0)), np.zeros((0, 0)))
    assert fixed.ways() == [fixed]
    assert fixed.value(3, 1, False) == 1.0
    assert fixed.value(3, 1, True) == 0.0
