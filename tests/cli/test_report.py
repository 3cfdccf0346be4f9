"""``gcode2krl report`` and ``--report``: the page of a prediction, and of a program that is not written."""

import json
import shutil

import pytest

from tests.conftest import ROOT

PIECE = ROOT / "examples" / "test_piece.nc"
OUT_OF_REACH = (
    "G21 G90 G54\nT1 M6\nG43 H1\nS8000 M3\nG0 X0 Y0 Z20\nG1 Z-2 F800\nX50\nY5000\nG0 Z50\nM5\nM30\n"
)
NOT_GCODE = "G21 G90\nG1 X Z-2 F800\nM30\n"


@pytest.fixture
def folder(tmp_path, prediction, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(PIECE, "part.nc")
    prediction.save("prediction")
    return tmp_path


def test_the_page_of_a_prediction(run, folder):
    assert "prediction -> report.html (0." in run("report", "prediction", "-o", "report.html", code=0).out
    text = (folder / "report.html").read_text(encoding="utf-8")
    assert "test_piece.nc" in text
    assert '"has_text": true' in text  # the G-code still lies where it was predicted from


def test_without_an_output_it_lies_beside_the_prediction(run, folder):
    assert json.loads(run("report", "prediction/", "--json", code=0).out)["files"] == ["prediction.html"]
    assert (folder / "prediction.html").is_file()


def test_changed_gcode_is_not_shown_unless_it_is_named(run, folder, prediction):
    from dataclasses import replace

    (folder / "part.nc").write_text("G0 X1\n", encoding="ascii")
    moved = replace(prediction, toolpath=replace(prediction.toolpath, source="part.nc"))
    replace(moved, inputs=prediction.inputs | {"program": "part.nc"}).save("moved")
    assert "part.nc is not at hand" in run("report", "moved", "-o", "moved.html", code=0).err
    assert "is not at hand" in (folder / "moved.html").read_text(encoding="utf-8")
    run("report", "moved", "-o", "moved.html", "--gcode", "part.nc")
    assert '"has_text": true' in (folder / "moved.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["report", "prediction", "-o", "report.pdf"], "allowed endings .html, .htm"),
        (["report", "prediction", "-o", "none/report.html"], "does not exist"),
        (["report", "nothing", "-o", "report.html"], "prediction.toml"),
        (["report", "prediction", "-o", "report.html", "--gcode", "none.nc"], "no such file"),
        (["part.nc", "-o", "part.src", "--report", "part.txt"], "allowed endings .html, .htm"),
        (["part.nc", "-o", "part.src", "--report", "none/part.html"], "does not exist"),
    ],
)
def test_what_cannot_be_written_is_refused_first(run, folder, words, sentence):
    before = {file.name for file in folder.iterdir()}
    assert sentence in run(*words, code=2).err
    assert {file.name for file in folder.iterdir()} == before


def test_a_report_never_replaces_an_input(run, folder):
    (folder / "part.html").write_text(PIECE.read_text(encoding="ascii"), encoding="ascii")
    assert "input" in run("part.html", "-o", "part.src", "--report", "part.html", code=2).err
    assert (folder / "part.html").read_text(encoding="ascii").startswith("%")


def test_a_written_program_has_its_page(run, folder):
    run("part.nc", "-o", "part.src", "--report", "part.html", "-q", code=0)
    text = (folder / "part.html").read_text(encoding="utf-8")
    assert 'class="badge written">written' in text
    assert (folder / "part.src").is_file()


def test_a_refused_program_has_its_page_with_line_remedy_and_path(run, folder):
    (folder / "far.nc").write_text(OUT_OF_REACH, encoding="ascii")
    assert "far.html written" in run("far.nc", "-o", "far.src", "--report", "far.html", code=1).err
    assert not (folder / "far.src").exists()
    text = (folder / "far.html").read_text(encoding="utf-8")
    assert 'class="badge refused">refused' in text
    assert "<h1>No program was written: X 50.000 Y" in text
    assert 'data-line="8">line 8</button>' in text
    assert "move the part nearer" in text
    assert '"rows": 0' not in text


def test_a_program_that_is_not_understood_has_its_page(run, folder):
    (folder / "wrong.nc").write_text(NOT_GCODE, encoding="ascii")
    done = run("wrong.nc", "-o", "wrong.src", "--report", "wrong.html", "--json", code=2)
    assert json.loads(done.out)["issues"][0]["code"] == "no-number"
    text = (folder / "wrong.html").read_text(encoding="utf-8")
    assert "not understood" in text
    assert 'data-line="2">line 2</button>' in text
    assert "write the number" in text


def test_a_cell_that_is_wrong_is_told_too(run, folder):
    (folder / "cell.toml").write_text("[robot]\nmodle = 3\n", encoding="ascii")
    run("part.nc", "-o", "part.src", "--report", "part.html", "--cell", "cell.toml", code=2)
    assert "modle" in (folder / "part.html").read_text(encoding="utf-8")
