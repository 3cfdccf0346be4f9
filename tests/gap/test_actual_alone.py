"""Logs of actual joints alone, the most ordinary export: they are compared with the plan."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.errors import NotUnderstoodError
from gcode2krl.gap import diagnose
from gcode2krl.gap.answer.words import headline
from gcode2krl.runs.foreign import run_or_log
from tests.gap.synthetic import applied, prediction, runs, write_log

ALONE = {"tracker": False, "force": False}


def logs(*effects, count=1, change=None):
    """Return runs whose controller's table has actual joints and nothing else."""
    made = []
    for run in runs(applied(*effects), count, 5, **ALONE):
        table = replace(run.controller, q_cmd_rad=None)
        made.append(replace(run, controller=change(table) if change else table))
    return made


def codes(gap):
    return [issue.code for issue in gap.issues]


def test_a_sound_log_has_no_gap_and_what_it_lacks_is_said_once():
    gap = diagnose(prediction(), logs(count=2))
    assert gap.verdict == "no_gap"
    assert [link.link for link in gap.links] == ["servo"]
    assert codes(gap).count("joints-actual-alone") == 1


def test_an_override_is_a_slip_and_the_lateness_is_told():
    gap = diagnose(prediction(), logs(change=lambda table: replace(table, time_s=table.time_s / 0.9)))
    assert [(slip.effect, slip.target) for slip in gap.causes] == [("override", None)]
    assert codes(gap).count("joints-actual-alone") == 2


def test_a_run_that_is_late_for_a_while_is_a_gap_of_timing():
    """Its joints are right place by place, but nobody may read first that there is no gap."""

    def late_in_the_middle(table):
        share = (table.time_s - table.time_s[0]) / np.ptp(table.time_s)
        return replace(table, time_s=table.time_s + 0.3 * np.sin(np.pi * share) ** 2)

    gap = diagnose(prediction(), logs(change=late_in_the_middle))
    assert gap.verdict == "unexplained"
    assert headline(gap).startswith("The robot is ")
    assert "early or late on its path" in headline(gap)
    (timing,) = [link for link in gap.links if link.link == "timing"]
    assert timing.rms_before == pytest.approx(0.3 / np.sqrt(8.0), rel=0.2)
    assert "timing" not in [each.link for each in gap.not_examined]


def test_another_sign_is_never_compared():
    gap = diagnose(
        prediction(),
        logs(change=lambda table: replace(table, q_act_rad=table.q_act_rad * [1, 1, 1, -1, 1, 1])),
    )
    assert "run-program" in codes(gap) or "run-axes" in codes(gap)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "size", "tolerance"),
    [
        ("servo_lag:target=A3,tau_s=0.012", "tau_s", 0.06),
        ("friction:target=A2,spike_deg=0.006,decay_s=0.15", "spike_deg", 0.1),
    ],
)
def test_an_effect_is_named_with_its_size(text, size, tolerance):
    truth = applied(text)[0]
    gap = diagnose(prediction(), logs(text, count=2))
    (cause,) = gap.named_causes
    assert (cause.effect, cause.target) == (truth.effect.name, truth.target)
    assert cause.parameters[size].value == pytest.approx(truth[size], rel=tolerance)


def test_a_log_is_a_run_where_its_columns_are_certain(tmp_path):
    (run,) = runs([], 1, 5, **ALONE)
    file = write_log(run, tmp_path / "my.csv")
    read = run_or_log(file, prediction())
    np.testing.assert_allclose(read.controller.q_act_rad, run.controller.q_act_rad, atol=1e-9)
    lines = (
        file.read_text(encoding="utf-8")
        .replace("Axis2", "Ax")
        .replace("Axis3", "Axis2")
        .replace("Ax,", "Axis3,")
    )
    file.write_text(lines, encoding="utf-8")
    with pytest.raises(NotUnderstoodError) as caught:
        run_or_log(file, prediction())
    assert caught.value.issues[0].remedy.endswith("my/ --joints 132456")


def test_a_prediction_is_a_run(tmp_path):
    prediction().save(tmp_path)
    run = run_or_log(tmp_path, prediction())
    planned = prediction().joints.q_rad
    np.testing.assert_allclose(run.controller.q_cmd_rad, planned, atol=1e-12)
    gap = diagnose(prediction(), [run])
    assert gap.verdict == "no_gap"
    assert "path" in [link.link for link in gap.links]
