"""Programs written, read back and compared in pieces: the same bytes, and nothing left behind."""

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from gcode2krl import set_targets, write_krl
from gcode2krl.errors import NotUnderstoodError, RefusedError
from gcode2krl.gcode import read_gcode
from gcode2krl.krl import composition, read_krl
from tests.cells import over_demonstration
from tests.conftest import HEEDS_CTRL_C, ROOT
from tests.krl.conftest import verified

WAVE = "".join(f"G1 X{k / 4} Y{(k * 7) % 5} F{900 + k % 3 * 300}\n" for k in range(900))
PART = (
    "G21 G90\nT1 M6\nS12000 M3\nG0 G43 H1 Z50\nG0 X0 Y0\nG0 Z2\nG1 Z-1 F600\n"
    f"{WAVE}M8\n{WAVE}{WAVE}G4 P0.5\n{WAVE}G0 Z50\nM5\nM30\n"
)
OTHER = {
    "message": PART.replace("M8", "M8 (MSG, half)").replace("G21 G90", "G21 G90 G61"),  # no blended corners
    "offline": "G21 G90\nT1 M6\nS12000 M3\nG0 G43 H1 Z50\nG0 X0 Y0\nG0 Z2\nG1 Z-1 F600\n"
    + "".join(f"G1 X{k / 10} F1500\n" for k in range(600))
    + "G0 Z50\nM5\nM30\n",
}
CELL = 'based_on = "demonstration"\n[material]\nrelative_band = 0.1\n'
CELL += "[program]\nmax_lines = 250\n[online]\nmost_mm = 1.5\n[online.link]\n"
CELL += 'address = "192.168.7.3"\nport = 50001\n'
WAYS = {
    "whole": ["--max-lines", "100000"],
    "parts": [],
    "files": ["--split", "files"],
    "values": ["--pilot", "values"],
    "values in files": ["--pilot", "values", "--split", "files"],
    "online": ["--online", "ImFree"],
    "offline": ["--compensate", "offline"],
    "without forces": ["--no-forces"],
    "message": ["--split", "files"],
}


@pytest.fixture
def small(monkeypatch):
    """The program is written in many pieces."""
    monkeypatch.setattr(composition, "PIECE_ROWS", 70)


def contents(folder):
    return {
        file.name: file.read_bytes() for file in folder.iterdir() if file.suffix not in ("", ".nc", ".toml")
    }


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_the_bytes_are_those_of_a_program_held_as_a_whole(run, tmp_path, request, way):
    (tmp_path / "part.nc").write_text(OTHER.get(way, PART), encoding="ascii")
    (tmp_path / "cell.toml").write_text(CELL, encoding="utf-8")
    command = ("part.nc", "-o", "part.src", "--cell", "cell.toml", "--json", *WAYS[way])
    whole = run(*command, code=0)
    written = contents(tmp_path)
    request.getfixturevalue("small")
    pieces = run(*command, code=0)
    assert contents(tmp_path) == written
    assert json.loads(pieces.out) == json.loads(whole.out)
    if way != "offline":
        run("verify", "part.src", "part.nc", "--cell", "cell.toml", "--json", code=0)


@pytest.fixture
def targets(tmp_path):
    (tmp_path / "part.nc").write_text(PART, encoding="ascii")
    cell = over_demonstration({"program": {"max_lines": 250}})
    toolpath = read_gcode(tmp_path / "part.nc", cell)
    return toolpath, set_targets(toolpath, cell), cell


@pytest.mark.parametrize("name", ["PART", None])
def test_texts_are_those_of_the_files(targets, tmp_path, small, name):
    """Of a program in files, and of one without."""
    _, rows, cell = targets
    written = write_krl(rows, tmp_path / "part.src" if name else None, cell)
    assert set(written.texts) == ({"PART.src", "PART.dat"} if name else {"PART.src"})
    assert written.size_bytes == sum(map(len, written.texts.values()))
    if name:
        assert list(written.texts.values()) == [file.read_bytes() for file in written.files]


def test_a_difference_in_a_long_file_is_found(targets, tmp_path, small):
    toolpath, rows, cell = targets
    written = write_krl(rows, tmp_path / "part.src", cell)
    text = written.texts["PART.src"]
    assert verified(tmp_path / "part.src", toolpath, cell).ok
    at = [found.start(1) for found in re.finditer(rb"LIN \{X (\d)", text)][3000]
    other = b"%d" % (9 - int(text[at : at + 1]))
    (tmp_path / "part.src").write_bytes(text[:at] + other + text[at + 1 :])
    report = verified(tmp_path / "part.src", toolpath, cell)
    assert [issue.code for issue in report.issues if issue.severity == "error"] == ["verify-position"]
    assert report.issues[0].line == text[:at].count(b"\n") + 1
    assert read_krl(tmp_path / "part.src").texts["part.src"] == (tmp_path / "part.src").read_bytes()


def test_a_refused_program_leaves_no_file(targets, tmp_path, small, monkeypatch):
    _, rows, cell = targets
    monkeypatch.setattr(composition, "turn_bits", lambda q_rad: 99)
    with pytest.raises(RefusedError, match="S or T differs"):
        write_krl(rows, tmp_path / "part.src", cell)
    assert sorted(file.name for file in tmp_path.rglob("*")) == ["part.nc"]


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError(28, "No space left on device")])
def test_what_ends_the_writing_leaves_no_file(targets, tmp_path, small, monkeypatch, error):
    _, rows, cell = targets
    lines, calls = composition.motion_lines, []

    def ended(*arguments):
        calls.append(1)
        if len(calls) == 20:
            raise error
        return lines(*arguments)

    monkeypatch.setattr(composition, "motion_lines", ended)
    wanted = NotUnderstoodError if isinstance(error, OSError) else KeyboardInterrupt
    with pytest.raises(wanted):
        write_krl(rows, tmp_path / "part.src", cell)
    assert sorted(file.name for file in tmp_path.rglob("*")) == ["part.nc"]


@pytest.mark.skipif(sys.platform == "win32", reason="there Ctrl+C reaches all of the console's programs")
def test_an_interrupted_run_leaves_no_file(tmp_path):
    """Ctrl+C while the program is written."""
    (tmp_path / "part.nc").write_text(PART, encoding="ascii")
    code = """
import sys, time
from gcode2krl.krl import composition
composition.PIECE_ROWS = 70
lines = composition.motion_lines
def slow(*arguments):
    print("writing", flush=True)
    time.sleep(0.5)
    return lines(*arguments)
composition.motion_lines = slow
from gcode2krl.cli.main import main
main(["part.nc", "-o", "part.src", "--no-forces"])
"""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        preexec_fn=HEEDS_CTRL_C,
    )
    assert process.stdout.readline() == b"writing\n"
    assert any(file.name.startswith(".part.src") for file in tmp_path.iterdir())
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=30)
    assert process.returncode != 0
    assert b"Traceback" not in said
    assert sorted(file.name for file in Path(tmp_path).iterdir()) == ["part.nc"]


@pytest.mark.skipif(sys.platform == "win32", reason="there is no such limit")
def test_a_full_disk_is_one_line(tmp_path):
    """No file may be longer than 20 kB."""
    (tmp_path / "part.nc").write_text(PART, encoding="ascii")
    code = """
import resource, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
from gcode2krl.cli.main import main
main(["part.nc", "-o", "part.src", "--no-forces", "-q"])
"""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert re.fullmatch(r"part\.src: error: cannot write: File too large .*\n", done.stderr), done.stderr
    assert [file.name for file in tmp_path.iterdir()] == ["part.nc"]
