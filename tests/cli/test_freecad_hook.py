"""The hook in FreeCAD itself, without a window: one post call from a job to a program, or a refusal.

Skipped where there is no ``freecadcmd`` (Debian: freecad-python3 and freecad-common).
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from gcode2krl import Prediction
from gcode2krl.cli.install_hook import POST, hook_text

FREECAD = shutil.which("freecadcmd")
JOB = Path(__file__).parent / "freecad" / "make_job.py"
PACKAGES = Path(__file__).resolve().parents[2]
CELL = """based_on = "demonstration"
[tool.1]
length_mm = 110.0
holder_diameter_mm = 40.0
"""
OPERATIONS = ("Facing", "Pocket", "Adaptive", "Helix", "Profile", "Drilling")

pytestmark = [
    pytest.mark.skipif(FREECAD is None, reason="no freecadcmd: the hook is not tried in FreeCAD"),
    pytest.mark.skipif(sys.platform != "linux", reason="FreeCAD's folders are those of Linux here"),
]


@pytest.fixture
def post(tmp_path):
    """Return a function that makes a job in FreeCAD, posts it, and returns what happened."""
    home = tmp_path / "zu Hause ä"  # blanks and letters beyond ASCII, as in users' names
    macros = home / ".local" / "share" / "FreeCAD" / "Macro"
    macros.mkdir(parents=True)
    cell = home / "cell.toml"
    cell.write_text(CELL, encoding="utf-8")
    (macros / POST).write_text(hook_text(sys.executable, PACKAGES, str(cell)), encoding="utf-8")

    def made(output="part.src", stock="box", drill_tool=2, arguments=""):
        result = tmp_path / "result.json"
        place = "-" if output == "-" else str(home / output)
        wanted = {"output": place, "stock": stock, "drill_tool": drill_tool, "arguments": arguments}
        wanted["result"] = str(result)
        kept = {
            key: value
            for key, value in os.environ.items()
            if not key.startswith(("PYTHON", "XDG_", "FREECAD"))
        }
        done = subprocess.run(
            [FREECAD, str(JOB)],
            env={**kept, "HOME": str(home), "GCODE2KRL_JOB": json.dumps(wanted)},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=300,
            check=False,
        )
        assert result.is_file(), done.stdout.decode("utf-8", "replace")[-3000:]
        return {
            **json.loads(result.read_text(encoding="utf-8")),
            "home": home,
            "view": done.stderr + done.stdout,
        }

    return made


def test_one_post_call_makes_the_program(post, run):
    done = post()
    assert done["listed"]
    assert "error" not in done, done["error"]
    assert set(done["moves"]) == set(OPERATIONS)
    assert min(done["moves"].values()) > 10
    source = done["home"] / "part.src"
    assert source.read_text(encoding="ascii") == done["text"]
    assert "DEF PART" in done["text"].upper()
    assert (done["home"] / "part.dat").is_file()
    assert b"the job's is used [tool-differs]" in done["view"]
    handed = done["home"] / "part.gcode2krl"
    cell = done["home"] / "cell.toml"
    run(
        "predict",
        handed / "part.nc",
        "--job",
        handed / "job.toml",
        "--cell",
        cell,
        "-o",
        done["home"] / "out",
        code=0,
    )
    prediction = Prediction.load(done["home"] / "out")
    assert prediction.cell.stock.box_mm == ((-3.0, -3.0, -2.0), (103.0, 63.0, 21.0))
    mill, drill, bull = (prediction.cell.tool[number] for number in (1, 2, 3))
    assert (mill.kind, mill.diameter_mm, mill.teeth, mill.flute_length_mm) == ("flat", 10.0, 3, 22.0)
    assert (mill.length_mm, mill.stick_out_mm, mill.holder_diameter_mm) == (110.0, 72.0, 40.0)
    assert (bull.kind, bull.corner_radius_mm, bull.teeth) == ("bull-nose", 1.0, 4)
    assert (drill.kind, drill.diameter_mm, drill.point_deg) == ("drill", 6.0, 119.0)
    drilled = prediction.motion.tool == 2
    bored = prediction.toolpath.tool == 2
    assert prediction.toolpath.position_mm[bored, 2].min() == 0.0
    assert (
        np.abs(prediction.forces.force_base_N[drilled, 2]).max() > 50.0
    )  # the holes are cut, not passed over
    run("verify", source, handed / "part.nc", "--job", handed / "job.toml", "--cell", cell, code=0)


@pytest.mark.slow
def test_a_tool_that_the_cell_has_not_fails_the_post(post):
    done = post(drill_tool=30)
    assert "gcode2krl refused the program, nothing was written" in done["error"]
    assert "T30 is not in the cell [tool-unknown] -> " in done["error"]
    assert "tools import" in done["error"]
    assert ", TC30: error:" in done["error"]
    assert not list(done["home"].glob("part.*[!l]"))  # neither .src nor .dat
    assert b"T30 is not in the cell" in done["view"]


@pytest.mark.slow
def test_a_round_stock_is_handed_over_as_a_mesh(post):
    done = post(stock="cylinder")
    assert "text" in done, done["error"]
    mesh = trimesh.load(done["home"] / "part.gcode2krl" / "part.stock.stl")
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(np.pi * 64.0**2 * 23.0, rel=2e-3)
    assert mesh.bounds[:, 2] == pytest.approx([-2.0, 21.0])


@pytest.mark.slow
def test_freecad_1_writes_the_text_itself(post):
    done = post(output="-", arguments="--pilot values --strict --cell demonstration.toml")
    assert "demonstration.toml" in done["error"]  # the user's --cell counts, and is not there
    done = post(output="-")
    assert done["text"].startswith("&ACCESS")
    assert "DEF Job" in done["text"] or "DEF JOB" in done["text"]
    assert "DECL" in done["text"]


def test_arguments_that_the_hook_sets_itself_are_refused(post):
    assert "the hook sets -o itself" in post(arguments="-o other.src")["error"]
