"""Three cases through the whole check: plant, diagnosis, records, tables, and again from the records."""

import json
from importlib import import_module

import pytest

from tests.benchmarks import hand_made  # noqa: F401 - puts the benchmarks on the path

blind = import_module("blind.check")

pytestmark = pytest.mark.slow


def test_three_cases_go_through_and_resume(tmp_path, capsys):
    options = ["--small", "--seed", "7", "--jobs", "1", "--effects", "backlash", "--no-baselines"]
    options += ["--resume", str(tmp_path)]
    assert blind.main(options) == 0
    out, err = capsys.readouterr()
    assert "| false alarms, usual noise" in out
    assert "calibration, not to be quoted" in out
    assert "3 cases, 0 already there" in err
    files = sorted((tmp_path / "results").glob("*.json"))
    assert [file.stem for file in files] == ["null-00007", "open-03007", "single-01007"]
    for file in files:
        made = json.loads(file.read_text(encoding="utf-8"))
        assert made["error"] is None, made["error"]
        assert made["result"]["schema"] == "gcode2krl/gap/1"
    assert not list(tmp_path.rglob("*.label.json"))
    assert blind.main([*options, "--json"]) == 0
    out, err = capsys.readouterr()
    assert "3 cases, 3 already there" in err
    assert len(out.splitlines()) == 3
