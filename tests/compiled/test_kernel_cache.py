"""Compiled kernels are never older than their sources."""

import ast
import importlib
import os
import pkgutil
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import gcode2krl
from gcode2krl.compiled.kernel_cache import drop_stale

PACKAGE = Path(gcode2krl.__file__).parent

INIT = """
from pathlib import Path
import numba
from gcode2krl.compiled.kernel_cache import drop_stale
drop_stale(Path(__file__).parent, "callee.py")
"""
CALLEE = "from numba import njit\n@njit(cache=True)\ndef added(x):\n    return x + 1\n"
CALLER = (
    "from numba import njit\nfrom pack.callee import added\n"
    "@njit(cache=True)\ndef total(x):\n    return added(x)\n"
)
ASK = "from pack.caller import total; print(total(1), sum(total.stats.cache_hits.values()))"


def ask(program, folder, **environment):
    """Return the output of a program that runs in a folder, in a separate process."""
    paths = os.pathsep.join([str(folder), str(PACKAGE.parent)])
    kept = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
        env={**kept, "PYTHONPATH": paths, "PYTHONDONTWRITEBYTECODE": "1", **environment},
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def rewrite(path, old, new):
    """Change a file without changing its size or time."""
    times = path.stat()
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == 1
    assert len(old) == len(new)
    path.write_text(text.replace(old, new), encoding="utf-8", newline="\n")
    os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))


@pytest.mark.parametrize("place", ["named by NUMBA_CACHE_DIR", "beside the sources", "of the user"])
def test_a_changed_callee_runs_its_new_code(place, tmp_path):
    pack, cache = tmp_path / "pack", tmp_path / "cache"
    pack.mkdir()
    for name, text in (("__init__", INIT), ("callee", CALLEE), ("caller", CALLER)):
        (pack / f"{name}.py").write_text(text, encoding="ascii", newline="\n")
    # folders of the user's cache on Linux, macOS and Windows
    environment = {"XDG_CACHE_HOME": str(cache), "HOME": str(cache), "LOCALAPPDATA": str(cache)}
    if place == "named by NUMBA_CACHE_DIR":
        environment = {"NUMBA_CACHE_DIR": str(cache)}
    if place == "of the user":
        (pack / "__pycache__").write_text("no folder", encoding="ascii")  # nobody can keep kernels here
    assert ask(ASK, tmp_path, **environment) == "2 0"
    assert ask(ASK, tmp_path, **environment) == "2 1"  # from the cache
    rewrite(pack / "callee.py", "x + 1", "x + 2")
    assert ask(ASK, tmp_path, **environment) == "3 0"
    assert ask(ASK, tmp_path, **environment) == "3 1"
    where = pack if place == "beside the sources" else cache
    assert list(where.rglob("caller.total-*.nbi"))


BOUND = """
import numpy as np
from gcode2krl.cutting.height_field import BLOCK, _bound
bound = np.zeros((1, 1), dtype=np.float32)
_bound(np.full((BLOCK, BLOCK), 5, dtype=np.float32), bound)
print(float(bound[0, 0]))
"""


def test_a_kernel_of_the_package_runs_the_new_code_of_another_file(tmp_path):
    shutil.copytree(PACKAGE, tmp_path / "gcode2krl", ignore=shutil.ignore_patterns("__pycache__"))
    cache = str(tmp_path / "cache")
    assert ask(BOUND, tmp_path, NUMBA_CACHE_DIR=cache) == "5.0"
    rewrite(tmp_path / "gcode2krl" / "cutting" / "sweep.py", "bound[i, j] = top", "bound[i, j] = 7.0")
    assert ask(BOUND, tmp_path, NUMBA_CACHE_DIR=cache) == "7.0"


def test_unchanged_sources_keep_their_kernels(tmp_path, monkeypatch):
    monkeypatch.setattr("numba.core.config.CACHE_DIR", "")
    source = tmp_path / "callee.py"
    source.write_text("a", encoding="ascii")
    assert drop_stale(tmp_path, "callee.py") == 0
    kernel = tmp_path / "__pycache__" / "caller.run-1.py311.nbi"
    kernel.write_text("", encoding="ascii")
    os.utime(source, (2e9, 2e9))  # copied or checked out anew: nothing but its time has changed
    assert drop_stale(tmp_path, "callee.py") == 0
    assert kernel.exists()
    source.write_text("b", encoding="ascii")
    assert drop_stale(tmp_path, "callee.py") == 1
    assert not kernel.exists()


