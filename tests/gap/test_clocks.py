"""Clocks: known offsets come back, and what is no clock is not taken for one."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.gap.compare.clocks import (
    coarse_offset,
    fitted_offset,
    with_coarse_clocks,
    with_controller_clocks,
    with_table_clock,
)
from gcode2krl.gap.compare.links import PATH
from gcode2krl.gap.compare.trace import Context
from gcode2krl.runs import Tracker
from tests.gap.constructed import controller, joints, motion, noise, pair, trace

LONG = motion(40.0)
STAMPS_S = np.arange(0.3, 36.0, 0.02)


def late(offset_s, sigma_rad=0.0):
    """Return a run's path whose samples are older than their stamps."""
    one = trace(np.zeros((500, 6)), "path")
    moved = replace(one, time_s=one.time_s - offset_s).nominal
    return replace(one, measured=moved + noise(500, 1, sigma_rad, 6) if sigma_rad else moved)


def run(offset_s=0.0, stretch=1.0, **more):
    """Return a run of the long motion with its table's clock off, or at another pace."""
    q = joints((STAMPS_S - offset_s) / stretch)
    return pair(LONG, controller=controller(STAMPS_S, q_cmd_rad=q), **more)


@pytest.mark.parametrize("offset_s", [0.0, 1e-3, -0.02, 0.3])
def test_an_offset_comes_back(offset_s):
    found, deviation = fitted_offset(late(offset_s))
    assert found == pytest.approx(offset_s, abs=2e-4)
    assert deviation < 1e-3


def test_its_deviation_is_that_of_least_squares():
    found, deviation = fitted_offset(late(2e-3, 1e-4))
    rate = trace(np.zeros((500, 6)), "path").rate
    expected = 1e-4 / np.sqrt(np.sum((rate - rate.mean(axis=0)) ** 2))
    assert deviation == pytest.approx(expected, rel=0.1)
    assert abs(found - 2e-3) < 4.0 * deviation


def test_a_zero_of_each_component_is_no_clock():
    one = late(5e-3)
    shifted = replace(one, measured=one.measured + np.arange(6) * 0.01)
    assert fitted_offset(shifted)[0] == pytest.approx(5e-3, abs=1e-4)


def test_what_does_not_move_has_no_clock():
    assert fitted_offset(trace(noise(500, 2), "servo")) == (0.0, np.inf)


@pytest.mark.parametrize("offset_s", [2.0, -1.5, 0.2])
def test_large_offsets_are_found_by_how_the_motion_follows(offset_s):
    made = run(offset_s)
    assert coarse_offset(made, made.run.controller) == pytest.approx(offset_s, abs=0.03)
    assert with_coarse_clocks(made).clock_s["controller"] == pytest.approx(offset_s, abs=0.03)


def test_a_trackers_clock_is_found_by_its_own_motion():
    tip = joints(STAMPS_S - 1.0)[:, :3]
    lengths = replace(LONG, position_mm=LONG.q_cmd_rad[:, :3])
    rows = {"row": np.arange(len(STAMPS_S)), "segments": np.array([[0, len(STAMPS_S)]])}
    table = Tracker(time_s=STAMPS_S, position_mm=tip, **rows)
    made = pair(lengths, tracker=table)
    assert with_coarse_clocks(made).clock_s == {"tracker": pytest.approx(1.0, abs=0.03)}


def test_small_offsets_are_left_to_the_effect_and_another_time_law_is_no_clock():
    for made in (run(), run(0.01), run(stretch=1.03)):
        assert coarse_offset(made, made.run.controller) == 0.0
    assert with_coarse_clocks(replace(run(2.0), from_log=True)).clock_s == {}


def test_no_commanded_joints_no_clock():
    made = pair(LONG, controller=controller(STAMPS_S))
    assert coarse_offset(made, made.run.controller) == 0.0


def test_a_tables_clock_is_set_by_its_link():
    made = with_table_clock(run(0.015), PATH)
    assert made.clock_s["controller"] == pytest.approx(0.015, abs=1e-4)
    (left,) = PATH.traces([made])
    assert np.abs(left.residual).max() < 2e-6
    bare = pair(LONG)
    assert with_table_clock(bare, PATH) is bare


def context(*pairs):
    return Context(tuple(pairs), len(pairs), {}, Mismatch())


def test_controllers_that_keep_to_the_plan_have_their_clocks_set():
    offsets = [1.2e-3, -0.7e-3, 0.1e-3]
    found = with_controller_clocks(context(*(run(o, number=i) for i, o in enumerate(offsets))), PATH)
    assert found.clocks_set
    assert [one.clock_s["controller"] for one in found.pairs] == pytest.approx(offsets, abs=1e-5)


def test_an_offset_that_all_share_beyond_mismatch_is_left_to_be_found():
    offsets = [10.5e-3, 10e-3, 9.5e-3]
    found = with_controller_clocks(context(*(run(o, number=i) for i, o in enumerate(offsets))), PATH)
    assert [one.clock_s["controller"] for one in found.pairs] == pytest.approx([5e-4, 0.0, -5e-4], abs=2e-5)


def test_runs_on_another_time_law_keep_their_clocks():
    before = context(run(stretch=1.02))
    assert with_controller_clocks(before, PATH) is before
