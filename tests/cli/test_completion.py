"""Completion: each shell's script is one that it reads, and its answers are commands, options and files."""

import os
import shutil
import subprocess
import sys

import pytest

from gcode2krl.cli.completion import SHELLS, VARIABLE, script
from gcode2krl.cli.main import _COMMANDS
from tests.conftest import ROOT

CHECKED_BY = {
    "bash": ["bash", "-n"],
    "zsh": ["zsh", "-n"],
    "fish": ["fish", "--no-execute"],
    "powershell": [
        "pwsh",
        "-NoProfile",
        "-Command",
        "$null = [scriptblock]::Create((Get-Content -Raw $args[0]))",
    ],
}


@pytest.fixture
def answer(tmp_path):
    """Return what the program answers to a shell that completes."""

    def answered(shell, words, current):
        asking = {"COMP_WORDS": words, "COMP_CWORD": current, VARIABLE: f"{shell}_complete"}
        done = subprocess.run(
            [sys.executable, "-m", "gcode2krl"],
            env={**os.environ, **asking, "PYTHONPATH": str(ROOT)},
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=True,
        )
        return [line for line in done.stdout.splitlines() if line]

    return answered


@pytest.mark.parametrize("shell", SHELLS)
def test_the_script_is_one_that_the_shell_reads(shell, tmp_path, run):
    printed = run("completion", shell).out
    assert printed.strip() == script(shell).strip()
    assert f"{VARIABLE}" in printed
    file = tmp_path / "script"
    file.write_text(printed, encoding="utf-8")
    program, *words = CHECKED_BY[shell]
    if shutil.which(program) is None:
        pytest.skip(f"no {program} here")
    done = subprocess.run([program, *words, str(file)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_the_first_word_is_a_command_or_a_file(answer):
    assert answer("bash", "gcode2krl ide", "1") == ["plain,identify", "file,ide"]
    assert set(_COMMANDS) <= {line.removeprefix("plain,") for line in answer("bash", "gcode2krl ", "1")}


def test_options_behind_a_part_are_those_of_translate(answer):
    assert answer("bash", "gcode2krl no-such.nc --tol", "2") == ["plain,--tolerance"]
    assert answer("bash", "gcode2krl halfwritten --str", "2") == ["plain,--strict"]


def test_groups_choices_and_files(answer):
    assert answer("bash", "gcode2krl models sh", "2") == ["plain,show"]
    assert answer("bash", "gcode2krl part.nc --pilot v", "3") == ["plain,values"]
    assert answer("bash", "gcode2krl part.nc --cell ", "3") == ["file,"]


def test_powershell_gets_a_help_beside_each_answer_and_no_files(answer):
    assert answer("powershell", "gcode2krl ide", "ide")[0].startswith("identify\tFit the cell")
    assert answer("powershell", "gcode2krl 'C:\\my parts\\a.nc' --str", "--str") == [
        "--strict\tWarnings refuse the program too."
    ]
    assert answer("powershell", "gcode2krl part.nc --cell ", "") == []
    assert answer("powershell", 'gcode2krl "C:\\half', "C:\\half") == []


def test_bash_itself_completes(tmp_path):
    folder = tmp_path / "bin"
    folder.mkdir()
    (folder / "gcode2krl").write_text(f'#!/bin/sh\nexec "{sys.executable}" -m gcode2krl "$@"\n')
    (folder / "gcode2krl").chmod(0o755)
    lines = (
        'eval "$(gcode2krl completion bash)"\n'
        "COMP_WORDS=(gcode2krl predict part.nc --no-f) COMP_CWORD=3\n"
        "_gcode2krl_completion gcode2krl --no-f part.nc\n"
        'echo "${COMPREPLY[@]}"\n'
    )
    path = f"{folder}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-c", lines],
        env={**os.environ, "PATH": path, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
    )
    assert done.stdout.strip() == "--no-forces", done.stderr


def test_no_word_at_all_prints_the_help(run):
    done = run()
    assert done.code == 0
    assert done.out.startswith("Usage: gcode2krl")
    assert done.err == ""
