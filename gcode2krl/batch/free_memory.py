"""How much memory there is for workers, and how much one is expected to need."""

import contextlib
import ctypes
import os
import sys
from pathlib import Path

BASE_MB = 200.0
"""A worker with everything imported and a short program, measured: see docs/batch.md."""
PER_MB = 55.0
"""And for each MB of G-code, measured: see docs/batch.md."""
WHOLE_TABLES_PER_MB = 120.0
"""The same where a page or a compensation needs whole tables, measured: see docs/batch.md."""
_SHARE = 0.85
"""Of the free memory; the rest is for the batch itself, and for what else runs."""
_SHARE_OF_ALL = 0.5
"""Of the machine's memory, where it does not tell how much of it is free."""
_MEGABYTE = 1e6
_NO_LIMIT = 1 << 60


def expected_mb(size_bytes: int, whole_tables: bool) -> float:
    """Return the peak memory (MB) that the translation of a program of this size is expected to need."""
    mb_per_megabyte = WHOLE_TABLES_PER_MB if whole_tables else PER_MB
    return BASE_MB + mb_per_megabyte * size_bytes / _MEGABYTE


def budget_mb() -> float:
    """Return the memory (MB) that all workers together may need; infinite where nothing is known of it."""
    free = [amount for amount in (_free_bytes(), _free_of_container()) if amount is not None]
    return _SHARE * min(free) / _MEGABYTE if free else float("inf")


def fitting_processes(most: int, budget: float) -> int:
    """Return how many workers to start: at most so many, and not more than the memory (MB) has room for."""
    return max(1, min(most, int(min(budget / BASE_MB, most))))


def _free_bytes() -> int | None:
    """Return how much memory of the machine can be had without swapping, None where unknown."""
    if sys.platform == "win32":
        return _free_of_windows()
    with contextlib.suppress(OSError, ValueError, IndexError):
        for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
            if line.startswith("MemAvailable:"):
                return 1024 * int(line.split()[1])
    with contextlib.suppress(AttributeError, ValueError, OSError):
        return int(_SHARE_OF_ALL * os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    return None


def _free_of_container() -> int | None:
    """Return what is left below the limit of a Linux control group, None where there is none."""
    for limit, used in (
        ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory.current"),
        ("/sys/fs/cgroup/memory/memory.limit_in_bytes", "/sys/fs/cgroup/memory/memory.usage_in_bytes"),
    ):
        with contextlib.suppress(OSError, ValueError):  # "max" is no number: no limit
            most = int(Path(limit).read_text(encoding="ascii"))
            if most < _NO_LIMIT:
                return max(0, most - int(Path(used).read_text(encoding="ascii")))
    return None


class _MemoryStatus(ctypes.Structure):
    """MEMORYSTATUSEX of Windows."""

    _fields_ = (
        ("length", ctypes.c_uint32),
        ("load_percent", ctypes.c_uint32),
        ("total", ctypes.c_uint64),
        ("available", ctypes.c_uint64),
        ("total_page_file", ctypes.c_uint64),
        ("available_page_file", ctypes.c_uint64),
        ("total_virtual", ctypes.c_uint64),
        ("available_virtual", ctypes.c_uint64),
        ("available_extended_virtual", ctypes.c_uint64),
    )


def _free_of_windows() -> int | None:
    if sys.platform != "win32":
        return None
    status = _MemoryStatus(length=ctypes.sizeof(_MemoryStatus))
    known = ctypes.windll.kernel32.GlobalMemoryStatusEx(ctypes.byref(status))
    return int(status.available) if known else None
