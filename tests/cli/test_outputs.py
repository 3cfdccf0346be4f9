"""Equal names of file and DEF, no input overwritten, foreign folders, files that cannot be read or
written."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from gcode2krl.krl.names import name_problem, suggested_name
from gcode2krl.prediction import Prediction

PART = """G21 G90 G17 G54 G64 P0.02
T1 M6
S8000 M3
G0 G43 H1 Z20
G0 X0 Y0
G0 Z2
G1 Z-1 F600
G1 X20 F1500
G0 Z20
M5
M30
"""


def hidden(folder):
    return [file.name for file in folder.rglob("*") if file.suffix in (".part", ".old")]


# --- names ------------------------------------------------------------------------------------------------

BAD = {
    "circ": "CIRC_1",
    "1abc": "P_1ABC",
    "a_name_of_more_than_24_characters": "A_NAME_OF_MORE_THAN_24_C",
    "two words": "TWO_WORDS",
    "teil-ä": "TEIL",
    "part.v2": "PART_V2",
    "sps": "SPS_1",
    "bas": "BAS_1",
    "ir_stopm": "IR_STOPM_1",
    "p00": "P00_1",
    "cell": "CELL_1",
    "MsgLib": "MSGLIB_1",
    "$config": "CONFIG_1",
    "config": "CONFIG_1",
    "usertech": "USERTECH_1",
    "con": "CON_1",
    "lpt1": "LPT1_1",
    "sqrt": "SQRT_1",
    "set_krlmsg": "SET_KRLMSG_1",
    "gk_pilot": "P_GK_PILOT",
    "gk_rsi_lost": "P_GK_RSI_LOST",
}


@pytest.mark.parametrize("stem", BAD)
def test_an_output_that_a_controller_would_not_take_is_refused(run, part, tmp_path, stem):
    done = run("part.nc", "-o", f"{stem}.src", code=2)
    assert "[krl-name]" in done.err
    assert f"-o {BAD[stem]}.src" in done.err
    assert len(done.err.splitlines()) == 1
    assert list(tmp_path.glob("*.src")) == []


@pytest.mark.parametrize(("stem", "where"), [("circ", "beside"), ("two words", "folder")])
def test_a_derived_name_is_one_that_a_controller_takes(run, part, tmp_path, stem, where):
    folder = tmp_path / ("out" if where == "folder" else ".")
    folder.mkdir(exist_ok=True)
    part.rename(tmp_path / f"{stem}.nc")
    done = run(f"{stem}.nc", *(["-o", "out"] if where == "folder" else []), code=0)
    name = BAD[stem]
    files = sorted(file.name for file in folder.glob(f"{name}*"))
    assert files == [f"{name}.dat", f"{name}.pilot.csv", f"{name}.src"]
    assert f"DEF {name}( )" in (folder / f"{name}.src").read_text("ascii")
    assert f"DEFDAT {name}\n" in (folder / f"{name}.dat").read_text("ascii")
    assert f"the program is called {name}: {stem!r} cannot be a program's name" in done.out, "the summary"
    assert run("verify", folder / f"{name}.src", f"{stem}.nc").code == 0
    assert run(f"{stem}.nc", "-o", folder, "--strict").code == 0, "a note refuses nothing"


def test_a_good_name_is_kept_as_it_is_written(run, part, tmp_path):
    (tmp_path / "out").mkdir()
    assert run("part.nc", "-o", "out").code == 0
    assert "DEF PART( )" in (tmp_path / "out" / "part.src").read_text("ascii")
    assert run("part.nc", "-o", "out", "--name", "job_7").code == 0
    assert "DEF JOB_7( )" in (tmp_path / "out" / "job_7.src").read_text("ascii")
    assert run("part.nc", "--name", "Job_8").code == 0
    assert "DEF JOB_8( )" in (tmp_path / "Job_8.src").read_text("ascii")
    assert run("part.nc", "-o", "same.src", "--name", "SAME").code == 0


def test_name_and_file_must_be_alike(run, part, tmp_path):
    assert "-o other.src" in run("part.nc", "-o", "part.src", "--name", "other", code=2).err
    assert list(tmp_path.glob("*.src")) == []


def test_a_subprogram_that_the_cell_calls_is_taken(run, part, tmp_path):
    (tmp_path / "cell.toml").write_text(
        'based_on = "demonstration"\n[program]\nexternals = ["SPINDLE_ON(INT :IN)"]\n'
    )
    done = run("part.nc", "-o", "spindle_on.src", "--cell", "cell.toml", code=2)
    assert "a subprogram that the cell calls" in done.err


@pytest.mark.parametrize("stem", [*BAD, "", "_", "9" * 40, "gk_" * 12, "sps_" * 9, "ß", "\n", "..", "LIN_1"])
def test_every_suggestion_is_a_good_name(stem):
    assert name_problem(suggested_name(stem)) == ""
    assert name_problem(suggested_name(stem, [suggested_name(stem)]), [suggested_name(stem)]) == ""


def test_standard_input_has_no_name(run, part, tmp_path, monkeypatch):
    assert "--name PART" in run("-", "-o", ".", code=2).err


# --- no input is overwritten ------------------------------------------------------------------------------

CELL = 'based_on = "demonstration"\n[stock]\nmesh = "stock.stl"\n'
STOCK = """solid s
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 9 0 0
vertex 0 9 0
endloop
endfacet
endsolid s
"""


@pytest.mark.parametrize(
    ("rename", "arguments"),
    [
        ({"part.nc": "part.dat"}, ["part.dat", "-o", "part.src"]),
        ({"part.nc": "part.dat"}, ["part.dat"]),
        ({"part.nc": "part.pilot.csv"}, ["part.pilot.csv", "-o", "part.src"]),
        ({"part.nc": "a.src"}, ["a.src", "-o", "a.src"]),
        ({"part.nc": "a.rsi.xml"}, ["a.rsi.xml", "-o", "b.src", "--online", "a"]),
        ({"part.nc": "a_ETH.xml"}, ["a_ETH.xml", "-o", "b.src", "--online", "a"]),
        ({"cell.toml": "part.dat"}, ["part.nc", "-o", "part.src", "--cell", "part.dat"]),
        ({"cell.toml": "part.src"}, ["part.nc", "--cell", "part.src"]),
        (
            {"part.nc": "p.png"},
            ["p.png", "-o", "b.src", "--compensate", "offline", "--compensate-plot", "p.png"],
        ),
        ({"part.nc": "p.stl"}, ["predict", "p.stl", "-o", "new", "--part", "p.stl"]),
        ({}, ["predict", "part.nc", "--cell", "cell.toml", "-o", "new", "--part", "stock.stl"]),
        ({}, ["predict", "part.nc", "--cell", "cell.toml", "-o", "new", "--part", "./link.stl"]),
        ({}, ["predict", "part.nc", "--cell", "cell.toml", "-o", "new", "--part", "hard.stl"]),
        ({"cell.toml": "t.src"}, ["make-test", "controller", "-o", "t.src", "--cell", "t.src"]),
        ({"cell.toml": "t.dat"}, ["make-test", "controller", "-o", "t.src", "--cell", "t.dat"]),
        ({}, ["identify", "controller", "trace.csv", "--plot", "trace.csv"]),
        ({"trace.csv": "t.png"}, ["identify", "controller", "t.png", "--plot", "t.png"]),
        ({"trace.csv": "t.toml"}, ["identify", "controller", "t.toml", "--apply", "t.toml"]),
        (
            {"cell.toml": "c.png"},
            ["identify", "controller", "trace.csv", "--plot", "c.png", "--cell", "c.png"],
        ),
        ({}, ["identify", "sensor", "trace.csv", "-o", "trace.csv"]),
        ({}, ["identify", "sensor", "trace.csv", "-o", "cell.toml", "--cell", "cell.toml"]),
        ({}, ["identify", "force", "run", "--apply", "run/force.csv"]),
        ({}, ["diagnose", "prediction", "run", "--apply", "run/run.toml"]),
        ({}, ["online", "replay", "run", "-o", "run/force.csv"]),
        ({"cell.toml": "run/run.toml"}, ["online", "serve", "--cell", "run/run.toml", "-o", "run"]),
        (
            {"cell.toml": "run/deviation.png"},
            ["online", "simulate", "--cell", "run/deviation.png", "--plot", "run"],
        ),
        (
            {"cell.toml": "run/a_ETH.xml"},
            ["online", "serve", "--files", "run", "--name", "a", "--cell", "run/a_ETH.xml"],
        ),
        ({"cell.toml": "run/spin.csv"}, ["stiffness-map", "--cell", "run/spin.csv", "-o", "run"]),
    ],
)
def test_no_input_is_overwritten(run, part, tmp_path, rename, arguments):
    (tmp_path / "run").mkdir()
    contents = {"cell.toml": CELL, "stock.stl": STOCK, "trace.csv": "t_s\n", "run/force.csv": "t_s\n"}
    for name, text in contents.items():
        (tmp_path / name).write_text(text)
    for old, new in rename.items():
        (tmp_path / old).rename(tmp_path / new)
        if new.startswith("run/"):  # as seen from there
            (tmp_path / "run" / "stock.stl").write_text(STOCK)
    if "run/run.toml" not in rename.values():
        (tmp_path / "run" / "run.toml").write_text("")
    (tmp_path / "link.stl").symlink_to("stock.stl")
    (tmp_path / "hard.stl").hardlink_to(tmp_path / "stock.stl")
    before = {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}
    done = run(*arguments, code=2)
    assert re.search(r"\[(output-is-input|option-value)\]", done.err), done.err
    assert len(done.err.splitlines()) == 1
    assert {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()} == before


def test_a_base_that_a_cell_names_is_an_input(run, part, tmp_path):
    (tmp_path / "base.toml").write_text(CELL.replace("stock.stl", "part.dat"))
    (tmp_path / "cell.toml").write_text('based_on = "base.toml"\n')
    (tmp_path / "part.dat").write_text(STOCK)
    assert "[output-is-input]" in run("part.nc", "-o", "part.src", "--cell", "cell.toml", code=2).err
    assert (tmp_path / "part.dat").read_text() == STOCK


def test_parts_are_compared_when_they_are_written(run, tmp_path):
    """The number of parts is not known beforehand."""
    moves = "".join(f"G1 X{10 * (k % 2)} Y{0.5 * k:.1f}\n" for k in range(300))
    (tmp_path / "LONG_002.src").write_text(PART.replace("G0 Z20\nM5", f"{moves}G0 Z20\nM5"))
    before = (tmp_path / "LONG_002.src").read_bytes()
    arguments = ("LONG_002.src", "-o", "long.src", "--max-lines", "100", "--no-forces")
    assert "LONG_002.src is an input" in run(*arguments, "--split", "files", code=2).err
    assert (tmp_path / "LONG_002.src").read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["LONG_002.src"], "all or none"
    assert run(*arguments).code == 0, "without parts there is nothing to overwrite"


# --- the folder of a prediction ---------------------------------------------------------------------------


@pytest.mark.parametrize("foreign", ["prediction.toml", "notes.txt", "motion.parquet"])
def test_a_foreign_folder_is_not_written_into(run, part, tmp_path, foreign):
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / foreign).write_text('title = "my own"\n')
    done = run("predict", "part.nc", "-o", "folder", "--no-forces", code=2)
    assert "[output-foreign]" in done.err
    assert len(done.err.splitlines()) == 1
    assert [file.name for file in (tmp_path / "folder").iterdir()] == [foreign]
    assert (tmp_path / "folder" / foreign).read_text() == 'title = "my own"\n'
    assert run("predict", "part.nc", "-o", ".").code == 2


def test_an_empty_folder_a_new_one_and_a_prediction_are_written_into(run, part, tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "empty" / ".prediction.toml.12345678-999999999-abcd1234.part").write_text("left")
    for folder in ("empty", "new", "new"):
        assert run("predict", "part.nc", "-o", folder, "--no-forces").code == 0
        assert Prediction.load(tmp_path / folder).motion is not None
    assert "unfinished" not in (tmp_path / "new" / "prediction.toml").read_text("utf-8")


def test_a_prediction_that_was_not_finished_is_not_read(run, part, tmp_path):
    assert run("predict", "part.nc", "-o", "new", "--no-forces").code == 0
    record = tmp_path / "new" / "prediction.toml"
    record.write_text('schema = "gcode2krl/prediction/1"\nunfinished = true\n')
    assert "[prediction-unfinished]" in run("online", "simulate", "new", code=2).err
    assert run("predict", "part.nc", "-o", "new", "--no-forces").code == 0


def test_a_prediction_that_cannot_be_written_stays_as_it_was(run, part, tmp_path):
    assert run("predict", "part.nc", "-o", "new", "--no-forces").code == 0
    before = (tmp_path / "new" / "prediction.toml").read_bytes()
    (tmp_path / "new" / "targets.parquet").unlink()
    (tmp_path / "new" / "targets.parquet").mkdir()
    assert "targets.parquet" in run("predict", "part.nc", "-o", "new", "--no-forces", code=2).err
    assert (tmp_path / "new" / "prediction.toml").read_bytes() == before
    assert hidden(tmp_path) == []


@pytest.mark.parametrize("mesh", ["x.nc", "mesh", "left.src", "nowhere/left.stl"])
def test_a_mesh_of_no_known_kind_is_refused_before_the_work(run, part, tmp_path, mesh):
    done = run("predict", "part.nc", "-o", "new", "--part", mesh, code=2)
    assert len(done.err.splitlines()) == 1
    assert "internal" not in done.err
    assert [file.name for file in tmp_path.iterdir()] == ["part.nc"]


# --- what cannot be read or written -----------------------------------------------------------------------


def shell(tmp_path, command):
    """Run a shell command; ``gcode2krl`` in it is this package."""
    root = Path(__file__).resolve().parents[2]
    environment = {**os.environ, "PYTHONPATH": str(root), "MPLBACKEND": "Agg"}
    text = command.replace("gcode2krl", f'"{sys.executable}" -m gcode2krl')
    return subprocess.run(
        ["bash", "-c", text],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        stdin=subprocess.DEVNULL,
        check=False,
    )


FULL = pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")


@pytest.mark.parametrize(
    ("command", "code", "lines"),
    [
        ("gcode2krl - -o x.src <&-", 2, 1),
        pytest.param("gcode2krl part.nc --no-forces -o - >/dev/full", 2, 1, marks=FULL),
        ("gcode2krl part.nc --no-forces -o - >&-", 2, 1),
        pytest.param("gcode2krl models schema >/dev/full", 2, 1, marks=FULL),
        ("gcode2krl models schema | head -1", 0, 0),
        pytest.param("gcode2krl nothere.nc -o x.src 2>/dev/full", 2, 0, marks=FULL),
        ("gcode2krl nothere.nc -o x.src 2>&-", 2, 0),
        ("LC_ALL=C PYTHONUTF8=0 PYTHONIOENCODING=ascii gcode2krl verify part.nc part.nc", 2, 1),
    ],
)
def test_standard_files_closed_or_full(tmp_path, part, command, code, lines):
    done = shell(tmp_path, command)
    assert done.returncode == code
    assert len(done.stderr.splitlines()) == lines, done.stderr
    assert "internal" not in done.stderr


@pytest.mark.parametrize("name", ["part.dat", "part.pilot.csv", "part.src"])
def test_a_folder_in_the_place_of_an_output_is_named(run, part, tmp_path, name):
    (tmp_path / name).mkdir()
    assert run("part.nc", "-o", "part.src", code=2).err.startswith(f"{name}: error: this is a folder")
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted([name, "part.nc"])


@pytest.mark.parametrize(
    "arguments",
    [
        ["", "-o", "x.src"],
        ["part.nc", "-o", ""],
        ["folder", "-o", "x.src"],
        ["predict", "folder", "-o", "p"],
        ["predict", "part.nc", "-o", ""],
        ["predict", "part.nc", "-o", "part.nc"],
        ["part.nc", "-o", "nowhere/"],
        ["part.nc", "-o", "nowhere/x.src"],
        ["part.nc", "-o", "x.src", "--comment-every", "99999999999999999999"],
        ["part.nc", "-o", "x.src", "--compensate", "offline", "--compensate-plot", "x.txt"],
        ["make-test", "controller", "-o", "t.nc", "--at", "nan", "0", "0"],
        ["stiffness-map", "--load", "1e300", "0", "0"],
        ["stiffness-map", "-o", "part.nc"],
        ["identify"],
        ["online"],
        ["models"],
        ["part.nc", "-o", "x.src", "--cell", "huge.toml"],
    ],
)
def test_one_line_and_nothing_written(run, part, tmp_path, arguments):
    (tmp_path / "folder").mkdir()
    (tmp_path / "huge.toml").write_text(
        'based_on = "demonstration"\n[program]\ncomment_every = 99999999999999999999\n'
    )
    before = sorted(file.name for file in tmp_path.rglob("*"))
    done = run(*arguments, code=2)
    assert len(done.err.splitlines()) == 1, done.err
    assert "internal" not in done.err
    assert sorted(file.name for file in tmp_path.rglob("*")) == before


def test_names_with_spaces_and_umlauts(run, part, tmp_path):
    folder = tmp_path / "fö lder"
    folder.mkdir()
    part.rename(folder / "mein Teil ä.nc")
    done = run(folder / "mein Teil ä.nc", "--json", code=0)
    assert [Path(file).name for file in json.loads(done.out)["files"]] == [
        "MEIN_TEIL.src",
        "MEIN_TEIL.dat",
        "MEIN_TEIL.pilot.csv",
    ]
    assert run("predict", folder / "mein Teil ä.nc", "-o", folder / "vor her").code == 0
