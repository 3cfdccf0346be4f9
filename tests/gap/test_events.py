"""Events: bursts, outliers, pulses, hum and jumps; whose they are, and what is left out."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gcode2krl.effects import library
from gcode2krl.gap.answer.causes import moment_of
from gcode2krl.gap.answer.words import events_of, impulses_of
from gcode2krl.gap.compare.events import (
    jump_clarity,
    loud_rows,
    pulse_rows,
    rough_spans,
    sorted_out,
    strongest_moments,
    without_hum,
)
from gcode2krl.gap.compare.trace import Event, Whose
from gcode2krl.gap.components import Signatures, blocks_at
from gcode2krl.gap.noise.short import Noise, Slow, drawn_noise
from gcode2krl.gap.posterior.judgement import judge
from gcode2krl.gap.posterior.least_squares import free_of
from gcode2krl.gap.thresholds import THRESHOLDS
from tests.gap.constructed import LINK, motion, noise, question, stub, trace, wave

# Whose an event is: the command's, the machine's or the instrument's, and what is left out

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


# Bursts and outliers are told from what effects, jumps, vibration or louder cutting do

BURST_ROWS = 1500
BURST_S = 0.01 * np.arange(BURST_ROWS)
WHOLE = np.array([[0, BURST_ROWS]], dtype=np.int64)


def loud(values):
    return loud_rows(BURST_S, values.reshape(BURST_ROWS, -1), WHOLE)


def test_a_burst_goes_and_little_besides():
    y = noise(BURST_ROWS, 1)[:, 0]
    inside = (BURST_S >= 6.0) & (BURST_S < 6.3)
    y[inside] *= 7.0
    found = loud(y)
    assert found[inside].mean() > 0.95
    assert found[~inside].sum() < 25


def test_white_noise_has_no_bursts():
    assert sum(loud(noise(BURST_ROWS, seed)[:, 0]).sum() for seed in range(50)) < 100


@pytest.mark.parametrize("size", [30.0, 200.0])
def test_outliers_go_and_jumps_stay(size):
    y = noise(BURST_ROWS, 2)[:, 0]
    y[[200, 900]] += size
    assert np.flatnonzero(loud(y)).tolist() == [200, 900]
    jumped = noise(BURST_ROWS, 2)[:, 0] + size * (BURST_S > 7.0)
    assert not loud(jumped).any()


def test_what_effects_do_stays():
    """Spikes that decay after a reversal, and ten damped swings of 12 Hz, at ten times the noise."""
    after = np.mod(BURST_S, 3.0)
    spikes = 10.0 * np.exp(-after / 0.05)
    swings = 10.0 * np.exp(-after / 0.15) * np.sin(2.0 * np.pi * 12.0 * after) * (BURST_S > 12.0)
    for form in (spikes, swings):
        assert loud(noise(BURST_ROWS, 3)[:, 0] + form).sum() < 10


def test_what_is_loud_for_long_stays():
    """A cut that takes a third of the run is no burst, and neither is what all of a run is like."""
    y = noise(BURST_ROWS, 4)[:, 0]
    y[500:1000] *= 6.0
    assert not loud(y).any()


def test_where_the_model_jumps_nothing_is_left_out():
    """A tool that enters the material: what is left beside the jumps of the model is the model's."""
    y, edges = (
        noise(BURST_ROWS, 7)[:, 0],
        20.0 * (np.mod(BURST_S, 0.04) > 0.02) * (np.abs(BURST_S - 7.0) < 0.1),
    )
    y += 0.5 * edges
    assert loud(y).sum() > 10
    model = edges.reshape(BURST_ROWS, -1)
    assert not loud_rows(BURST_S, y.reshape(BURST_ROWS, -1), WHOLE, model)[np.abs(BURST_S - 7.0) < 0.15].any()


# Pulses: hardly ever in noise of any kind, and found to the row where there is one

