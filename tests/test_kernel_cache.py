"""Compiled kernels are never older than their sources."""

import os

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