def test_kernels_of_unknown_sources_are_dropped(tmp_path, monkeypatch):
    """Kernels of an earlier version."""
    monkeypatch.setattr("numba.core.config.CACHE_DIR", "")
    (tmp_path / "callee.py").write_text("a", encoding="ascii")
    (tmp_path / "__pycache__").mkdir()
    for name in ("caller.run-1.py311.nbi", "caller.run-1.py311.1.nbc"):
        (tmp_path / "__pycache__" / name).write_text("", encoding="ascii")
    assert drop_stale(tmp_path, "callee.py") == 2
    assert drop_stale(tmp_path, "callee.py") == 0


class Names:
    """Dependencies of the names in the package's files, from their source."""

    def __init__(self):
        self._trees = {}
        self._seen = set()

    def tree(self, path):
        if path not in self._trees:
            self._trees[path] = ast.parse(path.read_text(encoding="utf-8"))
        return self._trees[path]

    def files_below(self, path, name):
        """Yield the files whose code the value of a name of a file depends on, the file itself first."""
        if (path, name) in self._seen:
            return
        self._seen.add((path, name))
        yield path
        for node in self.tree(path).body:
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("gcode2krl"):
                for alias in node.names:
                    if (alias.asname or alias.name) == name:
                        yield from self._imported(node.module, alias.name)
            elif name in defined(node):
                for used in names_in(node):
                    yield from self.files_below(path, used)

    def _imported(self, module, name):
        whole = PACKAGE.parent / Path(*module.split("."), f"{name}.py")
        if whole.exists():  # `from gcode2krl.gcode import findings`
            yield whole
            return
        path = PACKAGE.parent / Path(*module.split(".")).with_suffix(".py")
        yield from self.files_below(path if path.exists() else path.with_suffix("") / "__init__.py", name)


def defined(node):
    """Return the names that a statement gives a value to."""
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        return {node.name}
    targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
    return {
        each.id for target in targets if target for each in ast.walk(target) if isinstance(each, ast.Name)
    }


def names_in(node):
    """Return the names that a statement's value depends on; types do not affect a kernel."""
    if isinstance(node, ast.FunctionDef):
        parts = [*node.body, *node.decorator_list]
    elif isinstance(node, ast.ClassDef):
        parts = node.body
    else:
        parts = [node.value] if node.value else []
    return {each.id for part in parts for each in ast.walk(part) if isinstance(each, ast.Name)}


def kernels():
    """Yield file and name of each compiled function of the package."""
    from numba.core.dispatcher import Dispatcher

    for found in pkgutil.walk_packages([str(PACKAGE)], "gcode2krl."):
        if found.name.endswith("__main__"):
            continue
        module = importlib.import_module(found.name)
        for name, value in vars(module).items():
            if isinstance(value, Dispatcher) and value.py_func.__module__ == module.__name__:
                yield Path(module.__file__), name


def files_named(folder):
    """Return the files that a folder's ``__init__`` names to `drop_stale`."""
    for node in ast.walk(ast.parse((folder / "__init__.py").read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "drop_stale":
            return {(folder / each.value).resolve() for each in node.args[1:]}
    return set()


def test_every_file_that_kernels_of_other_files_use_is_named():
    missing, count = set(), 0
    for path, name in kernels():
        count += 1
        used = set(Names().files_below(path, name)) - {path}
        missing |= {(path.parent.name, each.relative_to(PACKAGE)) for each in used - files_named(path.parent)}
    assert missing == set()
    assert count > 100


QUICK_START = """
import sys
import gcode2krl.krl.scan
assert "numba.np.arraymath" in sys.modules
assert "scipy.linalg" not in sys.modules, "SciPy's linear algebra costs every start 0.2 s"
import numpy as np
from numba import njit
product = njit(lambda a, b: np.dot(a, b))
assert product(np.eye(3), np.arange(9.0).reshape(3, 3))[2, 1] == 7.0
import scipy.linalg.cython_blas
"""


def test_numba_starts_without_linear_algebra_and_finds_it_when_asked():
    """In a separate process, because modules that the tests have imported stay imported."""
    result = subprocess.run([sys.executable, "-c", QUICK_START], capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, result.stderr