PULSED_S = 15.0
STATED = 0.01
"""Of runs with a pulse by chance: what the threshold's reason says, with room for its own chance."""


def pulsed(values, step_s, least=0.0):
    time_s = step_s * np.arange(len(values))
    return pulse_rows(time_s, values[:, None], np.array([least]))


def drawn(kind, count, step_s, generator):
    short = drawn_noise(Noise(np.array([0.5, 0.0, 0.0]), 1.0, 1.15), count, generator)
    if kind == "slow":
        return short + drawn_noise(
            Noise(np.zeros(3), 1e-9, 1e-9, (Slow(np.exp(-step_s / 0.3), 2.0),)), count, generator
        )
    if kind == "heavy tails":
        return short + 1.5 * generator.standard_t(3.0, count) / np.sqrt(3.0)
    if kind == "bursts":
        for at_s in generator.uniform(0.0, PULSED_S, 5):
            loud = np.exp(-0.5 * ((step_s * np.arange(count) - at_s) / 0.15) ** 2)
            short = short + 4.0 * loud * generator.standard_normal(count)
    return np.round(short) if kind == "decimals" else short


@pytest.mark.parametrize("kind", ["short", "slow", "heavy tails", "bursts", "decimals"])
def test_noise_of_any_kind_hardly_ever_has_one(kind):
    draws, alarms = 60, 0
    for seed in range(draws):
        step_s = (0.004, 0.012)[seed % 2]
        values = drawn(kind, round(PULSED_S / step_s), step_s, np.random.default_rng(seed))
        alarms += bool(pulsed(values, step_s, 0.3 if kind == "decimals" else 0.0).any())
    # five kinds: three hundred draws; one each is the most that one in a hundred makes likely
    assert alarms <= 1 + STATED * draws


@pytest.mark.parametrize(
    ("step_s", "lasts_s", "height"),
    [(0.004, 0.03, 40.0), (0.004, 0.06, 40.0), (0.008, 0.06, 40.0), (0.008, 0.03, 150.0)],
)
def test_a_blow_is_found_where_it_is(step_s, lasts_s, height):
    time_s = step_s * np.arange(round(PULSED_S / step_s))
    for seed in range(10):
        values = drawn("short", len(time_s), step_s, np.random.default_rng(seed))
        since = (time_s - 7.3) / lasts_s
        values += height * np.where((since > 0.0) & (since < 1.0), np.sin(np.pi * since), 0.0)
        found = time_s[pulsed(values, step_s)]
        assert len(found)
        assert 7.3 - step_s < found.mean() < 7.3 + lasts_s + step_s
        assert found.max() - found.min() < lasts_s + 0.1  # the widest that is looked for


def test_a_step_is_none():
    values = drawn("short", 3000, 0.004, np.random.default_rng(1))
    values[1500:] += 60.0
    assert not pulsed(values, 0.004).any()


# Hum of the mains goes, folded or not; a tone beside the mains, and that of a spindle, stays

HUM_ROWS, HUM_STEP_S = 5000, 0.004
HUM_S = HUM_STEP_S * np.arange(HUM_ROWS)


def left_of(hz, size=1.0, spindle_hz=0.0, step_s=HUM_STEP_S):
    """Return the amplitude of a tone that is left in white noise of unit variance."""
    inputs = motion(HUM_ROWS * step_s, step_s)
    inputs = replace(inputs, spindle_rad_s=np.full(HUM_ROWS, 2.0 * np.pi * spindle_hz))
    tone = np.sin(2.0 * np.pi * hz * inputs.time_s + 0.7)
    made = trace(noise(HUM_ROWS, 3) + size * tone[:, None], inputs=inputs)
    (found,) = without_hum([made])
    rest = (found.measured - made.nominal)[:, 0]
    wave = np.exp(-2j * np.pi * hz * inputs.time_s)
    return 2.0 * abs(wave @ rest) / HUM_ROWS


