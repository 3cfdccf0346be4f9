"""Change points: a jump is found to a sample beside trends and tones, and nothing where nothing jumps."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.effects import library
from gcode2krl.gap.answer.causes import moment_of
from gcode2krl.gap.compare.events import jump_clarity, strongest_moments
from gcode2krl.gap.compare.trace import Event, Whose
from gcode2krl.gap.components import Signatures, blocks_at
from gcode2krl.gap.posterior.least_squares import free_of
from gcode2krl.gap.thresholds import THRESHOLDS
from tests.gap.constructed import stub, trace

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
