"""Wrong inputs: each has an answer of its own."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gcode2krl.errors import Gcode2KrlError, RefusedError
from gcode2krl.gap import diagnose, diagnose_log
from gcode2krl.runs import Run, RunHead, load_run
from tests.gap.constructed import controller
from tests.gap.synthetic import PROGRAM, applied, prediction, runs, write

# Wrong inputs: each has an answer of its own

SERVO = {"tracker": False, "force": False}


def _named(gap):
    return [(each.effect, each.target) for each in gap.named_causes]


@pytest.mark.slow
def test_another_unit_in_a_file_is_named(tmp_path):
    run = runs([], 1, 1)[0]
    assert run.tracker is not None
    tracker = replace(run.tracker, position_mm=run.tracker.position_mm / 1000.0)
    folder = write(replace(run, controller=None, tracker=tracker), tmp_path)
    gap = diagnose(prediction(), [load_run(folder)])
    assert ("unit", "tracker") in _named(gap)


@pytest.mark.slow
def test_swapped_columns_are_named(tmp_path):
    run = runs([], 1, 1)[0]
    assert run.controller is not None
    order = [0, 2, 1, 3, 4, 5]
    controller = replace(run.controller, q_act_rad=run.controller.q_act_rad[:, order])
    folder = write(replace(run, controller=controller), tmp_path)
    with pytest.raises(Gcode2KrlError, match="q2_act_deg"):
        load_run(folder)


@pytest.mark.slow
def test_another_program_is_named():
    other = PROGRAM.replace("X120", "X40").replace("Y-20", "Y30").replace("X140 Y40", "X-60 Y-40")
    gap = diagnose(prediction(), runs([], 1, 1, base=prediction(other, 0.003), normal=False, **SERVO))
    assert _named(gap) == [("other_program", None)]


@pytest.mark.slow
def test_a_clock_two_seconds_off_is_named():
    gap = diagnose(prediction(), runs(applied("clock:target=controller,offset_s=2"), 2, 5, **SERVO))
    assert _named(gap) == [("clock", "controller")]
    assert gap.causes[0].parameters["offset_s"].value == pytest.approx(2.0, abs=0.005)


@pytest.mark.slow
def test_an_override_of_50_percent_is_named():
    gap = diagnose(prediction(), runs(applied("override:percent=50"), 2, 5, **SERVO))
    assert _named(gap) == [("override", None)]
    assert gap.causes[0].parameters["percent"].value == pytest.approx(50.0, abs=0.1)


@pytest.mark.slow
def test_a_tracker_in_another_frame_is_named():
    some = runs([], 2, 5, force=False)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    moved = []
    for run in some:
        assert run.tracker is not None
        position = run.tracker.position_mm @ turn.T + [500.0, -200.0, 40.0]
        moved.append(replace(run, tracker=replace(run.tracker, position_mm=position)))
    assert ("base_frame", None) in _named(diagnose(prediction(), moved))


@pytest.mark.slow
def test_missing_signals_are_listed_with_what_they_would_need():
    gap = diagnose(prediction(), runs([], 1, 5, **SERVO))
    needs = {each.link: each.needs for each in gap.not_examined}
    assert "tracker.csv" in needs["mechanics"]
    assert "force.csv" in needs["force"]


@pytest.mark.slow
def test_bursts_of_missing_values_are_gaps(tmp_path):
    run = runs(applied("servo_lag:target=A3,tau_s=0.012"), 1, 5, **SERVO)[0]
    folder = write(run, tmp_path)
    lines = (folder / "controller.csv").read_text(encoding="utf-8").splitlines()
    for row in [*range(200, 260), *range(700, 705)]:
        cells = lines[row].split(",")
        lines[row] = ",".join([cells[0], *["nan"] * (len(cells) - 1)])
    (folder / "controller.csv").write_text("\n".join(lines), encoding="utf-8")
    gap = diagnose(prediction(), [load_run(folder)])
    assert _named(gap) == [("servo_lag", "A3")]
    assert any(issue.code == "trace-dropped" for issue in gap.issues)


@pytest.mark.slow
def test_a_run_of_one_sample_is_an_error(tmp_path):
    folder = write(runs([], 1, 5, **SERVO)[0], tmp_path)
    lines = (folder / "controller.csv").read_text(encoding="utf-8").splitlines()
    (folder / "controller.csv").write_text("\n".join(lines[:2]), encoding="utf-8")
    with pytest.raises(Gcode2KrlError, match="at least 10"):
        load_run(folder)


@pytest.mark.slow
def test_no_run_is_an_error():
    with pytest.raises(Gcode2KrlError, match="no run"):
        diagnose(prediction(), [])


# Where nothing was looked at "no gap" would be wrong: the diagnosis stops and says what to record

TIME_S = np.arange(0.0, 5.0, 0.012)
SHORT = "G21 G90 G17 G54\nG0 X0 Y0 Z20\nG1 X60 F3000\nG1 Y30\nM30\n"


def run_of(**columns):
    return Run("run-1", Path(), RunHead(), controller=controller(columns.pop("time_s", TIME_S), **columns))


def refused(diagnosed, *given):
    with pytest.raises(RefusedError) as caught:
        diagnosed(*given)
    (issue,) = caught.value.issues
    assert issue.code == "nothing-compared"
    return issue


def test_a_log_of_currents_alone_says_what_to_record():
    run = run_of(current_A=np.ones((len(TIME_S), 6)))
    assert "q1_act_deg" in refused(diagnose, prediction(SHORT), [run]).remedy
    assert "q1_act_deg" in refused(diagnose_log, [run]).remedy


def test_stamps_of_another_clock_are_named():
    plan = prediction(SHORT)
    own = np.stack([np.interp(TIME_S, plan.motion.time_s, q) for q in plan.joints.q_rad.T], axis=1)
    run = run_of(time_s=TIME_S + 1.7e9, q_cmd_rad=own, q_act_rad=own)
    issue = refused(diagnose, plan, [run])
    assert "1.7e+09" in issue.message
    assert "controller_s" in issue.remedy
