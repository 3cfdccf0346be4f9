"""Set-up slips: what each test finds, and what it leaves to others; the order is that of `test_order`."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from gcode2krl import robot
from gcode2krl.effects import simulate
from gcode2krl.effects.frame_effect import frame_of
from gcode2krl.errors import Issue, input_error
from gcode2krl.gap.compare.clocks import gone
from gcode2krl.gap.compare.interpolation import cubic
from gcode2krl.gap.compare.links import FORCE, MECHANICS, PATH
from gcode2krl.gap.compare.pair import pairs_of, with_nominal_joints, with_own_model
from gcode2krl.gap.compare.slips import (
    _UNITS,
    Curve,
    best_of,
    check_slip,
    checked,
    clock_slips,
    commanded_path,
    force_unit_slip,
    on_the_curve,
    other_feeds,
    other_program,
    override_slip,
    rms_before,
    rms_left,
    slip_if_explained,
    unplanned_stops,
    without_cuts,
)
from gcode2krl.gap.posterior.set_up import first_slip
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.runs import Run, RunHead
from tests.gap.constructed import controller, joints, motion, pair
from tests.gap.synthetic import LIBRARY, PROGRAM, TRUE_STEP_S, applied, prediction, refined, runs, side

JOINTS = {"tracker": False}
FIRST, SECOND = PROGRAM.split("G0 X140 Y40\n")
SHIFTED = f"{FIRST}G0 X140 Y42\n{SECOND.replace('Y60 F2400', 'Y62 F2400').replace('Y-40', 'Y-38')}"
SLOW = PROGRAM.replace("F3000", "F1800").replace("F2400", "F1440").replace("F6000", "F3600")


def with_table(one, table, **columns):
    """Return a pair with other columns in one of its tables."""
    return replace(one, run=replace(one.run, **{table: replace(getattr(one.run, table), **columns)}))


def with_joints(one, time_s, q_rad):
    """Return a pair whose run has nothing but commanded joints."""
    table = controller(time_s, q_cmd_rad=q_rad)
    return replace(one, run=Run(one.run.name, one.run.folder, one.run.head, controller=table))


# What the tests share, on signals whose gap is known

GAP = np.array([[3.0, 4.0], [0.0, 0.0]])


class KnownTrace:
    """A signal whose model is zero; a tool diameter of so many mm takes that share of the gap."""

    link, factor = FORCE, 10.0
    measured = residual = GAP

    def sample(self, effects):
        share = sum(effect["offset_mm"] for effect in effects)
        if share > 1.0:
            raise input_error("cell-key", "no such cutter", "")
        return share * GAP


def taking(share):
    return applied(f"tool_diameter:offset_mm={share}")[0]


def test_the_rms_is_that_of_the_length_of_rows():
    assert rms_before([KnownTrace()]) == pytest.approx(np.sqrt(12.5))
    assert rms_left([KnownTrace()], taking(0.5)) == pytest.approx(0.5 * np.sqrt(12.5))


def test_the_best_leaves_least_and_what_cannot_be_simulated_is_left_out():
    best, left = best_of([KnownTrace()], [taking(0.2), taking(2.0), taking(0.8)])
    assert best["offset_mm"] == 0.8
    assert left == pytest.approx(0.2 * np.sqrt(12.5))
    best, left = best_of([KnownTrace()], [taking(2.0)])
    assert (best["offset_mm"], left) == (2.0, np.inf)


@pytest.mark.parametrize("beyond", [-1e-3, 1e-3])
def test_a_slip_takes_nine_tenths_of_the_power(beyond):
    left = np.sqrt(1.0 - THRESHOLDS.compare.explained_share) * np.sqrt(12.5) * (1.0 + beyond)
    slips = slip_if_explained([KnownTrace()], taking(0.7), left, "words")
    assert len(slips) == (beyond < 0.0)
    for slip in slips:
        assert (slip.link, slip.unit, slip.final, slip.alike) == (FORCE, "N", False, ())
        assert slip.rms_before == pytest.approx(10.0 * np.sqrt(12.5))
        assert slip.rms_after == pytest.approx(10.0 * left)


# The checks of the runs: which findings end the comparison, and as which effect


def odd(code, severity="error"):
    return Issue(severity, code, 2, "tracker.csv: column x_mm is odd", "mend it")


def test_swapped_columns_end_the_comparison_but_of_a_log_alone():
    one = side()
    assert checked([one]) == []
    assert check_slip([one], LIBRARY, ()) == []
    tips_mm = one.run.tracker.position_mm[:, [1, 0, 2]]
    swapped = with_table(one, "tracker", position_mm=tips_mm, source="tracker.csv")
    issues = checked([swapped])
    assert {issue.code for issue in issues} == {"run-axes"}
    (slip,) = check_slip([one], LIBRARY, tuple(issues))
    assert (slip.applied.effect.name, slip.applied.target, slip.final) == ("unit", "tracker", True)
    assert (slip.words, slip.rms_after) == (issues[0].message, None)
    assert checked([replace(swapped, from_log=True)]) == []


@pytest.mark.parametrize(
    ("code", "effect"), [("run-unit", "unit"), ("run-axes", "unit"), ("run-program", "other_program")]
)
def test_an_error_is_the_slip_of_its_code_and_a_warning_or_an_excluded_effect_is_none(code, effect):
    (slip,) = check_slip([side()], LIBRARY, (odd("run-clock"), odd(code)))
    assert slip.applied.effect.name == effect
    assert check_slip([side()], LIBRARY, (odd(code, "warning"),)) == []
    without = {name: each for name, each in LIBRARY.items() if name != effect}
    assert check_slip([side()], without, (odd(code),)) == []


# Clocks that were taken off the stamps, one a table


@pytest.fixture(scope="module")
def three():
    nominal = prediction(dt_s=TRUE_STEP_S)
    some = runs([], 3, 3, base=nominal, normal=False, force=False)
    return [replace(side(), run=run, number=n) for n, run in enumerate(some)]


def late(one, table, offset_s):
    moved = with_table(one, table, time_s=getattr(one.run, table).time_s + offset_s)
    return replace(moved, clock_s={**one.clock_s, table: offset_s})


@pytest.mark.parametrize(("table", "link"), [("controller", PATH), ("tracker", MECHANICS)])
def test_the_median_offset_of_a_table_is_named(three, table, link):
    (slip,) = clock_slips(
        [late(one, table, s) for one, s in zip(three, (0.5, 0.8, 3.0), strict=True)], LIBRARY
    )
    assert (slip.applied.target, slip.link) == (table, link)
    assert slip.applied["offset_s"] == 0.8
    assert slip.rms_after < 0.01 * slip.rms_before
    assert slip.words == f"the clock of {table} is +0.800 s off the prediction's"
    assert not slip.final


def test_each_table_has_a_clock_and_those_of_few_runs_or_no_table_and_excluded_ones_are_not_named(three):
    both = [late(late(one, "controller", 0.5), "tracker", -0.3) for one in three]
    assert [slip.applied["offset_s"] for slip in clock_slips(both, LIBRARY)] == [0.5, -0.3]
    assert clock_slips(three, LIBRARY) == []
    assert clock_slips([late(three[0], "controller", 0.5), *three[1:]], LIBRARY) == []
    assert clock_slips(both, {}) == []
    bare = [replace(one, run=replace(one.run, tracker=None), clock_s={"tracker": 1.0}) for one in three]
    assert clock_slips(bare, LIBRARY) == []


# Units of force


def forces(factor):
    one = side(controller=False, tracker=False, force=True)
    return with_table(one, "force", force_N=factor * one.run.force.force_N)


def test_a_factor_is_how_many_of_the_unit_a_newton_is():
    of_unit = {name: factor for factor, name in _UNITS.items()}
    assert of_unit["kilograms-force"] == pytest.approx(1.0 / 9.80665, rel=1e-6)
    assert of_unit["pounds-force"] == pytest.approx(1.0 / 4.4482216, rel=1e-6)


@pytest.mark.parametrize("factor", _UNITS)
def test_a_unit_is_found(factor):
    (slip,) = force_unit_slip([forces(factor)], LIBRARY)
    assert (slip.applied.target, slip.applied["factor"]) == ("force", factor)
    assert _UNITS[factor] in slip.words


def test_another_factor_is_no_unit_and_without_forces_or_effect_there_is_none():
    for factor in (1.0, 1.5, 0.3, -1.0):
        assert force_unit_slip([forces(factor)], LIBRARY) == []
    assert force_unit_slip([side()], LIBRARY) == []
    assert force_unit_slip([forces(1e-3)], {}) == []


# Dry runs beside a prediction with forces: stated, or told by where the tip is


def in_air(cuts, stated=None, *texts):
    one = side(*texts, cuts=cuts, normal=cuts)
    return replace(one, run=replace(one.run, head=one.run.head.model_copy(update={"in_air": stated})))


@pytest.mark.parametrize(
    ("cuts", "stated", "is_in_air", "codes"),
    [
        (False, None, True, ["run-in-air"]),
        (False, True, True, []),
        (False, False, False, []),
        (True, None, False, []),
        (True, True, True, []),
    ],
)
def test_a_run_in_air_has_no_forces(cuts, stated, is_in_air, codes):
    (one,), issues = without_cuts([in_air(cuts, stated)])
    assert (not one.inputs.force_base_N.any()) == is_in_air
    assert (one.inputs.forces is None) == is_in_air
    assert [issue.code for issue in issues] == codes


def test_a_gap_as_large_as_the_deflection_is_no_run_in_air():
    stiff = in_air(True, None, "stiffness:target=A1,scale=2", "stiffness:target=A2,scale=2")
    (one,), issues = without_cuts([stiff])
    assert one.inputs.force_base_N.any()
    assert not issues


# Another override


@pytest.mark.slow
@pytest.mark.parametrize("signals", [JOINTS, {"controller": False}])
def test_the_override_is_found_by_joints_or_by_the_tip(signals):
    (slip,) = override_slip([side("override:percent=72", **signals)], LIBRARY)
    assert slip.applied["percent"] == pytest.approx(72.0, abs=0.2)
    assert slip.rms_after < 0.1 * slip.rms_before
    assert slip.words.startswith("the run was at 7")


def test_what_is_no_override_is_left_to_other_tests():
    """A small difference, another path, a log alone, and an effect that is excluded."""
    assert override_slip([side("override:percent=97", **JOINTS)], LIBRARY) == []
    one = side("override:percent=72", **JOINTS)
    rows = slice(0, int(0.8 * len(one.run.controller.time_s)))
    names = ("time_s", "row", "q_cmd_rad", "q_act_rad")
    columns = {name: getattr(one.run.controller, name)[rows] for name in names}
    shorter = with_table(one, "controller", segments=np.array([[0, rows.stop]]), **columns)
    assert override_slip([shorter], LIBRARY) == []
    assert override_slip([replace(one, from_log=True)], LIBRARY) == []
    assert override_slip([one], {}) == []


# Stops that nobody planned


def stopped(*texts):
    some = runs(applied(*texts), 2, 5, tracker=False, force=False)
    return unplanned_stops(list(pairs_of(refined(), some)), LIBRARY)


@pytest.mark.slow
def test_stops_are_found_with_their_hold():
    (slip,), planned = stopped("advance_stop:count=2,hold_s=0.08")
    assert slip.applied.values["count"] == 2.0
    assert slip.applied.values["hold_s"] == pytest.approx(0.08, abs=0.005)
    assert slip.rms_after < 0.05 * slip.rms_before
    assert "stopped exactly" in slip.words
    (as_planned,) = pairs_of(refined(), runs([], 1, 5, tracker=False, force=False))
    assert len(planned[0].inputs.time_s) > len(as_planned.inputs.time_s)


@pytest.mark.slow
@pytest.mark.parametrize(
    "texts", [(), ("velocity_rule:acc_cp_m_s2=1.2",), ("clock:target=controller,offset_s=0.2",)]
)
def test_another_law_or_clock_is_no_stop(texts):
    assert stopped(*texts)[0] == []


def test_how_far_a_noisy_signal_has_gone():
    t = np.arange(0.0, 10.0, 0.01)
    x = np.where(t < 4.0, 50.0 * t, np.where(t < 6.0, 200.0, 200.0 + 50.0 * (t - 6.0)))
    noisy = np.column_stack([x, 0.0 * x]) + np.random.default_rng(1).normal(0.0, 0.02, (len(t), 2))
    _, raw = gone(t, noisy, 0.0)
    _, way = gone(t, noisy, 0.5)
    assert raw[-1] > 1.01 * 400.0  # standing still in noise looks like motion
    assert way[-1] == pytest.approx(400.0, rel=2e-3)


# The commanded path beside the planned curve: distances by brute force

INPUTS = motion(10.0, 0.004)
STAMPS_S = np.arange(0.0, 9.9, 0.012)
OWN = joints(STAMPS_S)


def nearest_on_segments(point, corners):
    """Return the distance of a point from a polyline, segment by segment."""
    best = np.inf
    for a, b in pairwise(corners):
        along = b - a
        share = np.clip(np.dot(point - a, along) / max(np.dot(along, along), 1e-30), 0.0, 1.0)
        best = min(best, float(np.linalg.norm(point - a - share * along)))
    return best


def test_feet_on_a_curve_are_those_of_a_loop_over_its_segments():
    t = np.linspace(0.0, 4.0, 120)
    corners = np.stack([40 * np.cos(t), 30 * np.sin(2 * t), 5 * t], axis=1)
    points = corners[::7] + np.random.default_rng(1).normal(0.0, 2.0, (18, 3))
    feet, distance, along = Curve(corners).foot(points)
    np.testing.assert_allclose(distance, [nearest_on_segments(p, corners) for p in points], atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(points - feet, axis=1), distance, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(along, axis=1), 1.0, atol=1e-9)
    inside = np.abs(np.sum((points - feet) * along, axis=1)) < 1e-6  # across, but at a corner
    assert inside.mean() > 0.5


def test_a_straight_line_by_hand():
    curve = Curve(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [100.0, 0.0, 0.0]]))
    feet, distance, along = curve.foot(np.array([[30.5, 3.0, 4.0], [-6.0, 8.0, 0.0], [100.0, 0.0, 2.0]]))
    np.testing.assert_allclose(feet, [[30.5, 0, 0], [0, 0, 0], [100, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(distance, [5.0, 10.0, 2.0])
    np.testing.assert_allclose(along, [[1.0, 0.0, 0.0]] * 3)


def commanded(q_rad=OWN, **more):
    return pair(INPUTS, controller=controller(STAMPS_S, q_cmd_rad=q_rad), **more)


def test_a_path_as_planned_is_on_the_curve_with_its_whole_way():
    found = commanded_path(commanded())
    assert found.apart_mm.max() < 0.01
    tips, _ = robot.forward(OWN, INPUTS.cell, 1)
    length = np.sum(np.linalg.norm(np.diff(tips, axis=0), axis=1))
    assert found.way_mm.sum() == pytest.approx(length, rel=0.01)
    assert found.gone_mm[-1] == pytest.approx(length, rel=0.01)
    assert found.share(found.apart_mm < 1.0) == 1.0
    assert (found.on_mm, found.off_mm) == (0.03, 0.2)


def test_the_last_decimal_of_the_log_widens_what_is_on_the_curve():
    """A tenth of a degree is millimetres at the arm's length: twice that is on, five times is not off."""
    found = commanded_path(commanded(np.radians(np.round(np.degrees(OWN), 1))))
    root = np.linalg.inv(INPUTS.cell.base_matrix())[:3, 3]
    reach = np.linalg.norm(robot.forward(OWN, INPUTS.cell, 1)[0] - root, axis=1).max()
    assert found.resolution_mm == pytest.approx(np.radians(0.1) * reach, rel=0.02)
    assert (found.on_mm, found.off_mm) == (2.0 * found.resolution_mm, 5.0 * found.resolution_mm)
    assert found.apart_mm.max() < found.off_mm


