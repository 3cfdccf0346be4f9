"""The commanded path as a matplotlib figure, after figure 4 of Bigliardi et al. 2022."""

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.report.corner_marks import corners_apart
from gcode2krl.report.drawing import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PALE,
    SKY,
    VERMILION,
    length,
    look,
    need_samples,
    thin_path,
    title,
)
from gcode2krl.report.maps import (
    Shading,
    draw_map,
    draw_passes,
    height_in,
    near,
    passes_height_in,
    side_columns,
    side_title,
)
from gcode2krl.report.passes import Pass, passes_of
from gcode2krl.tables import Motion, Targets, Toolpath


class Corner(NamedTuple):
    """An approximated corner and how far the path stays from its programmed vertex."""

    target: int
    """Row of Targets that ends in the vertex."""
    line: int
    distance_mm: float
    reach_mm: float
    """How far from the vertex the path leaves the line: min(CDIS, L1/2, L2/2)."""
    sampled: bool
    """True where the distance is that of the samples, False where they are too far apart to tell and it is
    that of the parabola."""
    nearest_mm: Floats
    """(3,) the point of the path nearest to the vertex."""
    along: Floats
    """(3,) unit vector of the incoming line."""
    across: Floats
    """(3,) unit vector in the corner's plane, at right angles to it, on the outgoing side."""


