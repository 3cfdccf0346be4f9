"""`identify stiffness --pulls`: the form for a cell, and the fit to it filled in."""

import json

import numpy as np
import pytest

from gcode2krl import load_cell
from gcode2krl.compliance import assumed_stiffness, stiffness
from gcode2krl.errors import NotUnderstoodError
from gcode2krl.identify.pulls import fit, form, propose, read_form
from gcode2krl.robot.standing import limits_rad
from tests.identify import made_up_pulls as made_up

TRUE = np.array([3e9, 2e9, 2.5e9, 8e8, 5e8, 4e8])


@pytest.fixture
def cell():
    return load_cell()


@pytest.fixture
def done(cell, tmp_path):
    """Return a form filled in for a robot of known stiffness, without noise but the dial's rounding."""
    pulls = propose(cell, None, 8, 1000.0, np.array([250.0, 0.0, 0.0]))
    lengths = cell.robot.geometry.array()
    truth = [made_up.moved(pulls, row, lengths, TRUE) for row in range(len(pulls.q_rad))]
    file = tmp_path / "form.csv"
    file.write_text(made_up.filled(pulls, truth, np.random.default_rng(1), 0.0), "utf-8")
    return file


def test_the_stiffness_is_found(cell, done):
    found = fit(read_form(done), cell)
    assert not found.issues
    for estimate, true in zip(found.k_Nmm_rad, TRUE, strict=True):
        assert estimate.value == pytest.approx(true, rel=0.15)


def test_poses_are_within_the_limits_and_free(cell):
    asked = []

    def gap(q_rad):
        asked.append(len(q_rad))
        return np.where(q_rad[:, 0] > 0, 100.0, 0.0)

    pulls = propose(cell, gap, 9, None, None)
    assert asked
    assert len(pulls.q_rad) == 27
    assert (pulls.q_rad[:, 0] > 0).all()
    low, high = limits_rad(cell).T
    assert ((pulls.q_rad > low) & (pulls.q_rad < high)).all()
    with pytest.raises(NotUnderstoodError, match="0 of"):
        propose(cell, lambda q_rad: np.zeros(len(q_rad)), 9, None, None)


def test_what_the_pulls_do_not_determine_is_named(cell, done):
    """Without a bar no pull turns A6."""
    lines = done.read_text("utf-8").splitlines()
    bare = [lines[0], *(line.replace(",250,0,0,", ",0,0,0,") for line in lines[1:])]
    done.write_text("\n".join(bare) + "\n", "utf-8")
    found = fit(read_form(done), cell)
    assert found.k_Nmm_rad[5] is None
    assert any("A6" in issue.message for issue in found.errors())


def test_a_wrong_direction_is_a_misfit_and_a_stray_row_is_named(cell, done):
    lines = done.read_text("utf-8").splitlines()
    words = lines[4].split(",")
    words[-1] = f"{float(words[-1]) + 3.0:.2f}"
    lines[4] = ",".join(words)
    done.write_text("\n".join(lines) + "\n", "utf-8")
    issues = fit(read_form(done), cell).issues
    assert any(issue.code == "stray-reading" and issue.line == 5 for issue in issues)


def test_a_form_without_readings_says_so(cell, tmp_path):
    file = tmp_path / "form.csv"
    file.write_text(form(propose(cell, None, 4, None, None)), "utf-8")
    with pytest.raises(NotUnderstoodError, match="no reading yet"):
        read_form(file)


def test_form_to_cell_by_the_command(run, done, tmp_path):
    """A form is written, a filled one fitted; then the arm is measured, and the spindle still asked for."""
    new, cell_file = tmp_path / "new.csv", tmp_path / "cell.toml"
    cell_file.write_text('[robot]\nmodel = "KR 300 R2500 ultra"\n', "utf-8")
    run("identify", "stiffness", "--pulls", new, "--cell", cell_file, code=0)
    assert len(new.read_text("utf-8").splitlines()) == 31
    arguments = ("--pulls", done, "--cell", cell_file, "--apply", cell_file, "--json")
    fitted = json.loads(run("identify", "stiffness", *arguments, code=0).out)
    assert fitted["k_Nmm_rad"]["A2"]["value"] == pytest.approx(2e9, rel=0.15)
    cell = load_cell(cell_file)
    assert stiffness(cell).assumed == "sensor and spindle taken as rigid"
    assert assumed_stiffness(cell) is not None
    assert 0.3 <= cell.compliance.relative_band < 0.5
    assert cell.compliance.robot_sure == "checked"
