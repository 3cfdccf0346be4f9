"""``gcode2krl.toml``: options of a folder, what a command line states first, and what is wrong in one."""

import json
from pathlib import Path

import jsonschema
import pytest

from gcode2krl.translation.project import project_of
from gcode2krl.translation.project_file import project_schema
from tests.cli.test_batch import CELL, GOOD, records

PART = GOOD.format(x=50)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Parts of two CAM systems below one project file."""
    monkeypatch.chdir(tmp_path)
    for name in ("mill/a.nc", "shop/b.mpf"):
        place = tmp_path / name
        place.parent.mkdir()
        place.write_text(PART, encoding="ascii")
    (tmp_path / "shop/b.mpf").write_text(
        PART.replace("G21", "G71").replace("G43 H1", "G0 D1").replace("Y40", "Y=AC(40)"), "ascii"
    )
    (tmp_path / "cell.toml").write_text(CELL, encoding="utf-8")
    return tmp_path


def state(folder, text):
    (folder / "gcode2krl.toml").write_text(text, encoding="utf-8")


def record(run, *words):
    outcome = run(*words, "--json")
    return outcome.code, json.loads(outcome.out)


def test_options_come_from_the_nearest_file_and_are_told(folder, run):
    state(folder, 'cell = "cell.toml"\nsimplify = 0.02\n[[files]]\nmatch = "mill/*"\nsimplify = 0.03\n')
    code, told = record(run, "mill/a.nc", "-o", "A.src")
    assert code == 0
    assert told["options"] == {"simplify_mm": 0.03}
    assert told["project"]["options"] == ["cell", "simplify"]
    assert told["cell"]["file"].endswith("cell.toml")
    assert "simplify=0.03" in next(i["message"] for i in told["issues"] if i["code"] == "project-options")
    assert "project=cell,simplify" in (folder / "A.src").read_text(encoding="ascii")


def test_a_nearer_file_hides_one_above(folder):
    state(folder, "simplify = 0.02\n")
    state(folder / "mill", "strict = true\n")
    assert project_of("mill/a.nc").options == {"strict": True}


def test_the_command_line_comes_first_and_isolated_takes_nothing(folder, run):
    state(folder, "simplify = 0.02\ntolerance = 0.1\n")
    told = record(run, "mill/a.nc", "-o", "A.src", "--simplify", "0.05")[1]
    assert told["options"] == {"simplify_mm": 0.05, "tolerance_mm": 0.1}
    assert told["project"]["options"] == ["tolerance"]
    told = record(run, "mill/a.nc", "-o", "A.src", "--isolated")[1]
    assert told["options"] == {}
    assert "project" not in told


def test_a_prediction_takes_its_own_options_too(folder, run):
    state(folder, "no-forces = true\ncsv = true\nmax-lines = 500\n")
    code, told = record(run, "predict", "mill/a.nc", "-o", "p")
    assert code == 0
    assert told["project"]["options"] == ["no-forces", "csv"]  # it splits nothing
    assert (folder / "p/motion.csv").exists()


def test_a_release_of_a_folder_counts_where_its_finding_is(folder, run):
    state(folder, 'allow = ["above-clearance", "out-of-reach"]\n')
    assert run("mill/a.nc", "-o", "A.src").code == 0
    assert run("mill/a.nc", "-o", "A.src", "--allow", "above-clearance").code == 2  # asked for, and not there
    (folder / "mill/high.nc").write_text(PART.replace("G1 Y40", "G1 Y40 Z150"), encoding="ascii")
    code, told = record(run, "mill/high.nc", "-o", "HIGH.src")
    assert [i["severity"] for i in told["issues"] if i["code"] == "above-clearance"] == ["warning"]
    assert code == 0


def test_one_batch_translates_two_dialects_in_two_cells_and_a_broken_cell_fails_its_own_part(folder, run):
    (folder / "other.toml").write_text('name = "the other"\n' + CELL, encoding="utf-8")
    state(
        folder,
        'cell = "cell.toml"\n[[files]]\nmatch = "shop/*"\ndialect = "sinumerik"\ncell = "other.toml"\n',
    )
    done = run("batch", "mill", "shop", "-o", "out", code=0)
    assert "demonstration cell" not in done.out + done.err
    files = {part: Path(told["cell"]["file"]).name for part, told in records("out").items()}
    assert files == {"mill/a.nc": "cell.toml", "shop/b.mpf": "other.toml"}
    names = {part: told["cell"]["name"] for part, told in records("out").items()}
    assert names["shop/b.mpf"] == "the other" != names["mill/a.nc"]
    (folder / "bad.toml").write_text("[stock]\nbox = 3\n", encoding="utf-8")
    state(folder, '[[files]]\nmatch = "shop/*"\ndialect = "sinumerik"\ncell = "bad.toml"\n')
    assert run("batch", "mill", "shop", "-o", "out").code == 1
    told = records("out")
    assert [told[part]["exit_code"] for part in ("mill/a.nc", "shop/b.mpf")] == [0, 2]
    assert "stock.box" in told["shop/b.mpf"]["issues"][0]["message"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("simplfy = 0.01\n", "did you mean simplify"),
        ("simplify = -1\n", "greater than 0"),
        ('dialect = "fanuk"\n', "no dialect 'fanuk'"),
        ('[[files]]\ndialect = "fanuc"\n', "match"),
        ("simplify = \n", "not-toml"),
        ('cell = "there_is_none.toml"\n', "there_is_none.toml"),
    ],
)
def test_what_is_wrong_in_it_is_one_line(folder, run, text, words):
    state(folder, text)
    for command in (
        ("mill/a.nc", "-o", "A.src"),
        ("predict", "mill/a.nc", "-o", "p"),
        ("batch", "mill", "-o", "out"),
    ):
        outcome = run(*command, code=2)
        assert words in outcome.err
        assert len(outcome.err.strip().splitlines()) <= 2  # the second names `explain`
    assert not (folder / "A.src").exists()


def test_its_schema_knows_what_the_reader_knows():
    stated = {"cell": "c.toml", "block-delete": True, "files": [{"match": "*", "dialect": "fanuc"}]}
    jsonschema.validate(stated, project_schema())
    for wrong in ({"simplfy": 1}, {"files": [{}]}, {"dialect": "fanuk"}):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(wrong, project_schema())


def test_verify_takes_the_job_that_the_program_was_made_with(folder, run):
    """The stock of the job is in the program's hashes: without it the cell would count as another one."""
    (folder / "job.toml").write_text("[stock]\nbox_mm = [[-20, -20, -20], [80, 60, 0]]\n", encoding="utf-8")
    state(folder, 'cell = "cell.toml"\njob = "job.toml"\n')
    assert run("mill/a.nc", "-o", "A.src").code == 0
    assert run("verify", "A.src", "mill/a.nc").code == 0
    assert run("verify", "A.src", "mill/a.nc", "--isolated", "--cell", "cell.toml").code == 1


def test_names_below_the_folder_are_told_as_seen_from_it(folder, run):
    state(folder, 'cell = "cell.toml"\n')
    told = run("mill/a.nc", "-o", "A.src").err
    assert "gcode2krl.toml states cell=cell.toml [project-options]" in told
    assert str(folder) not in told
