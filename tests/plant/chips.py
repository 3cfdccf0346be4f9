"""Engagement and cutting force: rim points against exact swept volumes, teeth summed one by one.

There is no grid. The stock is a box; what earlier motion has removed is a union of swept cutters along
straight pieces. A point of the rim is cut from the top of what is left there down to the tip. The height left
at a plan point is the box's top or the lowest tip of any piece while it covered the point (a quadratic
equation).

A tooth meets what the tooth before it left, so what counts as removed ends one tooth passing back: the rim of
the present place is compared with the motion up to the place where the cutter was then. Feed direction and
advance are the way between these two places. That holds in rounded corners as on straight moves: on the inner
side of a turn the earlier motion has taken a part of the rim's front already, everywhere else the chip is
that of the advance. Corners are chords, inside the curve by less than a hundredth of the usual advance,
and swept volumes are thinner by as much, so that no chord takes what a tooth is about to cut.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from tests.plant.path import Chain, at_distance
from tests.plant.scene import Cutter, World

CELLS = 90  # of the front half turn, 2° each
SKIN_mm = 5e-4  # chords lie this much inside a corner's curve, and swept volumes are this much thinner
STILL_mm = 1e-9  # advance of a tooth that cuts nothing


@dataclass(frozen=True)
class Pieces:
    """Straight pieces of the whole motion in the order driven."""

    start_mm: np.ndarray
    end_mm: np.ndarray
    chain: np.ndarray
    from_mm: np.ndarray  # virtual distances of both ends within the chain
    to_mm: np.ndarray


def pieces(links: list[Chain], world: World) -> Pieces:
    """The commanded path as straight pieces; a rounded corner becomes chords."""
    start, end, owner, begin, finish = [], [], [], [], []
    for number, chain in enumerate(links):
        marks = [chain.knots_mm[[0, -1]], *(_marks(chain, i) for i in range(1, len(chain.knots_mm) - 1))]
        s = np.unique(np.concatenate(marks))
        s = s[np.append(True, np.diff(s) > 1e-9)]
        place = at_distance(chain, s, world)
        start.append(place[:-1])
        end.append(place[1:])
        owner.append(np.full(len(s) - 1, number))
        begin.append(s[:-1])
        finish.append(s[1:])
    join = np.concatenate
    return Pieces(join(start), join(end), join(owner), join(begin), join(finish))


def _marks(chain: Chain, corner: int) -> np.ndarray:
    """Ends of a corner's chords, no further than the skin from its curve: sagitta = bend·length²/8."""
    at, d = chain.knots_mm[corner], chain.reach_mm[corner]
    before, after = np.diff(chain.points_mm[corner - 1 : corner + 2], axis=0)
    turn = np.linalg.norm(after / np.linalg.norm(after) - before / np.linalg.norm(before))
    bend = 1.5 * turn / (2.0 * d) if d > 0.0 else 0.0  # of the soft corner in its middle; the parabola's is 1
    count = max(1, int(np.ceil(2.0 * d * np.sqrt(bend / (8.0 * SKIN_mm)))))
    return at + np.linspace(-d, d, count + 1)


@njit(cache=True, nogil=True, inline="always")
def _lowest(x, y, swept, k, radius):
    """Lowest tip of piece k (its start and its way) while it covers the plan point; inf if never."""
    px, py, az = x - swept[k, 0], y - swept[k, 1], swept[k, 2]
    dx, dy, dz = swept[k, 3], swept[k, 4], swept[k, 5]
    square = dx * dx + dy * dy
    if square < 1e-18:
        if px * px + py * py > radius * radius:
            return np.inf
        return min(az, az + dz)
    half = px * dx + py * dy
    disc = half * half - square * (px * px + py * py - radius * radius)
    if disc <= 0.0:
        return np.inf
    root = np.sqrt(disc)
    low, high = max((half - root) / square, 0.0), min((half + root) / square, 1.0)
    if low > high:
        return np.inf
    return min(az + low * dz, az + high * dz)


@njit(cache=True, nogil=True, inline="always")
def _left(x, y, floor, box, turn, swept, count, radius):
    """Height of the material left at a plan point, or any below `floor`; -inf outside the block."""
    cx, cy = 0.5 * (box[0, 0] + box[1, 0]), 0.5 * (box[0, 1] + box[1, 1])
    u, v = x - cx, y - cy
    px, py = cx + turn[0] * u + turn[1] * v, cy - turn[1] * u + turn[0] * v
    if px < box[0, 0] or px > box[1, 0] or py < box[0, 1] or py > box[1, 1]:
        return -np.inf
    top = box[1, 2]
    for k in range(count):
        top = min(top, _lowest(x, y, swept, k, radius))
        if top <= floor:
            break
    return top


