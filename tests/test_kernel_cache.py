"""Compiled kernels are never older than their sources."""

import os
import subprocess
import sys

from gcode2krl.kernel_cache import drop_stale


def test_a_kernel_older_than_a_source_beside_it_is_dropped(tmp_path):
    cache = tmp_path / "__pycache__"
    cache.mkdir()
    for name, age_s in (("caller.py", 100), ("callee.py", 10)):
        (tmp_path / name).write_text("", encoding="ascii")
        os.utime(tmp_path / name, (1e9 - age_s, 1e9 - age_s))
    for name, age_s in (("caller.run-1.nbi", 50), ("caller.run-1.1.nbc", 50), ("callee.f-1.nbi", 5)):
        (cache / name).write_text("", encoding="ascii")
        os.utime(cache / name, (1e9 - age_s, 1e9 - age_s))
    assert drop_stale(tmp_path) == 2
    assert [path.name for path in cache.iterdir()] == ["callee.f-1.nbi"]
    assert drop_stale(tmp_path) == 0


def test_a_folder_without_kernels_is_left_alone(tmp_path):
    assert drop_stale(tmp_path) == 0


QUICK_START = """
import sys
import gcode2krl.gcode
assert "numba.np.arraymath" in sys.modules
assert "scipy.linalg" not in sys.modules, "SciPy's linear algebra costs every start 0.2 s"
import numpy as np
from numba import njit
product = njit(lambda a, b: np.dot(a, b))
assert product(np.eye(3), np.arange(9.0).reshape(3, 3))[2, 1] == 7.0
import scipy.linalg.cython_blas
"""


def test_numba_starts_without_linear_algebra_and_finds_it_when_asked():
    """In a process of its own, because whatever the tests have imported stays imported."""
    result = subprocess.run([sys.executable, "-c", QUICK_START], capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, result.stderr
