"""On what a gap without a name depends, as the answer states it."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.gap.answer.assembly import _dependences
from gcode2krl.gap.answer.causes import depends_on
from gcode2krl.gap.compare.trace import Event, Whose
from gcode2krl.gap.posterior.calibrated import family_features
from gcode2krl.gap.posterior.judgement import judge
from tests.gap import constructed as c

SIGMA = 1e-4
EFFECT = c.wave(2.0)


def servo(form, runs=2):
    """Return the judgement of servo traces of A1 with a form (n,) of run number and time, in sigmas."""
    t = c.motion().time_s
    traces = [
        c.trace(
            SIGMA * form(number, t)[:, None] + c.noise(500, number, SIGMA),
            number=number,
            declared_sigma=SIGMA,
        )
        for number in range(runs)
    ]
    return judge(c.LINK["servo"], traces, [], c.question([EFFECT]))


def test_a_step_has_its_run_moment_and_height():
    found = servo(lambda run, t: 3.0 * ((t > 6.2) | (run > 0)))
    assert found.verdict == "unexplained"
    best, _ = next(iter(depends_on(found)))
    assert (best.link, best.at, best.on, best.form) == ("servo", "A1", "time in the run", "step")
    assert best.run == "run-1"
    assert best.at_time_s == pytest.approx(6.2, abs=0.05)
    assert best.size == pytest.approx(3.0 * SIGMA, rel=0.1)
    assert best.probability > 0.5
    assert best.tests == family_features(found.rest, found.rest.study.evidences[0]).as_dict()
    assert best.share > 0.9
    assert best.direction is None


def test_impulses_of_a_link_make_its_family_no_less_sure():
    plain = servo(lambda run, t: 2.0 * np.sin(2.0 * np.pi * 5.3 * t))
    hit = Event("servo", "run-1", Whose.IMPULSE, (4.2, 4.3), 4.25, 9, np.ones(1), np.zeros(1), 5.0)
    struck = replace(plain, every=(replace(plain.every[0], events=(hit,)), *plain.every[1:]))
    (impulse, _), (with_it, _), *_ = _dependences([struck])
    assert impulse.form == "impulse"
    assert with_it.probability == next(_dependences([plain]))[0].probability


def test_a_tone_is_periodic():
    found = servo(lambda run, t: 2.0 * np.sin(2.0 * np.pi * 5.3 * t))
    best, _ = next(iter(depends_on(found)))
    assert (best.at, best.on, best.form, best.unit) == ("A1", "tone", "periodic", "deg")
    assert best.at_time_s is None
    assert best.frequency_hz == pytest.approx(5.3, abs=0.05)
    assert best.course is None
    assert best.size == pytest.approx(2.0 * SIGMA, rel=0.2)


def test_a_drift_has_its_course_in_the_run_that_is_off_most():
    found = servo(lambda run, t: (4.0 if run else -0.5) * (t / t[-1]) ** 2)
    drift = next(each for each, _ in depends_on(found) if each.form == "drift")
    assert drift.course.run == "run-2"
    assert (drift.course.over, drift.course.over_unit, drift.course.unit) == ("time in the run", "s", "deg")
    t_s, off = np.transpose(drift.course.points)
    assert off == pytest.approx(4.0 * SIGMA * (t_s / c.motion().time_s[-1]) ** 2, abs=0.6 * SIGMA)


def test_a_deviation_that_follows_the_velocity_has_its_course_over_it():
    inputs = c.motion()
    rate = np.gradient(inputs.q_cmd_rad[:, 0], inputs.time_s)
    found = servo(lambda run, t: -5.0 * np.tanh(4.0 * rate / np.abs(rate).max()))
    fast = next(each for each, _ in depends_on(found) if each.on == "velocity")
    assert (fast.course.over, fast.course.over_unit, fast.course.run) == ("velocity of A1", "deg/s", None)
    speed, off = np.transpose(fast.course.points)
    assert np.all(np.diff(speed) > 0.0)
    assert off[0] > 3.0 * SIGMA
    assert off[-1] < -3.0 * SIGMA


def test_a_step_of_the_tip_has_a_direction():
    shift, t = np.array([0.9, 0.3, -0.1]), c.motion().time_s
    values = [shift * (t > 4.0)[:, None] + c.noise(500, 1, 0.01, 3), shift + c.noise(500, 2, 0.01, 3)]
    traces = [c.trace(each, "mechanics", number, declared_sigma=0.01) for number, each in enumerate(values)]
    found = judge(c.LINK["mechanics"], traces, [], c.question([]))
    best, _ = next(iter(depends_on(found)))
    assert (best.at, best.form, best.unit) == ("tip", "step", "mm")
    assert best.size == pytest.approx(np.linalg.norm(shift), rel=0.1)
    assert best.direction == pytest.approx(shift / np.linalg.norm(shift), abs=0.1)


def test_noise_depends_on_nothing_that_is_said():
    assert list(depends_on(servo(lambda run, t: 0.0 * t))) == []


def test_what_is_explained_depends_on_nothing_more():
    found = servo(lambda run, t: 3.0 * EFFECT.form(t))
    assert found.verdict == "explained"
    assert list(depends_on(found)) == []