@njit(cache=True, nogil=True)
def _near(p, fx, fy, last, share, swept, top, radius, near):
    """Copy the pieces that can have touched the rim's front, the last driven to `share`, latest first."""
    count = 0
    for j in range(last, -1, -1):
        dx, dy = 0.5 * swept[j, 3], 0.5 * swept[j, 4]
        x, y = swept[j, 0] + dx - p[0], swept[j, 1] + dy - p[1]  # the middle of the piece
        if swept[j, 2] + min(swept[j, 5], 0.0) >= top:
            continue
        if abs(x) > 2.0 * radius + abs(dx) or abs(y) > 2.0 * radius + abs(dy):
            continue
        if fx * x + fy * y + abs(fx * dx + fy * dy) < -radius:  # too far behind to reach the front
            continue
        for c in range(6):
            near[count, c] = swept[j, c] if c < 3 or j < last else share * swept[j, c]
        count += 1
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _teeth(phi, width, depth, advance, cos_ramp, k, edge, offsets, exponent, out):
    """Add the mean force of all teeth over one turn in one cell of the rim to `out`.

    out: feed, normal, axial (towards the tip), torque, and lever·feed, lever·normal about the tip.
    A tooth cuts the least of what the teeth before it have left (runout); a tooth that cuts nothing
    rubs nothing.
    """
    s, c = np.sin(phi), np.cos(phi)
    n = len(offsets)
    for tooth in range(n):
        h = np.inf
        for back in range(1, n + 1):
            other = offsets[tooth - back]  # below zero it counts from the last
            h = min(h, back * advance * s * cos_ramp + offsets[tooth] - other)
        if h <= 0.0:
            continue
        load = h if exponent == 0.0 else h * (h / 0.05) ** (-exponent)
        share = width / (2.0 * np.pi) * depth
        ft = share * (k[0] * load + k[3] * edge[0])
        fr = share * (k[1] * load + k[4] * edge[1])
        fa = share * (k[2] * load + k[5] * edge[2])
        feed, normal = -ft * c - fr * s, ft * s - fr * c
        out[0] += feed
        out[1] += normal
        out[2] += fa
        out[3] += ft
        out[4] += 0.5 * depth * feed
        out[5] += 0.5 * depth * normal


@njit(cache=True, nogil=True, inline="always")
def _height(co, si, p, fx, fy, radius, flute, box, turn, near, count):
    """Height of the cut at an angle of the rim (cosine and sine), counted from the left of the feed."""
    x, y = p[0] + radius * (fx * si - fy * co), p[1] + radius * (fy * si + fx * co)
    thin = radius - SKIN_mm
    left = _left(x, y, p[2], box, turn, near, count, thin)
    return min(max(left - p[2], 0.0), flute)


@njit(cache=True, nogil=True)
def _engaged(place, advance, last, share, swept, box, turn, cutter, k, edge, offsets, m):
    """Loads of all samples (n, 6) as in `_teeth`, depth of cut (n,), first and last angle (n, 2).

    `advance`: way since the tooth before (n, 3); `last`, `share`: how far the motion was then.
    """
    n, cells = len(place), CELLS
    radius, flute = cutter
    loads, deepest, arc = np.zeros((n, 6)), np.zeros(n), np.zeros((n, 2))
    near = np.empty(swept.shape)
    depth, border = np.empty(cells), np.empty(cells + 1)
    step, rim = np.pi / cells, np.empty((cells, 2))
    for c in range(cells):
        rim[c] = np.cos((c + 0.5) * step), np.sin((c + 0.5) * step)
    for i in range(n):
        p, way = place[i], advance[i]
        flat = np.hypot(way[0], way[1])
        if flat < STILL_mm or p[2] >= box[1, 2]:
            continue
        h = np.sqrt(flat * flat + way[2] * way[2])
        fx, fy = way[0] / flat, way[1] / flat
        count = _near(p, fx, fy, last[i], share[i], swept, box[1, 2], radius, near)
        border[0], border[cells] = 0.0, np.pi
        for c in range(cells):
            depth[c] = _height(rim[c, 0], rim[c, 1], p, fx, fy, radius, flute, box, turn, near, count)
            if c == 0:
                continue
            border[c] = c * step
            if abs(depth[c] - depth[c - 1]) > 0.02:  # where between the two is the step?
                low, high, half = (c - 0.5) * step, (c + 0.5) * step, 0.5 * (depth[c] + depth[c - 1])
                for _ in range(7):
                    mid = 0.5 * (low + high)
                    inside = _height(
                        np.cos(mid), np.sin(mid), p, fx, fy, radius, flute, box, turn, near, count
                    )
                    if (inside > half) == (depth[c - 1] > half):
                        low = mid
                    else:
                        high = mid
                border[c] = 0.5 * (low + high)
        deepest[i] = depth.max()
        if deepest[i] == 0.0:
            continue
        arc[i] = np.pi, 0.0
        for c in range(cells):
            if depth[c] > 0.0:
                centre, width = 0.5 * (border[c] + border[c + 1]), border[c + 1] - border[c]
                _teeth(centre, width, depth[c], h, flat / h, k, edge, offsets, m, loads[i])
                arc[i] = min(arc[i, 0], border[c]), max(arc[i, 1], border[c + 1])
    return loads, deepest, arc


