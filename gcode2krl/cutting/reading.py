"""Where a cutter is engaged, sample by sample, and the mean force there: compiled.

The engagement of a sample is read at its own position, before its sweep is removed. The field lags a little
behind the cutter (`Cutters.lag_mm`): cells near the rim of the last sweeps would be read as cut or as uncut by
chance. What has been cut since is evaluated exactly at each point that is read, and on a straight way that
is nothing: no point in front of a convex cutter was inside it before.

Angles phi run from the feed normal in the sense of rotation; their bins start at -90°, so that the front of
the cutter, 0 to 180°, lies in the middle.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from gcode2krl.cutting.kernels import kernel
from gcode2krl.cutting.removal import (
    FEEL_MM,
    LANES,
    beside_wall,
    cell_at,
    cells_between,
    draw_walls,
    highest,
    outline_height,
    outline_of,
    remove_sweep,
    sweep_height,
)
from gcode2krl.cutting.slices import LINEAR_EDGE, arc_force

BAND_COLUMNS = 7
ARCS = 3
"""Engagement arcs that are reported; the widest where there are more."""
_LOW, _HIGH, _R_LOW, _R_HIGH, _SIN, _COS, _WIDTH = range(BAND_COLUMNS)
_MOST_ARCS = 64
_MOST_RECENT = 8
_STRAIGHT = 0.03  # sine of the angle in plan below which a way counts as straight
_LEVEL = 0.15  # the same up or down, where it only moves the angle at which the chip begins
_COARSE_JUMP = 0.25  # the same for one of many bands, absolute share
_JUMP = 0.1  # change of depth, relative, at which an arc is split
_TURN = 2.0 * math.pi
_A_P, _LEAST, _MOST = 7, 8, 9  # after the four forces, two moments and the torque


class Cutters(NamedTuple):
    """What the kernels need of each tool, a row each."""

    bands: NDArray[np.float64]
    """(t, s, 7) stretches of the edge from the tip up: z low and high, r low and high, sin and cos of the edge
    angle, contact width."""
    count: NDArray[np.int32]
    """(t,) bands in use."""
    wall_bins: NDArray[np.int32]
    """(t,) points all around the rim, a multiple of 4."""
    ring_bins: NDArray[np.int32]
    """(t,) points all around a ring between two bands, a multiple of 4."""
    teeth: NDArray[np.float64]
    lag_mm: NDArray[np.float64]
    """(t,) way by which the field lags behind."""
    above: NDArray[np.float64]
    """(t, 4) shank: radius, height of its lower end; holder: the same; radius 0 = not checked."""


class Result(NamedTuple):
    """A row per sample; zero and NaN in air."""

    force_N: NDArray[np.float64]
    """(n, 3) on the tool, along the axes of the field."""
    moment_Nmm: NDArray[np.float64]
    """(n, 3) about the tip."""
    torque_Nmm: NDArray[np.float64]
    a_p_mm: NDArray[np.float64]
    a_e_mm: NDArray[np.float64]
    phi_rad: NDArray[np.float64]
    """(n, 2 * ARCS) pairs, NaN padded."""
    ramp_rad: NDArray[np.float64]
    """(n,) angle of descent."""
    centre_mm: NDArray[np.float32]
    """(n,) material below the middle of a descending tool."""
    overlap_mm: NDArray[np.float32]
    """(n, 3) how far rapid, shank and holder are in the material."""


class _Work(NamedTuple):
    """Scratch memory of one thread."""

    turn: NDArray[np.float64]
    """(8, bins) sin and cos of the wall's and the ring's bins; over the ring's bins the integrals of sin, cos,
    sin², sin·cos."""
    heading: NDArray[np.float64]
    """(2, bins) x and y of the directions of the bins."""
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    share: NDArray[np.float64]
    reach: NDArray[np.float64]
    """(2, bins) largest radius of the edge that is engaged, 0 = none; largest height of material there."""
    recent: NDArray[np.int64]
    """(8, 2) first and last sample of sweeps that the field does not show yet."""
    arcs: NDArray[np.float64]
    arc: NDArray[np.float64]
    part: NDArray[np.float64]
    total: NDArray[np.float64]
    lanes: NDArray[np.float64]
    """(5, LANES) partial sums."""


@njit(cache=True, nogil=True, error_model="numpy")
def cut_strip(grid, path, cutters, law, f_z_mm, way_mm, low, high, axis, reach_mm, index, rapid_mm, result):
    """Cut all samples one after the other; read those whose coordinate `axis` lies in [low, high).

    Sweeps farther than ``reach_mm`` from there are left out: the field outside is another strip's. What a
    sample reads depends on the samples before it alone, not on how the field is divided. ``index`` is that
    of `removal.remove_sweep`; ``rapid_mm`` (n,) gets the height that rapids cut off.
    """
    work, n = _new_work(), len(way_mm)
    done, lag, tool = 0, 0, -1
    for i in range(n + 1):
        if i < n:
            if path.first[i]:
                lag = i
            if not low <= path.position_mm[i, axis] < high:
                continue
            limit = way_mm[i] - cutters.lag_mm[path.tool[i]]
            while lag + 1 < i and way_mm[lag + 1] <= limit:
                lag += 1
        else:
            lag = n - 1
        for k in range(done + 1, lag + 1):
            _apply(grid, path, k, n, axis, low - reach_mm, high + reach_mm, index, rapid_mm)
        done = max(done, lag)
        if i == n:
            return
        if path.tool[i] != tool:
            tool = path.tool[i]
            _fill_turn(work.turn, cutters.wall_bins[tool], cutters.ring_bins[tool])
        _read(grid, path, cutters, law, f_z_mm[i], i, lag, work, result)


@njit(cache=True, nogil=True, error_model="numpy")
def _new_work():
    bins = 1024
    lower, upper, share, reach = np.zeros(bins), np.zeros(bins), np.zeros(bins), np.zeros((2, bins))
    recent, arcs = np.zeros((_MOST_RECENT, 2), np.int64), np.zeros((_MOST_ARCS, 2))
    turn, heading, lanes = np.zeros((8, bins)), np.zeros((2, bins)), np.zeros((5, int(LANES)))
    return _Work(
        turn, heading, lower, upper, share, reach, recent, arcs, np.zeros(4), np.zeros(4), np.zeros(10), lanes
    )


@kernel
def _fill_turn(turn, wall_bins, ring_bins):
    """Tabulate sine and cosine in the middle of the wall's and of the ring's bins, and their integrals there."""
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
def _apply(grid, path, k, n, axis, low, high, index, rapid_mm):
    """Remove a sweep where it comes near the strip."""
    if path.first[k]:
        return
    a, b = path.position_mm[k - 1, axis], path.position_mm[k, axis]
    if max(a, b) < low or min(a, b) > high:
        return
    cut_mm = remove_sweep(grid, path, k, index)
    draw_walls(grid, path, k, n)
    if path.rapid[k]:
        rapid_mm[k] = cut_mm


# --- one sample ----------------------------------------------------------------------------------------


@kernel
def _read(grid, path, cutters, law, f_z_mm, i, lag, work, result):
    """Read the engagement at sample i and write its row."""
    tool, position = path.tool[i], path.position_mm
    x, y, z = position[i, 0], position[i, 1], position[i, 2]
    outline = outline_of(path.outlines, tool)
    radius = outline[0]
    if cutters.above[tool, 0] > radius or cutters.above[tool, 2] > radius:
        _collide(grid, x, y, z, radius, cutters.above, tool, result.overlap_mm, i)
    fx, fy, sink, level = _heading(position, path.first, i)
    if sink == 0.0 and level == 0.0:
        return
    result.ramp_rad[i] = math.atan2(sink, level)
    place, shift = grid.place, grid.shift
    top = highest(place, shift, grid.bound, x - radius, x + radius, y - radius, y + radius) - z
    if top <= FEEL_MM:
        return
    if sink > 0.0:
        below = _height_at(grid.place, grid.shift, grid.height, grid.wall, path.position_mm, path.outlines, path.tool, x, y
        ) - max(z, grid.bottom_mm)
        result.centre_mm[i] = below if below > FEEL_MM else 0.0
    recent = _recent(position, i, lag, fx * level, fy * level, -sink, work.recent)
    total = work.total
    total[:] = 0.0
    total[_LEAST], total[_MOST] = math.inf, -math.inf
    chip = (f_z_mm, sink, level)
    arcs = _bands(grid, path, cutters, law, i, outline, (fx, fy), chip, top, recent, work)
    if arcs == 0:
        return
    scale = cutters.teeth[tool] / _TURN
    feed, normal = scale * total[0], scale * total[1]
    about_feed, about_normal = scale * total[4], scale * total[5]
    result.force_N[i, 0] = feed * fx - normal * fy
    result.force_N[i, 1] = feed * fy + normal * fx
    result.force_N[i, 2] = -scale * total[2]
    result.moment_Nmm[i, 0] = about_feed * fx - about_normal * fy
    result.moment_Nmm[i, 1] = about_feed * fy + about_normal * fx
    result.moment_Nmm[i, 2] = scale * total[6]
    result.torque_Nmm[i] = scale * total[6]
    result.a_p_mm[i] = total[_A_P]
    result.a_e_mm[i] = total[_MOST] - total[_LEAST]
    _union(work.arcs, arcs, result.phi_rad, i)


@kernel
def _step(position, first, i):
    """Return the way that leads to sample i, and its length; zero where none does."""
    if i >= first.size or first[i]:
        return 0.0, 0.0, 0.0, 0.0
    dx, dy = position[i, 0] - position[i - 1, 0], position[i, 1] - position[i - 1, 1]
    dz = position[i, 2] - position[i - 1, 2]
    return dx, dy, dz, math.sqrt(dx * dx + dy * dy + dz * dz)


@kernel
def _heading(position, first, i):
    """Return the direction of the way at a sample: unit vector in plan, sine and cosine of the descent.

    From the sample before to the one after; from the one before only where the way has a corner or ends.
    """
    bx, by, bz, before = _step(position, first, i)
    ax, ay, az, after = _step(position, first, i + 1)
    if before < 1e-9:
        bx, by, bz, before = ax, ay, az, after
    elif after > 1e-9 and ax * bx + ay * by + az * bz > 0.5 * before * after:
        bx, by, bz = bx + ax, by + ay, bz + az
        before = math.sqrt(bx * bx + by * by + bz * bz)
    if before < 1e-9:
        return 1.0, 0.0, 0.0, 0.0
    plan = math.sqrt(bx * bx + by * by)
    if plan < 1e-9 * before:
        return 1.0, 0.0, -math.copysign(1.0, bz), 0.0
    return bx / plan, by / plan, -bz / before, plan / before


@kernel
def _recent(position, i, lag, dx, dy, dz, recent):
    """List the sweeps that the field does not show yet and that were not on a straight way to sample i."""
    stride = max((i - lag + _MOST_RECENT - 1) // _MOST_RECENT, 1)
    count = 0
    for start in range(lag, i, stride):
        ax, ay = position[i, 0] - position[start, 0], position[i, 1] - position[start, 1]
        az = position[i, 2] - position[start, 2]
        back, aside = ax * dx + ay * dy + az * dz, ax * dy - ay * dx
        off = ax * ax + ay * ay + az * az - back * back
        if back < 0.0 or off > (_LEVEL * back) ** 2 + 1e-12 or abs(aside) > _STRAIGHT * back:
            recent[count, 0], recent[count, 1] = start, min(start + stride, i)
            count += 1
    return count


@kernel
def _collide(grid, x, y, z, radius, above, tool, overlap, sample):
    """Note how far shank and holder reach into material beside the cutter."""
    for part in range(2):
        wide, level = above[tool, 2 * part], z + above[tool, 2 * part + 1]
        if (
            wide <= radius
            or highest(grid.place, grid.shift, grid.bound, x - wide, x + wide, y - wide, y + wide)
            <= level + FEEL_MM
        ):
            continue
        (x0, y0, dx, dy), (row, column) = grid.place, grid.shift
        ia, ib = cells_between(y - wide, y + wide, y0, dy, row, grid.height.shape[0])
        ja, jb = cells_between(x - wide, x + wide, x0, dx, column, grid.height.shape[1])
        worst = 0.0
        for i in range(ia, ib):
            v = y0 + (i + row + 0.5) * dy - y
            for j in range(ja, jb):
                u = x0 + (j + column + 0.5) * dx - x
                square = u * u + v * v
                if radius * radius < square < wide * wide:
                    worst = max(worst, grid.height[i, j] - level)
        if worst > FEEL_MM:
            overlap[sample, 1 + part] = worst


# --- along the edge ----------------------------------------------------------------------------------------
# Loops over bins have no branches and unsigned indices, so that the compiler takes eight bins at once.


@kernel
def _bands(grid, path, cutters, law, i, outline, heading, chip, top, recent, work):
    """Add the force of every band of the edge to ``work.total``; return the number of arcs in ``work.arcs``.

    No material stands more than ``top`` above the tip.
    """
    tool, bands, position, part, total = path.tool[i], cutters.bands, path.position_mm, work.part, work.total
    lower, upper, share, reach, directions = work.lower, work.upper, work.share, work.reach, work.heading
    bins, arcs, known, turned, widest = cutters.ring_bins[tool], 0, -1.0, -1, cutters.ring_bins[tool]
    x, y, z = position[i, 0], position[i, 1], position[i, 2]
    last, bottom = cutters.count[tool] - 1, grid.bottom_mm - z
    reach[:, :bins] = 0.0
    for b in range(last + 1):
        band = _band_of(bands, tool, b)
        if band[_LOW] >= top:
            break
        start = _first_angle(band, chip)
        if start >= 0.25 * _TURN:
            continue
        if band[_COS] == 0.0:
            turned = _turn(work.turn, directions, 0, cutters.wall_bins[tool], heading, turned)
            arcs = _wall(grid, path, law, i, outline, band, chip, recent, work, cutters.wall_bins[tool], arcs)
            continue
        turned = _turn(work.turn, directions, 2, bins, heading, turned)
        first = _first_bin(min(start, _first_angle(_band_of(bands, tool, min(b + 1, last)), chip)), bins)
        for ring in range(1 if known == band[_R_LOW] else 0, 2):
            for j in range(np.uintp(first), np.uintp(bins - first)):
                lower[j] = upper[j]
            r = band[_R_LOW + ring]
            level = z + outline_height(r, outline)
            walls = _tops(grid.place, grid.shift, grid.height, grid.wall, x, y, r, first, bins - first, directions, upper)
            _above_cells(grid.place, outline, x, y, z, r, level, first, bins - first, directions, upper)
            if walls:
                _at_walls(grid, path, x, y, r, level, first, bins - first, directions, upper)
            if recent:
                after, sweeps = bins - first, work.recent
                _without_recent(position, outline, x, y, r, level, first, after, recent, sweeps, directions, upper)
        known, widest = band[_R_HIGH], min(widest, first)
        first = _first_bin(start, bins)
        _share(bottom, band, first, bins, lower, upper, share, reach)
        part[:] = 0.0
        if law[0] == LINEAR_EDGE:
            _integrate(law, band, chip, bins, share, work.turn, work.lanes, part)
        else:
            _by_arcs(law, band, chip, first, bins, share, work.arc, part)
        lever = 0.5 * (band[_LOW] + max(bottom - band[_LOW], 0.0) + band[_HIGH])
        _sum(band[_WIDTH], 0.5 * (band[_R_LOW] + band[_R_HIGH]), lever, part, total)
    return _list_arcs(work.turn, reach, widest, bins, max(bottom, 0.0), total, work.arcs, arcs)


@kernel
def _band_of(bands, tool, b):
    return (
        bands[tool, b, 0], bands[tool, b, 1], bands[tool, b, 2], bands[tool, b, 3],
        bands[tool, b, 4], bands[tool, b, 5], bands[tool, b, 6],
    )  # fmt: skip


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
def _turn(turn, directions, which, bins, heading, turned):
    """Turn the table of directions into the heading of the sample."""
    if turned == which:
        return turned
    fx, fy = heading
    for j in range(np.uintp(bins)):
        directions[0, j] = turn[which, j] * fx - turn[which + 1, j] * fy
        directions[1, j] = turn[which, j] * fy + turn[which + 1, j] * fx
    return which


@kernel
def _tops(place, shift, height, wall, x, y, r, first, after, directions, tops):
    """Write the height of the cells on a ring; return whether a wall runs through one of them."""
    ax, ay, rx, ry = (x - place[0]) / place[2], (y - place[1]) / place[3], r / place[2], r / place[3]
    nx, ny, walls = height.shape[1] - 0.5, height.shape[0] - 0.5, 0
    column_0, row_0 = float(shift[1]), float(shift[0])
    for j in range(np.uintp(first), np.uintp(after)):
        u, v = ax + rx * directions[0, j] - column_0, ay + ry * directions[1, j] - row_0
        u, v = (u if u > 0.5 else 0.5), (v if v > 0.5 else 0.5)  # the cells at the border are empty
        column, row = np.uintp(u if u < nx else nx), np.uintp(v if v < ny else ny)
        walls |= wall[row, column] >= 0
        tops[j] = height[row, column]
    return walls != 0


@kernel
def _at_walls(grid, path, x, y, r, level, first, after, directions, tops):
    """Replace the heights above a level of cells with a wall by that of the point's side of it."""
    place, shift, height, wall, position = grid.place, grid.shift, grid.height, grid.wall, path.position_mm
    for j in range(first, after):
        qx, qy = x + r * directions[0, j], y + r * directions[1, j]
        row, column = cell_at(place, shift, height.shape, qx, qy)
        if row >= 0 and wall[row, column] >= 0:
            sweep = np.int64(wall[row, column])
            outline = outline_of(path.outlines, path.tool[sweep])
            tops[j] = beside_wall(place, shift, height, position, outline, sweep, row, column, qx, qy) - level


