"""Clocks within normal mismatch are taken off the stamps run by run; what all runs share beyond it stays."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.gap.components import Signatures
from gcode2krl.gap.posterior.judgement import with_set_clocks
from tests.gap.constructed import motion, noise, question, trace

NOTHING = question([])
TIME_S = motion().time_s


def late(offset_s, number=0, sigma_mm=1e-3):
    """Return a run's tip whose samples are older than their stamps."""
    inputs = motion()
    moved = trace(np.zeros((500, 3)), "mechanics", number=number, time_s=inputs.time_s - offset_s).nominal
    return replace(
        trace(np.zeros((500, 3)), "mechanics", number=number),
        measured=moved + noise(500, 50 + number, sigma_mm, 3),
    )


def set_by(traces, asked=NOTHING):
    """Return by how much the stamps of each trace were moved, in s."""
    known = Signatures()
    moved = with_set_clocks(traces, asked, known)
    return np.array(
        [np.mean(before.time_s - after.time_s) for before, after in zip(traces, moved, strict=True)]
    )


def test_each_runs_clock_comes_off_its_stamps():
    offsets = [1.2e-3, -0.8e-3, 0.3e-3]
    found = set_by([late(offset, i) for i, offset in enumerate(offsets)])
    np.testing.assert_allclose(found, offsets, atol=2e-5)


def test_the_model_then_meets_the_data():
    one = late(1.5e-3)
    (moved,) = with_set_clocks([one], NOTHING, Signatures())
    assert np.sqrt(np.mean(one.residual**2)) > 0.05
    assert np.sqrt(np.mean(moved.residual**2)) == pytest.approx(1e-3, rel=0.1)


def test_no_more_than_normal_mismatch_is_taken_off():
    """One run in three is 6 ms off: 2 ms of it are usual."""
    found = set_by([late(0.0, 0), late(0.0, 1), late(6e-3, 2)])
    np.testing.assert_allclose(found, [0.0, 0.0, 2e-3], atol=5e-5)
    twice = set_by([late(0.0, 0), late(0.0, 1), late(6e-3, 2)], replace(NOTHING, clocks=2))
    np.testing.assert_allclose(twice, [0.0, 0.0, 4e-3], atol=5e-5)


def test_what_all_runs_share_beyond_it_is_left_to_be_found():
    offsets = np.array([5.5e-3, 4.5e-3, 5.0e-3])
    found = set_by([late(offset, i) for i, offset in enumerate(offsets)])
    np.testing.assert_allclose(found, offsets - 5e-3, atol=2e-4)


def test_of_load_encoders_the_one_side_is_moved():
    """The two encoders of a joint stand in one table: its own clock is that of both."""
    nominal = trace(np.zeros((500, 6)), "gear")
    older = replace(nominal, plus_late_s=1e-3).nominal
    one = replace(nominal, measured=older + noise(500, 3, 1e-6, 6))
    (moved,) = with_set_clocks([one], NOTHING, Signatures())
    assert moved.plus_late_s == pytest.approx(1e-3, abs=5e-5)
    assert (moved.time_s == one.time_s).all()


def test_signatures_of_the_first_stamps_are_kept():
    known, one = Signatures(), late(1e-3)
    (moved,) = with_set_clocks([one], NOTHING, known)
    block = question([library_frame()], None).blocks[0]
    assert known.columns(block, moved) is known.columns(block, one)


def library_frame():
    from gcode2krl.effects import library

    return library()["base_frame"]


@pytest.mark.parametrize("link", ["servo", "path", "force"])
def test_other_links_keep_their_stamps(link):
    one = trace(noise(500, 4, 1.0, 3), link)
    (same,) = with_set_clocks([one], NOTHING, Signatures())
    assert same is one


def test_no_run_is_none():
    assert with_set_clocks([], NOTHING, Signatures()) == []
