"""Slips that the commanded path shows: another program, other feeds, another base, a model of its own."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.effects import inputs_of, simulate
from gcode2krl.effects.frame_effect import frame_of
from gcode2krl.gap.compare.interpolation import cubic
from gcode2krl.gap.compare.pair import Pair, with_nominal_joints, with_own_model
from gcode2krl.gap.compare.slips import commanded_path, on_the_curve, other_program
from gcode2krl.gap.posterior.set_up import first_slip
from gcode2krl.runs import Controller, Run
from tests.gap.synthetic import LIBRARY, PROGRAM, TRUE_STEP_S, applied, prediction, runs

FIRST, SECOND = PROGRAM.split("G0 X140 Y40\n")
SHIFTED = f"{FIRST}G0 X140 Y42\n{SECOND.replace('Y60 F2400', 'Y62 F2400').replace('Y-40', 'Y-38')}"
SLOW = PROGRAM.replace("F3000", "F1800").replace("F2400", "F1440").replace("F6000", "F3600")


def _side(effects: list, program: str = PROGRAM) -> Pair:
    made = runs(
        effects, 1, 3, base=prediction(program, TRUE_STEP_S), normal=False, tracker=False, force=False
    )
    return Pair(run=made[0], number=0, inputs=inputs_of(prediction(dt_s=TRUE_STEP_S)))


def test_a_path_shifted_from_a_move_on_is_another_program():
    words = other_program([_side([], SHIFTED)])
    assert words is not None
    assert "up to 2 mm beside the predicted one" in words
    at_s = float(words.split("t = ")[1].split(" s ")[0])
    inputs = _side([]).inputs
    assert at_s == pytest.approx(inputs.time_s[inputs.source_line > FIRST.count("\n")][0], abs=1.0)


def test_it_is_said_before_everything_else_and_ends_the_comparison():
    slips = first_slip([_side([], SHIFTED)], LIBRARY)
    assert [(slip.applied.effect.name, slip.final) for slip in slips] == [("other_program", True)]


@pytest.mark.parametrize("cdis_mm", [3, 20, 50])
def test_corners_alone_are_the_same_program(cdis_mm):
    pair = _side(applied(f"corner:cdis_mm={cdis_mm}"))
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
    pair = _side(applied(text))
    assert commanded_path(pair).apart_mm.max() > 0.3
    assert other_program([pair]) is None


def test_the_way_to_the_start_and_from_the_end_is_no_program():
    pair = _side([])
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
    time_s = 0.012 * np.arange(len(q))
    longer = Controller(
        time_s=time_s, row=np.arange(len(q)) + 2, segments=np.array([[0, len(q)]]), q_cmd_rad=q
    )
    run = Run(pair.run.name, pair.run.folder, pair.run.head, controller=longer)
    assert other_program([replace(pair, run=run)]) is None


def test_slower_feeds_beside_rapid_moves_as_planned_are_another_program():
    words = other_program([_side([], SLOW)])
    assert words is not None
    assert words.startswith("feed moves at 60 % of the predicted speed, rapid ones at 100 %")


def test_an_override_is_no_other_program():
    pair = _side(applied("override:percent=60"))
    assert other_program([pair]) is None
    slips = first_slip([pair], LIBRARY)
    assert [slip.applied.effect.name for slip in slips] == ["override"]
    assert slips[0].applied["percent"] == pytest.approx(60.0, abs=0.1)


def test_slower_rapid_moves_alone_are_no_other_program():
    pair = _side([])
    inputs = pair.inputs
    held = inputs.targets.speed_mm_s.copy()
    held[held > 120.0] = 120.0
    slow = inputs.replanned(replace(inputs.targets, speed_mm_s=held), inputs.cell)
    assert slow.time_s[-1] > inputs.time_s[-1] + 0.2
    time_s = np.arange(0.0, slow.time_s[-1], 0.012)
    table = Controller(
        time_s=time_s,
        row=np.arange(len(time_s)) + 2,
        segments=np.array([[0, len(time_s)]]),
        q_cmd_rad=cubic(time_s, slow.time_s, slow.q_cmd_rad),
    )
    run = Run(pair.run.name, pair.run.folder, pair.run.head, controller=table)
    assert other_program([replace(pair, run=run)]) is None


@pytest.mark.parametrize(
    ("text", "alike"),
    [("base_number:x_mm=30,y_mm=-12", (("tool_number", None),)), ("base_number:x_mm=30,a_deg=2", ())],
)
def test_a_mere_shift_may_be_a_tool_as_well(text, alike):
    slips = first_slip([_side(applied(text))], LIBRARY)
    assert [(slip.applied.effect.name, slip.alike) for slip in slips] == [("base_number", alike)]


def test_a_model_of_the_controllers_own_is_no_other_base():
    pair = _with_own_model(_side([]))
    slips = first_slip([pair], LIBRARY)
    assert slips == []
    moved = applied("base_number:x_mm=30,a_deg=2")[0]
    assert on_the_curve(_side([moved]), frame_of(moved))
    assert not on_the_curve(pair, frame_of(moved))


def test_the_controllers_joints_come_back_to_the_plan_and_its_drives_stay():
    pair = _with_own_model(
        _side(applied("servo_lag:target=A1,tau_s=0.01", "clock:target=controller,offset_s=0.003"))
    )
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


def _with_own_model(pair: Pair) -> Pair:
    """Return a side whose controller's joints differ with the pose, by millimetres at the tip."""
    q = pair.run.controller.q_cmd_rad
    added = 2e-3 * np.sin(3.0 * q[:, [1, 0, 1, 0, 2, 1]] + np.arange(6)) + 1e-3
    controller = replace(
        pair.run.controller, q_cmd_rad=q + added, q_act_rad=pair.run.controller.q_act_rad + added
    )
    return replace(pair, run=replace(pair.run, controller=controller))


def test_load_data_of_another_tool_differ_in_mass_and_centre():
    inputs = _side([]).inputs
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
