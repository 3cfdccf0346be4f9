"""A tracker in another frame than ``$BASE``: found with its numbers where it is far off."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.effects import inputs_of
from gcode2krl.effects.frame_effect import frame_of
from gcode2krl.gap.compare.pair import Pair
from gcode2krl.gap.posterior.set_up import tracker_frame_slip
from tests.gap.synthetic import LIBRARY, TRUE_STEP_S, applied, prediction, runs


@pytest.fixture(scope="module")
def pair():
    nominal = prediction(dt_s=TRUE_STEP_S)
    run = runs([], 1, 3, base=nominal, normal=False, controller=False, force=False)[0]
    return Pair(run=run, number=0, inputs=inputs_of(nominal))


def _seen_from(pair, frame, stated="base"):
    tracker = pair.run.tracker
    moved = tracker.position_mm @ frame[:3, :3].T + frame[:3, 3]
    frames = pair.run.head.frames.model_copy(update={"tracker": stated})
    head = pair.run.head.model_copy(update={"frames": frames})
    return replace(pair, run=replace(pair.run, head=head, tracker=replace(tracker, position_mm=moved)))


def test_the_frame_is_found(pair):
    truth = applied("base_frame:x_mm=400,y_mm=-250,z_mm=30,a_deg=40,b_deg=3,c_deg=-5")[0]
    (slip,) = tracker_frame_slip([_seen_from(pair, frame_of(truth))], LIBRARY)
    np.testing.assert_allclose(frame_of(slip.applied), frame_of(truth), atol=0.02)
    assert slip.rms_after < 1e-3 * slip.rms_before
    assert "shifted by 473 mm" in slip.words


def test_what_a_robot_may_be_off_by_is_no_other_frame(pair):
    near = frame_of(applied("base_frame:x_mm=5,a_deg=0.5")[0])
    assert tracker_frame_slip([_seen_from(pair, near)], LIBRARY) == []


def test_a_frame_that_run_toml_states_is_none_of_base(pair):
    far = frame_of(applied("base_frame:x_mm=400")[0])
    assert tracker_frame_slip([_seen_from(pair, far, "tcp")], LIBRARY) == []
    assert tracker_frame_slip([_seen_from(pair, far)], {}) == []
