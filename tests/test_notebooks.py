"""The notebooks: no outputs in the repository, nothing but the package and the extra, and every cell runs.

CI runs them in Jupyter (``examples/notebooks/run.py``); here their code runs as it stands, without a kernel.
"""

import ast
import json
import sys
import tomllib

import matplotlib.pyplot as plt
import pytest

from tests.conftest import ROOT

FOLDER = ROOT / "examples" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
PYTHON = set(sys.stdlib_module_names)
DEPENDENCIES = {"gcode2krl", "numpy", "matplotlib", "polars"}


def cells(file, kind):
    """Return the texts of a notebook's cells of one kind."""
    found = json.loads(file.read_text(encoding="utf-8"))["cells"]
    return ["".join(cell["source"]) for cell in found if cell["cell_type"] == kind]


def test_there_are_three():
    assert len(NOTEBOOKS) == 3


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_a_notebook_has_no_outputs(file):
    for cell in json.loads(file.read_text(encoding="utf-8"))["cells"]:
        assert cell.get("outputs", []) == []
        assert cell.get("execution_count") is None
        assert cell["metadata"] == {}


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_a_notebook_needs_only_the_package_and_the_extra(file):
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extra = {name.split(">")[0] for name in project["optional-dependencies"]["notebook"]}
    imported = set()
    for node in ast.walk(ast.parse("\n".join(cells(file, "code")))):
        if isinstance(node, ast.Import):
            imported |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            imported.add(node.module.split(".")[0])
    assert imported <= PYTHON | DEPENDENCIES | extra
    assert cells(file, "markdown")[0].startswith("# ")


def is_slow(file):
    """Tell whether a notebook makes a whole diagnosis."""
    return any("diagnose(" in code for code in cells(file, "code"))


MARKED = [
    pytest.param(file, marks=[pytest.mark.slow] if is_slow(file) else [], id=file.stem) for file in NOTEBOOKS
]


@pytest.mark.parametrize("file", MARKED)
def test_every_cell_runs(file, tmp_path, monkeypatch, capsys):
    """The notebooks assert what they claim: force over depth, force over spin, the cause by its name."""
    monkeypatch.setattr("tempfile.mkdtemp", lambda: str(tmp_path))
    names = {}
    for code in cells(file, "code"):
        exec(compile(code, file.name, "exec"), names)
    plt.close("all")
    assert capsys.readouterr().out
