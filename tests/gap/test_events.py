"""Whose an event is: the command's, the machine's or the instrument's, and what is left out."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gcode2krl.gap.answer.words import events_of, impulses_of
from gcode2krl.gap.compare.events import rough_spans, sorted_out
from gcode2krl.gap.compare.trace import Whose
from gcode2krl.gap.posterior.judgement import judge
from tests.gap.constructed import LINK, motion, noise, question, trace, wave

STEP_S, SECONDS = 0.01, 20.0
COUNT = round(SECONDS / STEP_S)
TIME_S = STEP_S * np.arange(COUNT)
CORNERS_S = np.arange(1.5, 19.0, 1.5)
"""Where the joints of the made-up motion stop and go on."""


def stop_and_go(number=0):
    """Return a motion whose joints go at a constant rate and jerk at corners only."""
    made = motion(SECONDS, STEP_S)
    rate = np.ones(COUNT)
    for at_s in CORNERS_S:
        rate -= np.exp(-0.5 * ((TIME_S - at_s) / 0.02) ** 2)
    q = made.q_cmd_rad[:1] + 0.02 * STEP_S * np.cumsum(rate)[:, None] * np.arange(1.0, 7.0)
    return replace(made, q_cmd_rad=q, position_mm=made.position_mm + 5.0 * number)


def runs(*residuals, link="servo", inputs=None):
    return [
        trace(r.reshape(COUNT, -1), link, number=i, inputs=stop_and_go(i) if inputs is None else inputs)
        for i, r in enumerate(residuals)
    ]


def shaken(at_s, seed, lasts_s=0.2, times=9.0):
    """Return noise that is so many times as loud for a moment."""
    y = noise(COUNT, seed)[:, 0]
    for one_s in np.atleast_1d(at_s):
        y[(one_s <= TIME_S) & (one_s + lasts_s > TIME_S)] *= times
    return y


def blow(at_s, height=60.0, lasts_s=0.08):
    since = (TIME_S - at_s) / lasts_s
    return height * np.where((since > 0.0) & (since < 1.0), np.sin(np.pi * since), 0.0)


def kinds(traces):
    return [event.whose for one in traces for event in one.events]


def test_a_burst_of_the_instrument_goes_and_is_told():
    calm, loud = runs(noise(COUNT, 1)[:, 0], shaken(7.2, 2))
    first, second = sorted_out([calm, loud], {})
    assert first is calm
    (event,) = second.events
    assert event.whose is Whose.INSTRUMENT
    assert 7.1 < event.span_s[0] < event.at_s < event.span_s[1] < 7.5
    assert event.line == int(event.at_s / STEP_S) + 1 or event.line == int(event.at_s / STEP_S)
    assert 15 <= COUNT - second.shape[0] <= 45
    kept = np.isin(loud.time_s, second.time_s)
    np.testing.assert_array_equal(second.measured, loud.measured[kept])


def test_all_components_lose_the_row():
    y = noise(COUNT, 5, width=3)
    y[700:720, 1] *= 9.0
    (found,) = sorted_out(runs(y), {})
    assert found.shape[1] == 3
    assert 20 <= COUNT - found.shape[0] <= 45
    assert len(found.segments) == 2


def test_an_outlier_goes_without_a_moment():
    y = noise(COUNT, 6)[:, 0]
    y[900] += 40.0
    (found,) = sorted_out(runs(y), {})
    assert (COUNT - found.shape[0], found.events) == (1, ())
    assert found.left_out == (f"1 of {COUNT} rows: outliers of the instrument",)


def test_what_is_rough_in_step_with_the_command_stays():
    """A following error at the corners alone: it is what a servo does, and must be explained."""
    traces = runs(*(shaken(CORNERS_S[:7], seed) for seed in range(3)))
    assert sorted_out(traces, {}) == traces
    # as many bursts elsewhere are the instrument's, each in its own places
    generator = np.random.default_rng(0)
    elsewhere = [
        shaken(np.sort(generator.choice(CORNERS_S, 4, replace=False)) + 0.7, 10 + i) for i in range(3)
    ]
    assert set(kinds(sorted_out(runs(*elsewhere), {}))) == {Whose.INSTRUMENT}


def test_what_every_repeat_has_at_the_same_place_stays():
    inputs = stop_and_go()
    same = runs(*(shaken(7.2, seed) for seed in range(3)), inputs=inputs)
    assert sorted_out(same, {}) == same
    apart = runs(*(shaken(3.7 + 3.0 * seed, seed) for seed in range(3)), inputs=inputs)
    assert kinds(sorted_out(apart, {})) == [Whose.INSTRUMENT] * 3


def test_a_pulse_that_repeats_have_smaller_is_no_blow():
    """In one run it passes the limit of pulses, in the others it does not."""
    inputs = stop_and_go()
    smaller = [noise(COUNT, seed)[:, 0] + blow(7.2, height) for seed, height in ((8, 60.0), (9, 0.0))]
    assert Whose.IMPULSE in kinds(sorted_out(runs(*smaller, inputs=inputs), {}))
    smaller[1] = smaller[1] + blow(7.2, 36.0)
    traces = runs(*smaller, inputs=inputs)
    assert sorted_out(traces, {}) == traces


def test_a_blow_is_an_impulse_with_moment_and_size():
    (found,) = sorted_out(runs(noise(COUNT, 8)[:, 0] + blow(7.2)), {})
    (event,) = found.events
    assert event.whose is Whose.IMPULSE
    assert event.at_s == pytest.approx(7.24, abs=0.02)
    assert abs(event.peak[0]) == pytest.approx(60.0, rel=0.1)
    assert not np.any((found.time_s > 7.21) & (found.time_s < 7.27))


def test_a_blow_is_seen_between_rows_that_are_left_out():
    """Where a cutter goes in and out the force is in short pieces; a blow of three rows is in one of them."""
    kept = np.arange(COUNT) % 32 < 24
    y = noise(COUNT, 8)[:, 0] + blow(7.18, 200.0, 0.03)
    edges = np.flatnonzero(np.diff(kept, prepend=False, append=False)).reshape(-1, 2)
    lengths = np.cumsum([0, *(edges[:, 1] - edges[:, 0])])
    (whole,) = runs(y, link="force")
    pieces = replace(
        whole,
        time_s=whole.time_s[kept],
        measured=whole.measured[kept],
        segments=np.stack([lengths[:-1], lengths[1:]], axis=1),
    )
    (found,) = sorted_out([pieces], {})
    (event,) = found.events
    assert event.whose is Whose.IMPULSE
    assert event.at_s == pytest.approx(7.195, abs=0.01)


def test_the_moment_of_a_pull_that_ends_at_once_is_its_end():
    pull = np.where((TIME_S > 7.14) & (TIME_S < 7.24), (TIME_S - 7.14) / 0.1, 0.0)
    (found,) = sorted_out(runs(noise(COUNT, 8)[:, 0] + 90.0 * pull), {})
    (event,) = found.events
    assert event.at_s == pytest.approx(7.24, abs=0.015)


def test_a_blow_that_leaves_a_step_behind_is_a_slip_and_a_step_alone_keeps_its_rows():
    step = 30.0 * (TIME_S > 7.24)
    hit, *_ = sorted_out(runs(noise(COUNT, 9)[:, 0] + blow(7.2, 90.0) + step), {})
    (event,) = hit.events
    assert event.whose is Whose.SLIP
    assert abs(event.change[0]) == pytest.approx(30.0, abs=2.0)
    assert event.at_s == pytest.approx(7.24, abs=0.03)
    (slid,) = sorted_out(runs(noise(COUNT, 9)[:, 0] + step), {})
    assert slid.shape[0] == COUNT


def test_two_instruments_do_not_burst_together():
    spans = rough_spans(runs(shaken(7.2, 20)))
    calm = [noise(COUNT, seed)[:, 0] for seed in (22, 23)]
    assert kinds(sorted_out(runs(shaken(7.2, 21), *calm), {})) == [Whose.INSTRUMENT]
    assert kinds(sorted_out(runs(shaken(7.2, 21), *calm), spans)) == [Whose.IMPULSE]
    assert kinds(sorted_out(runs(shaken(3.7, 21), *calm), spans)) == [Whose.INSTRUMENT]


def test_a_pulse_of_a_sensor_that_bursts_is_one_more_burst():
    """Three bursts beside it; of an encoder a pulse stays a blow."""
    y = shaken([3.7, 11.3, 16.7], 24) + blow(7.2)
    assert kinds(sorted_out(runs(y, link="force"), {})) == [Whose.INSTRUMENT] * 4
    assert Whose.IMPULSE in kinds(sorted_out(runs(y), {}))
    assert Whose.IMPULSE in kinds(sorted_out(runs(shaken(3.7, 24) + blow(7.2), link="force"), {}))


def test_what_is_commanded_has_no_events():
    y = 1e-4 * shaken(7.2, 2)
    (planned,) = runs(y, link="path")
    assert sorted_out([planned], {})[0] is planned


def test_a_clock_a_lag_or_a_play_is_no_event():
    """Their pulses and steps follow the motion, in a run of its own too."""
    inputs = stop_and_go()
    rate = np.gradient(inputs.q_cmd_rad[:, 0], TIME_S)
    follows = 60.0 * rate / np.abs(rate).max()
    (late,) = runs(noise(COUNT, 3)[:, 0] + follows, inputs=inputs)
    assert not sorted_out([late], {})[0].events


def test_the_answer_tells_moments_by_run_seconds_and_line():
    (found,) = sorted_out(runs(noise(COUNT, 8)[:, 0] + blow(7.2)), {})
    size = SimpleNamespace(excess_before=0.0, rows=COUNT)
    judged = SimpleNamespace(
        link=found.link, factor=2.0, traces=(found,), events=found.events, impulses=found.events, size=size
    )
    (event,) = events_of(judged)
    assert (event.what, event.run, event.unit) == ("impulse", "run-1", "deg")
    assert event.size == pytest.approx(120.0, rel=0.1)
    assert event.t_s == pytest.approx(7.24, abs=0.02)
    assert event.line == pytest.approx(724, abs=3)
    (depends,) = impulses_of(judged)
    assert (depends.form, depends.at, depends.run, depends.line) == ("impulse", "A1", "run-1", event.line)
    assert depends.share == pytest.approx(1.0)


def test_a_following_error_in_step_with_the_jerk_is_a_gap_and_depends_on_it():
    """Twice the noise, nearly all of it at corners: it hardly raises the noise and none of it is left out."""

    def servo(number):
        jerk = np.gradient(np.gradient(np.gradient(stop_and_go().q_cmd_rad[:, 0], TIME_S), TIME_S), TIME_S)
        follows = np.convolve(jerk, np.exp(-np.arange(12) / 2.0), mode="full")[:COUNT]
        return noise(COUNT, 30 + number)[:, 0] + 2.0 * follows / np.std(follows)

    traces = sorted_out(runs(*(servo(number) for number in range(3))), {})
    assert [each.shape[0] for each in traces] == [COUNT] * 3
    found = judge(LINK["servo"], traces, [], question([wave(0.37)]))
    assert found.verdict == "unexplained"
    assert found.examination.noise[0].short_sigma < 1.25
    best = found.rest.study.evidences[0]
    assert best.place.name == "A1"
    assert best.on.value in (
        "jerk",
        "acceleration",
    )  # the one is nearly a function of the other where it stops
