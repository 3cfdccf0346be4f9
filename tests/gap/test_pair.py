"""A run beside its prediction: stamps, rows, and what was measured in place of the model."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation

from gcode2krl import robot
from gcode2krl.effects import Applied, library, simulate
from gcode2krl.gap.compare.pair import usable_rows, with_nominal_joints, with_own_model
from gcode2krl.runs import Force, RunHead, Tracker
from tests.gap.constructed import controller, joints, motion, pair, stub

INPUTS = motion()
SAME_PATH_RAD = 2e-5
"""0.03 mm at an arm's length: a log's last decimal."""
STAMPS_S = np.arange(0.5, 9.0, 0.011)
OWN = joints(STAMPS_S)
LAG = 1e-3 * np.sin(STAMPS_S)[:, None] * np.arange(1, 7)
TWIST = 2e-3 * np.cos(2.0 * STAMPS_S)[:, None] * np.arange(6, 0, -1)

LOG = controller(STAMPS_S, q_cmd_rad=OWN, q_act_rad=OWN + LAG, q_load_rad=OWN + LAG + TWIST)


def at_own(values):
    """Return differences (n, 6) at the prediction's samples."""
    slopes = np.gradient(values, STAMPS_S, axis=0)
    return CubicHermiteSpline(STAMPS_S, values, slopes)(np.clip(INPUTS.time_s, STAMPS_S[0], STAMPS_S[-1]))


def table(kind, **columns):
    count = len(STAMPS_S)
    segments = np.array([[0, count]])
    return kind(time_s=STAMPS_S, row=np.arange(count), segments=segments, **columns)


def test_clock_errors_come_off_the_stamps_of_their_table_alone():
    tip = table(Tracker, position_mm=np.zeros((len(STAMPS_S), 3)))
    run = pair(controller=controller(STAMPS_S), tracker=tip)
    later = run.later("tracker", 0.25).later("tracker", 0.05)
    np.testing.assert_allclose(later.stamps(tip), STAMPS_S - 0.3)
    np.testing.assert_array_equal(later.stamps(later.run.controller), STAMPS_S)
    np.testing.assert_array_equal(run.stamps(tip), STAMPS_S)


def test_rows_of_the_predictions_time_keep_their_segments():
    stamps = np.arange(-1.0, 12.0, 0.5)  # the prediction lasts from 0 to 9.98 s
    short = stub(segments=np.array([[0, 1], [1, 8], [8, 20], [20, 26]]))
    rows, segments = usable_rows(short, stamps, INPUTS)
    np.testing.assert_array_equal(rows, np.arange(2, 22))
    assert (segments == [[0, 6], [6, 18], [18, 20]]).all()
    empty, none = usable_rows(short, stamps + 100.0, INPUTS)
    assert (len(empty), none.shape) == (0, (0, 2))


def test_measured_joints_take_the_place_of_the_models_one_by_one():
    run = pair(
        controller=controller(STAMPS_S, q_cmd_rad=OWN, q_act_rad=OWN + LAG, q_load_rad=OWN + LAG + TWIST)
    )
    commanded = run.with_measured_joints("q_cmd").inputs
    np.testing.assert_array_equal(commanded.q_cmd_rad, INPUTS.q_cmd_rad)
    assert commanded.q_act_rad is None
    actual = run.with_measured_joints("q_act").inputs
    np.testing.assert_allclose(actual.q_act_rad, INPUTS.q_cmd_rad + at_own(LAG), atol=1e-12)
    assert actual.q_load_rad is None
    load = run.with_measured_joints("q_load").inputs
    np.testing.assert_allclose(load.q_load_rad, INPUTS.q_cmd_rad + at_own(LAG + TWIST), atol=1e-12)


@pytest.mark.parametrize(("share", "taken"), [(0.5, False), (2.0, True)])
def test_another_commanded_path_is_taken_over_and_a_rounded_one_is_not(share, taken):
    off = share * SAME_PATH_RAD * np.ones_like(OWN)
    run = pair(controller=controller(STAMPS_S, q_cmd_rad=OWN + off))
    found = run.with_measured_joints("q_cmd").inputs.q_cmd_rad - INPUTS.q_cmd_rad
    np.testing.assert_allclose(found, share * SAME_PATH_RAD if taken else 0.0, atol=1e-6)


