"""Some hundred damaged inputs of each kind, in a separate process; benchmarks/fuzz.py runs 10,000."""

import os

import pytest
from hypothesis import strategies as st

from benchmarks import fuzz


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "count"),
    [
        ("gcode", 600),
        ("cells", 300),
        ("predictions", 100),
        ("meshes", 150),
        ("telegrams", 4000),
        ("krl", 600),
    ],
)
def test_damaged_inputs_are_read_or_refused_in_one_line(kind, count):
    tally = fuzz.run(fuzz.KINDS[kind][0], count, 20)
    assert tally.failures == []
    assert tally.count == count
    assert tally.accepted > 0.05 * count  # the cases are near enough to sound ones
    assert tally.refused > 0.3 * count
    assert tally.peak_mb < fuzz.MOST_MB


def prepare_to_die(_):
    return st.integers(), lambda case: os.abort()


def prepare_to_fail(_):
    return st.integers(0, 1000), lambda case: 1 / max(500 - case, 0)


def test_a_process_that_aborts_is_a_failure_with_its_case():
    tally = fuzz.run(prepare_to_die, 2, 1)
    assert len(tally.failures) == 1
    assert "ended with -6: 0" in tally.failures[0]


def test_what_fails_is_made_small():
    tally = fuzz.run(prepare_to_fail, 200, 1)
    assert "ZeroDivisionError" in tally.failures[0]
    assert "500" in tally.failures[0]
