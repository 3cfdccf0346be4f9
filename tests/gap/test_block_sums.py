"""Sums over blocks of rows."""

from itertools import pairwise

import numpy as np

from gcode2krl.gap.noise.slow import sums_between


def test_each_block_is_summed_by_itself():
    values = np.random.default_rng(1).normal(size=(40, 3))
    edges = np.array([0, 1, 9, 40])
    sums = sums_between(values, edges)
    for block, (first, last) in enumerate(pairwise(edges)):
        assert np.allclose(sums[block], values[first:last].sum(axis=0), rtol=0.0, atol=1e-13)


def test_rows_before_the_first_edge_and_after_the_last_do_not_count():
    values = np.ones((10, 1))
    assert sums_between(values, np.array([2, 5, 6])).ravel().tolist() == [3.0, 1.0]


def test_columns_that_do_not_follow_each_other_in_memory():
    values = np.arange(24.0).reshape(4, 6)
    assert np.array_equal(sums_between(values[:, ::2], np.array([0, 2, 4])), [[6, 10, 14], [30, 34, 38]])


def test_no_columns_and_no_blocks():
    assert sums_between(np.ones((4, 0)), np.array([0, 2, 4])).shape == (2, 0)
    assert sums_between(np.ones((4, 2)), np.array([0])).shape == (0, 2)
