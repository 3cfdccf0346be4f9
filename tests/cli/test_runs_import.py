"""`gcode2krl runs import` and a log in the place of a run."""

import json

import numpy as np
import pytest

from gcode2krl import load_run
from tests.runs.foreign_layouts import TIME_S, P, Q, numbered, text

AXES = text(["Time", *numbered("Axis{}")], [TIME_S, *np.radians(Q).T])


@pytest.fixture
def bring(run, tmp_path):
    """Import a log: by default my.csv, which lies in the folder."""
    (tmp_path / "my.csv").write_bytes(AXES)
    return lambda *words, log="my.csv", code=0: run("runs", "import", log, *words, code=code)


def test_a_question_is_answered_by_the_option_it_names_and_kept_for_the_next_log(bring, tmp_path):
    asked = bring("-o", "run-1", code=2)
    assert "gcode2krl runs import my.csv -o run-1/ --unit angle=deg|rad" in asked.out + asked.err
    assert not (tmp_path / "run-1").exists()
    shown = bring("-o", "run-1", "--unit", "angle=rad").out.splitlines()
    assert shown[1].split() == ["column", "is", "min", "max", "unit", "why"]
    assert shown[3].split()[:2] == ["Axis1", "q1_act"]
    (tmp_path / "next.csv").write_bytes(AXES)
    bring("-o", "run-2", log="next.csv")
    for name in ("run-1", "run-2"):
        np.testing.assert_allclose(np.degrees(load_run(name).controller.q_act_rad), Q, atol=1e-4)


def test_a_run_is_never_written_over(bring, tmp_path):
    bring("-o", "run-1", "--unit", "angle=rad")
    before = (tmp_path / "run-1" / "controller.parquet").read_bytes()
    refused = bring("-o", "run-1", "--unit", "angle=rad", code=2)
    assert (tmp_path / "run-1" / "controller.parquet").read_bytes() == before
    assert "there is a run already" in refused.out + refused.err


def test_the_record_has_the_columns_and_the_files(bring):
    stated = ("--columns", "Axis1=q1_act_rad", "--unit", "angle=rad")
    record = json.loads(bring("-o", "run-1", *stated, "--json").out)
    assert record["columns"][1]["is"] == "q1_act"
    assert record["columns"][1]["why"].endswith("you said so")
    assert load_run("run-1").head.layout.columns["Axis6"] == "q6_act"


def test_what_is_not_there_is_said_with_what_it_costs(bring, tmp_path):
    (tmp_path / "tip.csv").write_bytes(
        text(["t_s", "x_mm", "y_mm", "z_mm", "note"], [TIME_S, *P.T, ["a"] * len(P)])
    )
    done = bring(log="tip.csv")
    assert "left out: note" in done.out + done.err
    assert "not in the log: commanded joints (" in done.out + done.err
    np.testing.assert_allclose(load_run("tip").tracker.position_mm, P, atol=1e-6)
