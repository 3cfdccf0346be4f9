"""What the cutter meets and what it costs: rim points against exact swept volumes, teeth summed one by one.

There is no grid. The stock is a box; what earlier motion has removed is a union of swept cutters along
straight pieces. A point of the rim is cut from the top of what is left there down to the tip. The height left
at a plan point is the box's top or the lowest tip of any piece while it covered the point (a quadratic
equation).
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from tests.plant.path import Chain, at_distance
from tests.plant.scene import Cutter, World

CELLS = 90  # of the front half turn, 2° each
SKIN_mm = 1e-6  # a swept volume is this much thinner, so that a rim point in front of it is uncut


@dataclass(frozen=True)
class Pieces:
    """Straight pieces of the whole motion in the order driven."""

    start_mm: np.ndarray
    end_mm: np.ndarray
    chain: np.ndarray
    from_mm: np.ndarray  # virtual distances of both ends within the chain
    to_mm: np.ndarray


def pieces(links: list[Chain], world: World) -> Pieces:
    """The commanded path as straight pieces; a wide corner becomes chords."""
    start, end, owner, begin, finish = [], [], [], [], []
    for number, chain in enumerate(links):
        knots = chain.knots_mm
        marks = [knots]
        for i in range(1, len(knots) - 1):
            d = chain.reach_mm[i]
            if d > 0.2:
                marks.append(knots[i] + d * np.array([-1.0, -0.5, 0.5, 1.0]))
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


@njit(cache=True, nogil=True)
def _lowest(x, y, a, b, share, radius):
    """Lowest tip of a piece, driven up to `share`, while it covers the plan point; inf if never."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    px, py = x - a[0], y - a[1]
    square = dx * dx + dy * dy
    if square < 1e-18:
        if px * px + py * py > radius * radius:
            return np.inf
        return min(a[2], a[2] + share * (b[2] - a[2]))
    half = px * dx + py * dy
    disc = half * half - square * (px * px + py * py - radius * radius)
    if disc <= 0.0:
        return np.inf
    root = np.sqrt(disc)
    low, high = max((half - root) / square, 0.0), min((half + root) / square, share)
    if low > high:
        return np.inf
    return min(a[2] + low * (b[2] - a[2]), a[2] + high * (b[2] - a[2]))


@njit(cache=True, nogil=True)
def _left(x, y, box, cos_turn, sin_turn, start, end, shares, chosen, count, radius):
    """Height of the material left at a plan point; -inf outside the block."""
    cx, cy = 0.5 * (box[0, 0] + box[1, 0]), 0.5 * (box[0, 1] + box[1, 1])
    u, v = x - cx, y - cy
    px, py = cx + cos_turn * u + sin_turn * v, cy - sin_turn * u + cos_turn * v
    if px < box[0, 0] or px > box[1, 0] or py < box[0, 1] or py > box[1, 1]:
        return -np.inf
    top = box[1, 2]
    for k in range(count):
        j = chosen[k]
        top = min(top, _lowest(x, y, start[j], end[j], shares[k], radius))
    return top


@njit(cache=True, nogil=True)
def _near(p, last, share, start, end, box, radius, chosen, shares):
    """Pieces that can have touched the material around this place; the last one is driven to `share`."""
    count = 0
    reach = 2.0 * radius
    for j in range(last + 1):
        if min(start[j, 2], end[j, 2]) >= box[1, 2]:
            continue
        if p[0] < min(start[j, 0], end[j, 0]) - reach or p[0] > max(start[j, 0], end[j, 0]) + reach:
            continue
        if p[1] < min(start[j, 1], end[j, 1]) - reach or p[1] > max(start[j, 1], end[j, 1]) + reach:
            continue
        chosen[count] = j
        shares[count] = share if j == last else 1.0
        count += 1
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _teeth(phi, width, depth, advance, cos_ramp, k, edge, offsets, exponent, out):
    """Add the mean over one turn of what all teeth feel in one cell of the rim to `out`.

    out: feed, normal, axial (towards the tip), torque, and lever·feed, lever·normal about the tip.
    A tooth cuts the least of what the teeth before it have left (runout); a tooth that cuts nothing
    rubs nothing.
    """
    s, c = np.sin(phi), np.cos(phi)
    n = len(offsets)
    for tooth in range(n):
        h = np.inf
        for back in range(1, n + 1):
            h = min(h, back * advance * s * cos_ramp + offsets[tooth] - offsets[(tooth - back) % n])
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


