"""What reads a program back shares only the words of the language with what writes it."""

import ast
import re
from pathlib import Path

import pytest

import gcode2krl

PACKAGE = Path(gcode2krl.__file__).parent
NATIVE = PACKAGE.parent / "native"
WRITERS = {"composition", "number_text", "statements", "pilot_text", "rsi_text", "write", "provenance"}
READING = ("scan.c", "letters.h", "motion.h", "statement.h", "statement.c", "columns.c")
"""What reads a program back in the core."""


def nodes(file, kind):
    """Return the nodes of a kind in a file of the package."""
    tree = ast.parse((PACKAGE / file).read_text(encoding="utf-8"))
    return [node for node in ast.walk(tree) if isinstance(node, kind)]


@pytest.mark.parametrize("file", ["krl/scan.py", "krl/read.py", "krl/executed.py"])
def test_reading_back_imports_nothing_of_the_writer(file):
    modules = {(node.module or "").split(".")[-1] for node in nodes(file, ast.ImportFrom)}
    names = {alias.name for node in nodes(file, ast.ImportFrom) for alias in node.names}
    assert (modules | names) & WRITERS == set()


@pytest.mark.skipif(not NATIVE.exists(), reason="no sources beside the installed package")
@pytest.mark.parametrize("file", READING)
def test_the_core_reads_back_without_the_writer(file):
    included = re.findall(r'#include "(.*)"', (NATIVE / "krl" / file).read_text(encoding="utf-8"))
    own = {f"krl/{name}" for name in READING if name.endswith(".h")}
    assert set(included) <= {"core.h", "constants.h"} | own
