"""The command ``diagnose``."""

import json
import tomllib
from pathlib import Path

import pytest
from click.testing import CliRunner

from gcode2krl.cli.diagnose import command
from gcode2krl.result.model import Record
from tests.gap.synthetic import applied, prediction, runs, write

pytestmark = pytest.mark.slow

SERVO = {"tracker": False, "force": False}


def _folders(tmp_path):
    prediction().save(tmp_path / "prediction")
    made = [write(run, tmp_path) for run in runs(applied("servo_lag:target=A3,tau_s=0.012"), 2, 5, **SERVO)]
    return [str(tmp_path / "prediction"), *map(str, made)]


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


def test_text(tmp_path):
    result = CliRunner().invoke(command, _folders(tmp_path))
    assert result.exit_code == 0
    assert "servo lag of A3" in result.stdout.splitlines()[0]


def test_from_log(tmp_path):
    result = CliRunner().invoke(command, ["--from-log", *_folders(tmp_path)[1:], "--json"])
    assert result.exit_code == 0
    found = json.loads(result.stdout)
    assert found["causes"][0]["effect"] == "servo_lag"
    Record.model_validate(found)
    assert (found["command"], found["gap_schema"]) == ("diagnose", "gcode2krl/gap/1")
    assert [Path(entry["file"]).name for entry in found["inputs"]] == ["run-1", "run-2"]
    assert found["options"] == {"from_log": True}
