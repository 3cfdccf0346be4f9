"""`predict` of Python takes the options of a project where it is asked to, as the command does."""

import numpy as np
import pytest

from gcode2krl import load_cell, predict, predict_many
from tests.conftest import ROOT

PART = "G21 G90 G94\nT1 M6\nS13000 M3\nG0 X0 Y0 Z20\nG1 Z5 F1500\nG1 X40 F1500\nG1 X40 Y40\nG0 Z20\nM5\nM30\n"
PROJECT = 'cell = "shop/cell.toml"\ntolerance = 0.2\nno-forces = true\n'
CELL = 'based_on = "demonstration"\nname = "the shop\'s"\n'


@pytest.fixture
def part(tmp_path):
    (tmp_path / "shop").mkdir()
    (tmp_path / "shop" / "cell.toml").write_text(CELL, encoding="utf-8")
    (tmp_path / "gcode2krl.toml").write_text(PROJECT, encoding="utf-8")
    file = tmp_path / "parts" / "part.nc"
    file.parent.mkdir()
    file.write_text(PART, encoding="utf-8")
    return file


def of_project(prediction):
    return [issue.message for issue in prediction.issues if issue.code == "project-options"]


def test_without_being_told_no_file_is_read(part):
    prediction = predict(part, forces=False)
    assert prediction.cell.name != "the shop's"
    assert not of_project(prediction)


def test_what_the_file_states_holds_and_is_said(part):
    prediction = predict(part, project=True)
    assert prediction.cell.name == "the shop's"
    assert prediction.forces is None
    assert len(of_project(prediction)) == 1
    for words in ("cell=", "tolerance=0.2", "no-forces=True"):
        assert words in of_project(prediction)[0]
    plain = predict(part, load_cell(part.parents[1] / "shop" / "cell.toml"), tolerance_mm=0.2, forces=False)
    np.testing.assert_array_equal(prediction.motion.position_mm, plain.motion.position_mm)
    assert prediction.inputs == plain.inputs


def test_what_the_call_states_comes_first(part):
    prediction = predict(part, load_cell(), tolerance_mm=0.05, project=True)
    assert prediction.cell.name != "the shop's"
    assert prediction.inputs["tolerance_mm"] == 0.05
    assert "cell=" not in of_project(prediction)[0]


def test_many_parts_each_have_their_project(part):
    (prediction,) = predict_many([part], processes=1, project=True)
    assert prediction.cell.name == "the shop's"


@pytest.mark.slow
def test_the_example_is_that_of_the_command():
    prediction = predict(ROOT / "examples" / "test_piece.nc", project=True)
    assert np.linalg.norm(prediction.forces.force_base_N, axis=1).max() == pytest.approx(546.0, abs=1.0)