@kernel
def _height_at(place, shift, height, wall, position, outlines, tools, x, y):
    """Return the top of the material at a point: of its cell, or beside the wall that runs through it."""
    row, column = cell_at(place, shift, height.shape, x, y)
    if row < 0:
        return -math.inf
    sweep = np.int64(wall[row, column])
    if sweep < 0:
        return np.float64(height[row, column])
    return beside_wall(place, shift, height, position, outline_of(outlines, tools[sweep]), sweep, row, column, x, y)


@kernel
def _without_recent(position, outline, x, y, r, level, first, after, recent, sweeps, directions, tops):
    """Lower heights above a level on a ring by the sweeps that the field does not show yet."""
    for sweep in range(recent):
        start, end = sweeps[sweep, 0], sweeps[sweep, 1]
        for j in range(first, after):
            qx, qy = x + r * directions[0, j], y + r * directions[1, j]
            tops[j] = min(tops[j], sweep_height(position, start, end, outline, qx, qy, 0.0) - level)


@kernel
def _above_cells(place, outline, x, y, z, r, level, first, after, directions, thickness):
    """Turn heights into thickness above the cutter's surface.

    A cell's height is that of its middle: exact against the cutter's surface there, which also is the better
    figure for a layer so thin that it is parallel to the cutter.
    """
    ax, ay, rx, ry = (x - place[0]) / place[2], (y - place[1]) / place[3], r / place[2], r / place[3]
    dx, dy, radius, bottom, corner = place[2], place[3], outline[0], outline[1], outline[2]
    arc_radius, arc_top, steep = (outline[3] if outline[5] > 0.0 else math.inf), outline[4], outline[5]
    for j in range(np.uintp(first), np.uintp(after)):
        u = (np.floor(ax + rx * directions[0, j]) + 0.5 - ax) * dx
        v = (np.floor(ay + ry * directions[1, j]) + 0.5 - ay) * dy
        s = math.sqrt(u * u + v * v)
        s = s if s < radius else radius
        w = s - bottom
        w = w if w > 0.0 else 0.0
        w = w if w < corner else corner
        surface = corner - math.sqrt(corner * corner - w * w)
        surface = surface if s < arc_radius else arc_top + (s - arc_radius) * steep
        own, plain = thickness[j] - z - surface, thickness[j] - level
        thickness[j] = own if (own <= FEEL_MM) | (own < 2.0 * abs(own - plain)) else plain


