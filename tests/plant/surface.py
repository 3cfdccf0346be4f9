"""A scan of the finished part: floors under the tool and walls beside it, as the bent arm left them."""

import numpy as np

from tests.plant import chips
from tests.plant.robot import SLOW, Run

EVERY = 8  # slow samples between points
BESIDE_mm = 0.4  # a wall stands if the material this far outside is higher


def _feed_axes(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors to the left of the feed, and where the feed is level enough to leave a wall."""
    v = run.velocity_mm_s
    flat = np.hypot(v[:, 0], v[:, 1])
    left = np.stack([-v[:, 1], v[:, 0], np.zeros(len(v))], axis=1) / np.maximum(flat, 1e-6)[:, None]
    return left, flat > 5.0


def scanned(run: Run, rng: np.random.Generator, noise_mm: float) -> np.ndarray:
    """Points of the finished part in `$BASE`, (n, 3) mm.

    A point belongs to the part if the programmed motion left it standing: a floor that nothing lowers
    afterwards, a wall whose material outside is still there. It lies where the real tip has been.
    """
    left, level = _feed_axes(run)
    place, tip = run.place_mm[::SLOW], run.tip_mm[::SLOW]
    rows = np.flatnonzero(level & (run.cut.depth_mm > 0.3))[::EVERY]
    radius = run.world.cutter.diameter_mm / 2.0
    nominal = run.believed.cutter.diameter_mm / 2.0
    points = []
    heights = chips.left_heights(place[rows, :2], run.pieces, run.world)
    floor = rows[np.abs(heights - place[rows, 2]) < 0.02]
    points.append(tip[floor])
    for side in (-1.0, 1.0):
        outside = place[rows] + side * (nominal + BESIDE_mm) * left[rows]
        stands = chips.left_heights(outside[:, :2].copy(), run.pieces, run.world)
        wall = rows[stands > place[rows, 2] + 0.9 * run.cut.depth_mm[rows]]
        share = rng.uniform(0.2, 0.8, len(wall))
        out = radius + run.depth_taper_mm / 2.0 * (share - 1.0)  # thinner towards the tip where it tapers
        at = tip[wall] + side * out[:, None] * left[wall]
        at[:, 2] += share * run.cut.depth_mm[wall]
        points.append(at)
    cloud = np.concatenate(points)
    return cloud + noise_mm * rng.normal(size=cloud.shape)
