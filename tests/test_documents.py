"""Every example of the README and of the documents runs: Python, commands, and what the README shows."""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from gcode2krl import Prediction, load_cell, predict
from tests.conftest import ROOT
from tests.identify.test_controller import Controller, trace_of, write_csv

DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
CELL = """based_on = "demonstration"

[stock]
box_mm = [[0, -100, -30], [300, 100, 0]]
"""
ELSEWHERE = {"docs/diagnose_check.md": "hours of cases; .ci/run makes one with the same program"}
"""Documents with commands that are not run here, and why."""


def blocks(language):
    """Yield document, number and text of each example in a language; those of the set-up run in .ci/run."""
    for path in DOCUMENTS:
        name = path.relative_to(ROOT).as_posix()
        found = re.findall(rf"^```{language}\n(.*?)^```", path.read_text(encoding="utf-8"), re.M | re.S)
        for number, text in enumerate(found):
            if name not in ELSEWHERE:
                yield name, number, text


def case(name, number, text):
    """Return a block or a command as a parameter; all but what the README begins with is slow."""
    first = (name, number) == ("README.md", 0)
    return pytest.param(text, id=f"{name}:{number}", marks=[] if first else pytest.mark.slow)


PYTHON = [case(*each) for each in blocks("python")]
COMMANDS = [
    case(name, f"{number}.{line}", command)
    for name, number, text in blocks("sh")
    for line, command in enumerate(text.splitlines())
]
SHOWN = [
    pytest.param(path, command, id=f"{path.name}:{number}")
    for path in (DOCUMENTS[0], ROOT / "docs" / "first_program.md")
    for number, command in enumerate(
        re.findall(r"<!-- output: (gcode2krl .*?)(?: \| .*?)? -->", path.read_text(encoding="utf-8"))
    )
]


@pytest.fixture(scope="module")
def predicted(tmp_path_factory):
    """A prediction of the test piece."""
    folder = tmp_path_factory.mktemp("predicted")
    measured_material = f"{CELL}[material]\nrelative_band = 0.1\n"  # as `identify force` leaves it
    (folder / "cell.toml").write_text(measured_material, encoding="ascii")
    made = predict(ROOT / "examples" / "test_piece.nc", load_cell(folder / "cell.toml"))
    made.save(folder / "prediction")
    return folder / "prediction"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The working folder of the examples: the part and the cell that they name."""
    monkeypatch.chdir(tmp_path)
    for name in ("examples", "docs"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("images", "__pycache__"))
    shutil.copy(ROOT / "examples" / "test_piece.nc", "part.nc")
    Path("cell.toml").write_text(CELL, encoding="ascii")
    trimesh.creation.box(bounds=[[0, -100, -30], [300, 100, -9]]).export("nominal.stl")
    return tmp_path


def measured(folder):
    """Write a prediction and three runs with play in axis 2 to a folder, and the joints of one as a log."""
    from tests.gap.synthetic import applied, prediction, runs, write, write_log

    prediction().save(folder / "prediction")
    for run in runs(applied("backlash:target=A2,gap_deg=0.02"), 3, 5):
        write(run, folder)
        write_log(run, folder / "my.csv")


def traced(folder, run):
    """Write the controller's test program, and the trace of a controller that runs it, to a folder."""
    assert run("make-test", "controller", "-o", folder / "test.nc").code == 0
    write_csv(trace_of((folder / "test.nc").read_text(encoding="ascii"), Controller()), folder / "trace.csv")


def names_of(prediction):
    """Return the names that the short examples use."""
    load_N = np.zeros_like(prediction.motion.position_mm)
    load_N[:, 0] = 100.0
    return {
        "prediction": prediction,
        "cell": prediction.cell,
        "toolpath": prediction.toolpath,
        "targets": prediction.targets,
        "motion": prediction.motion,
        "forces": prediction.forces,
        "joints": prediction.joints,
        "q_rad": prediction.joints.q_rad,
        "force_root_N": load_N,
        "moment_root_Nmm": 50.0 * load_N,
        "feed": np.gradient(prediction.motion.position_mm, axis=0),
    }


@pytest.mark.parametrize("code", PYTHON)
def test_python(code, folder, predicted):
    if "load_run" in code:
        measured(folder)
    exec(compile(code, "example", "exec"), names_of(Prediction.load(predicted)))


@pytest.mark.parametrize("command", COMMANDS)
def test_commands(command, folder, run, predicted):
    words = shlex.split(command, comments=True)
    assert words[0] == "gcode2krl"
    if "diagnose" in words:
        measured(folder)
    if words[1] == "report":
        shutil.copytree(predicted, "prediction")
    if "trace.csv" in words:
        traced(folder, run)
    if "milling_cell.toml" in words and "init" not in words:
        answers = "examples/cells/answers/upside_down.toml"
        assert run("init", "milling_cell.toml", "--answers", answers).code == 0
    run(*words[1:], code=0)


@pytest.mark.parametrize(("path", "command"), SHOWN)
def test_what_a_page_shows_is_what_is_printed(path, command, folder):
    """Equal except for figures: the last digits of a computer may differ."""
    words = shlex.split(command.replace("{tmp}", "."))[1:]
    done = subprocess.run([sys.executable, "-m", "gcode2krl", *words], capture_output=True, text=True)
    block = re.escape(f"<!-- output: {command} -->\n```text\n") + r"(.*?)\n```"
    shown = re.search(block, path.read_text(encoding="utf-8"), re.S).group(1)
    lines = [line.rstrip() for line in (done.stderr + done.stdout).splitlines()]
    assert without_figures("\n".join(lines)) == without_figures(shown)


def without_figures(text):
    return re.sub(r"[\d.]*\d", "#", text).replace("./", "")


def test_no_example_is_forgotten():
    """A block in a language that is not known here would run nowhere."""
    known = {"", "text", "toml", "python", "math", "sh", "sh setup"}
    for path in DOCUMENTS:
        fences = re.findall(r"^```(.*)$", path.read_text(encoding="utf-8"), re.M)
        assert set(fences[::2]) <= known, path
        assert set(fences[1::2]) <= {""}, path
    assert len(PYTHON) >= 7
    assert len(COMMANDS) >= 7
    assert len(SHOWN) >= 2