@kernel
def _share(bottom, band, first, bins, lower, upper, shares, reach):
    """Write the share of a band that is engaged: between its rings the thickness changes evenly.

    ``bottom`` is the height of the material's bottom above the tip.
    """
    from_low, from_high, radius = band[_LOW], band[_HIGH], band[_R_HIGH]
    height, missing = from_high - from_low, max(bottom - from_low, 0.0)
    sound = 1.0 if missing == 0.0 else max(1.0 - missing / height, 0.0) if height > 0.0 else 0.0
    for j in range(np.uintp(bins)):
        shares[j] = 0.0
    for j in range(np.uintp(first), np.uintp(bins - first)):
        low, high = lower[j], upper[j]
        low_in, high_in = low > FEEL_MM, high > FEEL_MM
        most, gap = (low if low > high else high), abs(low - high)
        part = most / (gap if gap > most else most)
        part = part if low_in | high_in else 0.0
        part = sound * (1.0 if low_in & high_in else part)
        shares[j] = part
        here = radius if part > 0.0 else 0.0
        reach[0, j] = reach[0, j] if reach[0, j] > here else here
        top = from_high + high if high_in else from_low + low
        top = top if part > 0.0 else 0.0
        reach[1, j] = reach[1, j] if reach[1, j] > top else top


