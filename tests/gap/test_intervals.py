"""Clusters of the sandwich: a stretch of time of one run is no stretch of another."""

from types import SimpleNamespace

import numpy as np
import pytest

from gcode2krl.gap.choose import intervals
from gcode2krl.gap.fit.sensitivity import stretches_of_all


def run_of(seconds, components=2, begins_s=0.0, rate_hz=4.0):
    """Return as much of a part as stretches are numbered by."""
    time_s = begins_s + np.arange(int(seconds * rate_hz)) / rate_hz
    return SimpleNamespace(
        time_s=time_s, inputs=SimpleNamespace(time_s=np.zeros(1)), shape=(len(time_s), components)
    )


@pytest.mark.parametrize("seconds", [15, 1_500, 250_000])
def test_runs_of_any_length_share_no_stretch(seconds):
    runs = [run_of(seconds), run_of(30, components=3), run_of(seconds)]
    numbers = np.split(stretches_of_all(runs), np.cumsum([run.shape[0] * run.shape[1] for run in runs])[:-1])
    distinct = [set(each.tolist()) for each in numbers]
    assert [len(each) for each in distinct] == [seconds, 30, seconds]
    assert len(set.union(*distinct)) == 2 * seconds + 30


def test_a_table_that_begins_before_its_model_has_stretches_of_its_own():
    runs = [run_of(20), run_of(20, begins_s=-10.0)]
    first, second = np.split(stretches_of_all(runs), 2)
    assert not set(first.tolist()) & set(second.tolist())


def test_components_of_one_moment_are_in_one_stretch():
    numbers = stretches_of_all([run_of(5, components=3)]).reshape(3, -1)
    assert (numbers == numbers[0]).all()


class LongRuns:
    """As much of an examination as the covariance needs: long runs, one parameter, scores that cancel."""

    def __init__(self, seconds):
        self.traces = [run_of(seconds, 1, rate_hz=1.0), run_of(seconds, 1, rate_hz=1.0)]
        self.applied = ()
        self.fitted = SimpleNamespace(free=[SimpleNamespace(scale=np.ones(1))])
        # what one run pulls up in its late seconds, the next one pulls down in its early ones
        sign = np.ones(2 * seconds)
        sign[seconds:] = -1.0
        self.rest = 30.0 * sign
        self.target = SimpleNamespace(residual=lambda _applied: np.concatenate([self.rest, np.zeros(1)]))


def test_an_interval_does_not_shrink_because_runs_are_long(monkeypatch):
    """Clusters of two runs under one number take out each other's scores."""
    found = LongRuns(2_000)
    jacobian = np.concatenate([np.ones(4_000), [0.0]])[:, None]
    monkeypatch.setattr(intervals, "unbounded_jacobian", lambda _target, _fitted: jacobian)
    scores = found.rest  # a second of a run each: a cluster of its own
    information = 4_000.0 + intervals.PRIOR**-2
    expected = np.sum(scores**2) * 4_000 / 3_999 / information**2
    assert intervals._covariance(found)[0, 0] == pytest.approx(expected, rel=1e-9)
