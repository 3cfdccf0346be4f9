"""Columns of a picture: no sample is lost, and only what fills them is no line."""

import numpy as np
import pytest

from gcode2krl.report.columns import TimeColumns

RNG = np.random.default_rng(5)


def by_hand(time_s, values, count):
    """The rows of each column, one by one."""
    edges = np.linspace(time_s[0], time_s[-1], count + 1)
    last = np.arange(count) == count - 1
    return [
        values[(time_s >= low) & ((time_s < high) | is_last)]
        for low, high, is_last in zip(edges[:-1], edges[1:], last, strict=True)
    ]


@pytest.fixture
def uneven():
    """Times with a gap of several columns, values with a missing one."""
    time_s = np.sort(np.concatenate([RNG.uniform(0, 40, 5000), RNG.uniform(60, 100, 300)]))
    values = RNG.normal(size=len(time_s))
    values[777] = np.nan
    return time_s, values


def test_extremes_are_those_of_the_samples(uneven):
    time_s, values = uneven
    low, high = TimeColumns.of(time_s, 50).extremes(values)
    for column, held in enumerate(by_hand(time_s, values, 50)):
        if len(held):
            assert (low[column], high[column]) == (np.nanmin(held), np.nanmax(held))
        else:
            assert np.isnan(low[column])
            assert np.isnan(high[column])


def test_quantiles_and_mean_are_those_of_the_samples(uneven):
    time_s, values = uneven
    columns = TimeColumns.of(time_s, 50)
    tenth, middle = columns.quantiles(values, (0.1, 0.5))
    mean = columns.mean(values)
    for column, held in enumerate(by_hand(time_s, values, 50)):
        held = held[np.isfinite(held)]
        if len(held):
            near = np.quantile(held, [0.1, 0.5], method="nearest")
            assert np.searchsorted(np.sort(held), [tenth[column], middle[column]]) == pytest.approx(
                np.searchsorted(np.sort(held), near), abs=1
            )
            assert mean[column] == pytest.approx(held.mean())
        else:
            assert np.isnan(mean[column])


def test_highest_rows_are_the_largest_of_each_column(uneven):
    time_s, values = uneven
    rows = TimeColumns.of(time_s, 50).highest_rows(values)
    assert values[rows].tolist() == [np.nanmax(held) for held in by_hand(time_s, values, 50) if len(held)]


@pytest.mark.parametrize("rows", [1, 2])
def test_one_sample_is_a_column(rows):
    columns = TimeColumns.of(np.zeros(rows), 10)
    assert columns.extremes(np.arange(rows, dtype=float))[1][0] == rows - 1
    assert columns.highest_rows(np.arange(rows, dtype=float)).tolist() == [rows - 1]


class TestHatch:
    time_s = np.arange(200_000) * 0.012

    def hatch(self, values):
        return TimeColumns.of(self.time_s).is_hatch(values, float(np.nanmax(values)))

    def test_what_goes_up_and_down_in_each_column_is(self):
        assert self.hatch(50 + 50 * np.sin(self.time_s * 40))

    def test_half_of_the_time_is_enough(self):
        assert self.hatch(np.where(self.time_s > 1000, 50 + 50 * np.sin(self.time_s * 40), 20.0))

    def test_a_ramp_steps_and_peaks_are_lines(self):
        assert not self.hatch(self.time_s)
        assert not self.hatch(np.where(self.time_s % 400 < 200, 10.0, 90.0))
        peaks = np.full(len(self.time_s), 10.0)
        peaks[::20_000] = 100.0
        assert not self.hatch(peaks)

    def test_noise_thinner_than_the_line_is_a_line(self):
        assert not self.hatch(100 + 0.5 * np.sin(self.time_s * 40))

    def test_few_samples_are_a_line(self):
        columns = TimeColumns.of(np.arange(900.0))
        assert not columns.is_hatch(np.arange(900) % 2.0, 1.0)
