"""The names that scripts rely on, and no name that means a module and a function at once."""

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import pytest

import gcode2krl

PACKAGE = Path(gcode2krl.__file__).parent

PUBLIC = {
    "gcode2krl": [
        "Cell",
        "Gcode2KrlError",
        "Issue",
        "Prediction",
        "Run",
        "__version__",
        "cut",
        "deflect",
        "diagnose",
        "load_cell",
        "load_run",
        "plan_motion",
        "predict",
        "predict_many",
        "read_gcode",
        "run_from",
        "set_targets",
        "solve_joints",
        "verify_krl",
        "write_krl",
    ],
    "gcode2krl.krc4": ["corner", "effective_acceleration", "jerk", "speed_step"],
    "gcode2krl.robot": ["forward", "inverse", "jacobian"],
    "gcode2krl.cutting": ["mean_force"],
    "gcode2krl.compliance": ["displace", "project_normal"],
}
"""Module to names: the published interface."""

STILL_SHARED = (
    "cli.main",  # the console script: `gcode2krl.cli.main:main`
)
"""Modules in which a function or class has the module's own name."""


def modules():
    """Return dotted name, without the package's, and syntax tree of each module."""
    for file in sorted(PACKAGE.rglob("*.py")):
        dotted = ".".join(file.relative_to(PACKAGE).with_suffix("").parts)
        yield dotted, ast.parse(file.read_text(encoding="utf-8"))


def defined(tree):
    """Return the functions and classes at the top of a module."""
    kinds = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef
    return {node.name for node in tree.body if isinstance(node, kinds)}


@pytest.mark.parametrize(("module", "name"), [(m, name) for m, names in PUBLIC.items() for name in names])
def test_a_public_name_is_a_function_or_class_that_can_be_imported(module, name):
    found = getattr(importlib.import_module(module), name)
    assert callable(found) or name == "__version__"


def test_dir_shows_the_public_names_and_nothing_else():
    assert dir(gcode2krl) == sorted(PUBLIC["gcode2krl"])
    assert sorted(gcode2krl.__all__) == sorted(PUBLIC["gcode2krl"])


@pytest.mark.slow
def test_a_public_name_stays_a_function_when_every_module_has_been_imported():
    """Importing a module binds its name in its package; a function of that name would be hidden."""
    program = (
        "import importlib, pkgutil, gcode2krl\n"
        "for found in pkgutil.walk_packages(gcode2krl.__path__, 'gcode2krl.'):\n"
        "    if not found.name.endswith('__main__'): importlib.import_module(found.name)\n"
        f"for module, names in {PUBLIC!r}.items():\n"
        "    for name in names:\n"
        "        found = getattr(importlib.import_module(module), name)\n"
        "        assert callable(found) or name == '__version__', (module, name, found)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr


def test_the_package_imports_nothing_heavy():
    program = (
        "import sys, gcode2krl; print([m for m in ('numpy', 'numba', 'scipy', 'polars') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert done.stdout.strip() == "[]", done.stderr


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'predictions'"):
        _ = gcode2krl.predictions


@pytest.mark.slow
def test_no_function_has_the_name_of_its_module():
    shared = [dotted for dotted, tree in modules() if dotted.split(".")[-1] in defined(tree)]
    assert shared == sorted(STILL_SHARED)
