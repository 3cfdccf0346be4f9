"""Hooks of CAM systems without the systems: the filter, the job file, the installer, the Windows files."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gcode2krl import Prediction
from gcode2krl.cell.job import lay_job_over
from gcode2krl.cli.install_hook import POST, hook_text
from gcode2krl.errors import NotUnderstoodError
from tests.cells import over_demonstration
from tests.conftest import ROOT

GOOD = (
    "G21 G90 G17 G54\nT1 M6\nS8000 M3\nG0 G43 H1 Z20\nG0 X0 Y0\nG1 Z-1 F600\nG1 X20 F1500\nG0 Z20\nM5\nM30\n"
)
JOB = """name = "trial"
[stock]
box_mm = [[0, 0, -10], [300, 100, 0]]
[tool.1]
kind = "ball"
diameter_mm = 10.0
teeth = 2
overall_length_mm = 70
"""


def filtered(text, *words):
    """Run the filter as a shell would."""
    return subprocess.run(
        [sys.executable, "-m", "gcode2krl", "-", "-o", "-", *words],
        input=text.encode(),
        capture_output=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )


@pytest.mark.parametrize(
    ("text", "code", "finding"),
    [
        (GOOD, 0, b"note: the cell has not been confirmed"),
        (GOOD.replace("S8000 M3\n", ""), 1, b"[spindle-off]"),
        (GOOD.replace("G1 X20", "G1 X2O"), 2, b"stdin:7: error:"),
        ("", 2, b"error:"),
    ],
)
def test_the_filter_writes_a_program_or_nothing_and_findings_beside_it(text, code, finding):
    done = filtered(text, "--name", "PART")
    assert done.returncode == code, done.stderr
    assert finding in done.stderr
    assert (b"DEF PART" in done.stdout) == (code == 0)
    assert code == 0 or done.stdout == b""
    assert b"[" not in done.stdout.splitlines()[0] if done.stdout else True


def test_a_job_changes_the_prediction_and_not_where_the_tip_is(run, tmp_path):
    (tmp_path / "part.nc").write_text(GOOD, encoding="ascii")
    (tmp_path / "job.toml").write_text(JOB, encoding="utf-8")
    done = run("predict", "part.nc", "--job", "job.toml", "-o", "under", code=0)
    assert "T1 is a ball cutter of 10 mm in the job and flat of 16 mm in the cell" in done.err
    assert run("predict", "part.nc", "-o", "plain").code == 0
    under, plain = Prediction.load(tmp_path / "under"), Prediction.load(tmp_path / "plain")
    assert under.cell.stock.box_mm == ((0.0, 0.0, -10.0), (300.0, 100.0, 0.0))
    tool = under.cell.tool[1]
    assert (tool.kind, tool.diameter_mm, tool.teeth, tool.stick_out_mm) == ("ball", 10.0, 2, 70.0)
    np.testing.assert_array_equal(under.cell.tool_matrix(1), plain.cell.tool_matrix(1))
    np.testing.assert_array_equal(under.targets.position_mm, plain.targets.position_mm)
    assert np.abs(under.forces.force_base_N - plain.forces.force_base_N).max() > 1.0


def test_a_job_adds_no_tool_and_is_shifted_with_the_program(tmp_path):
    file = tmp_path / "job.toml"
    file.write_text(JOB + "[tool.77]\ndiameter_mm = 3\n", encoding="utf-8")
    offset = {"x_mm": 5.0, "y_mm": -1.0, "z_mm": 2.0, "a_deg": 0.0, "b_deg": 0.0, "c_deg": 0.0}
    under, _ = lay_job_over(over_demonstration({"work_offsets": {"G54": offset}}), file)
    assert 77 not in under.tool
    assert under.stock.box_mm == ((5.0, -1.0, -8.0), (305.0, 99.0, 2.0))


@pytest.mark.parametrize(
    ("line", "key"),
    [
        ("diameter_mm = 0", "tool.1.diameter_mm"),
        ("flute_length_mm = 900", "tool.1"),
        ("colour = 3", "colour"),
    ],
)
def test_a_wrong_job_is_refused_by_its_key(line, key, tmp_path):
    file = tmp_path / "job.toml"
    file.write_text(
        f"[tool.1]\n{line}\n" + ("" if "diameter" in line else "diameter_mm = 8\n"), encoding="utf-8"
    )
    with pytest.raises(NotUnderstoodError) as caught:
        lay_job_over(over_demonstration(), file)
    assert any(key in issue.message for issue in caught.value.issues)


def test_the_hook_is_installed_and_removed(run, tmp_path):
    folder = tmp_path / "Macro ä"
    folder.mkdir()
    (tmp_path / "cell.toml").write_text('based_on = "demonstration"\n', encoding="utf-8")
    assert run("install-hook", "freecad", "--folder", folder, "--cell", "cell.toml").code == 0
    text = (folder / POST).read_text(encoding="utf-8")
    compile(text, POST, "exec")
    assert f"PYTHON = {sys.executable!a}" in text
    assert f"CELL = {str(tmp_path / 'cell.toml')!a}" in text
    assert run("install-hook", "freecad", "--folder", folder, "--remove").code == 0
    assert not (folder / POST).exists()
    assert run("install-hook", "freecad", "--folder", tmp_path / "nowhere").code == 2
    assert run("install-hook", "freecad", "--folder", folder, "--cell", "no.toml").code == 2


def test_settings_of_the_hook_survive_any_path():
    python, cell = 'C:\\Prögram "x"\\python.exe', "D:\\ä'b\\cell.toml"
    space = {}
    for line in hook_text(python, Path("p"), cell).splitlines():
        if re.match(r"(PYTHON|CELL) = ", line):
            exec(line, space)
    assert (space["PYTHON"], space["CELL"]) == (python, cell)


def test_the_windows_files_are_ascii_and_quote_every_path():
    folder = ROOT / "examples" / "hooks"
    batch = (folder / "gcode2krl_after_post.bat").read_bytes()
    assert batch.count(b"\n") == batch.count(b"\r\n")  # cmd loses labels in files with bare line feeds
    (folder / "gcode2krl_after_post.ps1").read_bytes().decode("ascii")
    for line in batch.decode("ascii").splitlines():
        if line.startswith(("rem", "echo", "set")):
            continue
        bare = re.sub(r'"[^"]*"', "", line)
        assert not re.search(r"%(PART|PLACE|CELL|LOG|GCODE2KRL)%", bare), line
