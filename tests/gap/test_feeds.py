"""Feeds of another program, on a commanded path whose times are stretched by hand."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.effects import inputs_of
from gcode2krl.gap.compare.pair import Pair
from gcode2krl.gap.compare.slips import commanded_path, other_feeds
from tests.gap.synthetic import TRUE_STEP_S, prediction, runs


@pytest.fixture(scope="module")
def path():
    nominal = prediction(dt_s=TRUE_STEP_S)
    run = runs([], 1, 3, base=nominal, normal=False, tracker=False, force=False)[0]
    found = commanded_path(Pair(run=run, number=0, inputs=inputs_of(nominal)))
    assert found is not None
    return found


def _at(path, feeds, rapids):
    """Return the path, gone at these shares of the predicted speeds of feed and rapid moves."""
    inputs = path.inputs
    rapid = inputs.toolpath.rapid[inputs.move[np.searchsorted(inputs.time_s, path.time_s[1:])]]
    steps_s = np.diff(path.time_s) / np.where(rapid, rapids, feeds)
    return replace(path, time_s=np.concatenate([[0.0], np.cumsum(steps_s)]))


@pytest.mark.parametrize(("feeds", "rapids"), [(1.0, 1.0), (0.5, 0.5), (1.0, 0.4), (0.97, 1.0)])
def test_overrides_and_slow_rapids_are_the_same_program(path, feeds, rapids):
    assert other_feeds([_at(path, feeds, rapids)]) is None


@pytest.mark.parametrize(("feeds", "rapids", "percent"), [(0.8, 1.0, 80), (1.3, 1.0, 130), (0.4, 0.5, 40)])
def test_feeds_at_another_share_than_rapids_are_another_program(path, feeds, rapids, percent):
    words = other_feeds([_at(path, feeds, rapids)])
    assert words is not None
    assert words.startswith(f"feed moves at {percent} % of the predicted speed, rapid ones at")


def test_faster_feeds_beside_slow_rapids_show_nothing(path):
    assert other_feeds([_at(path, 1.3, 0.8)]) is None


def test_shares_that_scatter_show_nothing(path):
    assert other_feeds([_at(path, feeds, 1.0) for feeds in (0.6, 0.8)]) is None


def test_another_curve_is_not_compared_by_its_speeds(path):
    beside = replace(path, apart_mm=path.apart_mm + 10.0)
    assert other_feeds([_at(beside, 0.6, 1.0)]) is None
    assert other_feeds([]) is None
