"""Canned programs as inputs of the measuring chain: loads and speeds at the right moments."""

import numpy as np
import pytest

from gcode2krl.canned import REPEAT, draft_of, place_of
from gcode2krl.canned.catalogue import PROGRAMS, SPINDLE_SHARES, WEIGHT_N
from gcode2krl.canned.trial import trials_of
from gcode2krl.cell import load_cell

CELL = load_cell()
TRIALS = {trial.name: trial for trial in trials_of(CELL)}


def test_every_program_but_the_repetition_can_be_tried():
    assert set(TRIALS) == set(PROGRAMS) - {REPEAT}
    assert trials_of(CELL) is trials_of(load_cell())  # remembered


@pytest.mark.parametrize("name", sorted(TRIALS))
def test_a_trial_is_whole(name):
    inputs = TRIALS[name].inputs
    assert np.isfinite(inputs.q_cmd_rad).all()
    assert (np.diff(inputs.time_s) > 0.0).all()
    assert TRIALS[name].minutes >= inputs.time_s[-1] / 60.0
    assert len(inputs) < 6000


def test_weights_pull_only_while_the_robot_stands():
    inputs = TRIALS["weights"].inputs
    pulled = np.linalg.norm(inputs.force_base_N, axis=1) > 0.0
    assert set(np.round(np.linalg.norm(inputs.force_base_N[pulled], axis=1))) == {WEIGHT_N}
    step_mm = np.linalg.norm(np.diff(inputs.position_mm, axis=0), axis=1)
    assert step_mm[pulled[1:] & pulled[:-1]].max() < 1e-9
    directions = {tuple(row) for row in np.round(inputs.force_base_N[pulled] / WEIGHT_N)}
    assert len(directions) == 3
    seconds = pulled.sum() * np.median(np.diff(inputs.time_s))
    assert seconds == pytest.approx(3 * 3 * 10.0, rel=0.05)
    assert inputs.deflection_mm[pulled].any(axis=1).all()


def test_the_spindle_turns_at_its_four_speeds_and_then_stands():
    inputs = TRIALS["spindle"].inputs
    rpm = np.round(inputs.spindle_rad_s * 60.0 / (2.0 * np.pi))
    most = place_of(CELL).most_rpm
    assert set(rpm) == {0.0, *(share * most for share in SPINDLE_SHARES)}
    assert rpm[0] == rpm[-1] == 0.0
    step_s = np.median(np.diff(inputs.time_s))
    for share in SPINDLE_SHARES:
        assert (rpm == share * most).sum() * step_s == pytest.approx(20.0, rel=0.05)
    assert draft_of("spindle", place_of(CELL)).starts == 2 * len(SPINDLE_SHARES)


def test_what_cannot_run_is_left_out():
    assert trials_of(CELL.model_copy(update={"mounted_tool": None})) == ()
