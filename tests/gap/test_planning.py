"""Plans are remembered by what they are made of; predictions are refined where their samples are coarse."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.gap.compare.interpolation import cubic
from gcode2krl.gap.compare.pair import refined_prediction, remembered_plan
from gcode2krl.prediction import Prediction

STEP_S = 0.004
PROGRAM = "G21 G90 G17\nG54\nT1 M6\nS9000 M3\nG0 X0 Y0 Z30\nG1 X80 F6000\nG1 Y60\nG1 X10 Y20\nM30\n"


@pytest.fixture(scope="module")
def prediction() -> Prediction:
    """A short path in air, sampled every 12 ms."""
    import io

    from gcode2krl import load_cell
    from gcode2krl.gcode import read_stream
    from gcode2krl.pipeline import predict_toolpath

    cell = load_cell()
    return predict_toolpath(read_stream(io.BytesIO(PROGRAM.encode()), "p.nc", cell), cell, dt_s=0.012)


def test_the_plan_of_the_predictions_own_targets_is_its_motion(prediction):
    plan = remembered_plan(prediction)
    motion = plan(prediction.targets, prediction.cell)
    np.testing.assert_allclose(motion.position_mm, prediction.motion.position_mm, atol=1e-6)
    np.testing.assert_allclose(motion.time_s, prediction.motion.time_s, atol=1e-9)


def test_the_same_targets_are_planned_once_by_value(prediction):
    plan = remembered_plan(prediction)
    first = plan(prediction.targets, prediction.cell)
    copied = replace(prediction.targets, speed_mm_s=prediction.targets.speed_mm_s.copy())
    assert plan(copied, prediction.cell) is first
    slower = replace(prediction.targets, speed_mm_s=0.5 * prediction.targets.speed_mm_s)
    other = plan(slower, prediction.cell)
    assert other.time_s[-1] > 1.5 * first.time_s[-1]
    assert plan(prediction.targets, prediction.cell) is first


def test_another_controller_is_another_plan(prediction):
    plan = remembered_plan(prediction)
    first = plan(prediction.targets, prediction.cell)
    weak = prediction.cell.model_copy(
        update={"controller": prediction.cell.controller.model_copy(update={"acc_cp_m_s2": 0.3})}
    )
    assert plan(prediction.targets, weak).time_s[-1] > first.time_s[-1] + 0.05


def test_two_predictions_share_no_plan(prediction):
    first, second = remembered_plan(prediction), remembered_plan(prediction)
    assert first(prediction.targets, prediction.cell) is not second(prediction.targets, prediction.cell)


def test_a_coarse_prediction_is_sampled_every_4_ms_along_the_same_motion(prediction):
    fine = refined_prediction(prediction)
    steps = np.diff(fine.motion.time_s)
    assert np.median(steps) == pytest.approx(STEP_S)
    met = cubic(prediction.motion.time_s, fine.motion.time_s, fine.motion.position_mm)
    np.testing.assert_allclose(met, prediction.motion.position_mm, atol=0.02)
    assert len(fine.joints.q_rad) == len(fine.motion)
    assert fine.inputs["dt_s"] == STEP_S


def test_a_fine_prediction_is_left_as_it_is(prediction):
    fine = refined_prediction(prediction)
    assert refined_prediction(fine) is fine


def test_one_that_was_planned_by_other_laws_is_left_as_it_is(prediction):
    """Planned anew, its own samples must be met."""
    moved = replace(prediction.motion, position_mm=prediction.motion.position_mm + np.array([0.0, 0.2, 0.0]))
    other = replace(prediction, motion=moved)
    assert refined_prediction(other) is other


def test_without_motion_or_joints_there_is_nothing_to_refine(prediction):
    for bare in (replace(prediction, motion=None), replace(prediction, joints=None)):
        assert refined_prediction(bare) is bare