def test_what_cannot_be_compared_is_none():
    """A log alone, relative angles, an unknown joint, no motion, no table."""
    for one in (replace(commanded(), from_log=True), commanded(head=RunHead(angles="relative"))):
        assert commanded_path(one) is None
        assert on_the_curve(one)
    unknown = OWN.copy()
    unknown[:, 5] = np.nan
    assert commanded_path(commanded(unknown)) is None
    assert commanded_path(commanded(np.tile(OWN[:1], (len(OWN), 1)))) is None
    assert commanded_path(pair(INPUTS)) is None


def shifted(frame):
    """Return joints whose tips are the planned ones moved by a frame, by Newton steps."""
    q = OWN.copy()
    tips, _ = robot.forward(OWN, INPUTS.cell, 1)
    wanted = tips @ frame[:3, :3].T + frame[:3, 3]
    rows = np.clip(np.searchsorted(INPUTS.time_s, STAMPS_S), 0, len(INPUTS) - 1)
    inverse = np.linalg.pinv(INPUTS.jacobian[rows][:, :3])
    for _ in range(8):
        q += np.einsum("nij,nj->ni", inverse, wanted - robot.forward(q, INPUTS.cell, 1)[0])
    return q


def test_a_frame_brings_a_path_onto_the_curve_that_was_commanded_in_it():
    turn = np.radians(1.0)
    frame, small = np.eye(4), np.eye(4)
    frame[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    frame[:3, 3] = [4.0, -3.0, 2.0]
    # the way to the start and from the end is no part of the program, so it begins and ends near the curve
    small[:3, 3] = [0.12, 0.0, 0.0]
    moved = commanded(shifted(small))
    assert not on_the_curve(moved)
    assert on_the_curve(moved, small)
    assert on_the_curve(commanded())
    assert not on_the_curve(commanded(), frame)


# Feeds of another program, on a commanded path whose times are stretched by hand


def at_shares(feeds, rapids, beside_mm=0.0):
    """Return the commanded path, gone at these shares of the predicted speeds of feed and rapid moves."""
    path = commanded_path(side(**JOINTS))
    inputs = path.inputs
    rapid = inputs.toolpath.rapid[inputs.move[np.searchsorted(inputs.time_s, path.time_s[1:])]]
    steps_s = np.diff(path.time_s) / np.where(rapid, rapids, feeds)
    time_s = np.concatenate([[0.0], np.cumsum(steps_s)])
    return replace(path, time_s=time_s, apart_mm=path.apart_mm + beside_mm)


@pytest.mark.parametrize(("feeds", "rapids", "percent"), [(0.8, 1.0, 80), (1.3, 1.0, 130), (0.4, 0.5, 40)])
def test_feeds_at_another_share_than_rapids_are_another_program(feeds, rapids, percent):
    words = other_feeds([at_shares(feeds, rapids)])
    assert words.startswith(f"feed moves at {percent} % of the predicted speed, rapid ones at")


@pytest.mark.parametrize(
    "shares",
    [
        [(1.0, 1.0)],
        [(0.5, 0.5)],
        [(1.0, 0.4)],
        [(0.97, 1.0)],
        [(1.3, 0.8)],  # faster feeds beside slow rapids
        [(0.6, 1.0), (0.8, 1.0)],  # they scatter
        [(0.6, 1.0, 10.0)],  # along another curve
        [],
    ],
)
def test_other_feeds_show_nothing(shares):
    assert other_feeds([at_shares(*each) for each in shares]) is None


# Another program, another base, a model of the controller's own


def test_a_path_shifted_from_a_move_on_is_another_program():
    words = other_program([side(program=SHIFTED, **JOINTS)])
    assert words is not None
    assert "up to 2 mm beside the predicted one" in words
    at_s = float(words.split("t = ")[1].split(" s ")[0])
    inputs = side(**JOINTS).inputs
    assert at_s == pytest.approx(inputs.time_s[inputs.source_line > FIRST.count("\n")][0], abs=1.0)


def test_it_is_said_before_everything_else_and_ends_the_comparison():
    slips = first_slip([side(program=SHIFTED, **JOINTS)], LIBRARY)
    assert [(slip.applied.effect.name, slip.final) for slip in slips] == [("other_program", True)]


@pytest.mark.parametrize("cdis_mm", [3, 20, 50])
def test_corners_alone_are_the_same_program(cdis_mm):
    pair = side(f"corner:cdis_mm={cdis_mm}", **JOINTS)
    assert commanded_path(pair).apart_mm.max() > 0.15 * cdis_mm
    assert other_program([pair]) is None


@pytest.mark.parametrize(
    "text",
    [
        "base_number:y_mm=1.5",
        "base_number:x_mm=0.6,a_deg=0.1",
        "absolute_accuracy:offsets_deg=0.02/0.02/0/0/0.05/0",
    ],
)
def test_what_is_off_everywhere_is_the_same_program(text):
    pair = side(text, **JOINTS)
    assert commanded_path(pair).apart_mm.max() > 0.3
    assert other_program([pair]) is None


def test_the_way_to_the_start_and_from_the_end_is_no_program():
    pair = side(**JOINTS)
    table = pair.run.controller
    away = table.q_cmd_rad[[0, -1]] + [[0.2, 0, 0, 0, 0, 0]]
    share = np.linspace(1.0, 0.0, 100, endpoint=False)[:, None]
    q = np.concatenate(
        [
            table.q_cmd_rad[0] + share * (away[0] - table.q_cmd_rad[0]),
            table.q_cmd_rad,
            table.q_cmd_rad[-1] + share[::-1] * (away[1] - table.q_cmd_rad[-1]),
        ]
    )
    assert other_program([with_joints(pair, 0.012 * np.arange(len(q)), q)]) is None


def test_slower_feeds_beside_rapid_moves_as_planned_are_another_program():
    words = other_program([side(program=SLOW, **JOINTS)])
    assert words is not None
    assert words.startswith("feed moves at 60 % of the predicted speed, rapid ones at 100 %")


def test_an_override_is_no_other_program():
    pair = side("override:percent=60", **JOINTS)
    assert other_program([pair]) is None
    slips = first_slip([pair], LIBRARY)
    assert [slip.applied.effect.name for slip in slips] == ["override"]
    assert slips[0].applied["percent"] == pytest.approx(60.0, abs=0.1)


def test_slower_rapid_moves_alone_are_no_other_program():
    pair = side(**JOINTS)
    inputs = pair.inputs
    held = inputs.targets.speed_mm_s.copy()
    held[held > 120.0] = 120.0
    slow = inputs.replanned(replace(inputs.targets, speed_mm_s=held), inputs.cell)
    assert slow.time_s[-1] > inputs.time_s[-1] + 0.2
    time_s = np.arange(0.0, slow.time_s[-1], 0.012)
    slower = with_joints(pair, time_s, cubic(time_s, slow.time_s, slow.q_cmd_rad))
    assert other_program([slower]) is None


@pytest.mark.parametrize(
    ("text", "alike"),
    [("base_number:x_mm=30,y_mm=-12", (("tool_number", None),)), ("base_number:x_mm=30,a_deg=2", ())],
)
def test_a_mere_shift_may_be_a_tool_as_well(text, alike):
    slips = first_slip([side(text, **JOINTS)], LIBRARY)
    assert [(slip.applied.effect.name, slip.alike) for slip in slips] == [("base_number", alike)]


def test_a_model_of_the_controllers_own_is_no_other_base():
    pair = _with_own_model(side(**JOINTS))
    slips = first_slip([pair], LIBRARY)
    assert slips == []
    text = "base_number:x_mm=30,a_deg=2"
    frame = frame_of(applied(text)[0])
    assert on_the_curve(side(text, **JOINTS), frame)
    assert not on_the_curve(pair, frame)


def test_the_controllers_joints_come_back_to_the_plan_and_its_drives_stay():
    texts = "servo_lag:target=A1,tau_s=0.01", "clock:target=controller,offset_s=0.003"
    pair = _with_own_model(side(*texts, **JOINTS))
    before, planned = pair.run.controller, pair.inputs
    on_time = with_own_model(pair)
    assert on_time.clock_s["controller"] == pytest.approx(0.003, abs=2e-5)
    nominal = with_nominal_joints(replace(on_time, inputs=planned))
    after = nominal.run.controller
    wanted = cubic(nominal.stamps(after), planned.time_s, planned.q_cmd_rad)
    assert np.abs(before.q_cmd_rad - wanted).max() > 5e-4
    np.testing.assert_allclose(after.q_cmd_rad, wanted, atol=1e-12)
    lag = before.q_act_rad - before.q_cmd_rad
    np.testing.assert_allclose(after.q_act_rad - after.q_cmd_rad, lag, atol=1e-12)


def _with_own_model(one):
    """Return a pair whose controller's joints differ with the pose, by millimetres at the tip."""
    q, actual = one.run.controller.q_cmd_rad, one.run.controller.q_act_rad
    added = 2e-3 * np.sin(3.0 * q[:, [1, 0, 1, 0, 2, 1]] + np.arange(6)) + 1e-3
    return with_table(one, "controller", q_cmd_rad=q + added, q_act_rad=actual + added)


def test_load_data_of_another_tool_differ_in_mass_and_centre():
    inputs = side(**JOINTS).inputs
    stated, tool = inputs.cell.load, inputs.cell.tool_matrix(1)
    further = np.array([40.0, -60.0, 100.0])
    centre = tool[:3, :3].T @ (np.array([stated.x_mm, stated.y_mm, stated.z_mm]) + further - tool[:3, 3])
    load, weight = applied(
        "load:mass_kg=25,dx_mm=40,dy_mm=-60,dz_mm=100",
        f"gravity:payload_kg=25,cx_mm={centre[0]},cy_mm={centre[1]},cz_mm={centre[2]}",
    )
    tips = [simulate(inputs, [one]).tcp_base_mm for one in (load, weight)]
    at_the_stated = simulate(inputs, applied("load:mass_kg=25")).tcp_base_mm
    np.testing.assert_allclose(tips[0], tips[1], atol=1e-9)
    assert np.abs(tips[0] - at_the_stated).max() > 0.01
