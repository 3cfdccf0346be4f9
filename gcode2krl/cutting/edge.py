"""The force along the cutter's edge at one sample, from the material in front of it: compiled.

The edge is divided into bands; the material is read on the rings between them, and between two rings its
thickness changes linearly. An upright band (a cylinder) is read along its rim. Angles phi run from the feed
normal in the sense of rotation; their bins start at -90°, so that the front of the cutter, 0 to 180°, lies in
the middle.
"""

# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False

import math
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.cutting.kernels import kernel
from gcode2krl.cutting.rings import correct_at_walls, stand_above_cutter, take_off_recent, tops_on_ring
from gcode2krl.cutting.slices import LINEAR_EDGE, arc_force
from gcode2krl.cutting.sweep import FEEL_MM, outline_height, sweep_height
from gcode2krl.cutting.walls import height_at

BAND_COLUMNS = 7
ARCS = 3
"""Engagement arcs that are reported; the widest where there are more."""
A_P, LEAST, MOST = 7, 8, 9
"""Places in `Work.total` after four forces, two moments and the torque: depth, right and left extent."""
MOST_RECENT = 8
_LOW, _HIGH, _R_LOW, _R_HIGH, _SIN, _COS, _WIDTH = range(BAND_COLUMNS)
_MOST_ARCS = 64
_MOST_BINS = 1024
_JUMP = 0.1  # change of depth, relative, at which an arc is split
_COARSE_JUMP = 0.25  # the same for one of many bands, as an absolute fraction
_TURN = 2.0 * math.pi
_WALL_TURN, _RING_TURN = np.int64(0), np.int64(2)  # rows of `Work.turn`
_NONE = np.int64(0)
_LOWER, _LOWER_TOP, _UPPER, _UPPER_TOP, _SHARE = range(5)  # rows of `Work.rows`


class Cutters(NamedTuple):
    """What the kernels need to know of each tool, one row a tool."""

    bands: Floats
    """(t, s, 7) stretches of the edge from the tip up: z low and high, r low and high, sin and cos of the
    edge angle, contact width."""
    used: Ints
    """(t,) bands in use."""
    wall_bins: Ints
    """(t,) points all around the rim, a multiple of 4."""
    ring_bins: Ints
    """(t,) points all around a ring between two bands, a multiple of 4."""
    teeth: Floats
    lag_mm: Floats
    """(t,) distance by which the field lags behind the cutter."""
    above: Floats
    """(t, 4) shank: radius, height of its lower end; holder: the same; radius 0 = not checked."""


class Work(NamedTuple):
    """Scratch memory of one thread."""

    turn: Floats
    """(8, bins) sin and cos of the wall's and the ring's bins; over the ring's bins the integrals of sin,
    cos, sin², sin·cos."""
    heading: Floats
    """(2, bins) x and y of the directions of the bins."""
    rows: Floats
    """(5, bins) thickness above a band's lower and upper ring, each with the material's top; engaged
    fraction."""
    reach: Floats
    """(2, bins) largest radius of the edge that is engaged, 0 = none; largest height of material there."""
    recent: Ints
    """(8, 2) first and last sample of sweeps that the field does not show yet."""
    arcs: Floats
    arc: Floats
    part: Floats
    total: Floats


def new_work() -> Work:
    """Return scratch memory for one thread."""
    bins = _MOST_BINS
    rows, reach = np.zeros((5, bins)), np.zeros((2, bins))
    recent, arcs = np.zeros((MOST_RECENT, 2), np.int64), np.zeros((_MOST_ARCS, 2))
    turn, heading = np.zeros((8, bins)), np.zeros((2, bins))
    return Work(turn, heading, rows, reach, recent, arcs, np.zeros(4), np.zeros(4), np.zeros(10))


