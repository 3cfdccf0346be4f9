"""Cut a motion out of a grid and read every sample: compiled.

The engagement of a sample is read at its own position, before its sweep is removed. The field lags a little
behind the cutter (`edge.Cutters.lag_mm`): cells near the rim of the last sweeps would be read as cut or as
uncut by chance. The sweeps that the field does not show yet are evaluated exactly at each point that is read.
On a straight path there are none: no point in front of a convex cutter was inside it before.
"""

# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False

import math
from typing import NamedTuple

from gcode2krl.arrays import Floats
from gcode2krl.cutting.edge import A_P, LEAST, MOST, MOST_RECENT, add_bands, fill_turn, write_union
from gcode2krl.cutting.kernels import inlined, kernel
from gcode2krl.cutting.removal import remove_sweep
from gcode2krl.cutting.sweep import FEEL_MM, cells_between, highest, outline_of
from gcode2krl.cutting.walls import draw_walls, height_at

_STRAIGHT = 0.03  # sine of the angle in plan below which a path counts as straight
_LEVEL = 0.15  # the same up or down, where it only moves the angle at which the chip begins
_TURN = 2.0 * math.pi


class Result(NamedTuple):
    """A row per sample; zero and NaN in air."""

    force_N: Floats
    """(n, 3) on the tool, along the axes of the field."""
    moment_Nmm: Floats
    """(n, 3) about the tip."""
    torque_Nmm: Floats
    a_p_mm: Floats
    a_e_mm: Floats
    phi_rad: Floats
    """(n, 2 * ARCS) pairs, NaN padded."""
    ramp_rad: Floats
    """(n,) angle of descent."""
    centre_mm: Floats
    """(n,) material below the middle of a descending tool."""
    overlap_mm: Floats
    """(n, 3) how far rapid, shank and holder are in the material."""


@kernel
def cut_strip(
    grid, path, cutters, law, f_z_mm, way_mm, low, high, axis, reach_mm, index, work, rapid_mm, result
):
    """Cut all samples one after the other; read those whose coordinate `axis` lies in [low, high).

    Sweeps farther than ``reach_mm`` from there are left out: the field outside is another strip's. The
    reading of a sample depends only on the samples before it, not on how the field is divided. ``index`` is
    as in `removal.remove_sweep`, ``work`` a `new_work`; ``rapid_mm`` (n,) gets the height that rapids cut
    off.
    """
    n = len(way_mm)
    done, lag, tool = 0, 0, -1
    for i in range(n + 1):
        if i < n:
            if path.first[i]:
                lag = i
            if not (path.read[i] and low <= path.position_mm[i, axis] < high):
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
            fill_turn(work.turn, cutters.wall_bins[tool], cutters.ring_bins[tool])
        _read(grid, path, cutters, law, f_z_mm[i], way_mm, i, lag, work, result)


@inlined
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


@inlined
def _read(grid, path, cutters, law, f_z_mm, way_mm, i, lag, work, result):
    """Read the engagement at sample i and write its row."""
    tool, position = path.tool[i], path.position_mm
    x, y, z = position[i, 0], position[i, 1], position[i, 2]
    outline = outline_of(path.outlines, tool)
    radius = outline[0]
    if cutters.above[tool, 0] > radius or cutters.above[tool, 2] > radius:
        _collide(grid, x, y, z, radius, cutters.above, tool, result.overlap_mm, i)
    fx, fy, sink, level = _heading(path.direction, i)
    if sink == 0.0 and level == 0.0:
        return
    result.ramp_rad[i] = math.atan2(sink, level)
    place, shift = grid.place, grid.shift
    top = highest(place, shift, grid.bound, x - radius, x + radius, y - radius, y + radius) - z
    if top <= FEEL_MM:
        return
    if sink > 0.0:
        below = height_at(
            grid.place, grid.shift, grid.height, grid.wall, path.position_mm, path.outlines, path.tool, x, y
        ) - max(z, grid.bottom_mm)
        result.centre_mm[i] = below if below > FEEL_MM else 0.0
    met = _met(way_mm, i, lag, f_z_mm)
    recent = _recent(position, i, lag, met, fx * level, fy * level, -sink, work.recent)
    total = work.total
    total[:] = 0.0
    total[LEAST], total[MOST] = math.inf, -math.inf
    chip = (f_z_mm, sink, level)
    arcs = add_bands(grid, path, cutters, law, i, outline, (fx, fy), chip, top, recent, work)
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
    result.a_p_mm[i] = total[A_P]
    result.a_e_mm[i] = total[MOST] - total[LEAST]
    write_union(work.arcs, arcs, result.phi_rad, i)


@kernel
def _heading(direction, i):
    """Return the unit vector in plan of the path's tangent at a sample, sine and cosine of its descent."""
    dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
    plan = math.sqrt(dx * dx + dy * dy)
    if plan < 1e-9:
        return 1.0, 0.0, -dz, 0.0
    return dx / plan, dy / plan, -dz, plan


@kernel
def _met(way_mm, i, lag, f_z_mm):
    """Return the last point whose sweep the edge at sample i finds cut: a feed per tooth before it.

    What an edge meets is what the tooth before has left. A step of the sampling or of the path's shape in its
    place would make the force depend on how densely points lie.
    """
    met = i - 1
    while met > lag and way_mm[met] > way_mm[i] - f_z_mm:
        met -= 1
    return met


@kernel
def _recent(position, i, lag, met, dx, dy, dz, recent):
    """List the sweeps up to point ``met`` that the field does not show yet and that were not on a straight
    path to sample i."""
    stride = max((met - lag + MOST_RECENT - 1) // MOST_RECENT, 1)
    count = 0
    for start in range(lag, met, stride):
        ax, ay = position[i, 0] - position[start, 0], position[i, 1] - position[start, 1]
        az = position[i, 2] - position[start, 2]
        back, aside = ax * dx + ay * dy + az * dz, ax * dy - ay * dx
        off = ax * ax + ay * ay + az * az - back * back
        if back < 0.0 or off > (_LEVEL * back) ** 2 + 1e-12 or abs(aside) > _STRAIGHT * back:
            recent[count, 0], recent[count, 1] = start, min(start + stride, met)
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