@pytest.mark.parametrize("hz", [50.0, 50.02, 149.95, 60.0, 180.05])
def test_hum_goes(hz):
    assert left_of(hz) < 0.1


def test_hum_that_is_folded_by_slow_sampling_goes():
    """50 Hz at 12 ms shows at 33.3 Hz."""
    assert left_of(50.01, step_s=0.012) < 0.1


@pytest.mark.parametrize("hz", [47.0, 51.5, 33.0])
def test_a_tone_beside_the_mains_stays(hz):
    assert left_of(hz) == pytest.approx(1.0, abs=0.1)


def test_what_turns_with_the_spindle_stays():
    """3000 a minute is 50 Hz: a runout, not hum."""
    assert left_of(50.0, spindle_hz=50.0) == pytest.approx(1.0, abs=0.1)


def test_noise_alone_stays_as_it_is():
    made = [
        trace(noise(HUM_ROWS, seed), inputs=motion(HUM_ROWS * HUM_STEP_S, HUM_STEP_S)) for seed in range(20)
    ]
    assert sum(found is not one for found, one in zip(without_hum(made), made, strict=True)) <= 1


def test_what_went_is_told():
    tone = np.sin(2.0 * np.pi * 50.0 * HUM_S)[:, None]
    (found,) = without_hum(
        [trace(noise(HUM_ROWS, 3) + tone, inputs=motion(HUM_ROWS * HUM_STEP_S, HUM_STEP_S))]
    )
    assert found.left_out == ("hum of the mains at 50 Hz",)


# Change points: a jump is found to a sample beside trends and tones, and nothing where nothing jumps

STEP = library()["step"]


def noisy(seed=1, rows=500):
    return np.random.default_rng(seed).normal(0.0, 0.02, (rows, 3))


def at(row, size, rows=500):
    return np.where(np.arange(rows) >= row, size, 0.0)[:, None] * np.array([1.0, 0.3, 0.1])


def test_a_jump_is_as_surprising_as_least_squares_say():
    values = noisy()[:, 0] + at(180, 0.2)[:, 0]
    half, row = 20, 180
    window = values[row - half : row + half]
    cubic = np.vander(np.linspace(-1.0, 1.0, 2 * half), 4)
    both = np.column_stack([cubic, np.arange(2 * half) >= half])
    left = [np.sum((window - a @ np.linalg.lstsq(a, window, rcond=None)[0]) ** 2) for a in (cubic, both)]
    found = jump_clarity(values, half)
    assert found[row] == pytest.approx(2 * half * np.log(left[0] / left[1]), rel=1e-6)
    assert np.argmax(found) == row
    assert not found[:half].any()


def test_the_clearest_jump_comes_first_beside_a_trend_and_a_tone():
    t = np.arange(500) * 0.02
    slow = (0.03 * t + 0.2 * np.sin(2.0 * np.pi * 0.3 * t))[:, None]
    one = trace(noisy() + slow + at(310, 0.3) + at(120, 0.2), "mechanics")
    found = strongest_moments([one], 0.0, 1e6)
    np.testing.assert_allclose(found[:2], [one.time_s[310], one.time_s[120]], atol=1e-9)
    assert len(found) <= THRESHOLDS.noise.jumps


def test_noise_and_slow_motion_have_no_jump():
    slow = 0.1 * np.sin(2.0 * np.pi * 0.3 * np.arange(500) * 0.02)[:, None]
    for seed in range(5):
        assert strongest_moments([trace(noisy(seed) + slow, "mechanics")], 0.0, 1e6) == ()


def test_moments_count_from_the_start_of_the_earliest_run():
    later = trace(noisy() + at(310, 0.3), "mechanics")
    later = replace(later, inputs=replace(later.inputs, hours=0.5))
    (found, *_) = strongest_moments([trace(noisy(2), "mechanics"), later], 0.0, 1e6)
    assert found == pytest.approx(1800.0 + later.time_s[310])
    assert strongest_moments([later], 0.0, 1000.0) == ()


