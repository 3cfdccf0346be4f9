"""A path in pixels: the worst is seen whatever passed last, and no part of it is lost."""

import numpy as np
import pytest

from gcode2krl.report import maps
from gcode2krl.report.maps import Canvas, thicken, worst_per_pixel


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