@njit(cache=True, nogil=True)
def _engaged(place, velocity, last, shares_now, start, end, box, turn, cutter, k, edge, offsets, m):
    """Loads of all samples (n, 6) as in `_teeth`, and depth and width of cut (n, 2)."""
    n, cells = len(place), CELLS
    radius, flute, teeth_s = cutter
    loads, sizes = np.zeros((n, 6)), np.zeros((n, 2))
    chosen, shares = np.empty(len(start), np.int64), np.empty(len(start))
    depth, border = np.empty(cells), np.empty(cells + 1)
    step, thin = np.pi / cells, radius - SKIN_mm
    cos_turn, sin_turn = np.cos(turn), np.sin(turn)
    for i in range(n):
        p, v = place[i], velocity[i]
        flat = np.hypot(v[0], v[1])
        if flat < 1e-6 or p[2] >= box[1, 2]:
            continue
        speed = np.sqrt(flat * flat + v[2] * v[2])
        fx, fy = v[0] / flat, v[1] / flat
        count = _near(p, last[i], shares_now[i], start, end, box, radius, chosen, shares)
        for c in range(cells + 1):
            border[c] = c * step
        cut = 0.0
        for c in range(cells):
            co, si = np.cos((c + 0.5) * step), np.sin((c + 0.5) * step)
            x, y = p[0] + radius * (fx * si - fy * co), p[1] + radius * (fy * si + fx * co)
            left = _left(x, y, box, cos_turn, sin_turn, start, end, shares, chosen, count, thin)
            depth[c] = min(max(left - p[2], 0.0), flute)
            cut = max(cut, depth[c])
            if c > 0 and abs(depth[c] - depth[c - 1]) > 0.02:  # where between the two is the step?
                low, high, half = (c - 0.5) * step, (c + 0.5) * step, 0.5 * (depth[c] + depth[c - 1])
                for _ in range(7):
                    mid = 0.5 * (low + high)
                    co, si = np.cos(mid), np.sin(mid)
                    x, y = p[0] + radius * (fx * si - fy * co), p[1] + radius * (fy * si + fx * co)
                    left = _left(x, y, box, cos_turn, sin_turn, start, end, shares, chosen, count, thin)
                    inside = min(max(left - p[2], 0.0), flute)
                    if (inside > half) == (depth[c - 1] > half):
                        low = mid
                    else:
                        high = mid
                border[c] = 0.5 * (low + high)
        if cut == 0.0:
            continue
        sides_low, sides_high = np.pi, 0.0
        for c in range(cells):
            if depth[c] > 0.0:
                centre, width = 0.5 * (border[c] + border[c + 1]), border[c + 1] - border[c]
                _teeth(centre, width, depth[c], speed / teeth_s, flat / speed, k, edge, offsets, m, loads[i])
                sides_low, sides_high = min(sides_low, border[c]), max(sides_high, border[c + 1])
        sizes[i] = cut, radius * (np.cos(sides_low) - np.cos(sides_high))
    return loads, sizes


@dataclass(frozen=True)
class Cut:
    """Force and moment about the tip along `$BASE`'s axes on the tool, and the size of the cut."""

    force_N: np.ndarray
    moment_Nmm: np.ndarray
    depth_mm: np.ndarray
    width_mm: np.ndarray


def cut(place_mm, velocity_mm_s, chain, s_mm, work: Pieces, world: World) -> Cut:
    """Mean forces of a revolution at places (n, 3); the tool stands upright, its axis is z.

    `chain` and `s_mm` say how far the motion has come at each sample.
    """
    cutter = world.cutter
    key = work.chain * 1e6 + work.from_mm
    last = np.clip(np.searchsorted(key, chain * 1e6 + s_mm, side="right") - 1, 0, len(key) - 1)
    length = np.maximum(work.to_mm[last] - work.from_mm[last], 1e-12)
    share = np.clip((s_mm - work.from_mm[last]) / length, 0.0, 1.0)
    loads, sizes = _engaged(
        place_mm,
        velocity_mm_s,
        last,
        share,
        work.start_mm,
        work.end_mm,
        world.stock_mm,
        np.radians(world.stock_turn_deg),
        (cutter.diameter_mm / 2.0, cutter.flute_mm, cutter.teeth * cutter.spindle_rad_s / (2.0 * np.pi)),
        cutter.coefficients,
        cutter.edge_of_shares,
        _offsets(cutter),
        cutter.chip_exponent,
    )
    flat = np.hypot(velocity_mm_s[:, 0], velocity_mm_s[:, 1])
    flat[flat < 1e-6] = 1.0
    fx, fy = velocity_mm_s[:, 0] / flat, velocity_mm_s[:, 1] / flat
    feed, normal, axial, tangential, lever_feed, lever_normal = loads.T
    force = np.stack([feed * fx - normal * fy, feed * fy + normal * fx, -axial], axis=1)
    lever = np.stack([lever_feed * fx - lever_normal * fy, lever_feed * fy + lever_normal * fx], axis=1)
    torque = tangential * cutter.diameter_mm / 2.0
    moment = np.stack([-lever[:, 1], lever[:, 0], torque], axis=1)  # height x force, and what resists turning
    return Cut(force, moment, sizes[:, 0], sizes[:, 1])


def _offsets(cutter: Cutter) -> np.ndarray:
    """Radial offsets of the teeth."""
    return cutter.runout_mm if len(cutter.runout_mm) == cutter.teeth else np.zeros(cutter.teeth)


def left_heights(points_mm: np.ndarray, work: Pieces, world: World) -> np.ndarray:
    """Height of the finished part at plan points (n, 2)."""
    return _heights(
        points_mm,
        world.stock_mm,
        np.radians(world.stock_turn_deg),
        work.start_mm,
        work.end_mm,
        world.cutter.diameter_mm / 2.0 - SKIN_mm,
    )


@njit(cache=True, nogil=True)
def _heights(points, box, turn, start, end, radius):
    chosen, shares = np.arange(len(start)), np.ones(len(start))
    out = np.empty(len(points))
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        out[i] = _left(x, y, box, np.cos(turn), np.sin(turn), start, end, shares, chosen, len(start), radius)
    return out
