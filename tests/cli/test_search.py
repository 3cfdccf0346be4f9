"""--search: folders with subprograms, on each command that reads G-code."""

import json

import pytest

from gcode2krl.batch.cluster import make_shipped, pack
from gcode2krl.batch.parts import BatchPart
from gcode2krl.batch.planning import plan
from gcode2krl.batch.work import Task, make
from gcode2krl.gcode.dependencies import possible_files
from gcode2krl.translation import Order

HEAD = "G21 G90 G17\nT1 M6\nG0 G43 H1 Z50\nS12000 M3\nX0 Y0\n"
PART = HEAD + "o<side> call [50]\nG0 Z50\nM5\nM30\n"
SIDE = "o<side> sub\nG1 Z-2 F600\nX#1 F1500\no<side> endsub\n"


@pytest.fixture
def part(tmp_path):
    path = tmp_path / "part.nc"
    path.write_text(PART, encoding="ascii")
    (tmp_path / "macros").mkdir()
    (tmp_path / "macros" / "side.ngc").write_text(SIDE, encoding="ascii")
    return path


def test_a_subprogram_of_a_named_folder_is_found(run, part):
    assert run(part, "-o", "part.src").code == 2
    done = run(part, "-o", "part.src", "--search", "macros", "--json", code=0)
    assert json.loads(done.out)["options"]["search"] == ["macros"]
    assert run("verify", "part.src", part).code == 2
    assert run("verify", "part.src", part, "--search", "macros").code == 0
    assert run("predict", part, "-o", "prediction/", "--no-forces").code == 2
    run("predict", part, "-o", "prediction/", "--no-forces", "--search", "macros", "--json", code=0)


def test_folders_may_be_several_and_must_be_there(run, part, tmp_path):
    (tmp_path / "empty").mkdir()
    assert run(part, "-o", "part.src", "--search", "empty", "--search", "macros").code == 0
    assert "--search nowhere" in run(part, "-o", "part.src", "--search", "nowhere", code=2).err


def test_a_batch_finds_them_and_takes_a_changed_one_for_a_changed_part(run, part, tmp_path):
    def key():
        (planned,) = plan([BatchPart(part.name, part)], Order("", search=(str(tmp_path / "macros"),)))
        return planned.key

    run("batch", part, "-o", "out", "--search", "macros", "--no-cache", "--processes", "1", code=0)
    before = key()
    assert key() == before
    (tmp_path / "macros" / "side.ngc").write_text(SIDE.replace("Z-2", "Z-3"), encoding="ascii")
    assert key() != before


def test_a_program_that_calls_nothing_depends_on_its_own_bytes_alone(part, tmp_path):
    (tmp_path / "plain.nc").write_text(HEAD + "G0 X5\nM30\n", encoding="ascii")
    assert possible_files(tmp_path / "plain.nc", [tmp_path / "macros"]) == ()
    assert [file.name for file in possible_files(part, [tmp_path / "macros"])] == ["side.ngc"]


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("M98 P12\n", ["12.ngc", "O0012.nc"]),
        ("m98p30012\n", ["12.ngc", "O0012.nc"]),
        ("G65 P12 A1.\n", ["12.ngc", "O0012.nc"]),
        ("O12 call [1]\n", ["12.ngc", "O0012.nc"]),
        ("o<outer> call\n", ["inner.ngc", "outer.ngc"]),
        ("M98 P#1\n", ["12.ngc", "O0012.nc", "inner.ngc", "outer.ngc"]),
        ("O[#1] call\n", ["12.ngc", "O0012.nc", "inner.ngc", "outer.ngc"]),
        ("o<nowhere> call\n", []),
        ("G0 X5\n", []),
    ],
)
def test_calls_name_their_files_and_what_those_call(tmp_path, text, names):
    files = {"12.ngc": "", "O0012.nc": "", "outer.ngc": "o<inner> call\n", "inner.ngc": "", "other.txt": ""}
    for name, content in files.items():
        (tmp_path / name).write_text(content, encoding="ascii")
    (tmp_path / "part.nc").write_text(text, encoding="ascii")
    assert sorted(file.name for file in possible_files(tmp_path / "part.nc", ())) == sorted(names)


def test_a_cluster_gets_them(part, tmp_path):
    task = Task(Order(part, search=(str(tmp_path / "macros"),)))
    assert make_shipped(pack(task)).files == make(task).files
