"""``gcode2krl runkit`` as a user meets it."""

import json

import pytest

from tests.conftest import EXAMPLES


@pytest.fixture
def program(run, tmp_path):
    assert run(EXAMPLES[0], "-o", "PART.src").code == 0
    return tmp_path / "PART.src"


def test_the_folder_is_beside_the_program_and_named_after_it(run, program, tmp_path):
    done = run("runkit", program, code=0)
    kit = tmp_path / "PART_runkit"
    assert sorted(file.name for file in kit.iterdir()) == [
        "PART_AIR.dat",
        "PART_AIR.src",
        "checklist.html",
        "prediction",
        "run_air",
        "trace.txt",
    ]
    assert "100 mm higher" in done.out


def test_json_and_a_second_run_into_the_same_folder(run, program):
    first = json.loads(run("runkit", program, "-o", "kit", "--json").out)
    again = json.loads(run("runkit", program, "-o", "kit", "--json").out)
    assert first == again
    assert first["time_s"] > 10.0
    assert any(file.endswith("checklist.html") for file in first["files"])


def test_a_restart_says_so_on_its_page(run, tmp_path):
    part = next(example for example in EXAMPLES if example.stem == "test_piece")
    assert run(part, "-o", "HALF.src", "--from-line", 47).code == 0
    assert run("runkit", "HALF.src").code == 0
    page = (tmp_path / "HALF_runkit" / "checklist.html").read_text("utf-8")
    assert "the part must be cut up to G-code line 47" in page


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("part.nc",), "is no KRL program"),
        (("none.src",), "cannot read"),
        (("PART.src", "--lift", "0"), "not a height"),
    ],
)
def test_bad_input_is_one_line(run, program, words, said):
    (line,) = run("runkit", *words, code=2).err.strip().splitlines()
    assert said in line


def test_an_output_that_is_a_file_is_refused(run, program, tmp_path):
    (tmp_path / "kit").write_text("", encoding="ascii")
    assert "this is a file" in run("runkit", program, "-o", "kit", code=2).err


def test_a_folder_with_foreign_files_keeps_them(run, program, tmp_path):
    (tmp_path / "kit").mkdir()
    (tmp_path / "kit" / "notes.txt").write_text("mine", encoding="ascii")
    assert run("runkit", program, "-o", "kit").code == 0
    assert (tmp_path / "kit" / "notes.txt").read_text("ascii") == "mine"