@kernel
def fill_turn(turn, wall_bins, ring_bins):
    """Tabulate sine and cosine in the middle of the bins, and integrals over those of rings."""
    for first, bins in ((0, wall_bins), (2, ring_bins)):
        for j in range(bins):
            phi = -0.25 * _TURN + (j + 0.5) * _TURN / bins
            turn[first, j], turn[first + 1, j] = math.sin(phi), math.cos(phi)
    half = 0.5 * _TURN / ring_bins
    for j in range(ring_bins):
        sin, cos = turn[2, j], turn[3, j]
        turn[4, j], turn[5, j] = 2.0 * sin * math.sin(half), 2.0 * cos * math.sin(half)
        wobble = 0.5 * math.sin(2.0 * half)
        turn[6, j] = half - (cos * cos - sin * sin) * wobble
        turn[7, j] = 2.0 * sin * cos * wobble


@kernel
def add_bands(grid, path, cutters, law, i, outline, heading, chip, top, recent, work):
    """Add the force of every band of the edge to ``work.total``; return the number of arcs in ``work.arcs``.

    No material is more than ``top`` above the tip.
    """
    tool, bands, position, part, total = path.tool[i], cutters.bands, path.position_mm, work.part, work.total
    lower, lower_top, upper, upper_top, share = _rows(work.rows)
    east, north, depth, reach = work.heading[0], work.heading[1], work.reach[1], work.reach[0]
    bins, arcs, known, turned = cutters.ring_bins[tool], _NONE, -1.0, -_RING_TURN
    widest = bins
    x, y, z = position[i, 0], position[i, 1], position[i, 2]
    last, bottom = cutters.used[tool] - 1, grid.bottom_mm - z
    for j in range(np.uintp(bins)):
        reach[j], depth[j] = 0.0, 0.0
    for b in range(last + 1):
        band = _band_of(bands, tool, b)
        if band[_LOW] >= top:
            break
        start = _first_angle(band, chip)
        if start >= 0.25 * _TURN:
            continue
        if band[_COS] == 0.0:
            turned = _turn(work.turn, east, north, _WALL_TURN, cutters.wall_bins[tool], heading, turned)
            arcs = _wall(grid, path, law, i, outline, band, chip, recent, work, cutters.wall_bins[tool], arcs)
            continue
        turned = _turn(work.turn, east, north, _RING_TURN, bins, heading, turned)
        first = _first_bin(min(start, _first_angle(_band_of(bands, tool, min(b + 1, last)), chip)), bins)
        for ring in range(1 if known == band[_R_LOW] else 0, 2):
            for j in range(np.uintp(first), np.uintp(bins - first)):
                lower[j], lower_top[j] = upper[j], upper_top[j]
            r = band[_R_LOW + ring]
            level = z + outline_height(r, outline)
            after = bins - first
            walls = tops_on_ring(
                grid.place, grid.shift, grid.height, grid.wall, x, y, r, first, after, east, north, upper_top
            )
            stand_above_cutter(
                grid.place, outline, x, y, z, r, level, first, after, east, north, upper_top, upper
            )
            if walls:
                correct_at_walls(grid, path, x, y, r, level, first, after, east, north, upper_top, upper)
            if recent:
                past = (recent, work.recent)
                take_off_recent(
                    position, outline, x, y, r, level, first, after, past, east, north, upper_top, upper
                )
        known, widest = band[_R_HIGH], min(widest, first)
        first = _first_bin(start, bins)
        _share(bottom, band, first, bins, lower, upper, share)
        _extend(z, band[_R_HIGH], first, bins, share, lower_top, upper, upper_top, reach, depth)
        part[:] = 0.0
        if law[0] == LINEAR_EDGE:
            _integrate(law, band, chip, first, bins, share, work.turn, part)
        else:
            _by_arcs(law, band, chip, first, bins, share, work.arc, part)
        lever = 0.5 * (band[_LOW] + max(bottom - band[_LOW], 0.0) + band[_HIGH])
        _sum(band[_WIDTH], 0.5 * (band[_R_LOW] + band[_R_HIGH]), lever, part, total)
    return _list_arcs(work.turn, reach, depth, widest, bins, max(bottom, 0.0), total, work.arcs, arcs)


@kernel
def _rows(rows):
    return rows[_LOWER], rows[_LOWER_TOP], rows[_UPPER], rows[_UPPER_TOP], rows[_SHARE]