@kernel
def _integrate(law, band, chip, bins, shares, turn, lanes, part):
    """Add the force of a band from the integrals over its bins: linear edge forces.

    Summed in LANES places, so that the compiler adds eight bins at once.
    """
    lanes[:] = 0.0
    for block in range(np.uintp(0), np.uintp(bins), LANES):
        for lane in range(LANES):
            share = shares[block + lane]
            lanes[0, lane] += share
            lanes[1, lane] += share * turn[4, block + lane]
            lanes[2, lane] += share * turn[5, block + lane]
            lanes[3, lane] += share * turn[6, block + lane]
            lanes[4, lane] += share * turn[7, block + lane]
    one, sin, cos, sin_sin, sin_cos = 0.0, 0.0, 0.0, 0.0, 0.0
    for lane in range(LANES):
        one += lanes[0, lane]
        sin += lanes[1, lane]
        cos += lanes[2, lane]
        sin_sin += lanes[3, lane]
        sin_cos += lanes[4, lane]
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
def _by_arcs(law, band, chip, first, bins, shares, one, part):
    """Add the force of a band arc by arc: any law."""
    at = first
    while at < bins - first:
        end, added = at, 0.0
        while end < bins - first and shares[end] > 0.0 and abs(shares[end] - shares[at]) < _COARSE_JUMP:
            added += shares[end]
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
def _list_arcs(turn, reach, first, bins, below, total, listed, arcs):
    """List the arcs over which any band between rings is engaged, and their extent normal to the feed."""
    open_at, most, least, top = -1, total[_MOST], total[_LEAST], total[_A_P] + below
    for j in range(first, bins - first + 1):
        engaged = j < bins - first and reach[0, j] > 0.0
        if engaged:
            side = reach[0, j] * turn[3, j]
            most, least = (side if side > most else most), (side if side < least else least)
            top = reach[1, j] if reach[1, j] > top else top
            open_at = j if open_at < 0 else open_at
        elif open_at >= 0:
            a, b = -0.25 * _TURN + open_at * _TURN / bins, -0.25 * _TURN + j * _TURN / bins
            arcs = _put_arc(a, b, listed, arcs)
            open_at = -1
    total[_MOST], total[_LEAST], total[_A_P] = most, least, top - below
    return arcs


