"""``predict --allow``: what a person releases is shown as a warning; the prediction keeps it as it is."""

import json

import pytest

from gcode2krl.prediction import Prediction

SLOT = "G21 G90 G17\nT1 M6\nG0 G43 H1 X-20 Y0 Z50\nG0 Z5\nG1 Z-1 F600\nG1 X100 F1500\nG0 Z50\nM30\n"
"""The spindle never turns."""


@pytest.fixture
def part(tmp_path):
    path = tmp_path / "slot.nc"
    path.write_text(SLOT, encoding="ascii")
    return path


def severities(done):
    issues = json.loads(done.out)["issues"]
    return {issue["severity"] for issue in issues if issue["code"] == "spindle-off"}


def predict(run, part, *options):
    return run("predict", part, "-o", "out", "--no-forces", "--json", *options)


def test_a_finding_is_a_warning_where_it_is_allowed(run, part, tmp_path):
    assert severities(predict(run, part)) == {"error"}
    done = predict(run, part, "--allow", "spindle-off")
    assert done.code == 0, done.err
    assert severities(done) == {"warning"}
    of_prediction = {issue.severity for issue in Prediction.load(tmp_path / "out").issues}
    assert "error" in of_prediction  # whoever writes a program from it has to release it there
    assert severities(run("report", "out", "--json")) == {"warning"}


@pytest.mark.parametrize("word", ["spindle-of", "spindle-off:99", "spindle-off:x"])
def test_a_release_that_means_nothing_is_refused(run, part, word):
    done = predict(run, part, "--allow", word)
    assert done.code == 2
    assert [issue["code"] for issue in json.loads(done.out)["issues"]] == ["allow"]


def test_a_release_of_a_folder_counts_where_its_finding_is(run, part, tmp_path):
    (tmp_path / "gcode2krl.toml").write_text('allow = ["spindle-off", "g43-missing"]\n', encoding="utf-8")
    assert severities(predict(run, part)) == {"warning"}
