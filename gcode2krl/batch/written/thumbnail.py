"""The path of a part in a few characters of SVG, to draw beside its figures."""

from collections.abc import Sequence
from itertools import pairwise

WIDTH = 384
HEIGHT = 256
"""Steps of the box: four a pixel as it is drawn, finer is not seen."""
_MARGIN = 12


def svg_path(points_mm: Sequence[tuple[float, float]]) -> str:
    """Return the ``d`` of a path that fills a box of `WIDTH` by `HEIGHT` whole steps, y upwards.

    Empty where there is nothing to draw.
    """
    if len(points_mm) < 2:
        return ""
    low = [min(point[k] for point in points_mm) for k in (0, 1)]
    high = [max(point[k] for point in points_mm) for k in (0, 1)]
    size = [high[k] - low[k] for k in (0, 1)]
    room = (WIDTH - 2 * _MARGIN, HEIGHT - 2 * _MARGIN)
    scales = [room[k] / size[k] for k in (0, 1) if size[k] > 0.0]
    if not scales:
        return ""
    scale = min(scales)
    centre = [0.5 * (low[k] + high[k]) for k in (0, 1)]
    placed = [
        (
            round(0.5 * WIDTH + scale * (x - centre[0])),
            round(0.5 * HEIGHT - scale * (y - centre[1])),
        )
        for x, y in points_mm
    ]
    moves = [(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(placed)]
    return f"M{_pair(placed[0])}l" + " ".join(_pair(move) for move in moves if move != (0, 0))


def _pair(steps: tuple[int, int]) -> str:
    return f"{steps[0]},{steps[1]}"
