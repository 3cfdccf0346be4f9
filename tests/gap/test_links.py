"""Links: each trace is the measured signal less the right thing, and what later links learn from it."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.gap.compare.links import (
    GEAR,
    LINKS,
    MECHANICS,
    PATH,
    SERVO,
    SIGNALS,
    TIMING,
    ForceLink,
    SurfaceLink,
    TimingLink,
    at_edges,
    logged_correction,
)
from gcode2krl.gap.compare.trace import Link, is_lost
from gcode2krl.runs import Force, RunHead, Tracker
from tests.gap.constructed import controller, joints, motion, pair, stub, table

INPUTS = motion()
STAMPS_S = np.arange(0.1, 9.5, 0.012)
OWN = joints(STAMPS_S)
GENERATOR = np.random.default_rng(1)
LAG, TWIST = 1e-3 * GENERATOR.standard_normal((2, len(STAMPS_S), 6))
FORCE = ForceLink()


def log(**more):
    columns = {"q_cmd_rad": OWN, "q_act_rad": OWN + LAG, "q_load_rad": OWN + LAG + TWIST} | more
    return controller(STAMPS_S, **columns)


def only(link, run, **more):
    (found,) = link.traces([run], **more)
    return found


def test_the_joints_are_compared_side_by_side():
    run = pair(controller=log())
    np.testing.assert_array_equal(only(PATH, run).measured, OWN)
    np.testing.assert_allclose(only(SERVO, run).measured, LAG, atol=1e-15)
    np.testing.assert_allclose(only(GEAR, run).measured, TWIST, atol=1e-15)
    assert np.abs(only(PATH, run).residual).max() < 1e-6  # the model is the plan
    for link in (SERVO, GEAR):
        assert not only(link, run).nominal.any()  # the model is that nothing differs
    assert only(SERVO, run).components == ("A1", "A2", "A3", "A4", "A5", "A6")


def test_force_and_tip_are_compared_with_the_model():
    tip = GENERATOR.standard_normal((len(STAMPS_S), 3))
    push = GENERATOR.standard_normal((len(STAMPS_S), 3))
    run = pair(tracker=table(Tracker, STAMPS_S, position_mm=tip), force=table(Force, STAMPS_S, force_N=push))
    np.testing.assert_array_equal(only(MECHANICS, run).measured, tip)
    np.testing.assert_array_equal(only(FORCE, run).measured, push)
    assert (only(FORCE, run).link.unit, only(MECHANICS, run).link.unit) == ("N", "mm")


def test_the_tip_is_expected_where_the_measured_joints_put_it():
    """An error upstream is not blamed twice: a lag that the drives show is in the model of the tip."""
    slow = 2e-3 * np.sin(STAMPS_S)[:, None] * np.ones(6)
    log_ = controller(STAMPS_S, q_cmd_rad=OWN, q_act_rad=OWN + slow)
    tip = table(Tracker, STAMPS_S, position_mm=np.zeros((len(STAMPS_S), 3)))
    alone, with_log = pair(tracker=tip), pair(tracker=tip, controller=log_)
    moved = only(MECHANICS, with_log).nominal - only(MECHANICS, alone).nominal
    jacobian = INPUTS.jacobian[np.searchsorted(INPUTS.time_s, STAMPS_S)][:, :3]
    np.testing.assert_allclose(moved, np.einsum("nij,nj->ni", jacobian, slow), atol=0.15)
    assert np.abs(moved).max() > 2.0


def test_a_joint_at_rest_or_without_a_column_is_left_out():
    still = OWN.copy()
    still[:, 3] = 0.2
    missing = (OWN + LAG).copy()
    missing[:, 5] = np.nan
    still_actual = missing.copy()
    still_actual[:, 3] = 0.2
    run = pair(controller=controller(STAMPS_S, q_cmd_rad=still, q_act_rad=still_actual))
    assert only(SERVO, run).components == ("A1", "A2", "A3", "A5")


def test_a_logged_correction_is_no_servo_error():
    correction = 1e-4 * GENERATOR.standard_normal((len(STAMPS_S), 6))
    run = pair(controller=log(q_act_rad=OWN + LAG + correction, q_correction_rad=correction))
    np.testing.assert_allclose(only(SERVO, run).measured, LAG, atol=1e-15)


def test_a_correction_at_the_tip_is_one_of_the_joints_by_the_jacobian():
    along = np.tile([0.5, -0.2, 0.3], (len(STAMPS_S), 1))
    table = log(correction_mm=along)
    found = logged_correction(pair(controller=table), table)
    rows = [int(np.argmin(np.abs(INPUTS.time_s - t))) for t in STAMPS_S[::50]]
    for q, row in zip(found[::50], rows, strict=True):
        np.testing.assert_allclose(INPUTS.jacobian[row] @ q, [0.5, -0.2, 0.3, 0, 0, 0], atol=1e-9)


def test_a_correction_of_each_cycle_adds_up_and_a_missing_answer_holds():
    q = np.full((len(STAMPS_S), 6), 1e-5)
    q[10:20] = np.nan
    table = log(q_correction_rad=q)
    found = logged_correction(pair(controller=table), table)
    np.testing.assert_allclose(found, 1e-5)
    relative = pair(head=RunHead(channels={"correction": "relative"}), controller=table)
    np.testing.assert_allclose(logged_correction(relative, table)[:, 0], 1e-5 * np.arange(1, len(q) + 1))


@pytest.mark.parametrize(
    ("link", "changes"),
    [
        (PATH, {"from_log": True}),
        (PATH, {"head": RunHead(angles="relative")}),
        (FORCE, {"from_log": True}),
        (MECHANICS, {"known_robot": False}),
        (MECHANICS, {"from_log": True, "head": RunHead(angles="relative")}),
    ],
)
def test_what_cannot_be_compared_is_no_trace(link, changes):
    zeros = np.zeros((len(STAMPS_S), 3))
    tables = {
        "tracker": table(Tracker, STAMPS_S, position_mm=zeros),
        "force": table(Force, STAMPS_S, force_N=zeros),
    }
    run = pair(controller=log(), **tables)
    assert len(link.traces([run])) == 1
    changed = replace(run, run=replace(run.run, head=changes.pop("head", run.run.head)), **changes)
    assert link.traces([changed]) == []


def test_a_run_without_the_signal_has_no_trace_and_a_short_one_none_either():
    for link in LINKS:
        assert link.traces([pair()]) == []
        assert link.needs
    few = slice(0, 9)
    short = controller(STAMPS_S[few], q_cmd_rad=OWN[few], q_act_rad=OWN[few] + LAG[few])
    assert SERVO.traces([pair(controller=short)]) == []


def test_a_stated_sigma_is_that_of_the_compared_signal():
    head = RunHead(noise={"q_act_deg": 3e-3, "q_load_deg": 4e-3})
    run = pair(head=head, controller=log())
    assert only(SERVO, run).declared_sigma == pytest.approx(np.radians(3e-3))
    assert only(GEAR, run).declared_sigma == pytest.approx(np.radians(5e-3))  # of both encoders
    assert only(PATH, run).declared_sigma == pytest.approx(np.radians(4e-4))
    assert only(GEAR, pair(controller=log())).declared_sigma is None


def test_jumps_of_the_predicted_force_are_left_out():
    cuts = (INPUTS.time_s >= 3.0) & (INPUTS.time_s < 6.0)
    inputs = replace(INPUTS, force_base_N=np.where(cuts[:, None], [80.0, 0.0, 0.0], 0.0))
    near = at_edges(inputs, STAMPS_S)
    away = np.minimum(np.abs(STAMPS_S - 3.0), np.abs(STAMPS_S - 6.0))
    assert near[away < 0.01].all()
    assert not near[away > 0.05].any()
    run = pair(inputs, force=table(Force, STAMPS_S, force_N=np.zeros((len(STAMPS_S), 3))))
    assert len(only(FORCE, run).segments) == 3
    assert not at_edges(INPUTS, STAMPS_S).any()  # no force, no jump


def test_timing_is_of_the_path_and_has_no_trace_of_its_own():
    assert isinstance(TIMING, TimingLink)
    assert TIMING not in SIGNALS
    assert [link.name for link in LINKS if link.tells_time] == ["path"]


@pytest.mark.parametrize(
    ("verdict", "lost"),
    [("unexplained", True), ("partly_explained", True), ("explained", False), ("no_gap", False)],
)
def test_a_model_is_lost_where_its_gap_has_no_name(verdict, lost):
    assert is_lost(stub(verdict=verdict, nearly_all=False)) is lost
    assert not is_lost(stub(verdict=verdict, nearly_all=True))
    assert not is_lost(None)


def test_clocks_of_instruments_are_known_worse_where_the_plans_times_are():
    link = Link()

    def clocks(path_verdict):
        judged = None if path_verdict is None else stub(verdict=path_verdict, nearly_all=False)
        return link.clocks(stub(timing=judged))

    assert [clocks(v) for v in (None, "no_gap", "explained", "unexplained")] == [1, 1, 2, 4]
    without_path = stub(timing=None, has_data=lambda name: name == "servo")
    assert MECHANICS.clocks(without_path) == 2
    assert [PATH.clock_share(stub(clocks_set=known)) for known in (True, False)] == [0.1, 1.0]


def test_the_part_has_points_only_where_a_cutter_of_a_known_robot_was_scanned():
    part = SurfaceLink()
    run = pair()
    assert part.points(run) is None  # no scan
    assert part.points(replace(run, from_log=True)) is None
    assert part.points(replace(run, known_robot=False)) is None
    assert part.base(stub(slips=("slip",), learned=("cause",))) == ("slip", "cause")
