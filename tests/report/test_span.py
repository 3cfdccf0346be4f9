"""Axes by percentile: a spike does not flatten the rest, and nothing usual is left out."""

import numpy as np
import pytest

from gcode2krl.report.columns import TimeColumns
from gcode2krl.report.span import span_of

TIME_S = np.arange(140_000) * 0.012
COLUMNS = TimeColumns.of(TIME_S)


def test_one_spike_is_beyond_the_axis():
    values = 1000.0 + 900.0 * np.sin(TIME_S)
    values[77_777] = 565_685.0
    span = span_of(COLUMNS, values)
    assert (span.low, span.cut_high, span.cut_low) == (0.0, True, False)
    assert 1900.0 < span.high < 2500.0
    assert np.flatnonzero(span.beyond(values)).tolist() == [77_777]


def test_a_spike_in_every_column_is_beyond_the_axis():
    values = np.full(len(TIME_S), 20.0)
    values[50::200] = 4000.0  # one sample of the 200 in a column
    span = span_of(COLUMNS, values)
    assert span.cut_high
    assert span.high == pytest.approx(25.0)


def test_nothing_is_left_out_without_a_spike():
    values = np.abs(np.sin(TIME_S)) * 100.0
    values[5000] = 300.0
    span = span_of(COLUMNS, values)
    assert not span.cut_high
    assert span.high > 300.0


def test_rare_pulses_are_not_spikes_of_nothing():
    """What is zero most of the time is judged by what is not."""
    values = np.zeros(len(TIME_S))
    values[::1000] = 12_000.0
    values[70_000] = 23_000.0
    assert span_of(COLUMNS, values).high > 23_000.0


def test_what_must_be_inside_is():
    values = np.full(len(TIME_S), 20.0)
    values[123] = 130.0
    assert span_of(COLUMNS, values).cut_high
    with_feed = span_of(COLUMNS, values, keep=np.array([100.0, np.inf]))
    assert not with_feed.cut_high
    assert with_feed.high > 130.0


def test_both_sides_of_a_signed_quantity():
    values = 10.0 * np.sin(TIME_S)
    values[999] = -800.0
    span = span_of(COLUMNS, values)
    assert (span.cut_low, span.cut_high) == (True, False)
    assert -20.0 < span.low < -10.0


@pytest.mark.parametrize("values", [np.zeros(3), np.full(3, np.nan)])
def test_nothing_to_show(values):
    span = span_of(TimeColumns.of(np.arange(3.0)), values)
    assert span.height > 0.0