def worst_corner(targets: Targets, motion: Motion) -> Corner | None:
    """Return the corner whose vertex the path misses most, or None where no corner is approximated.

    With three samples or more in a corner the path between them is the parabola through them, which is
    what the controller drives (Bigliardi et al. 2022, eq. 4); with fewer it is the parabola that leaves the
    lines at d = min(CDIS, L1/2, L2/2), with the error d·cos(alpha/2)/2 (their eq. 3).
    """
    if len(targets) < 3 or not len(motion):
        return None
    position = targets.position_mm
    step = np.diff(position, axis=0)
    length = np.linalg.norm(step, axis=1)
    unit = step / np.maximum(length, 1e-12)[:, None]
    cosine = np.einsum("ij,ij->i", unit[:-1], unit[1:])
    reach = np.zeros(len(targets))
    reach[1:-1] = np.minimum(targets.cdis_mm[1:-1], np.minimum(length[:-1], length[1:]) / 2.0)
    lin = ~(targets.ptp | targets.home)
    reach[1:-1][~(lin[1:-1] & lin[2:]) | (cosine < -1.0 + 1e-9)] = 0.0  # a reversal is an exact stop
    error = np.zeros(len(targets))
    error[1:-1] = reach[1:-1] * np.sqrt(np.clip(1.0 - cosine, 0.0, 2.0) / 2.0) / 2.0

    row_of = np.full(int(max(targets.move.max(), motion.move.max())) + 1, -1)
    planned = np.flatnonzero(targets.move >= 0)
    row_of[targets.move[planned]] = planned
    rows = row_of[motion.move[motion.move >= 0]]
    if not (rows >= 0).any():
        return None
    error[: rows[rows >= 0].min()] = 0.0
    error[rows.max() :] = 0.0

    nearest, resolved = _nearest_samples(targets, motion, row_of, reach)
    row = int(np.argmax(np.where(resolved, 0.0, error)))
    point = position[row] + reach[row] * (unit[row] - unit[row - 1]) / 4.0
    distance = 0.0 if resolved[row] else float(error[row])
    measured = np.flatnonzero(resolved & (error > 0.0))
    bound = np.linalg.norm(motion.position_mm[nearest[measured]] - position[measured], axis=1)
    order = np.argsort(-bound, kind="stable")
    for some in np.array_split(order, max(len(order) // 5000, 1)):
        if not len(some) or bound[some[0]] <= distance:
            break
        points = _between_samples(motion.position_mm, nearest[measured[some]], position[measured[some]])
        missed = np.linalg.norm(points - position[measured[some]], axis=1)
        if missed.max() > distance:
            row, point, distance = measured[some[missed.argmax()]], points[missed.argmax()], missed.max()
    if distance <= 1e-9:
        return None
    across = unit[row] - cosine[row - 1] * unit[row - 1]
    across /= np.linalg.norm(across)
    line, sampled = int(targets.source_line[row]), bool(resolved[row])
    return Corner(int(row), line, float(distance), float(reach[row]), sampled, point, unit[row - 1], across)


def _nearest_samples(targets: Targets, motion: Motion, row_of: Ints, reach: Floats) -> tuple[Ints, Bools]:
    """Return (p,) the corner sample nearest to each vertex, and whether it and both its neighbours are in
    that corner."""
    nearest = np.zeros(len(targets), dtype=np.int64)
    resolved = np.zeros(len(targets), dtype=np.bool_)
    sample = np.flatnonzero(motion.corner & (motion.move >= 0))
    sample = sample[row_of[motion.move[sample]] > 0]
    if not len(sample):
        return nearest, resolved
    end = row_of[motion.move[sample]]
    point = motion.position_mm[sample]
    to_end = np.linalg.norm(point - targets.position_mm[end], axis=1)
    to_start = np.linalg.norm(point - targets.position_mm[end - 1], axis=1)
    vertex = np.where(to_end <= to_start, end, end - 1)
    distance = np.minimum(to_end, to_start)
    order = np.lexsort((distance, vertex))
    corners, first = np.unique(vertex[order], return_index=True)
    nearest[corners] = sample[order[first]]
    of = np.full(len(motion) + 2, -1)  # one spare at each end
    inside = distance <= 1.001 * reach[vertex] + 1e-9
    of[sample[inside] + 1] = vertex[inside]
    at = nearest[corners] + 1
    resolved[corners] = (of[at] == corners) & (of[at - 1] == corners) & (of[at + 1] == corners)
    return nearest, resolved


def _between_samples(path_mm: Floats, nearest: Ints, vertex: Floats) -> Floats:
    """Return (k, 3) the points nearest to the vertices on the parabolas through three samples each."""
    before, middle, after = (path_mm[nearest + step] for step in (-1, 0, 1))
    s = np.linspace(-1.0, 1.0, 201)[:, None, None]
    points = middle + s * (after - before) / 2.0 + s**2 * (after - 2.0 * middle + before) / 2.0
    pick = np.linalg.norm(points - vertex, axis=2).argmin(axis=0)
    nearest_points: Floats = points[pick, np.arange(len(pick))]
    return nearest_points


def smooth(samples: Floats) -> Floats:
    """Return samples at equal times with the curve between them, exact where that is a parabola.

    Between two samples it is the blend of the parabolas through three on either side (Catmull and Rom).
    """
    if not 3 <= len(samples) <= 500:
        return samples
    padded = np.concatenate([2 * samples[:1] - samples[1:2], samples, 2 * samples[-1:] - samples[-2:-1]])
    a, b, c, d = (padded[first : len(padded) - 3 + first, None] for first in range(4))
    s = np.linspace(0.0, 1.0, 11)[:-1, None]
    curve = (
        b
        + s * (c - a) / 2.0
        + s**2 * (a - 2.5 * b + 2.0 * c - d / 2.0)
        + s**3 * (1.5 * (b - c) + (d - a) / 2.0)
    )
    return np.concatenate([curve.reshape(-1, samples.shape[1]), samples[-1:]])


# The worst corner in its own plane, enlarged.


def draw_corner(axes: Axes, corner: Corner, targets: Targets, motion: Motion) -> None:
    """Draw the worst corner in its own plane, true to scale, with the vertex at 0, 0."""
    vertex = targets.position_mm[corner.target]
    plane = np.stack([corner.along, corner.across], axis=1)
    before, after = ((targets.position_mm[corner.target + step] - vertex) @ plane for step in (-1, 1))
    half = min(1.35 * corner.reach_mm, 8.0 * corner.distance_mm)
    near = np.flatnonzero(np.linalg.norm(motion.position_mm - vertex, axis=1) <= 3.0 * corner.reach_mm)
    is_near = (
        np.abs((motion.position_mm[near] - vertex) @ np.cross(corner.along, corner.across)) <= corner.reach_mm
    )
    near = near[is_near & np.isin(motion.move[near], targets.move[corner.target : corner.target + 2])]
    samples = (motion.position_mm[near] - vertex) @ plane
    axes.plot(*np.stack([before, [0.0, 0.0], after]).T, color=GREY, lw=0.9, zorder=2)
    s = np.linspace(0.0, 1.0, 101)[:, None]
    parabola = corner.reach_mm * (
        (1.0 - s) ** 2 * before / np.linalg.norm(before) + s**2 * after / np.linalg.norm(after)
    )
    if corner.sampled:
        axes.plot(*thin_path(smooth(samples)).T, color=BLUE, lw=1.2, zorder=3)
    else:
        axes.plot(*parabola.T, color=BLUE, lw=1.2, ls="--", zorder=3)
    inside = samples[motion.corner[near]]
    axes.plot(*thin_path(samples).T, ".", color=BLUE, ms=5, zorder=4)
    axes.plot(*thin_path(inside).T, ".", color=ORANGE, ms=5, zorder=4)
    apex = (corner.nearest_mm - vertex) @ plane
    axes.plot(*np.stack([[0.0, 0.0], apex]).T, color=VERMILION, lw=1.4, zorder=5)
    axes.plot(0.0, 0.0, "o", ms=5, mfc="white", mec=BLACK, zorder=6)
    end = f"end of line {corner.line}" if corner.line > 0 else "vertex"
    axes.annotate(
        f"{end}\n{length(corner.distance_mm)} mm from the path",
        (0.0, 0.0),
        xytext=(0.03, 0.03),
        textcoords="axes fraction",
        fontsize=8.5,
        color=BLACK,
        arrowprops={"arrowstyle": "-", "color": PALE, "lw": 0.8},
        zorder=7,
    )
    centre = (before / np.linalg.norm(before) + after / np.linalg.norm(after)) * half / 2.7
    axes.set_xlim(centre[0] - half, centre[0] + half)
    axes.set_ylim(centre[1] - half, centre[1] + half)
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlabel("Along the incoming line (mm)")
    axes.set_ylabel("Across it (mm)")
    axes.set_title(
        "Largest distance to a vertex" + ("" if corner.sampled else "\n(dashed: between the samples)"),
        loc="left",
    )
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.yaxis.set_major_locator(MaxNLocator(5))


_MANY_MOVES = 2000
"""Moves above which the path is coloured by depth instead of drawn over the programmed lines."""
_MUCH_INK = 60.0
"""So many times across the picture, and the path is drawn as if it had many moves."""
_TOLD = 1.0 / 150.0
"""Share of the picture that two corners must be apart to be marked."""


class _Scene(NamedTuple):
    """What both pictures draw."""

    toolpath: Toolpath
    targets: Targets
    motion: Motion
    rapid: Bools
    """(m,)"""
    corner: Corner | None


def path_figure(toolpath: Toolpath, targets: Targets, motion: Motion) -> Figure:
    """Draw the commanded path from above, from the side, and its worst corner.

    The side view is XZ or YZ, whichever is larger, with Z stretched by a whole number where the part is
    flat. The zoom shows, in the plane of the corner, where the path misses a programmed vertex most, with
    the G-code line that ends there and the distance; without an approximated corner it is left out.

    A path of many moves is coloured by depth, the deepest on top, and drawn once more pass by pass with its
    speed as a share of the programmed feed, the slowest on top.

    Raises
    ------
    ValueError
        Where the motion has no sample.
    """
    need_samples(motion)
    rapid = ~np.isfinite(toolpath.feed_mm_s[np.clip(motion.move, 0, len(toolpath) - 1)])
    scene = _Scene(toolpath, targets, motion, rapid, worst_corner(targets, motion))
    across_mm = max(float(np.ptp(motion.position_mm, axis=0).max()), 1e-9)
    ink = float(motion.path_mm[-1] - motion.path_mm[0]) / across_mm
    many = len(np.unique(motion.move)) > _MANY_MOVES or ink > _MUCH_INK
    with look():
        figure = _of_maps(scene) if many and not rapid.all() else _of_lines(scene)
        figure.suptitle(title("Commanded path", toolpath))
    return figure


def _of_lines(scene: _Scene) -> Figure:
    """Draw the path over the programmed lines."""
    motion, corner = scene.motion, scene.corner
    programmed = _programmed_mm(scene.targets, motion)
    across_mm = float(np.ptp(motion.position_mm, axis=0).max())
    marked = corners_apart(motion.path_mm, motion.corner, motion.move, _TOLD * across_mm)
    side, stretch = side_columns(np.concatenate([programmed, motion.position_mm]))
    figure = Figure(figsize=(11.0, 7.0), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(1.75, 1.0), height_ratios=(2.2, 1.0))
    views = _views(figure, grid, side, stretch, corner)
    for axes, columns in views:
        _draw_path(axes, programmed[:, columns], motion.position_mm[:, columns], scene.rapid, marked)
        axes.set_xlabel(f"{'XYZ'[columns[0]]} (mm)")
        axes.set_ylabel(f"{'XYZ'[columns[1]]} (mm)")
    views[0][0].set_title("From above", loc="left")
    handles, labels = views[0][0].get_legend_handles_labels()
    if corner:
        _mark_corner(views, scene.targets, corner)
        draw_corner(figure.add_subplot(grid[0, 1]), corner, scene.targets, motion)
        room = figure.add_subplot(grid[1, 1])
        room.set_axis_off()
        room.legend(handles, labels, loc="upper left", borderaxespad=0.0)
    else:
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    return figure


def _of_maps(scene: _Scene) -> Figure:
    """Draw the path coloured by depth, and its passes coloured by speed."""
    motion, corner, position = scene.motion, scene.corner, scene.motion.position_mm
    feed = ~scene.rapid
    side, stretch = side_columns(position[near(position, feed)])
    passes = passes_of(position[:, 2], motion.tool, feed)
    heights = (
        height_in(position[near(position, feed)], 6.0, 2.8, 6.0),
        1.6,
        passes_height_in(position, passes),
    )
    figure = Figure(figsize=(11.0, sum(heights) + 1.6), layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=(1.75, 1.0), height_ratios=heights)
    z_mm = position[:, 2]
    depth = Shading(z_mm, feed, Normalize(z_mm[feed].min(), z_mm[feed].max()), "viridis", -1.0)
    views = _views(figure, grid, side, stretch, corner)
    for axes, columns in views:
        coloured = draw_map(axes, position, columns, depth, stretch if 2 in columns else 1.0)
        _mark_ends(axes, position[:, columns])
    views[0][0].set_title("From above, the deepest feed moves on top, rapids pale", loc="left")
    figure.colorbar(coloured, ax=[axes for axes, _ in views], label="Z of feed moves (mm)", aspect=40)
    if corner:
        _mark_corner(views, scene.targets, corner)
        draw_corner(figure.add_subplot(grid[0, 1]), corner, scene.targets, motion)
        room = figure.add_subplot(grid[1, 1])
        room.set_axis_off()
        room.legend(*views[0][0].get_legend_handles_labels(), loc="upper left", borderaxespad=0.0)
    _draw_speeds(figure, grid, scene, passes)
    return figure


def _draw_speeds(figure: Figure, grid: GridSpec, scene: _Scene, passes: list[Pass]) -> None:
    """Draw each pass coloured by its speed, with the time that it loses against the programmed feed."""
    share = speed_share(scene.toolpath, scene.motion)
    step_s = np.diff(scene.motion.time_s, append=scene.motion.time_s[-1:])
    lost_s = (1.0 - share / 100.0) * step_s
    words = [f"{lost_s[each.rows].sum():.1f} of {step_s[each.rows].sum():.1f} s lost" for each in passes]
    speed = Shading(share, ~scene.rapid, Normalize(0.0, 100.0), "viridis_r", -1.0)
    panels = draw_passes(figure, grid[2, :], scene.motion.position_mm, passes, speed, words)
    label = "Speed (% of the\nprogrammed feed)"
    figure.colorbar(panels[0].images[0], ax=panels, label=label, aspect=15)


def speed_share(toolpath: Toolpath, motion: Motion) -> Floats:
    """Return (m,) the speed in percent of the programmed feed, at most 100; 100 where there is none."""
    feed_mm_s = toolpath.feed_mm_s[np.clip(motion.move, 0, len(toolpath) - 1)]
    known = np.isfinite(feed_mm_s) & (feed_mm_s > 0.0)
    share = np.divide(motion.speed_mm_s, feed_mm_s, where=known, out=np.ones(len(motion)))
    shares: Floats = np.minimum(share, 1.0) * 100.0
    return shares


def _views(
    figure: Figure, grid: GridSpec, side: list[int], stretch: int, corner: Corner | None
) -> list[tuple[Axes, list[int]]]:
    """Return the axes from above and from the side, with the columns of the position that they show."""
    top = figure.add_subplot(grid[0, 0] if corner else grid[0, :])
    below = figure.add_subplot(grid[1, 0] if corner else grid[1, :])
    top.set_aspect("equal", adjustable="datalim")
    below.set_aspect(stretch, adjustable="datalim")
    below.set_title(side_title(stretch), loc="left")
    below.margins(y=0.15)
    below.yaxis.set_major_locator(MaxNLocator(5))
    return [(top, [0, 1]), (below, side)]


def _mark_corner(views: list[tuple[Axes, list[int]]], targets: Targets, corner: Corner) -> None:
    at = targets.position_mm[corner.target]
    for axes, columns in views:
        _mark(axes, at[columns], "o", ms=13, mfc="none", mec=VERMILION, mew=1.2, zorder=6)


def _mark_ends(axes: Axes, path: Floats) -> None:
    _mark(axes, path[0], "^", color=GREEN, mec=BLACK, mew=0.7, ms=8, zorder=5, label="start")
    _mark(axes, path[-1], "s", color=VERMILION, mec=BLACK, mew=0.7, ms=7, zorder=5, label="end")


def _mark(axes: Axes, at: Floats, marker: str, **style: Any) -> None:
    """Mark a place; as an artist it does not widen the view, so one outside is left out."""
    axes.add_artist(Line2D(at[:1], at[1:], ls="", marker=marker, **style))


def _programmed_mm(targets: Targets, motion: Motion) -> Floats:
    """Return (k, 3) the programmed vertices that the motion covers, with a NaN row where lines end."""
    planned = targets.move >= max(int(motion.move.min()), 0)
    points = targets.position_mm[planned]
    row = np.flatnonzero(planned)
    jump = (np.diff(row, prepend=row[:1]) > 1) | (targets.ptp | targets.home)[planned]
    jump[:1] = False
    return np.insert(points, np.flatnonzero(jump), np.nan, axis=0)


def _draw_path(axes: Axes, programmed: Floats, path: Floats, rapid: Bools, is_told: Bools) -> None:
    """Draw one plane view: programmed lines, path, corner samples, start and end."""
    axes.plot(*thin_path(programmed).T, color=GREY, lw=0.7, zorder=2, label="programmed lines")
    into_rapid = rapid & np.append(rapid[1:], True)  # the sample on the border belongs to both
    for mask, colour, label in (
        (~rapid, BLUE, "commanded path, feed"),
        (rapid, SKY, "commanded path, rapid"),
    ):
        if mask.any():
            shown = np.where((mask | (into_rapid != rapid))[:, None], path, np.nan)
            axes.plot(*thin_path(shown).T, color=colour, lw=1.2, zorder=3, label=label)
    if is_told.any():
        label = "samples in corners that can be told apart"
        axes.plot(*path[is_told].T, ".", color=ORANGE, ms=2.5, zorder=4, label=label)
    _mark_ends(axes, path)
