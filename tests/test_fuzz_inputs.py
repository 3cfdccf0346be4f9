"""Some hundred damaged inputs of each kind, in a separate process; benchmarks/fuzz.py runs 10,000."""

import sys
from importlib import import_module
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "count"),
    [("gcode", 600), ("predictions", 100), ("meshes", 150), ("telegrams", 4000), ("krl", 600)],
)
def test_damaged_inputs_are_read_or_refused_in_one_line(kind, count):
    common, module = import_module("fuzz_common"), import_module(f"fuzz_{kind}")
    tally = common.run(module.prepare, count, 20)
    assert tally.failures == []
    assert tally.count == count
    assert tally.accepted > 0.05 * count  # the cases are near enough to sound ones
    assert tally.refused > 0.3 * count
    assert tally.peak_mb < common.MOST_MB


def _dies(rng, folder):
    import os

    os.abort()


def _prepare_to_die(folder):
    return _dies


def test_a_process_that_aborts_is_a_failure():
    common = import_module("fuzz_common")
    tally = common.run(_prepare_to_die, 2, 1)
    assert len(tally.failures) == 2
    assert "ended with -6" in tally.failures[0]
