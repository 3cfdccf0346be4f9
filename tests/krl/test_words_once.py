"""KRL words, ASCII codes and G numbers stand once; the read-back shares only words with the writer."""

import ast
import re
from pathlib import Path

import pytest

import gcode2krl
from gcode2krl import krl_words

PACKAGE = Path(gcode2krl.__file__).parent
NATIVE = PACKAGE.parent / "native"
CORE = sorted([*NATIVE.glob("gcode/*.c"), *NATIVE.glob("krl/*.c")])
WRITERS = {"composition", "number_text", "statements", "pilot_text", "rsi_text", "write", "provenance"}
SHORTEST_WORD = 4
READING = ("scan.c", "letters.h", "motion.h", "statement.h", "statement.c", "columns.c")
"""What reads a program back in the core."""


def nodes(file, kind):
    """Return the nodes of a kind in a file of the package."""
    tree = ast.parse((PACKAGE / file).read_text(encoding="utf-8"))
    return [node for node in ast.walk(tree) if isinstance(node, kind)]


@pytest.mark.parametrize("file", CORE, ids=lambda file: file.name)
def test_the_core_compares_with_names_instead_of_codes(file):
    compared = re.findall(r"(?:[=!<>]=|[^-<>][<>])\s*(\d+)\b(?!\.)", file.read_text(encoding="utf-8"))
    assert [code for code in compared if 10 <= int(code) < 0x80] == []


def words_of_krl():
    """Return the words of the vocabulary that are long enough to be no English ones."""
    values = [value for name, value in vars(krl_words).items() if name.isupper()]
    return {value for value in values if isinstance(value, str) and len(value) >= SHORTEST_WORD}


def test_no_other_module_states_a_word_of_the_vocabulary():
    files = [*sorted((PACKAGE / "krl").glob("*.py")), *PACKAGE.rglob("template_rules.py")]
    words = words_of_krl()
    again = {
        (file.name, node.value)
        for file in files
        for node in nodes(file.relative_to(PACKAGE), ast.Constant)
        if isinstance(node.value, str) and node.value in words
    }
    assert {"$VEL.CP", "GK_PILOT", ".pilot.csv"} <= words
    assert again == set()


@pytest.mark.parametrize("file", ["krl/scan.py", "krl/read.py", "krl/executed.py"])
def test_reading_back_imports_nothing_of_the_writer(file):
    modules = {(node.module or "").split(".")[-1] for node in nodes(file, ast.ImportFrom)}
    names = {alias.name for node in nodes(file, ast.ImportFrom) for alias in node.names}
    assert (modules | names) & WRITERS == set()


@pytest.mark.skipif(not NATIVE.exists(), reason="no sources beside the installed package")
@pytest.mark.parametrize("file", [*READING, "number_text.c", "number_text.h"])
def test_the_core_has_no_word_of_the_vocabulary(file):
    code = re.sub(r"/\*.*?\*/", "", (NATIVE / "krl" / file).read_text(encoding="utf-8"), flags=re.DOTALL)
    written = set(re.findall(r'"((?:[^"\\]|\\.)*)"', code))
    assert not {
        word for word in words_of_krl() | {krl_words.LIN, krl_words.PTP} for text in written if word in text
    }


@pytest.mark.skipif(not NATIVE.exists(), reason="no sources beside the installed package")
@pytest.mark.parametrize("file", READING)
def test_the_core_reads_back_without_the_writer(file):
    included = re.findall(r'#include "(.*)"', (NATIVE / "krl" / file).read_text(encoding="utf-8"))
    own = {f"krl/{name}" for name in READING if name.endswith(".h")}
    assert set(included) <= {"core.h", "constants.h"} | own
