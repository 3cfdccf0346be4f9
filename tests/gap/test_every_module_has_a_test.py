"""Every module of the diagnosis is imported by a test of its own, so that a new one brings its test.

A test file is a module's own where it imports it and is named after the module (``test_noise.py`` of
``fit/noise.py``) or the room that holds it (``test_links.py`` of ``beside/links/joints.py``), or lists it in
``COVERS``: one file may test modules that belong together.
"""

import ast
from pathlib import Path

import pytest

TESTS = Path(__file__).parent
PACKAGE = TESTS.parent.parent / "gcode2krl"
ROOM = PACKAGE / "gap"


def module_names():
    """Return the dotted names of all modules of the room that hold code."""
    for file in sorted(ROOM.rglob("*.py")):
        name = ".".join(file.relative_to(PACKAGE.parent).with_suffix("").parts)
        body = ast.parse(file.read_text(encoding="utf-8")).body
        holds = [node for node in body if isinstance(node, ast.FunctionDef | ast.ClassDef)]
        if file.name != "__init__.py" or holds:
            yield name.removesuffix(".__init__")


def imported(tree):
    """Return the dotted names that a test imports, ``from a import b`` as a and a.b."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def covered(tree):
    """Return what a test file lists in COVERS."""
    for node in tree.body:
        if isinstance(node, ast.Assign) and any(getattr(t, "id", "") == "COVERS" for t in node.targets):
            return set(ast.literal_eval(node.value))
    return set()


TREES = {file.stem: ast.parse(file.read_text(encoding="utf-8")) for file in TESTS.glob("test_*.py")}
IMPORTS = {stem: set(imported(tree)) for stem, tree in TREES.items()}


def own_tests(module):
    """Return the test files of a module's own that import it."""
    own = {f"test_{part}" for part in module.split(".")[2:]}
    return [
        stem
        for stem, tree in TREES.items()
        if module in IMPORTS[stem] and (stem in own or module in covered(tree))
    ]


@pytest.mark.parametrize("module", list(module_names()))
def test_a_module_has_a_test_of_its_own(module):
    file = f"tests/gap/test_{module.rpartition('.')[2]}.py"
    assert own_tests(module), f"{module}: write {file}, which imports it"


def test_what_is_listed_as_covered_is_there():
    listed = {module for tree in TREES.values() for module in covered(tree)}
    assert listed <= set(module_names())


def test_a_module_without_a_test_is_seen():
    assert own_tests("gcode2krl.gap.fit.noise") == ["test_noise"]
    assert own_tests("gcode2krl.gap.fit.no_such_module") == []
