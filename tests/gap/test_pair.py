"""A run beside its prediction: stamps, rows, plans, and what was measured in place of the model."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation

from gcode2krl import robot
from gcode2krl.effects import Applied, library, simulate
from gcode2krl.effects.dependence import Dependence
from gcode2krl.gap.compare import pair as pairing
from gcode2krl.gap.compare.interpolation import cubic
from gcode2krl.gap.compare.pair import (
    Simulator,
    first_start,
    hours_since,
    log_pairs,
    pairs_of,
    refined_prediction,
    remembered_plan,
    temperature_at,
    usable_rows,
    with_nominal_joints,
    with_own_model,
)
from gcode2krl.gap.components import Grid
from gcode2krl.prediction import Prediction
from gcode2krl.runs import Force, RunHead, Tracker
from tests.gap.constructed import (
    Added,
    applied,
    cell,
    controller,
    joints,
    motion,
    noise,
    pair,
    stub,
    table,
    trace,
)

# A run beside its prediction: stamps, rows, and what was measured in place of the model

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


def test_clock_errors_come_off_the_stamps_of_their_table_alone():
    tip = table(Tracker, STAMPS_S, position_mm=np.zeros((len(STAMPS_S), 3)))
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
    run = pair(controller=LOG)
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
    run = pair(controller=LOG)
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
    measured = table(Force, own_s, force_N=turn.inv().apply(force))
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
    measured = table(Force, inputs.time_s, force_N=1.02 * inputs.force_base_N)
    found = pair(inputs, force=measured).with_measured_load().inputs.load_base_N
    np.testing.assert_allclose(found[cuts], 510.0, atol=5.0 + 1e-9)


def test_what_the_sensor_alone_shows_does_not_bend_the_arm():
    """Effects of the sensor are in what is measured, not in the load."""
    inputs = replace(INPUTS, force_base_N=np.full((500, 3), 100.0), forces=stub())
    zero = Applied(library()["force_offset"], None, {"fx_N": 40.0, "fy_N": 0.0, "fz_N": 0.0})
    seen = simulate(inputs, [zero]).force_meas_base_N
    measured = table(Force, inputs.time_s, force_N=seen)
    found = pair(inputs, force=measured).with_measured_load([zero]).inputs.load_base_N
    np.testing.assert_allclose(found, 100.0, atol=1e-9)


# Plans are remembered by what they are made of; predictions are refined where their samples are coarse

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


# Runs to pairs: with predictions, with logs alone, and the hours between them

FINE_S = np.arange(0.0, 10.0, 0.004)
ROUNDED_RAD = np.radians(np.round(np.degrees(joints(FINE_S)), 4))
LAST_DECIMAL_RAD = np.radians(1e-4)
START = datetime(2026, 3, 1, 8, 0, tzinfo=UTC)


def run(number=0, head=None, **columns):
    columns = columns or {"q_cmd_rad": ROUNDED_RAD}
    return pair(controller=controller(FINE_S, **columns), number=number, head=head).run


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
    np.testing.assert_allclose(one.inputs.q_cmd_rad, ROUNDED_RAD, atol=1.01 * LAST_DECIMAL_RAD)
    tip, quaternion = robot.forward(one.inputs.q_cmd_rad, cell(), 1)
    np.testing.assert_allclose(one.inputs.position_mm, tip, atol=1e-9)
    np.testing.assert_allclose(np.abs(np.sum(one.inputs.rotation * quaternion, axis=1)), 1.0, atol=1e-9)
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(tip, axis=0), axis=1))])
    np.testing.assert_allclose(one.inputs.path_mm, way, atol=1e-3)


def test_a_command_that_stands_and_flickers_by_its_last_decimal_does_not_reverse():
    q_deg = np.round(np.degrees(ROUNDED_RAD), 3)
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
    q = ROUNDED_RAD.copy()
    q[:, 0] = np.radians(np.round(4.0 * FINE_S, 4))  # 4 degrees a second, 0.016 a sample
    (one,) = log_pairs([run(q_cmd_rad=q)], cell())
    np.testing.assert_allclose(one.inputs.q_cmd_rad, q, atol=1.01 * LAST_DECIMAL_RAD)


@pytest.mark.parametrize("columns", [{"q_act_rad": ROUNDED_RAD}, {"q_load_rad": ROUNDED_RAD}])
def test_what_was_not_commanded_is_what_was_measured(columns):
    (one,) = log_pairs([run(**columns)], cell())
    np.testing.assert_allclose(one.inputs.q_cmd_rad, ROUNDED_RAD, atol=1.01 * LAST_DECIMAL_RAD)


def test_without_a_robot_or_with_relative_angles_there_is_no_tip():
    (unknown,) = log_pairs([run()], None)
    (relative,) = log_pairs([run(0, RunHead(angles="relative"))], cell())
    assert not unknown.known_robot
    for one in (unknown, relative):
        assert not one.inputs.position_mm.any()


def test_a_measured_force_is_the_load_turned_into_the_base():
    force = table(Force, FINE_S, force_N=np.tile([10.0, -20.0, 5.0], (len(FINE_S), 1)))
    turns = {"base": Rotation.identity(len(FINE_S))}
    turns["tcp"] = Rotation.from_quat(robot.forward(ROUNDED_RAD, cell(), 1)[1])
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


# Commanded paths are simulated once for what they were planned from, whatever object holds it


class Counted(Added):
    """Takes (1 + size) of the time; counts how often it is planned."""

    def __init__(self):
        super().__init__("counted", np.sin)
        self.times = 0

    def replan(self, inputs, applied):
        self.times += 1
        return replace(inputs, time_s=inputs.time_s * (1.0 + applied["size_rad"]))


def test_a_path_is_planned_once_and_by_value():
    simulator, effect = Simulator(), Counted()
    first = simulator.commanded(motion(), [applied(effect, 0.1)])
    same = replace(motion(), time_s=motion().time_s.copy(), q_cmd_rad=motion().q_cmd_rad.copy())
    assert simulator.commanded(same, [applied(effect, 0.1)]) is first
    assert effect.times == 1
    np.testing.assert_allclose(first.time_s, motion().time_s * 1.1)


def test_another_size_target_or_motion_is_another_path():
    simulator, effect = Simulator(), Counted()
    first = simulator.commanded(motion(), [applied(effect, 0.1)])
    moved = replace(motion(), q_cmd_rad=motion().q_cmd_rad + 0.1)
    later = replace(motion(), time_s=motion().time_s + 1.0)
    others = [
        simulator.commanded(motion(), [applied(effect, 0.2)]),
        simulator.commanded(motion(), [applied(effect, 0.1, "A2")]),
        simulator.commanded(moved, [applied(effect, 0.1)]),
        simulator.commanded(later, [applied(effect, 0.1)]),
        simulator.commanded(motion(), []),
    ]
    assert len({id(each) for each in [first, *others]}) == 6
    np.testing.assert_array_equal(others[2].q_cmd_rad, moved.q_cmd_rad)


def test_an_effect_that_is_in_the_plan_already_is_not_planned_again():
    simulator, effect = Simulator(), Counted()
    planned = replace(applied(effect, 0.1), planned=True)
    np.testing.assert_array_equal(simulator.commanded(motion(), [planned]).time_s, motion().time_s)
    assert effect.times == 0
    assert simulator.commanded(motion(), [applied(effect, 0.1)]).time_s[-1] > motion().time_s[-1]


def test_the_oldest_are_forgotten_beyond_64():
    simulator, clock = Simulator(), library()["clock"]
    short = motion(1.0)

    def late(number):
        return [Applied(clock, "controller", {"offset_s": 1e-3 * number, "skew": 0.0})]

    first, second = (simulator.commanded(short, late(number)) for number in (0, 1))
    for number in range(2, 65):
        simulator.commanded(short, late(number))
    assert simulator.commanded(short, late(1)) is second
    assert simulator.commanded(short, late(0)) is not first


def test_two_simulators_share_nothing():
    path = [applied(Counted(), 0.1)]
    assert Simulator().commanded(motion(), path) is not Simulator().commanded(motion(), path)


def test_of_long_runs_the_last_fine_path_alone_is_kept(monkeypatch):
    simulator, made = Simulator(), []

    def finer(inputs):
        made.append(replace(inputs))
        return made[-1]

    monkeypatch.setattr(pairing, "with_corners", finer)
    for limit, kept in ((10**6, [0, 1]), (10, [2])):
        monkeypatch.setattr(pairing, "_LIMITS", replace(pairing._LIMITS, remembered_rows=limit))
        for later_s in (1.0, 2.0) if limit > 10 else (3.0,):
            simulator.commanded(replace(motion(), time_s=motion().time_s + later_s), [])
        assert list(simulator._fine.values()) == [made[number] for number in kept]


# Logged temperatures at the samples of a model, and as what a gap depends on

TIME_S = np.arange(0.0, 10.0, 0.02)


def logged(**columns):
    return controller(TIME_S, **columns)


def test_places_come_first_the_ambient_last_and_gaps_are_filled():
    places = np.full((len(TIME_S), 8), np.nan)
    places[:, 2] = 20.0 + 0.1 * TIME_S
    places[100:400, 2] = np.nan
    found = temperature_at(logged(temperature_C=places, ambient_C=np.full((len(TIME_S), 1), 18.0)), TIME_S)
    assert found.shape == (len(TIME_S), 2)
    np.testing.assert_allclose(found[:, 0], 20.0 + 0.1 * TIME_S)
    np.testing.assert_allclose(found[:, 1], 18.0)


def test_without_a_logged_value_there_is_none():
    assert temperature_at(None, TIME_S) is None
    assert temperature_at(logged(), TIME_S) is None
    assert temperature_at(logged(temperature_C=np.full((len(TIME_S), 8), np.nan)), TIME_S) is None


@pytest.mark.parametrize("logged", [True, False])
def test_temperature_is_a_family_where_it_was_logged(logged):
    warm_C = (20.0 + np.sqrt(TIME_S))[:, None] if logged else None
    inputs = replace(motion(), temperature_C=warm_C)
    grid = Grid([trace(noise(500, 1, width=2), inputs=inputs)], [1.0, 1.0])
    assert (Dependence.TEMPERATURE in {family.on for family in grid.families()}) == logged
