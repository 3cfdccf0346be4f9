"""A repository of G-code in which the steps of a CI file run, with the gcode2krl of this checkout."""

import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import ROOT

CI = ROOT / "examples" / "ci"
GOOD = "G21 G90 G17\nT1 M6\nS8000 M3\nG43 H1\nG0 X0 Y0 Z20\nG1 Z-1 F600\nG1 X30 Y5\nG0 Z20\nM5\nM30\n"
BAD = "G21 G90\nG0 X0 Y0 Z20\nG1 X\nM30\n"


def needs(*programs):
    """Skip the test where a program is missing."""
    for program in programs:
        if shutil.which(program) is None:
            pytest.skip(f"no {program} on this machine")


class Repository:
    """A folder with ``parts/``, and on its path a ``gcode2krl`` that is this checkout's."""

    def __init__(self, folder: Path) -> None:
        if sys.platform == "win32":
            pytest.skip("the services' shells are bash on Linux")
        needs("bash", "git")
        self.folder = folder / "repository"
        (self.folder / "parts" / "sub").mkdir(parents=True)
        self.write("parts/good.nc", GOOD)
        self.write("parts/sub/bad.nc", BAD)
        programs = folder / "programs"
        programs.mkdir()
        for name, words in {"gcode2krl": '"{python}" -m gcode2krl', "python": '"{python}"'}.items():
            program = programs / name
            program.write_text(f'#!/bin/sh\nexec {words.format(python=sys.executable)} "$@"\n')
            program.chmod(program.stat().st_mode | stat.S_IXUSR)
        self.variables = {
            **os.environ,
            "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}",
            "PYTHONPATH": str(ROOT),
            "COLUMNS": "200",
        }

    def write(self, name: str, text: str) -> None:
        file = self.folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8", newline="\n")

    def run(self, script: str, **variables: str) -> subprocess.CompletedProcess[str]:
        """Run a script as GitHub does where no shell is named: it stops at the first error."""
        return subprocess.run(
            ["bash", "-e", "-c", script],
            cwd=self.folder,
            env=self.variables | variables,
            capture_output=True,
            text=True,
            timeout=300,
        )
