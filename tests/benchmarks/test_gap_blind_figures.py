"""Figures of the check against their definitions."""

from importlib import import_module
from math import comb, log

import numpy as np
import pytest

from tests.benchmarks import hand_made  # noqa: F401 - puts the benchmarks on the path

figures = import_module("blind.figures")
baselines = import_module("blind.cases")


def test_bounds_of_a_rate_agree_with_their_definition():
    none = figures.Rate(0, 300)
    assert none.upper == pytest.approx(1.0 - 0.05 ** (1.0 / 300.0), rel=1e-9)
    assert none.upper < 0.01
    some = figures.Rate(7, 40)
    below = sum(comb(40, k) * some.upper**k * (1.0 - some.upper) ** (40 - k) for k in range(8))
    above = sum(comb(40, k) * some.lower**k * (1.0 - some.lower) ** (40 - k) for k in range(7, 41))
    assert below == pytest.approx(0.05, rel=1e-6)
    assert above == pytest.approx(0.05, rel=1e-6)


def test_the_worst_group_is_the_one_furthest_from_the_aim():
    items = [("a", True), ("a", True), ("b", False), ("b", True), ("c", False), ("c", True), ("c", False)]

    def worst(high):
        return figures.worst(items, lambda item: item[0], lambda item: item[1], high)

    assert worst(True) == ("c", figures.Rate(1, 3))
    assert worst(False) == ("a", figures.Rate(2, 2))
    assert figures.worst(items[:2], lambda item: item[0], lambda item: item[1], True) is None
    assert figures.worst([], lambda item: item[0], lambda item: item[1], True) is None


def test_of_equally_bad_groups_the_larger_is_the_worst():
    items = ["a", "b", "b"]
    assert figures.worst(items, lambda item: item, lambda item: False, True) == ("b", figures.Rate(0, 2))


def test_calibration_error():
    assert figures.calibration_error([(0.9, True)] * 9 + [(0.9, False)]) == pytest.approx(0.0)
    assert figures.calibration_error([(0.9, True)] * 5 + [(0.9, False)] * 5) == pytest.approx(0.4)
    assert figures.calibration_error([(1.0, False)]) == 1.0
    assert np.isnan(figures.calibration_error([]))


def test_brier_and_log_score():
    pairs = [(0.8, True), (0.3, False)]
    assert figures.brier(pairs) == pytest.approx((0.04 + 0.09) / 2.0)
    assert figures.log_score(pairs) == pytest.approx(-(log(0.8) + log(0.7)) / 2.0)
    assert figures.log_score([(1.0, False)]) == pytest.approx(-log(figures.LEAST_PROBABILITY))


def test_smallest_seen():
    seen = [(ratio, ratio > 0.6) for ratio in (0.3, 0.5, 0.7, 1.0, 3.0)]
    assert figures.smallest_seen(seen) == 0.7
    assert figures.smallest_seen(seen[:1]) is None
    assert figures.smallest_seen([(3.0, True), (2.0, False), (1.0, True)]) == 3.0
