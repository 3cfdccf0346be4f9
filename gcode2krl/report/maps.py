"""Coloured paths on axes: seen from above and from the side, and pass by pass beside each other."""

from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.image import AxesImage
from matplotlib.ticker import MaxNLocator

from gcode2krl.arrays import Bools, Floats
from gcode2krl.report.drawing import PALE
from gcode2krl.report.passes import Pass, overlap

# A path drawn into pixels of which each shows the worst that passed it, whatever passed it last.

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


STRETCHES = (1, 2, 3, 4, 5, 7, 10, 15, 20, 30, 50, 70, 100, 200, 500, 1000)
_ACROSS = 2000
"""Pixels across a large map: more than the page has, so that nothing is dropped."""
_ACROSS_SMALL = 700
_FILLED = 1.0
"""Share of the pixels that lines are thickened to, at most."""
_AROUND = 0.25
"""Pale moves are drawn up to this share of the coloured path's extent around it."""
_HIDES = 0.05
"""Share of pixels that several passes cover from which on they are drawn beside each other."""
_BESIDE = 4
"""Passes in a row."""


class Shading(NamedTuple):
    """What colours a path: the larger value covers."""

    values: Floats
    """(m,)"""
    coloured: Bools
    """(m,) samples that have a colour; the others are pale."""
    norm: Normalize
    colours: str
    sign: float = 1.0
    """-1.0 where the smaller value covers."""

    def image(self, canvas: Canvas, points_mm: Floats, rows: Bools) -> Floats:
        """Return the worst value in each pixel, lines as wide as there is room."""
        worst = worst_per_pixel(canvas, points_mm, self.sign * self.values, rows)
        filled = max(np.count_nonzero(np.isfinite(worst)) / worst.size, 1e-9)
        wider = int(np.clip((_FILLED / filled - 1.0) / 2.0, 1.0, max(canvas.shape) / 600.0))
        return self.sign * thicken(worst, wider)


def side_columns(points_mm: Floats) -> tuple[list[int], int]:
    """Return the axes of the side view, XZ or YZ, whichever is larger, and how much Z is stretched."""
    span = np.nanmax(points_mm, axis=0) - np.nanmin(points_mm, axis=0)
    side = 0 if span[0] >= span[1] else 1
    stretch = next((s for s in STRETCHES if s * span[2] >= 0.24 * span[side]), STRETCHES[-1])
    return [side, 2], stretch if span[2] > 0.0 else 1


def near(position_mm: Floats, coloured: Bools) -> Bools:
    """Return (m,) the samples that a picture shows: those with a colour, and the others not far from them."""
    if not coloured.any():
        return np.ones(len(position_mm), dtype=np.bool_)
    low, high = position_mm[coloured].min(axis=0), position_mm[coloured].max(axis=0)
    room = max(_AROUND * float((high - low).max()), 1.0)
    x, y, z = ((position_mm >= low - room) & (position_mm <= high + room)).T
    shown: Bools = x & y & z
    return shown


def side_title(stretch: int) -> str:
    """Return the title of the side view."""
    return "From the side" + (f", Z drawn {stretch} times larger" if stretch > 1 else "")


def draw_map(
    axes: Axes, position_mm: Floats, columns: list[int], shading: Shading, stretch: float
) -> AxesImage:
    """Draw the path in a plane: pale where it has no colour, else the worst in each pixel.

    Moves far from those with a colour, as to a tool changer, are not drawn.
    """
    points = position_mm[:, columns]
    shown = near(position_mm, shading.coloured)
    canvas = Canvas.around(points[shown], _ACROSS, stretch)
    drawn_pale = _with_neighbours(~shading.coloured) & shown
    air = worst_per_pixel(canvas, points, np.ones(len(points)), drawn_pale)
    _show(axes, thicken(air, 1), canvas, cmap=ListedColormap([PALE]))
    image = shading.image(canvas, points, shading.coloured)
    drawn = _show(axes, image, canvas, cmap=shading.colours, norm=shading.norm)
    axes.set_aspect(stretch, adjustable="datalim")
    axes.set_xlabel(f"{'XYZ'[columns[0]]} (mm)")
    axes.set_ylabel(f"{'XYZ'[columns[1]]} (mm)")
    return drawn


def hide_each_other(position_mm: Floats, passes: list[Pass]) -> bool:
    """Return whether passes cover each other so far, seen from above, that each needs its own picture."""
    if len(passes) < 2:
        return False
    points = position_mm[:, :2]
    canvas = Canvas.around(points, 300)
    ones = np.ones(len(points))
    return overlap([worst_per_pixel(canvas, points, ones, each.rows) for each in passes]) > _HIDES


def height_in(position_mm: Floats, width_in: float, lowest_in: float, highest_in: float) -> float:
    """Return the height in inches of a view from above that is so wide."""
    span_mm = np.ptp(position_mm, axis=0)
    return float(np.clip(width_in * span_mm[1] / max(span_mm[0], 1e-9), lowest_in, highest_in))


def passes_height_in(position_mm: Floats, passes: list[Pass]) -> float:
    """Return the height in inches that the small maps of the passes need."""
    inside = np.any([each.rows for each in passes], axis=0)
    width_in = 9.2 / min(len(passes), _BESIDE)
    return -(-len(passes) // _BESIDE) * (height_in(position_mm[inside], width_in, 0.6, 6.0) + 0.6)


def draw_passes(
    figure: Figure,
    room: SubplotSpec,
    position_mm: Floats,
    passes: list[Pass],
    shading: Shading,
    words: Sequence[str],
) -> list[Axes]:
    """Draw each pass from above in a small map, all to one scale, with its words over it."""
    points = position_mm[:, :2]
    inside = np.any([drawn.rows for drawn in passes], axis=0)
    canvas = Canvas.around(points[inside], _ACROSS_SMALL if len(passes) > 1 else _ACROSS)
    cells = room.subgridspec(-(-len(passes) // _BESIDE), min(len(passes), _BESIDE))
    flat = canvas.shape[0] < 0.2 * canvas.shape[1]
    panels: list[Axes] = []
    for place, drawn in enumerate(passes):
        axes = figure.add_subplot(cells[divmod(place, _BESIDE)])
        image = shading.image(canvas, points, drawn.rows)
        _show(axes, image, canvas, cmap=shading.colours, norm=shading.norm)
        axes.set_aspect("equal")
        axes.set_title(drawn.name, loc="left", fontsize=8.5)
        axes.set_title(words[place], loc="right", fontsize=8)
        axes.xaxis.set_major_locator(MaxNLocator(4))
        axes.yaxis.set_major_locator(MaxNLocator(2 if flat else 4))
        axes.tick_params(
            labelleft=place % _BESIDE == 0, labelbottom=place + _BESIDE >= len(passes), labelsize=7
        )
        panels.append(axes)
    return panels


def _show(axes: Axes, image: Floats, canvas: Canvas, **colours: Any) -> AxesImage:
    return axes.imshow(
        np.ma.masked_invalid(image),
        origin="lower",
        extent=canvas.extent(),
        interpolation="antialiased",
        interpolation_stage="rgba",
        zorder=2,
        **colours,
    )


def _with_neighbours(mask: Bools) -> Bools:
    """Return the mask with one sample more on either side, so that stretches meet."""
    wide = mask.copy()
    wide[1:] |= mask[:-1]
    wide[:-1] |= mask[1:]
    return wide
