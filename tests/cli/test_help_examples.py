"""Every help text ends with examples, and each example runs as it stands."""

import json
import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import click
import numpy as np
import pytest

from gcode2krl import load_cell, predict
from gcode2krl.cli.help_examples import lines_of
from gcode2krl.cli.main import commands
from tests.cli.test_help import groups
from tests.conftest import ROOT
from tests.test_documents import CELL, folder, measured, traced  # noqa: F401 (folder is a fixture)

NEEDS_SHELL = ("|", ">", '"$(')
LISTENS = "online serve --pilot"
"""Begins a line of an example that waits for a robot."""


def all_commands():
    """Yield the name of each command, with its groups, and the command."""
    yield "", commands
    for path, group in groups(commands):
        for name in group.list_commands(click.Context(group)):
            yield " ".join([*path, name]), group.get_command(click.Context(group), name)


LINES = sorted({line for _, command in all_commands() for line in lines_of(command.epilog)})


@pytest.mark.parametrize(("name", "command"), list(all_commands()))
def test_a_help_text_ends_with_examples_of_its_command(name, command):
    lines = lines_of(command.epilog)
    assert lines
    word = "gcode2krl" if name in ("", "translate") else f"gcode2krl {name}"
    assert all(word in line for line in lines)
    shown = command.get_help(click.Context(command, info_name=name))
    assert shown.endswith("\n".join(["  Examples:", *(f"    {line}" for line in lines)]))


@pytest.fixture
def ready(folder, run):  # noqa: F811
    """Return a function that makes the files that an example names."""

    def prepare(line):
        if "--answers" in line:
            answers = ROOT / "examples" / "cells" / "answers" / "tool_magazine.toml"
            text = answers.read_text(encoding="utf-8")
            (folder / "answers.toml").write_text(text, encoding="utf-8")
        if "verify" in line or "runkit" in line:
            cell = ("--cell", "cell.toml") if "--cell" in line else ()  # that of the program
            assert run("part.nc", *cell, "-o", "part.src").code == 0
        if "--compensate" in line:  # as if the material had been measured
            with (folder / "cell.toml").open("a", encoding="utf-8") as cell:
                cell.write("[material]\nrelative_band = 0.1\n")
        if "report" in line:
            assert run("predict", "part.nc", "--cell", "cell.toml", "-o", "prediction").code == 0
        if "identify force" in line:
            force_run(folder)
        elif "run-1" in line or "my.csv" in line:
            measured(folder)
        if "trace.csv" in line:
            traced(folder, run)
        if "batch" in line:
            (folder / "parts").mkdir()
            shutil.copy(folder / "part.nc", folder / "parts")
        if "tools import" in line:
            geometry = {"DC": 10, "NOF": 3, "LCF": 22}
            tool = {"type": "flat end mill", "unit": "millimeters", "geometry": geometry}
            library = {"data": [tool | {"post-process": {"number": 5}}]}
            (folder / "library.json").write_text(json.dumps(library), encoding="utf-8")
            (folder / "tool.tbl").write_text("T1 P1 D6 ; end mill\n", encoding="utf-8")
        if "macros/" in line:
            (folder / "macros").mkdir()
        (folder / ".local" / "share" / "FreeCAD" / "Macro").mkdir(parents=True, exist_ok=True)
        (folder / ".config" / "fish" / "completions").mkdir(parents=True, exist_ok=True)

    return prepare


def force_run(place):
    """Write a run whose force is the predicted one and noise."""
    made = predict(place / "part.nc", load_cell(place / "cell.toml"))
    made.save(place / "prediction")
    run = place / "run-1"
    run.mkdir()
    (run / "run.toml").write_text(
        'prediction = "../prediction"\n[frames]\nforce = "base"\n', encoding="utf-8"
    )
    motion, forces = made.motion, made.forces
    noise = np.random.default_rng(1).normal(0.0, 2.0, forces.force_base_N.shape)
    rows = np.column_stack([motion.time_s, forces.force_base_N + noise])
    header = "t_s,fx_N,fy_N,fz_N"
    np.savetxt(run / "force.csv", rows, delimiter=",", header=header, comments="", fmt="%.6f")


@pytest.mark.slow
@pytest.mark.parametrize("line", LINES)
def test_an_example_runs(line, ready, run, folder, monkeypatch, tmp_path):  # noqa: F811
    if LISTENS in line:
        pytest.skip("it waits for a robot; --files of the same command runs")
    ready(line)
    for name in ("HOME", "USERPROFILE", "XDG_DATA_HOME"):
        monkeypatch.setenv(name, str(folder / (".local/share" if name.startswith("XDG") else "")))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(folder / ".config"))
    if not any(sign in line for sign in NEEDS_SHELL):
        words = shlex.split(line)
        assert words.pop(0) == "gcode2krl"
        run(*words, code=0)
        return
    if os.name == "nt":
        pytest.skip("the line is for a Unix shell")
    bin_folder = tmp_path / "bin"
    bin_folder.mkdir()
    (bin_folder / "gcode2krl").write_text(f'#!/bin/sh\nexec "{sys.executable}" -m gcode2krl "$@"\n')
    (bin_folder / "gcode2krl").chmod(0o755)
    environment = {
        **os.environ,
        "PATH": f"{bin_folder}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(ROOT),
    }
    done = subprocess.run(["bash", "-ec", line], env=environment, capture_output=True, text=True, cwd=folder)
    assert done.returncode == 0, done.stderr
    if ">" in line:
        assert (folder / Path(line.split(">")[-1].strip().replace("~/", ""))).stat().st_size > 100
