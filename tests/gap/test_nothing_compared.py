"""Where nothing was looked at "no gap" would be wrong: the diagnosis stops and says what to record."""

from pathlib import Path

import numpy as np
import pytest

from gcode2krl.errors import RefusedError
from gcode2krl.gap import diagnose, diagnose_log
from gcode2krl.runs import Run, RunHead
from gcode2krl.runs.measured import Controller
from tests.gap.synthetic import prediction

TIME_S = np.arange(0.0, 5.0, 0.012)
PROGRAM = "G21 G90 G17 G54\nG0 X0 Y0 Z20\nG1 X60 F3000\nG1 Y30\nM30\n"


def run_of(**columns):
    time_s = columns.pop("time_s", TIME_S)
    rows = np.arange(len(time_s))
    table = Controller(
        time_s=time_s, row=rows, segments=np.array([[0, len(rows)]]), source="controller.csv", **columns
    )
    return Run("run-1", Path(), RunHead(), controller=table)


def refused(diagnosed, *given):
    with pytest.raises(RefusedError) as caught:
        diagnosed(*given)
    (issue,) = caught.value.issues
    assert issue.code == "nothing-compared"
    return issue


def test_a_log_of_currents_alone_says_what_to_record():
    run = run_of(current_A=np.ones((len(TIME_S), 6)))
    assert "q1_act_deg" in refused(diagnose, prediction(PROGRAM), [run]).remedy
    assert "q1_act_deg" in refused(diagnose_log, [run]).remedy


def test_stamps_of_another_clock_are_named():
    plan = prediction(PROGRAM)
    own = np.stack([np.interp(TIME_S, plan.motion.time_s, q) for q in plan.joints.q_rad.T], axis=1)
    run = run_of(time_s=TIME_S + 1.7e9, q_cmd_rad=own, q_act_rad=own)
    issue = refused(diagnose, plan, [run])
    assert "1.7e+09" in issue.message
    assert "controller_s" in issue.remedy
