"""Runs to pairs: with predictions, with logs alone, and the hours between them."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gcode2krl import robot
from gcode2krl.gap.compare.pair import first_start, hours_since, log_pairs, pairs_of
from gcode2krl.runs import Force, RunHead
from tests.gap.constructed import cell, controller, joints, pair
from tests.gap.test_planning import prediction

__all__ = ["prediction"]
STAMPS_S = np.arange(0.0, 10.0, 0.004)
OWN = np.radians(np.round(np.degrees(joints(STAMPS_S)), 4))
LAST_DECIMAL_RAD = np.radians(1e-4)
START = datetime(2026, 3, 1, 8, 0, tzinfo=UTC)


def run(number=0, head=None, **columns):
    columns = columns or {"q_cmd_rad": OWN}
    return pair(controller=controller(STAMPS_S, **columns), number=number, head=head).run


def started(hours):
    return RunHead(started=START + timedelta(hours=hours))


def test_hours_count_from_the_earliest_start():
    runs = [run(0, started(2.0)), run(1), run(2, started(0.5))]
    first = first_start(runs)
    assert first == START + timedelta(hours=0.5)
    assert [hours_since(first, each) for each in runs] == [1.5, 0.0, 0.0]
    assert first_start([run()]) is None
    assert hours_since(None, run(0, started(2.0))) == 0.0


def test_runs_of_one_prediction_share_its_inputs_and_its_memory(prediction):
    first, second = pairs_of(prediction, [run(0, started(0.0)), run(1, started(3.0))])
    assert (first.number, second.number) == (0, 1)
    assert first.simulator is second.simulator
    assert first.inputs.q_cmd_rad is second.inputs.q_cmd_rad
    assert (first.inputs.hours, second.inputs.hours) == (0.0, 3.0)
    assert np.median(np.diff(first.inputs.time_s)) == pytest.approx(0.004)
    assert not first.from_log


def test_a_logs_own_commands_are_the_path():
    (one,) = log_pairs([run()], cell())
    assert one.from_log
    assert one.known_robot
    np.testing.assert_allclose(one.inputs.q_cmd_rad, OWN, atol=1.01 * LAST_DECIMAL_RAD)
    tip, quaternion = robot.forward(one.inputs.q_cmd_rad, cell(), 1)
    np.testing.assert_allclose(one.inputs.position_mm, tip, atol=1e-9)
    np.testing.assert_allclose(np.abs(np.sum(one.inputs.rotation * quaternion, axis=1)), 1.0, atol=1e-9)
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(tip, axis=0), axis=1))])
    np.testing.assert_allclose(one.inputs.path_mm, way, atol=1e-3)


def test_a_command_that_stands_and_flickers_by_its_last_decimal_does_not_reverse():
    q_deg = np.round(np.degrees(OWN), 3)
    q_deg[:, 2] = 12.345 + 0.001 * (np.arange(len(q_deg)) % 2)
    (one,) = log_pairs([run(q_cmd_rad=np.radians(q_deg))], cell())
    moved = np.diff(one.inputs.q_cmd_rad[5:, 2])
    assert np.abs(moved).max() < 1e-9
    np.testing.assert_allclose(one.inputs.q_cmd_rad, np.radians(q_deg), atol=np.radians(1.01e-3))


@pytest.mark.xfail(
    strict=True,
    reason="the last decimal is taken to be the smallest difference of two values: at constant speed that "
    "is a step, and the path of a log alone comes out a sample late",
)
def test_a_joint_that_turns_steadily_is_where_it_was_commanded():
    q = OWN.copy()
    q[:, 0] = np.radians(np.round(4.0 * STAMPS_S, 4))  # 4 degrees a second, 0.016 a sample
    (one,) = log_pairs([run(q_cmd_rad=q)], cell())
    np.testing.assert_allclose(one.inputs.q_cmd_rad, q, atol=1.01 * LAST_DECIMAL_RAD)


@pytest.mark.parametrize("columns", [{"q_act_rad": OWN}, {"q_load_rad": OWN}])
def test_what_was_not_commanded_is_what_was_measured(columns):
    (one,) = log_pairs([run(**columns)], cell())
    np.testing.assert_allclose(one.inputs.q_cmd_rad, OWN, atol=1.01 * LAST_DECIMAL_RAD)


def test_without_a_robot_or_with_relative_angles_there_is_no_tip():
    (unknown,) = log_pairs([run()], None)
    (relative,) = log_pairs([run(0, RunHead(angles="relative"))], cell())
    assert not unknown.known_robot
    for one in (unknown, relative):
        assert not one.inputs.position_mm.any()


def test_a_measured_force_is_the_load_turned_into_the_base():
    force = Force(
        time_s=STAMPS_S,
        row=np.arange(len(STAMPS_S)),
        segments=np.array([[0, len(STAMPS_S)]]),
        force_N=np.tile([10.0, -20.0, 5.0], (len(STAMPS_S), 1)),
    )
    turns = {"base": Rotation.identity(len(STAMPS_S))}
    turns["tcp"] = Rotation.from_quat(robot.forward(OWN, cell(), 1)[1])
    push = np.array(force.force_N)
    turns["sensor"] = turns["tcp"] * Rotation.from_matrix(cell().tool_matrix(1)[:3, :3]).inv()
    for frame, turn in turns.items():
        made = replace(run(0, RunHead(frames={"force": frame})), force=force)
        (one,) = log_pairs([made], cell())
        np.testing.assert_allclose(one.inputs.force_base_N, turn.apply(push), atol=1e-3)


def test_a_run_without_a_controllers_table_is_left_out_and_keeps_its_number():
    bare = pair(number=0).run
    found = log_pairs([bare, run(1)], cell())
    assert [one.number for one in found] == [1]
    assert log_pairs([run(q_cmd_rad=None)], cell()) == []