@kernel
def _wall(grid, path, law, i, outline, band, chip, recent, work, bins, arcs):
    """Add a cylindrical band: its depth may change along the rim, by steps whose places are looked for."""
    position, directions, depths, total, part = (
        path.position_mm,
        work.heading,
        work.share,
        work.total,
        work.part,
    )
    x, y, z = position[i, 0], position[i, 1], position[i, 2]
    r, below, high = band[_R_HIGH], max(grid.bottom_mm - z, 0.0), band[_HIGH]
    foot, first, after = max(band[_LOW], below), bins // 4, bins - bins // 4
    if _tops(grid.place, grid.shift, grid.height, grid.wall, x, y, r, first, after, directions, depths):
        _at_walls(grid, path, x, y, r, 0.0, first, after, directions, depths)
    if recent:
        _without_recent(position, outline, x, y, r, 0.0, first, after, recent, work.recent, directions, depths)
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
            total[_A_P] = max(total[_A_P], deep + foot - below)
            total[_MOST] = max(total[_MOST], r * math.cos(a))
            total[_LEAST] = min(total[_LEAST], r * math.cos(b))
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
    position, outlines, tools, directions = path.position_mm, path.outlines, path.tool, work.heading
    low, high, before, behind = 0.0, 1.0, work.share[j - 1], work.share[j]
    for _ in range(4):
        middle = 0.5 * (low + high)
        qx = x + r * (directions[0, j - 1] + middle * (directions[0, j] - directions[0, j - 1]))
        qy = y + r * (directions[1, j - 1] + middle * (directions[1, j] - directions[1, j - 1]))
        height = _height_at(grid.place, grid.shift, grid.height, grid.wall, position, outlines, tools, qx, qy)
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
def _union(arcs, count, phi_rad, row):
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
