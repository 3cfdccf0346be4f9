"""The command ``diagnose``: its answer, its files, and one clear line where these cannot be written."""

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from gcode2krl.cli import diagnose
from gcode2krl.cli.diagnose import command
from gcode2krl.cli.main import main
from gcode2krl.gap.answer.result import Where
from gcode2krl.result.model import Record
from tests.gap.answered import GAP, STRETCH, evidence
from tests.gap.synthetic import applied, prediction, runs, write

# The command ``diagnose``

SERVO = {"tracker": False, "force": False}


def _folders(tmp_path):
    prediction().save(tmp_path / "prediction")
    made = [write(run, tmp_path) for run in runs(applied("servo_lag:target=A3,tau_s=0.012"), 2, 5, **SERVO)]
    return [str(tmp_path / "prediction"), *map(str, made)]


@pytest.mark.slow
def test_json_and_apply(tmp_path):
    cell = tmp_path / "cell.toml"
    result = CliRunner().invoke(command, [*_folders(tmp_path), "--json", "--apply", str(cell)])
    assert result.exit_code == 0
    found = json.loads(result.stdout)
    assert found["verdict"] == "explained"
    entry = tomllib.loads(cell.read_text(encoding="utf-8"))["effects"][0]
    assert entry["name"] == "servo_lag"
    assert entry["target"] == "A3"
    assert "run-1" in entry["source"]


@pytest.mark.slow
def test_text(tmp_path):
    result = CliRunner().invoke(command, _folders(tmp_path))
    assert result.exit_code == 0
    assert "servo lag of A3" in result.stdout.splitlines()[0]


@pytest.mark.slow
def test_from_log(tmp_path):
    result = CliRunner().invoke(command, ["--from-log", *_folders(tmp_path)[1:], "--json"])
    assert result.exit_code == 0
    found = json.loads(result.stdout)
    assert found["causes"][0]["effect"] == "servo_lag"
    Record.model_validate(found)
    assert (found["command"], found["gap_schema"]) == ("diagnose", "gcode2krl/gap/1")
    assert [Path(entry["file"]).name for entry in found["inputs"]] == ["run-1", "run-2"]
    assert found["options"] == {"from_log": True}


# ``diagnose --html`` and ``--plot``: what is written, and one clear line where it cannot be

FOUND = replace(GAP, where=Where(intervals=(STRETCH,)), evidence=evidence())


@pytest.fixture
def diagnosed(monkeypatch):
    """Let every diagnosis find the same; return how often one was asked for."""
    asked = []
    monkeypatch.setattr(diagnose, "_diagnosis", lambda *given: asked.append(given) or FOUND)
    return asked


def run(*words):
    return CliRunner().invoke(diagnose.command, ["prediction", "run-1", *map(str, words)])


@pytest.mark.slow
def test_the_page_and_a_picture_a_run_are_written_beside_the_text(tmp_path, diagnosed):
    result = run("--html", tmp_path / "gap.html", "--plot", tmp_path / "pictures")
    assert result.exit_code == 0
    assert result.stdout.startswith("The tip is off by 0.41 mm RMS: backlash of A2")
    assert (tmp_path / "gap.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    pictures = sorted(each.name for each in (tmp_path / "pictures").iterdir())
    assert pictures == ["gap_run-1.png", "gap_run-2.png"]
    assert result.stderr.count(" written") == 3


@pytest.mark.slow
def test_the_page_is_written_with_json_too_and_the_evidence_is_not_in_it(tmp_path, diagnosed):
    result = run("--html", tmp_path / "gap.html", "--json")
    found = json.loads(result.stdout)
    assert found["at_part"]["rms_before"] == 0.4123
    assert "evidence" not in found
    assert (tmp_path / "gap.html").exists()


@pytest.mark.slow
def test_what_cannot_be_written_is_said_in_one_line_before_the_work_begins(tmp_path, diagnosed, capfd):
    (tmp_path / "file").write_text("mine")
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "tracker.csv").write_text("t_s")
    for words in (
        ["--html", tmp_path / "no" / "gap.html"],
        ["--html", tmp_path],
        ["--html", tmp_path / "run" / "tracker.csv", tmp_path / "run"],
        ["--plot", tmp_path / "file"],
        ["--plot", tmp_path / "no" / "pictures"],
    ):
        with pytest.raises(SystemExit) as left:
            main(["diagnose", "prediction", "run-1", *map(str, words)])
        assert left.value.code == 2
        (line,) = capfd.readouterr().err.strip().splitlines()
        assert "error:" in line
    assert diagnosed == []
    assert (tmp_path / "file").read_text() == "mine"