@kernel
def _band_of(bands, tool, b):
    return (
        bands[tool, b, 0],
        bands[tool, b, 1],
        bands[tool, b, 2],
        bands[tool, b, 3],
        bands[tool, b, 4],
        bands[tool, b, 5],
        bands[tool, b, 6],
    )


@kernel
def _first_angle(band, chip):
    """Return the angle at which the chip of a band begins; it ends at 180° minus that. 90° = no chip."""
    swing, offset = band[_SIN] * chip[2], band[_COS] * chip[1]
    if swing <= 1e-6:
        return -0.25 * _TURN if offset > 1e-6 else 0.25 * _TURN
    if offset == 0.0:
        return 0.0
    return -math.asin(min(max(offset / swing, -1.0), 1.0))


@kernel
def _first_bin(start, bins):
    """Return the first bin whose middle has a chip; the last one is opposite."""
    return max(math.ceil((start + 0.25 * _TURN) / _TURN * bins - 0.5 - 1e-9), 0)


@kernel
def _turn(turn, east, north, which, bins, heading, turned):
    """Turn the table of directions into the heading of the sample."""
    if turned == which:
        return turned
    fx, fy = heading
    for j in range(np.uintp(bins)):
        east[j] = turn[which, j] * fx - turn[which + 1, j] * fy
        north[j] = turn[which, j] * fy + turn[which + 1, j] * fx
    return which


@kernel
def _share(bottom, band, first, bins, lower, upper, share):
    """Write the fraction of a band that is engaged: between its rings the thickness changes linearly.

    ``bottom`` is the height of the material's bottom above the tip.
    """
    height, missing = band[_HIGH] - band[_LOW], max(bottom - band[_LOW], 0.0)
    sound = 1.0 if missing == 0.0 else max(1.0 - missing / height, 0.0) if height > 0.0 else 0.0
    for j in range(np.uintp(first), np.uintp(bins - first)):
        low, high = lower[j], upper[j]
        low_in, high_in = low > FEEL_MM, high > FEEL_MM
        most, gap = (low if low > high else high), abs(low - high)
        part = most / (gap if gap > most else most)
        part = part if low_in | high_in else 0.0
        share[j] = sound * (1.0 if low_in & high_in else part)


@kernel
def _extend(z, radius, first, bins, share, lower_top, upper, upper_top, reach, depth):
    """Note the radius of a band, and the height of the material above the tip, where the band is engaged."""
    for j in range(np.uintp(first), np.uintp(bins - first)):
        here = radius if share[j] > 0.0 else 0.0
        reach[j] = reach[j] if reach[j] > here else here
    for j in range(np.uintp(first), np.uintp(bins - first)):
        top = (upper_top[j] if upper[j] > FEEL_MM else lower_top[j]) - z
        top = top if share[j] > 0.0 else 0.0
        depth[j] = depth[j] if depth[j] > top else top


@kernel
def _integrate(law, band, chip, first, bins, share, turn, part):
    """Add the force of a band from the integrals over its bins: linear edge forces."""
    one, sin, cos, sin_sin, sin_cos = 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(np.uintp(first), np.uintp(bins - first)):
        one += share[j]
        sin += share[j] * turn[4, j]
        cos += share[j] * turn[5, j]
        sin_sin += share[j] * turn[6, j]
        sin_cos += share[j] * turn[7, j]
    if one > 0.0 and chip[0] > 0.0:
        _edge_force((one * _TURN / bins, sin, cos, sin_sin, sin_cos), band, chip, law, part)