@dataclass(frozen=True)
class Cut:
    """Force and moment about the tip along `$BASE`'s axes on the tool, and the size of the cut.

    `arc_rad` (n, 2): first and last engaged angle of the rim, from the left of the feed over its front.
    """

    force_N: np.ndarray
    moment_Nmm: np.ndarray
    depth_mm: np.ndarray
    width_mm: np.ndarray
    arc_rad: np.ndarray


def cut(place_mm, before_mm, chain, s_before_mm, work: Pieces, world: World) -> Cut:
    """Mean forces of a revolution at places (n, 3); the tool stands upright, its axis is z.

    `before_mm` is where the cutter was when the tooth before passed; `chain` and `s_before_mm` say how far
    the motion had come then.
    """
    cutter = world.cutter
    key = work.chain * 1e6 + work.from_mm
    last = np.clip(np.searchsorted(key, chain * 1e6 + s_before_mm, side="right") - 1, 0, len(key) - 1)
    length = np.maximum(work.to_mm[last] - work.from_mm[last], 1e-12)
    share = np.clip((s_before_mm - work.from_mm[last]) / length, 0.0, 1.0)
    turn = np.radians(world.stock_turn_deg)
    advance_mm = place_mm - before_mm
    loads, depth_mm, arc_rad = _engaged(
        place_mm,
        advance_mm,
        last,
        share,
        _swept(work),
        world.stock_mm,
        (np.cos(turn), np.sin(turn)),
        (cutter.diameter_mm / 2.0, cutter.flute_mm),
        cutter.coefficients,
        cutter.edge_of_shares,
        _offsets(cutter),
        cutter.chip_exponent,
    )
    flat = np.maximum(np.hypot(advance_mm[:, 0], advance_mm[:, 1]), STILL_mm)
    fx, fy = advance_mm[:, 0] / flat, advance_mm[:, 1] / flat
    feed, normal, axial, tangential, lever_feed, lever_normal = loads.T
    force = np.stack([feed * fx - normal * fy, feed * fy + normal * fx, -axial], axis=1)
    lever = np.stack([lever_feed * fx - lever_normal * fy, lever_feed * fy + lever_normal * fx], axis=1)
    torque = tangential * cutter.diameter_mm / 2.0
    moment = np.stack([-lever[:, 1], lever[:, 0], torque], axis=1)  # height x force, and the resisting torque
    width_mm = cutter.diameter_mm / 2.0 * (np.cos(arc_rad[:, 0]) - np.cos(arc_rad[:, 1]))
    return Cut(force, moment, depth_mm, width_mm, arc_rad)


def _swept(work: Pieces) -> np.ndarray:
    """Start and way of each piece, (n, 6)."""
    return np.hstack([work.start_mm, work.end_mm - work.start_mm])


def _offsets(cutter: Cutter) -> np.ndarray:
    """Radial offsets of the teeth."""
    return cutter.runout_mm if len(cutter.runout_mm) == cutter.teeth else np.zeros(cutter.teeth)


def left_heights(points_mm: np.ndarray, work: Pieces, world: World) -> np.ndarray:
    """Height of the finished part at plan points (n, 2)."""
    turn = np.radians(world.stock_turn_deg)
    thin = world.cutter.diameter_mm / 2.0 - SKIN_mm
    return _heights(points_mm, world.stock_mm, (np.cos(turn), np.sin(turn)), _swept(work), thin)


@njit(cache=True, nogil=True)
def _heights(points, box, turn, swept, radius):
    out = np.empty(len(points))
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        out[i] = _left(x, y, -np.inf, box, turn, swept, len(swept), radius)
    return out
