"""`gcode2krl runs import` and a log in the place of a run."""

import json

import numpy as np
import pytest

from gcode2krl import load_run
from gcode2krl.cli.main import _run as run_command
from tests.runs.foreign_layouts import TIME_S, P, Q, numbered, text

AXES = text(["Time", *numbered("Axis{}")], [TIME_S, *np.radians(Q).T])


@pytest.fixture
def log(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my.csv").write_bytes(AXES)
    return tmp_path


def test_a_question_is_answered_by_the_option_it_names_and_kept_for_the_next_log(log, capsys):
    assert run_command(["runs", "import", "my.csv", "-o", "run-1"]) == 2
    assert "gcode2krl runs import my.csv -o run-1/ --unit angle=deg|rad" in "".join(capsys.readouterr())
    assert not (log / "run-1").exists()
    assert run_command(["runs", "import", "my.csv", "-o", "run-1", "--unit", "angle=rad"]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert shown[1].split() == ["column", "is", "min", "max", "unit", "why"]
    assert shown[3].split()[:2] == ["Axis1", "q1_act"]
    (log / "next.csv").write_bytes(AXES)
    assert run_command(["runs", "import", "next.csv", "-o", "run-2"]) == 0
    for name in ("run-1", "run-2"):
        np.testing.assert_allclose(np.degrees(load_run(name).controller.q_act_rad), Q, atol=1e-4)


def test_a_run_is_never_written_over(log, capsys):
    assert run_command(["runs", "import", "my.csv", "-o", "run-1", "--unit", "angle=rad"]) == 0
    before = (log / "run-1" / "controller.parquet").read_bytes()
    assert run_command(["runs", "import", "my.csv", "-o", "run-1", "--unit", "angle=rad"]) == 2
    assert (log / "run-1" / "controller.parquet").read_bytes() == before
    assert "there is a run already" in "".join(capsys.readouterr())


def test_the_record_has_the_columns_and_the_files(log, capsys):
    assert run_command(["runs", "import", "my.csv", "-o", "run-1", "--columns", "Axis1=q1_act_rad",
                        "--unit", "angle=rad", "--json"]) == 0  # fmt: skip
    record = json.loads(capsys.readouterr().out)
    assert record["columns"][1]["is"] == "q1_act"
    assert record["columns"][1]["why"].endswith("you said so")
    assert load_run("run-1").head.layout.columns["Axis6"] == "q6_act"


def test_what_is_not_there_is_said_with_what_it_costs(log, capsys):
    (log / "tip.csv").write_bytes(
        text(["t_s", "x_mm", "y_mm", "z_mm", "note"], [TIME_S, *P.T, ["a"] * len(P)])
    )
    assert run_command(["runs", "import", "tip.csv"]) == 0
    out = "".join(capsys.readouterr())
    assert "left out: note" in out
    assert "not in the log: commanded joints (" in out
    np.testing.assert_allclose(load_run("tip").tracker.position_mm, P, atol=1e-6)