@kernel
def _edge_force(integrals, band, chip, law, out):
    """Add `slices.arc_force` of linear edge forces, from the integrals of 1, sin, cos, sin² and sin·cos."""
    one, sin, cos, sin_sin, sin_cos = integrals
    swing, offset = chip[0] * band[_SIN] * chip[2], chip[0] * band[_COS] * chip[1]
    h, h_sin, h_cos = (
        swing * sin + offset * one,
        swing * sin_sin + offset * sin,
        swing * sin_cos + offset * cos,
    )
    radial_c, radial_e = band[_SIN] * law[2] + band[_COS] * law[3], band[_SIN] * law[5] + band[_COS] * law[6]
    axial_c, axial_e = band[_SIN] * law[3] - band[_COS] * law[2], band[_SIN] * law[6] - band[_COS] * law[5]
    out[0] -= law[1] * h_cos + law[4] * cos + radial_c * h_sin + radial_e * sin
    out[1] += law[1] * h_sin + law[4] * sin - radial_c * h_cos - radial_e * cos
    out[2] += axial_c * h + axial_e * one
    out[3] += law[1] * h + law[4] * one


@kernel
def _by_arcs(law, band, chip, first, bins, share, one, part):
    """Add the force of a band arc by arc: any law."""
    at = first
    while at < bins - first:
        end, added = at, 0.0
        while end < bins - first and share[end] > 0.0 and abs(share[end] - share[at]) < _COARSE_JUMP:
            added += share[end]
            end += 1
        if end > at:
            a, b = -0.25 * _TURN + at * _TURN / bins, -0.25 * _TURN + end * _TURN / bins
            one[:] = 0.0
            arc_force(a, b, band[_SIN], band[_COS], chip[0], chip[1], chip[2], law, one)
            for q in range(4):
                part[q] += added / (end - at) * one[q]
        at = max(end, at + 1)


@kernel
def _sum(width, radius, z, part, total):
    """Add a force per mm of contact width: with the moment by its height and the torque."""
    for q in range(4):
        total[q] += width * part[q]
    total[4] -= z * width * part[1]
    total[5] += z * width * part[0]
    total[6] += radius * width * part[3]


@kernel
def _wall(grid, path, law, i, outline, band, chip, recent, work, bins, arcs):
    """Add a cylindrical band: its depth may change along the rim in steps, whose places are searched."""
    position, total, part, depths = path.position_mm, work.total, work.part, work.rows[_SHARE]
    east, north = work.heading[0], work.heading[1]
    x, y, z = position[i, 0], position[i, 1], position[i, 2]
    r, below, high = band[_R_HIGH], max(grid.bottom_mm - z, 0.0), band[_HIGH]
    foot, first, after = max(band[_LOW], below), bins // 4, bins - bins // 4
    if tops_on_ring(
        grid.place, grid.shift, grid.height, grid.wall, x, y, r, first, after, east, north, depths
    ):
        correct_at_walls(grid, path, x, y, r, 0.0, first, after, east, north, depths, depths)
    if recent:
        past = (recent, work.recent)
        take_off_recent(position, outline, x, y, r, 0.0, first, after, past, east, north, depths, depths)
    engaged = 0
    for j in range(np.uintp(first), np.uintp(after)):
        depth = depths[j] - (z + foot)
        depth = depth if depth > FEEL_MM else 0.0
        engaged |= depth > 0.0
        depths[j] = depth
    if not engaged:
        return arcs
    at, a = first, 0.0
    while at < after:
        end, added = at, 0.0
        while end < after and not _jumps(depths[at], depths[end]):
            added += depths[end]
            end += 1
        b = 0.5 * _TURN
        if end < after:
            b = _edge(grid, path, outline, (x, y, r, z + foot), end, bins, recent, work)
        if depths[at] > 0.0 and b > a:
            deep = added / (end - at)
            width = min(deep, high - foot)
            part[:] = 0.0
            arc_force(a, b, band[_SIN], band[_COS], chip[0], chip[1], chip[2], law, part)
            _sum(width, r, foot + 0.5 * width, part, total)
            total[A_P] = max(total[A_P], deep + foot - below)
            total[MOST] = max(total[MOST], r * math.cos(a))
            total[LEAST] = min(total[LEAST], r * math.cos(b))
            arcs = _put_arc(a, b, work.arcs, arcs)
        at, a = end, b
    return arcs


@kernel
def _jumps(a, b):
    return abs(a - b) > _JUMP * max(a, b) or (a == 0.0) != (b == 0.0)


