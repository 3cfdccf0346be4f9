"""Brute force beside the plant's capsules: a map of fine pixels, lowered by one tooth passing after another.

Shares the commanded path and the force law's coefficients with the plant and nothing of its engagement: a
tooth passing is a whole disc at one place, and its chip is what this disc takes off the map.
"""

import numpy as np
from numba import njit

from tests.plant import path
from tests.plant.robot import Run

DEGREES = 360
TURN = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])  # no row of pixels along a move


@njit(cache=True, nogil=True)
def _lower(place, first, heights, origin, cell, radius, volume, depth):
    """Lower the map at every place; log what each place from `first` on takes off, by volume and by degree.

    volume: sum of what is taken times its direction from the axis (x, y), and plainly; depth: the deepest.
    """
    rows, columns = heights.shape
    for j in range(len(place)):
        x0, y0 = (place[j, 0] - origin[0]) / cell - 0.5, (place[j, 1] - origin[1]) / cell - 0.5
        z, r = place[j, 2], radius / cell
        for row in range(max(int(np.ceil(y0 - r)), 0), min(int(y0 + r), rows - 1) + 1):
            half = np.sqrt(max(r * r - (row - y0) ** 2, 0.0))
            for column in range(max(int(np.ceil(x0 - half)), 0), min(int(x0 + half), columns - 1) + 1):
                deep = heights[row, column] - z
                if deep <= 0.0:
                    continue
                heights[row, column] = z
                if j >= first:
                    angle = np.arctan2(row - y0, column - x0)
                    degree = int(np.floor(np.degrees(angle))) % DEGREES
                    depth[j - first, degree] = max(depth[j - first, degree], deep)
                    volume[j - first, 0] += deep * np.cos(angle) * cell * cell
                    volume[j - first, 1] += deep * np.sin(angle) * cell * cell
                    volume[j - first, 2] += deep * cell * cell


def _map(place_mm, box_mm, radius_mm, cell_mm):
    """Pixels under these turned places, as high as the stock, bottomless beside it; their lower corner."""
    low = place_mm[:, :2].min(axis=0) - radius_mm
    count = np.ceil((place_mm[:, :2].max(axis=0) + radius_mm - low) / cell_mm).astype(int)
    x, y = (low[k] + (np.arange(count[k]) + 0.5) * cell_mm for k in (0, 1))
    plan = np.stack(np.meshgrid(x, y), axis=2) @ TURN.T  # back to the axes of the stock
    inside = np.all((plan > box_mm[0, :2]) & (plan < box_mm[1, :2]), axis=2)
    return np.where(inside, box_mm[1, 2], -np.inf), low


def tooth_passings(run: Run, begin_s: float, end_s: float, cell_mm: float):
    """Times of the tooth passings in a window, mean force of a turn (n, 3), first and last angle (n, 2).

    The stock must not be turned, the teeth run true, the law is linear, the cut no deeper than the flute.
    """
    cutter = run.world.cutter
    radius, k = cutter.diameter_mm / 2.0, cutter.coefficients
    t_s = np.arange(0.0, end_s, cutter.tooth_s)
    first = int(np.searchsorted(t_s, begin_s))
    place = path.commanded(run.links, t_s, run.believed)
    place[:, :2] = place[:, :2] @ TURN
    heights, low = _map(place[first:], run.world.stock_mm, radius, cell_mm)
    volume, depth = np.zeros((len(t_s) - first, 3)), np.zeros((len(t_s) - first, DEGREES))
    _lower(place, first, heights, low, cell_mm, radius, volume, depth)
    turn = np.arange(len(volume) - cutter.teeth + 1)[:, None] + np.arange(cutter.teeth)  # its passings
    volume, depth = volume[turn].mean(axis=1), depth[turn].max(axis=1)
    now = turn[:, cutter.teeth // 2]
    way = place[first + now] - place[first + now - 1]
    force = _force(volume, depth, cutter.teeth, radius, k)
    force[:, :2] = force[:, :2] @ TURN.T
    return t_s[first + now], force, _arc(depth, way)


def _force(volume, depth, teeth, radius, k):
    """The linear edge law with volume / radius for chip thickness x angle x depth."""
    angle = np.radians(np.arange(DEGREES) + 0.5)
    edge = np.stack([depth @ np.cos(angle), depth @ np.sin(angle), depth.sum(axis=1)])
    x, y, z = teeth / (2.0 * np.pi) * volume.T / radius
    ex, ey, ez = teeth / (2.0 * np.pi) * edge * np.radians(1.0)
    fx = -k[0] * y - k[1] * x - k[3] * ey - k[4] * ex
    fy = k[0] * x - k[1] * y + k[3] * ex - k[4] * ey
    return np.stack([fx, fy, -k[2] * z - k[5] * ez], axis=1)


def _arc(depth, way):
    """First and last angle that is cut, from the left of the feed over its front."""
    left = np.degrees(np.arctan2(way[:, 1], way[:, 0])) + 90.0
    angle = (left[:, None] - (np.arange(DEGREES) + 0.5) + 90.0) % 360.0 - 90.0
    taken = depth > 0.0
    first, last = np.where(taken, angle, np.inf).min(axis=1), np.where(taken, angle, -np.inf).max(axis=1)
    return np.radians(np.stack([first, last], axis=1))
