"""How many workers fit into the memory."""

import os
from pathlib import Path

import pytest

from gcode2krl.batch import free_memory
from gcode2krl.batch.free_memory import BASE_MB, budget_mb, expected_mb, fitting_processes


def test_a_budget_is_known_and_below_what_the_machine_has():
    budget = budget_mb()
    assert budget > 0.0
    if hasattr(os, "sysconf"):
        assert budget < os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 1e6


def test_a_container_bounds_it(monkeypatch):
    monkeypatch.setattr(free_memory, "_free_bytes", lambda: 8_000_000_000)
    monkeypatch.setattr(free_memory, "_free_of_container", lambda: 1_000_000_000)
    assert budget_mb() == pytest.approx(850.0)
    monkeypatch.setattr(free_memory, "_free_of_container", lambda: None)
    assert budget_mb() == pytest.approx(6800.0)
    monkeypatch.setattr(free_memory, "_free_bytes", lambda: None)
    assert budget_mb() == float("inf")


def test_where_the_kernel_says_nothing_half_of_the_memory_counts(monkeypatch):
    def unreadable(self, **_):
        raise FileNotFoundError(str(self))

    monkeypatch.setattr(Path, "read_text", unreadable)
    if hasattr(os, "sysconf"):
        whole = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
        assert free_memory._free_bytes() == pytest.approx(0.5 * whole)


def test_so_many_workers_as_fit():
    assert fitting_processes(8, 3.5 * BASE_MB) == 3
    assert fitting_processes(8, 0.5 * BASE_MB) == 1
    assert fitting_processes(2, float("inf")) == 2


def test_a_longer_part_needs_more():
    assert expected_mb(0, False) == BASE_MB
    assert expected_mb(10_000_000, True) > expected_mb(10_000_000, False) > BASE_MB
