"""On what a gap without a name depends, how it goes over its input, and what is said of the instruments."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.codes import all_codes
from gcode2krl.effects.dependence import Dependence
from gcode2krl.gap.answer.assembly import _dependences
from gcode2krl.gap.answer.causes import course_of, depends_on, issues_of, noise_of, readings_of_noise
from gcode2krl.gap.compare.events import sorted_out
from gcode2krl.gap.compare.inputs import Admissible
from gcode2krl.gap.compare.trace import Event, Whose
from gcode2krl.gap.noise.short import Slow, white
from gcode2krl.gap.posterior.calibrated import family_features
from gcode2krl.gap.posterior.judgement import judge
from tests.gap import constructed as c
from tests.gap.constructed import LINK, motion, noise, stub, trace

# On what a gap without a name depends, as the answer states it


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


# How a deviation goes over its input: which input, in which unit, at which points


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


# What is said of the instruments: where their noise is known from, steps, more than stated, bursts


SIGMA_N = 2.0


def of_force(*residuals, models=None, link="force", apart=True, **more):
    """Return a judgement of runs of different programs, or of one, whose noise is known."""
    made = motion(0.02 * len(residuals[0]))
    traces = [
        trace(
            each.reshape(len(each), -1),
            link,
            number=i,
            inputs=replace(made, position_mm=made.position_mm + (9.0 * i if apart else 0.0)),
            **more,
        )
        for i, each in enumerate(residuals)
    ]
    traces = sorted_out(traces, {})
    models = models or [white(SIGMA_N)] * traces[0].shape[1]
    return stub(
        link=LINK[link], factor=1.0, traces=tuple(traces), every=tuple(traces), examination=stub(noise=models)
    )


def codes(*judgements):
    return [issue.code for issue in issues_of(judgements)]


def rough(seed, count=1000):
    return noise(count, seed, SIGMA_N)


def test_the_noise_of_a_link_and_where_it_is_known_from():
    wide = replace(white(SIGMA_N), slow=(Slow(0.99, 1.5),))
    found = noise_of(of_force(rough(1), rough(2), models=[wide], declared_sigma=1.8))
    assert (found.stated, found.short, found.source) == (1.8, SIGMA_N, "each run by itself")
    assert found.learnt == pytest.approx(2.5)
    assert noise_of(of_force(rough(1), rough(2), apart=False)).source == "repeats"
    assert noise_of(of_force(1e-4 * rough(1), link="path")) is None


def test_both_readings_are_told_where_the_noise_is_neither_stated_nor_repeated():
    wide = [replace(white(SIGMA_N), slow=(Slow(0.99, 1.5),))]
    (said,) = readings_of_noise([of_force(rough(1), rough(2), models=wide)])
    assert "neither stated nor repeated" in said
    assert "2.5 N" in said
    assert "2 N are forgotten within milliseconds" in said
    (plain,) = readings_of_noise([of_force(rough(1))])
    assert "milliseconds" not in plain
    known = of_force(rough(1), declared_sigma=SIGMA_N), of_force(rough(1), rough(2), apart=False)
    assert not list(readings_of_noise(known))


def test_readings_in_steps_above_the_noise_are_a_finding():
    ladder = 20.0 * np.round((rough(3) + 7.0) / 20.0)
    (issue,) = issues_of([of_force(ladder, models=[white(6.0)], declared_sigma=8.0)])
    assert issue.code == "readings-in-steps"
    assert issue.message == "force, x: readings in a ladder of 20 N, the noise is 8 N"
    fine = np.round(rough(3), 1)
    assert not codes(of_force(fine, declared_sigma=SIGMA_N))
    assert not codes(of_force(fine))


def test_more_noise_than_stated_is_a_finding():
    assert codes(of_force(rough(4), models=[white(1.4)], declared_sigma=1.0)) == ["noise-above-stated"]
    assert not codes(of_force(rough(4), models=[white(1.2)], declared_sigma=1.0))


def test_bursts_that_were_left_out_are_told_with_moment_and_line():
    loud = rough(5, 2000)
    loud[900:912] *= 12.0
    (issue,) = issues_of([of_force(rough(6, 2000), loud)])
    assert issue.code == "instrument-bursts"
    assert issue.message.startswith("run-2: force: rough for 0.")
    assert "at 18." in issue.message
    assert "(line 9" in issue.message
    assert all(
        code in all_codes() for code in ("instrument-bursts", "readings-in-steps", "noise-above-stated")
    )