def test_without_commanded_joints_the_plan_is_what_drives_follow():
    run = pair(controller=controller(STAMPS_S, q_act_rad=OWN + LAG))
    found = run.with_measured_joints("q_act").inputs.q_act_rad
    np.testing.assert_allclose(found, INPUTS.q_cmd_rad + at_own(LAG), atol=1e-6)


def test_what_a_links_model_says_goes_before_what_its_encoders_say():
    run = pair(
        controller=controller(STAMPS_S, q_cmd_rad=OWN, q_act_rad=OWN + LAG, q_load_rad=OWN + LAG + TWIST)
    )
    modelled = replace(run, fitted={"q_act_rad": 3.0 * LAG, "q_load_rad": 0.0 * TWIST})
    found = modelled.with_measured_joints("q_load").inputs
    np.testing.assert_allclose(found.q_act_rad, INPUTS.q_cmd_rad + at_own(3.0 * LAG), atol=1e-12)
    np.testing.assert_allclose(found.q_load_rad, found.q_act_rad, atol=1e-12)


def test_a_run_without_a_controller_is_left_as_it_is():
    run = pair()
    assert run.with_measured_joints("q_load") is run
    assert with_own_model(run) is run
    assert with_nominal_joints(run) is run
    assert run.with_measured_load() is run


@pytest.mark.parametrize("frame", ["base", "tcp", "sensor"])
def test_a_measured_force_bends_the_arm_as_its_mean_over_50_ms_where_the_cutter_cuts(frame):
    _, quaternion = robot.forward(INPUTS.q_cmd_rad, INPUTS.cell, 1)
    turn = {
        "base": Rotation.identity(),
        "tcp": Rotation.from_quat(quaternion),
        "sensor": Rotation.from_quat(quaternion)
        * Rotation.from_matrix(INPUTS.cell.tool_matrix(1)[:3, :3]).inv(),
    }[frame]
    cuts = (INPUTS.time_s > 2.0) & (INPUTS.time_s < 7.0)
    inputs = replace(INPUTS, force_base_N=np.where(cuts[:, None], 50.0, 0.0) * np.ones(3), forces=stub())
    own_s = INPUTS.time_s
    force = np.stack([100 * np.sin(own_s), 50 * np.cos(own_s), 20 + 0 * own_s], axis=1)
    measured = Force(
        time_s=own_s, row=np.arange(500), segments=np.array([[0, 500]]), force_N=turn.inv().apply(force)
    )
    run = pair(inputs, RunHead(frames={"force": frame}), force=measured)
    found = run.with_measured_load().inputs.load_base_N
    assert not found[~cuts].any()
    # 50 ms are two samples: one and the one before it
    beside = force - inputs.force_base_N
    expected = inputs.force_base_N[1:] + (beside[1:] + beside[:-1]) / 2.0
    np.testing.assert_allclose(found[1:][cuts[1:]], expected[cuts[1:]], atol=1e-9)


def test_edges_of_the_cut_stay_sharp_in_a_measured_load():
    """A force 2 % above the model bends the arm by 2 % more, at the edges of the cut too."""
    cuts = (INPUTS.time_s > 2.0) & (INPUTS.time_s < 7.0)
    inputs = replace(INPUTS, force_base_N=np.where(cuts[:, None], 500.0, 0.0) * np.ones(3), forces=stub())
    measured = Force(
        time_s=inputs.time_s,
        row=np.arange(500),
        segments=np.array([[0, 500]]),
        force_N=1.02 * inputs.force_base_N,
    )
    found = pair(inputs, force=measured).with_measured_load().inputs.load_base_N
    np.testing.assert_allclose(found[cuts], 510.0, atol=5.0 + 1e-9)


def test_what_the_sensor_alone_shows_does_not_bend_the_arm():
    """Effects of the sensor are in what is measured, not in the load."""
    inputs = replace(INPUTS, force_base_N=np.full((500, 3), 100.0), forces=stub())
    zero = Applied(library()["force_offset"], None, {"fx_N": 40.0, "fy_N": 0.0, "fz_N": 0.0})
    seen = simulate(inputs, [zero]).force_meas_base_N
    measured = Force(time_s=inputs.time_s, row=np.arange(500), segments=np.array([[0, 500]]), force_N=seen)
    found = pair(inputs, force=measured).with_measured_load([zero]).inputs.load_base_N
    np.testing.assert_allclose(found, 100.0, atol=1e-9)