@kernel
def _edge(grid, path, outline, place, j, bins, recent, work):
    """Return the angle between bins j - 1 and j at which the depth jumps."""
    x, y, r, foot = place
    position, outlines, tools = path.position_mm, path.outlines, path.tool
    east, north, depths = work.heading[0], work.heading[1], work.rows[_SHARE]
    low, high, before, behind = 0.0, 1.0, depths[j - 1], depths[j]
    for _ in range(4):
        middle = 0.5 * (low + high)
        qx = x + r * (east[j - 1] + middle * (east[j] - east[j - 1]))
        qy = y + r * (north[j - 1] + middle * (north[j] - north[j - 1]))
        height = height_at(grid.place, grid.shift, grid.height, grid.wall, position, outlines, tools, qx, qy)
        for sweep in range(recent):
            start, end = work.recent[sweep, 0], work.recent[sweep, 1]
            height = min(height, sweep_height(position, start, end, outline, qx, qy, 0.0))
        depth = height - foot if height - foot > FEEL_MM else 0.0
        if abs(depth - before) < abs(depth - behind):
            low = middle
        else:
            high = middle
    return -0.25 * _TURN + (j - 0.5 + 0.5 * (low + high)) * _TURN / bins


@kernel
def _list_arcs(turn, reach, depth, first, bins, below, total, listed, arcs):
    """List the arcs over which any band between rings is engaged, and their extent normal to the feed."""
    open_at, most, least, top = -1, total[MOST], total[LEAST], total[A_P] + below
    for j in range(first, bins - first + 1):
        engaged = j < bins - first and reach[j] > 0.0
        if engaged:
            side = reach[j] * turn[3, j]
            most, least = (side if side > most else most), (side if side < least else least)
            top = depth[j] if depth[j] > top else top
            open_at = j if open_at < 0 else open_at
        elif open_at >= 0:
            a, b = -0.25 * _TURN + open_at * _TURN / bins, -0.25 * _TURN + j * _TURN / bins
            arcs = _put_arc(a, b, listed, arcs)
            open_at = -1
    total[MOST], total[LEAST], total[A_P] = most, least, top - below
    return arcs


@kernel
def _put_arc(a, b, listed, arcs):
    """List an arc; return how many there are."""
    if arcs > 0 and listed[arcs - 1, 1] == a:
        listed[arcs - 1, 1] = b
        return arcs
    if arcs == _MOST_ARCS:
        arcs = _merge(listed, arcs)
    if arcs < _MOST_ARCS:
        listed[arcs, 0], listed[arcs, 1] = a, b
        arcs += 1
    return arcs


@kernel
def _merge(arcs, count):
    """Sort arcs and join those that touch; return how many are left."""
    for k in range(1, count):
        a, b, at = arcs[k, 0], arcs[k, 1], k
        while at > 0 and arcs[at - 1, 0] > a:
            arcs[at, 0], arcs[at, 1] = arcs[at - 1, 0], arcs[at - 1, 1]
            at -= 1
        arcs[at, 0], arcs[at, 1] = a, b
    left = 0
    for k in range(1, count):
        if arcs[k, 0] <= arcs[left, 1] + 1e-9:
            arcs[left, 1] = max(arcs[left, 1], arcs[k, 1])
        else:
            left += 1
            arcs[left, 0], arcs[left, 1] = arcs[k, 0], arcs[k, 1]
    return left + 1


@kernel
def write_union(arcs, count, phi_rad, row):
    """Write the union of the arcs, the widest where there are too many."""
    count = _merge(arcs, count)
    while count > ARCS:
        narrowest = 0
        for k in range(1, count):
            if arcs[k, 1] - arcs[k, 0] < arcs[narrowest, 1] - arcs[narrowest, 0]:
                narrowest = k
        for k in range(narrowest, count - 1):
            arcs[k, 0], arcs[k, 1] = arcs[k + 1, 0], arcs[k + 1, 1]
        count -= 1
    for k in range(count):
        phi_rad[row, 2 * k], phi_rad[row, 2 * k + 1] = arcs[k, 0], arcs[k, 1]
