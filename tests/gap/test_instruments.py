"""What is said of the instruments: where their noise is known from, steps, more than stated, bursts."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.codes import all_codes
from gcode2krl.gap.answer.causes import issues_of, noise_of, readings_of_noise
from gcode2krl.gap.compare.events import sorted_out
from gcode2krl.gap.noise.short import Slow, white
from tests.gap.constructed import LINK, motion, noise, stub, trace

SIGMA = 2.0


def judgement(*residuals, models=None, link="force", apart=True, **more):
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
    models = models or [white(SIGMA)] * traces[0].shape[1]
    return stub(
        link=LINK[link], factor=1.0, traces=tuple(traces), every=tuple(traces), examination=stub(noise=models)
    )


def codes(*judgements):
    return [issue.code for issue in issues_of(judgements)]


def rough(seed, count=1000):
    return noise(count, seed, SIGMA)


def test_the_noise_of_a_link_and_where_it_is_known_from():
    wide = replace(white(SIGMA), slow=(Slow(0.99, 1.5),))
    found = noise_of(judgement(rough(1), rough(2), models=[wide], declared_sigma=1.8))
    assert (found.stated, found.short, found.source) == (1.8, SIGMA, "each run by itself")
    assert found.learnt == pytest.approx(2.5)
    assert noise_of(judgement(rough(1), rough(2), apart=False)).source == "repeats"
    assert noise_of(judgement(1e-4 * rough(1), link="path")) is None


def test_both_readings_are_told_where_the_noise_is_neither_stated_nor_repeated():
    wide = [replace(white(SIGMA), slow=(Slow(0.99, 1.5),))]
    (said,) = readings_of_noise([judgement(rough(1), rough(2), models=wide)])
    assert "neither stated nor repeated" in said
    assert "2.5 N" in said
    assert "2 N are forgotten within milliseconds" in said
    (plain,) = readings_of_noise([judgement(rough(1))])
    assert "milliseconds" not in plain
    known = judgement(rough(1), declared_sigma=SIGMA), judgement(rough(1), rough(2), apart=False)
    assert not list(readings_of_noise(known))


def test_readings_in_steps_above_the_noise_are_a_finding():
    ladder = 20.0 * np.round((rough(3) + 7.0) / 20.0)
    (issue,) = issues_of([judgement(ladder, models=[white(6.0)], declared_sigma=8.0)])
    assert issue.code == "readings-in-steps"
    assert issue.message == "force, x: readings in a ladder of 20 N, the noise is 8 N"
    fine = np.round(rough(3), 1)
    assert not codes(judgement(fine, declared_sigma=SIGMA))
    assert not codes(judgement(fine))


def test_more_noise_than_stated_is_a_finding():
    assert codes(judgement(rough(4), models=[white(1.4)], declared_sigma=1.0)) == ["noise-above-stated"]
    assert not codes(judgement(rough(4), models=[white(1.2)], declared_sigma=1.0))


def test_bursts_that_were_left_out_are_told_with_moment_and_line():
    loud = rough(5, 2000)
    loud[900:912] *= 12.0
    (issue,) = issues_of([judgement(rough(6, 2000), loud)])
    assert issue.code == "instrument-bursts"
    assert issue.message.startswith("run-2: force: rough for 0.")
    assert "at 18." in issue.message
    assert "(line 9" in issue.message
    assert all(
        code in all_codes() for code in ("instrument-bursts", "readings-in-steps", "noise-above-stated")
    )
