"""The field that sweeps leave, cell by cell, against the lowest of many places of the cutter on its way."""

import math
from itertools import pairwise

import numpy as np
import pytest

from gcode2krl.cell.sections import Tool
from gcode2krl.cutting.cutter import outline
from gcode2krl.cutting.engagement import engage
from gcode2krl.cutting.height_field import HeightField
from tests.cutting.scenes import LAW

TOOLS = {
    "flat": Tool(diameter_mm=6, teeth=3, flute_length_mm=30),
    "bull-nose": Tool(kind="bull-nose", diameter_mm=6, corner_radius_mm=1, teeth=3, flute_length_mm=30),
    "ball": Tool(kind="ball", diameter_mm=6, corner_radius_mm=3, teeth=3, flute_length_mm=30),
    "tapered": Tool(
        kind="tapered", diameter_mm=4, taper_deg=10, corner_radius_mm=1, teeth=3, flute_length_mm=9
    ),
}
CELL_MM, PLACES = 0.1, 16
BETWEEN_PLACES_MM = 0.02
"""What a sweep of 0.35 mm may cut deeper between two of so many places."""


def wave():
    """Rows over a wavy surface, back and forth: sinking on, turning up, level, aside."""
    rows = []
    for number, y in enumerate((2.0, 3.1)):
        x = np.arange(-4.0, 10.0, 0.35)[:: -1 if number % 2 else 1]
        rows.append(np.column_stack([x, np.full(len(x), y), -1.5 + 0.8 * np.sin(x / 1.7 + number)]))
    return np.concatenate(rows)


def steps():
    """Ramps down that turn sharply, one back on itself, a plunge between them, and up again."""
    corners = [
        (2, 2, 1),
        (7, 2, -1),
        (7, 5, -1.8),
        (3, 5, -2.5),
        (6, 5.2, -3),
        (6, 5.2, -3.5),
        (4, 3, -3.5),
        (4, 3, -1),
    ]
    points = [np.linspace(a, b, 12) for a, b in pairwise(np.array(corners, float))]
    return np.concatenate([points[0][:1], *(each[1:] for each in points)])


def field():
    return HeightField(np.zeros((80, 100), np.float32), np.array([-1.0, -1.0]), np.full(2, CELL_MM), -20.0)


def left(path, tool, room_mm):
    """Return the height (ny, nx) that a cutter leaves whose radius is so much larger."""
    height = field().height_mm.astype(float)
    y, x = np.indices(height.shape) * CELL_MM - 1.0 + 0.5 * CELL_MM
    r, z = outline(tool)
    for a, b in pairwise(path):
        places = a + np.linspace(0.0, 1.0, PLACES)[:, None] * (b - a)
        low, high = (
            ((end + 1.0) / CELL_MM).astype(int)
            for end in (np.minimum(a, b) - r[-1], np.maximum(a, b) + r[-1])
        )
        near = (
            slice(max(low[1] - 1, 0), max(high[1] + 2, 0)),
            slice(max(low[0] - 1, 0), max(high[0] + 2, 0)),
        )
        for place in places:
            distance = np.hypot(x[near] - place[0], y[near] - place[1])
            below = place[2] + np.interp(distance - room_mm, r, z)
            reached = distance < r[-1] + room_mm
            height[near] = np.where(reached, np.minimum(height[near], below), height[near])
    return height


@pytest.mark.parametrize("path", [wave(), steps()], ids=["wave", "steps"])
@pytest.mark.parametrize("kind", TOOLS)
def test_every_cell_is_as_low_as_the_lowest_place_of_the_cutter(kind, path):
    tool, block, count = TOOLS[kind], field(), len(path)
    columns = (np.zeros(count, np.int32), np.zeros(count, bool), np.full(count, 0.1))
    engage(block, path, *columns, [tool], LAW, 1, nodes_per_diameter=math.inf)
    assert (block.height_mm > left(path, tool, 1e-3) - BETWEEN_PLACES_MM).all()
    assert (block.height_mm < left(path, tool, -1e-3) + BETWEEN_PLACES_MM).all()
