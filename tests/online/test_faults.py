"""Every state with every fault: no answer differs from the one before by more than one step."""

import pytest

from tests.conftest import draws
from tests.online import faults


def check(report):
    assert report.violations == []
    assert 0.99 < report.largest_step <= 1.0 + faults.ROUNDING  # the limit is reached, or nothing is tested
    assert report.largest_rate <= 1.0 + faults.ROUNDING
    assert report.answers > 0.5 * report.cycles


@pytest.mark.slow
def test_no_fault_in_any_state_makes_a_step():
    report = faults.drive(draws(40_000), seed=11)
    check(report)
    ends = set(report.ended)
    assert {"held too-far", "closed adds-up", "closed restarted", "held sensor", "zero adds-up"} <= ends
    met = {(phase.value, name) for phase in faults.PHASES for name in faults.FAULTS}
    assert len(met & report.met) > 0.95 * len(met)