def test_a_short_trace_has_none():
    assert strongest_moments([trace(noisy(rows=20) + at(10, 1.0, 20), "mechanics")], 0.0, 1e6) == ()


def told(values, one, *, is_smooth=False):
    return moment_of([trace(noisy(2), "mechanics"), one], [np.zeros((500, 3)), values], is_smooth=is_smooth)


def test_what_acts_for_moments_is_told_with_its_largest_and_what_lasts_is_not():
    one = trace(noisy(), "mechanics", number=1)
    peaks = np.zeros((500, 3))
    peaks[[120, 121, 122, 340], 1] = 1.0, -1.5, 1.0, 1.2
    found = told(peaks, one)
    assert (found.run, found.line) == ("run-2", 121)
    assert found.t_s == pytest.approx(one.time_s[121])
    assert told(np.sin(one.time_s)[:, None] * np.ones(3), one) is None


def test_the_moment_of_a_smooth_function_is_where_the_residual_jumps_near_it():
    """A pull that grows and ends at once: the function of time that follows it is largest too early."""
    rows = np.arange(500)
    pull = np.where((rows >= 200) & (rows < 230), (rows - 200) / 30.0, 0.0)[:, None] * [1.0, 0.3, 0.1]
    one = trace(noisy() + pull, "mechanics", number=1)
    smooth = np.exp(-0.5 * ((rows - 218) / 10.0) ** 2)[:, None] * [0.7, 0.2, 0.1]
    assert told(smooth, one, is_smooth=True).t_s == pytest.approx(one.time_s[229] + 0.01)
    assert told(smooth, trace(noisy(), "mechanics"), is_smooth=True).t_s == pytest.approx(one.time_s[218])


def test_the_moment_of_a_smooth_function_is_that_of_an_event_whose_rows_are_gone():
    rows = np.arange(500)
    smooth = np.exp(-0.5 * ((rows - 218) / 10.0) ** 2)[:, None] * np.ones(3)
    hit = Event("mechanics", "run-2", Whose.SLIP, (4.2, 4.7), 4.61, 9, np.ones(3), np.ones(3), 5.0)
    burst = replace(hit, whose=Whose.INSTRUMENT, at_s=4.4, power=9.0)
    one = trace(noisy(), "mechanics", number=1, events=(hit, burst))
    assert told(smooth, one, is_smooth=True).t_s == 4.61


def test_blocks_of_a_step_stand_at_the_moments_and_count_what_was_looked_at():
    blocks = list(blocks_at(STEP.at("tip"), "tip", (4.0, 6.0), 30.0))
    assert [block.shape["at_s"] for block in blocks] == [4.0, 6.0]
    assert [block.tried for block in blocks] == [15.0, 15.0]
    tip = trace(np.zeros((500, 3)), "mechanics")
    columns = Signatures().columns(blocks[0], tip)
    np.testing.assert_allclose(columns[0, :, 0], np.where(tip.time_s > 4.0, 0.1, 0.0), atol=0.051)
    free = free_of(blocks[0].settings(tip)[0], tip)
    assert free.scale[free.names.index("at_s")] == pytest.approx(2.0)
    assert list(blocks_at(library()["backlash"], "A1", (4.0,), 30.0)) == []


def test_a_usual_clock_at_corners_is_no_jump():
    """A joint that stops and starts is off by 2 ms of its speed: ten deviations, in every sound run."""
    speed = np.where(np.arange(500) // 90 % 2 == 0, 1.0, -0.6)[:, None] * [0.2, 0.15, 0.1]
    time_s = np.arange(500) * 0.02
    late = stub(inputs=stub(hours=0.0), time_s=time_s, clock_rate=speed, residual=noisy() + speed)
    assert strongest_moments([late], 0.0, 1e6) == ()
    late.residual = late.residual + at(310, 0.2)
    found = strongest_moments([late], 0.0, 1e6)
    assert found[0] == pytest.approx(time_s[310])
