"""Long signals in few pixels: columns, paths and spans of axes lose nothing that matters."""

import numpy as np
import pytest

from gcode2krl.report import maps
from gcode2krl.report.columns import TimeColumns
from gcode2krl.report.maps import Canvas, thicken, worst_per_pixel
from gcode2krl.report.span import span_of

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


def test_a_later_pass_does_not_hide_a_worse_one():
    way = np.stack([np.linspace(0, 100, 1001), np.full(1001, 20.0)], axis=1)
    points = np.concatenate([way, way[::-1], way])
    values = np.concatenate([np.full(1001, 0.3), np.full(1001, 1.7), np.full(1001, 0.01)])
    image = worst_per_pixel(Canvas.around(points, 400), points, values, np.ones(len(points), dtype=bool))
    assert np.unique(image[np.isfinite(image)]).tolist() == [1.7]


def test_the_largest_value_of_each_pixel_by_hand(monkeypatch):
    rng = np.random.default_rng(1)
    points = np.cumsum(rng.normal(scale=0.2, size=(4000, 2)), axis=0)
    values = rng.uniform(size=4000)
    monkeypatch.setattr(maps, "_CHUNK", 700)
    canvas = Canvas.around(points, 40)
    image = worst_per_pixel(canvas, points, values, np.ones(4000, dtype=bool))
    cell = ((points - canvas.low_mm) / canvas.pixel_mm).astype(int)
    for row, column in np.unique(cell[:, ::-1], axis=0):
        inside = (cell == (column, row)).all(axis=1)
        assert image[row, column] >= values[inside].max()
    assert np.nanmax(image) == values.max()


def test_a_long_line_has_no_gap_and_a_pause_has_no_line():
    points = np.array([[0.0, 0.0], [100.0, 50.0], [100.0, 0.0]])
    drawn = np.array([True, True, False])
    canvas = Canvas.around(points, 200)
    image = worst_per_pixel(canvas, points, np.ones(3), drawn)
    rows, columns = np.nonzero(np.isfinite(image))
    assert set(columns) == set(range(columns.min(), columns.max() + 1))
    assert columns.max() - columns.min() >= 199
    assert (np.abs(rows - columns / 2) < 6).all(), "nothing along the second stretch"


def test_one_point_is_a_pixel():
    points = np.array([[3.0, 4.0]])
    image = worst_per_pixel(Canvas.around(points, 10), points, np.array([7.0]), np.ones(1, dtype=bool))
    assert np.isfinite(image).sum() == 1


@pytest.mark.parametrize("times", [1, 2, 3])
def test_thick_lines_keep_the_worst(times):
    image = np.full((21, 21), np.nan)
    image[10, 10], image[10, 12] = 1.0, 5.0
    thick = thicken(image, times)
    assert thick[10, 12 - times] == 5.0
    assert thick[10, 10 - times] == 1.0
    assert np.isnan(thick[10, 10 - times - 1])
    assert np.nanmax(thick) == 5.0


def test_stretch_makes_flat_pixels():
    canvas = Canvas.around(np.array([[0.0, 0.0], [100.0, 2.0]]), 100, stretch=10.0)
    assert canvas.pixel_mm.tolist() == pytest.approx([1.0, 0.1])
    left, right, bottom, top = canvas.extent()
    assert left < 0.0 < 100.0 < right
    assert bottom < 0.0 < 2.0 < top


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
