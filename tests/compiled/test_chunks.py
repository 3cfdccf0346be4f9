"""Chunks of long columns: every row once, results in order, errors not lost."""

import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode2krl.compiled.chunks import chunk_borders, in_chunks


@given(st.integers(0, 200), st.integers(1, 50))
def test_every_row_once_and_in_order(count, rows):
    spans = in_chunks(lambda start, end: (start, end), chunk_borders(count, rows))
    assert [row for start, end in spans for row in range(start, end)] == list(range(count))
    assert all(0 < end - start <= rows for start, end in spans)


def test_results_do_not_depend_on_who_is_first():
    second_may_end = threading.Event()

    def work(start, end):
        if start == 0:
            second_may_end.wait(0.05)
        else:
            second_may_end.set()
        return np.arange(start, end)

    assert np.concatenate(in_chunks(work, chunk_borders(30, 10))).tolist() == list(range(30))


def test_an_error_in_a_chunk_comes_out():
    def work(start, end):
        if start == 20:
            raise ValueError("row 20")

    with pytest.raises(ValueError, match="row 20"):
        in_chunks(work, chunk_borders(30, 10))
