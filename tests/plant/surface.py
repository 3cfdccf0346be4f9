"""A scan of the finished part: floors under the tool and walls beside it, as the bent arm left them."""

from dataclasses import dataclass

import numpy as np

from tests.plant import chips
from tests.plant.robot import SLOW, Run

EVERY = 8  # slow samples between points
BESIDE_mm = 0.4  # a wall stands if the material this far outside is higher
FLOOR, WALLS = 0, (-1, 1)


@dataclass(frozen=True)
class Surface:
    """Points of a finished part; `rows` and `sides` say which cut left each, whatever acted."""

    points_mm: np.ndarray  # (n, 3) in `$BASE`
    normals: np.ndarray  # (n, 3)
    rows: np.ndarray  # (n,) slow samples
    sides: np.ndarray  # (n,) of `FLOOR`, `WALLS`


def _feed_axes(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors to the left of the feed, and where the feed is level enough to leave a wall."""
    v = run.velocity_mm_s
    flat = np.hypot(v[:, 0], v[:, 1])
    left = np.stack([-v[:, 1], v[:, 0], np.zeros(len(v))], axis=1) / np.maximum(flat, 1e-6)[:, None]
    return left, flat > 5.0


def surface(run: Run, rng: np.random.Generator) -> Surface:
    """The finished part without a scanner's noise.

    A point belongs to the part if the programmed motion left it standing: a floor that nothing lowers
    afterwards, a wall whose material outside is still there. It lies where the real tip has been, seen from
    the part, which may have stood aside at that moment.
    """
    left, level = _feed_axes(run)
    place, tip = run.place_mm[::SLOW], run.tip_mm[::SLOW] - run.part_mm
    taken = np.arange(len(level)) % EVERY == 0
    rows = np.flatnonzero(taken & level & (run.cut.depth_mm > 0.3))
    radius = run.world.cutter.diameter_mm / 2.0
    nominal = run.believed.cutter.diameter_mm / 2.0
    heights = chips.left_heights(place[rows, :2], run.pieces, run.world)
    floor = rows[np.abs(heights - place[rows, 2]) < 0.02]
    up = np.broadcast_to([0.0, 0.0, 1.0], (len(floor), 3))
    parts = [(tip[floor], up, floor, np.full(len(floor), FLOOR))]
    for side in WALLS:
        outside = place[rows] + side * (nominal + BESIDE_mm) * left[rows]
        stands = chips.left_heights(outside[:, :2].copy(), run.pieces, run.world)
        wall = rows[stands > place[rows, 2] + 0.9 * run.cut.depth_mm[rows]]
        share = rng.uniform(0.2, 0.8, len(wall))
        out = radius + run.depth_taper_mm / 2.0 * (share - 1.0)  # thinner towards the tip where it tapers
        at = tip[wall] + side * out[:, None] * left[wall]
        at[:, 2] += share * run.cut.depth_mm[wall]
        parts.append((at, -side * left[wall], wall, np.full(len(wall), side)))
    return Surface(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def scanned(run: Run, rng: np.random.Generator, noise_mm: float) -> np.ndarray:
    """Points of the finished part in `$BASE` as a scanner sees them, (n, 3) mm."""
    cloud = surface(run, rng).points_mm
    return cloud + noise_mm * rng.normal(size=cloud.shape)


def change_mm(acted: Run, bare: Run) -> np.ndarray:
    """How far an effect moves the finished surface along its normal, at each point that both have."""
    one, two = (surface(run, np.random.default_rng(0)) for run in (acted, bare))
    keys = [3 * each.rows + each.sides for each in (one, two)]
    _, i, k = np.intersect1d(*keys, return_indices=True)
    return np.sum((one.points_mm[i] - two.points_mm[k]) * one.normals[i], axis=1)
