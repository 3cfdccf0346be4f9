"""A path drawn into pixels of which each shows the worst that passed it, whatever passed it last."""

from typing import NamedTuple, Self

import numpy as np

from gcode2krl.arrays import Bools, Floats

_CHUNK = 250_000
"""Segments that are drawn at once: some 50 MB."""


class Canvas(NamedTuple):
    """A grid of pixels over a plane."""

    low_mm: Floats
    """(2,) corner of the first pixel."""
    pixel_mm: Floats
    """(2,) size of a pixel."""
    shape: tuple[int, int]
    """Rows, columns."""

    @classmethod
    def around(cls, points_mm: Floats, across: int, stretch: float = 1.0) -> Self:
        """Return the canvas of plane points (m, 2), ``across`` pixels along its longer side as drawn.

        The second axis is drawn ``stretch`` times larger.
        """
        present = points_mm[np.isfinite(points_mm).all(axis=1)]
        low, high = present.min(axis=0), present.max(axis=0)
        drawn = np.array([1.0, stretch])
        pixel = max(float(((high - low) * drawn).max()), 1e-6) / across / drawn
        low = low - 5.0 * pixel
        columns, rows = np.ceil((high + 5.0 * pixel - low) / pixel).astype(int) + 1
        return cls(low, pixel, (int(rows), int(columns)))

    def extent(self) -> tuple[float, float, float, float]:
        """Return left, right, bottom and top in mm, as matplotlib asks for them."""
        rows, columns = self.shape
        right, top = self.low_mm + self.pixel_mm * (columns, rows)
        return float(self.low_mm[0]), float(right), float(self.low_mm[1]), float(top)


def worst_per_pixel(canvas: Canvas, points_mm: Floats, values: Floats, drawn: Bools) -> Floats:
    """Return (rows, columns) the largest value in each pixel that the path passes, NaN where it does not.

    The path goes straight through the points (m, 2); a stretch between two ``drawn`` (m,) ones has the
    larger of their values.
    """
    image = np.full(canvas.shape[0] * canvas.shape[1], -np.inf)
    at = (points_mm - canvas.low_mm) / canvas.pixel_mm
    for begin in range(0, max(len(at) - 1, 1), _CHUNK):
        rows = slice(begin, begin + _CHUNK + 1)
        _draw(image, canvas.shape, at[rows], values[rows], drawn[rows])
    image[image == -np.inf] = np.nan
    return image.reshape(canvas.shape)


def _draw(image: Floats, shape: tuple[int, int], at: Floats, values: Floats, drawn: Bools) -> None:
    """Draw a piece of the path into a flat image."""
    segment = np.flatnonzero(drawn[:-1] & drawn[1:])
    way = at[segment + 1] - at[segment]
    steps = np.ceil(np.abs(way).max(axis=1, initial=0.0)).astype(np.int64) + 1
    first = np.cumsum(steps) - steps
    number = np.arange(int(steps.sum())) - np.repeat(first, steps)
    share = (number / np.repeat(steps, steps))[:, None]
    between = np.repeat(at[segment], steps, axis=0) + share * np.repeat(way, steps, axis=0)
    worst = np.repeat(np.maximum(values[segment], values[segment + 1]), steps)
    for points, shade in ((between, worst), (at[drawn], values[drawn])):
        cell = np.clip(points.astype(np.int64), 0, (shape[1] - 1, shape[0] - 1))
        np.maximum.at(image, cell[:, 1] * shape[1] + cell[:, 0], shade)


def thicken(image: Floats, times: int) -> Floats:
    """Return the image with each line wider by about ``times`` pixels on both sides; the worst covers."""
    thick = np.where(np.isfinite(image), image, -np.inf)
    for turn in range(times):
        wide = thick.copy()
        np.maximum(wide[1:], thick[:-1], out=wide[1:])
        np.maximum(wide[:-1], thick[1:], out=wide[:-1])
        across = wide.copy() if turn % 2 else thick  # a square and a cross by turns: nearly round
        np.maximum(wide[:, 1:], across[:, :-1], out=wide[:, 1:])
        np.maximum(wide[:, :-1], across[:, 1:], out=wide[:, :-1])
        thick = wide
    thick[thick == -np.inf] = np.nan
    return thick
