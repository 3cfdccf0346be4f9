"""The path with its corners, its kinematics over time and the joints, as matplotlib figures.

After figures 4 and 5 of Bigliardi et al. 2022. Needs no display; importing this module loads matplotlib, so
it is imported only where a figure is asked for.
"""

from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from gcode2krl.arrays import Bools, Floats, Ints32
from gcode2krl.files import make_folder, write_together
from gcode2krl.report.drawing import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PALE,
    SKY,
    VERMILION,
    Corner,
    intervals,
    line_ticks,
    lines_of,
    look,
    smooth,
    thin,
    thin_dots,
    thin_path,
    worst_corner,
)
from gcode2krl.tables import Joints, Motion, Targets, Toolpath
from gcode2krl.units import DEG_PER_RAD

_DPI = 150
_STRETCHES = (1, 2, 3, 4, 5, 7, 10, 15, 20, 30, 50, 70, 100, 200, 500, 1000)


def path_figure(toolpath: Toolpath, targets: Targets, motion: Motion) -> Figure:
    """Draw the commanded path over the programmed lines: from above, from the side, and its worst corner.

    The side view is XZ or YZ, whichever is larger, with Z stretched by a whole number where the part is
    flat. The zoom shows, in the plane of the corner, where the path misses a programmed vertex most, with
    the G-code line that ends there and the distance; without an approximated corner it is left out.

    Raises
    ------
    ValueError
        Where the motion has no sample.
    """
    _need_samples(motion)
    programmed = _programmed_mm(targets, motion)
    everything = np.concatenate([programmed, motion.position_mm])
    span = np.nanmax(everything, axis=0) - np.nanmin(everything, axis=0)
    side = 0 if span[0] >= span[1] else 1
    corner = worst_corner(targets, motion)
    with look():
        figure = Figure(figsize=(11.0, 7.0), layout="constrained")
        grid = figure.add_gridspec(2, 2, width_ratios=(1.75, 1.0), height_ratios=(2.2, 1.0))
        top = figure.add_subplot(grid[0, 0] if corner else grid[0, :])
        below = figure.add_subplot(grid[1, 0] if corner else grid[1, :])
        rapid = ~np.isfinite(toolpath.feed_mm_s[np.clip(motion.move, 0, len(toolpath) - 1)])
        for axes, columns in ((top, [0, 1]), (below, [side, 2])):
            _draw_path(axes, programmed[:, columns], motion.position_mm[:, columns], rapid, motion.corner)
            axes.set_xlabel(f"{'XYZ'[columns[0]]} (mm)")
            axes.set_ylabel(f"{'XYZ'[columns[1]]} (mm)")
        top.set_aspect("equal", adjustable="datalim")
        top.set_title("From above", loc="left")
        stretch = next((s for s in _STRETCHES if s * span[2] >= 0.24 * span[side]), _STRETCHES[-1])
        stretch = stretch if span[2] > 0.0 else 1
        below.set_aspect(stretch, adjustable="datalim")
        below.set_title(
            "From the side" + (f", Z drawn {stretch} times larger" if stretch > 1 else ""), loc="left"
        )
        below.margins(y=0.15)
        below.yaxis.set_major_locator(MaxNLocator(5))
        handles, labels = top.get_legend_handles_labels()
        if corner:
            at = targets.position_mm[corner.target]
            for axes, columns in ((top, [0, 1]), (below, [side, 2])):
                axes.plot(*at[columns], "o", ms=13, mfc="none", mec=VERMILION, mew=1.2, zorder=6)
            _draw_corner(figure.add_subplot(grid[0, 1]), corner, targets, motion)
            room = figure.add_subplot(grid[1, 1])
            room.set_axis_off()
            room.legend(handles, labels, loc="upper left", borderaxespad=0.0)
        else:
            figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
        figure.suptitle(_title("Commanded path", toolpath))
    return figure


def kinematics_figure(toolpath: Toolpath, motion: Motion) -> Figure:
    """Draw speed, acceleration and jerk of the tool tip over time, with the G-code lines along the top.

    The magnitudes are those of the table; the programmed feed is a thin step line (rapids have none) and
    approximated corners are shaded. Lines of any length keep their peaks.

    Raises
    ------
    ValueError
        Where the motion has no sample.
    """
    _need_samples(motion)
    line = lines_of(toolpath, motion)
    feed = toolpath.feed_mm_s[np.clip(motion.move, 0, len(toolpath) - 1)]
    panels = (
        ("Speed", "mm/s", motion.speed_mm_s),
        ("Acceleration", "mm/s²", motion.acceleration_mm_s2),
        ("Jerk", "mm/s³", motion.jerk_mm_s3),
    )
    with look():
        figure = Figure(figsize=(11.0, 7.5), layout="constrained")
        first = figure.add_subplot(3, 1, 1)
        rest = [figure.add_subplot(3, 1, number, sharex=first) for number in (2, 3)]
        bars, gap = intervals(motion.time_s, motion.corner)
        shade = "approximated corner" + (f" (drawn as one where closer than {gap:.2g} s)" if gap else "")
        for axes, (name, unit, values) in zip((first, *rest), panels, strict=True):
            _shade(axes, bars, ORANGE, shade)
            if name == "Speed":
                _programmed_feed(axes, motion.time_s, feed)
            axes.plot(*thin(motion.time_s, values), color=BLUE, lw=1.1, label="commanded")
            axes.set_ylabel(f"{name} ({unit})")
            axes.set_ylim(bottom=0.0)
            axes.grid(axis="y", color=PALE, lw=0.4)
            if np.isfinite(values).any():
                present = np.where(np.isfinite(values), values, -np.inf)
                peak = int(np.argmax(present >= present.max() * (1.0 - 1e-6)))  # where a plateau begins
                where = f", line {line[peak]}" if line[peak] > 0 else ""
                axes.set_title(
                    f"largest {_number(values[peak])} {unit} at {motion.time_s[peak]:.2f} s{where}",
                    loc="right",
                    fontsize=8,
                    color=GREY,
                )
        for axes in (first, rest[0]):
            axes.tick_params(labelbottom=False)
        rest[1].set_xlabel("Time (s)")
        _time_limits(first, motion)
        _line_axis(first, motion, line)
        handles, labels = first.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
        figure.suptitle(_title("Speed, acceleration and jerk of the tool tip", toolpath))
    return figure


def joints_figure(
    motion: Motion,
    joints: Joints,
    limits_deg: Floats | None = None,
    speed_limits_deg_s: Floats | None = None,
) -> Figure:
    """Draw the six joint angles over time, their speeds as a fraction of the limit, margin and conditioning.

    A limit is drawn where it lies in or near the range of the joint; otherwise its distance is noted above
    the panel. Stretches out of reach (NaN) are shaded. The speed row is left out without speed limits.

    Parameters
    ----------
    motion, joints : Motion, Joints
        Tables of the same rows.
    limits_deg : (6, 2) array or None
        Lowest and highest angle of each joint.
    speed_limits_deg_s : (6,) array or None
        Speed limit of each joint.

    Raises
    ------
    ValueError
        Where the motion has no sample or the tables differ in length.
    """
    _need_samples(motion)
    if len(joints) != len(motion):
        raise ValueError(f"joints have {len(joints)} rows, the motion {len(motion)}")
    time = motion.time_s
    q_deg = joints.q_rad * DEG_PER_RAD
    unreached: Bools = np.logical_not(np.isfinite(joints.q_rad).all(axis=1))
    lost, _ = intervals(time, unreached)
    share = None
    if speed_limits_deg_s is not None:
        share = (
            np.abs(joints.qd_rad_s) * DEG_PER_RAD / np.asarray(speed_limits_deg_s, dtype=np.float64) * 100.0
        )
    with look():
        figure = Figure(figsize=(11.0, 9.0 if share is not None else 7.0), layout="constrained")
        heights = (3.0, 1.3, 3.0, 1.3, 2.4) if share is not None else (3.0, 3.0, 2.4)
        grid = figure.add_gridspec(len(heights), 6, height_ratios=heights)
        shared: Axes | None = None
        for joint in range(6):
            columns = slice(2 * (joint % 3), 2 * (joint % 3) + 2)
            row = joint // 3 * (2 if share is not None else 1)
            angle = figure.add_subplot(grid[row, columns], sharex=shared)
            shared = shared or angle
            _shade(angle, lost, VERMILION, "out of reach")
            angle.plot(*thin(time, q_deg[:, joint]), color=BLUE, lw=1.1, label="joint angle")
            angle.set_title(f"A{joint + 1}", loc="left", fontweight="bold")
            limit = None if limits_deg is None else np.asarray(limits_deg, dtype=np.float64)[joint]
            _angle_limits(angle, q_deg[:, joint], limit)
            if joint % 3 == 0:
                angle.set_ylabel("Angle (°)")
            if share is not None:
                angle.tick_params(labelbottom=False)
                speed = figure.add_subplot(grid[row + 1, columns], sharex=shared)
                _shade(speed, lost, VERMILION, "out of reach")
                _speed_share(speed, time, share, joint)
        margin = figure.add_subplot(grid[-1, :3], sharex=shared)
        sigma = figure.add_subplot(grid[-1, 3:], sharex=shared)
        _shade(margin, lost, VERMILION, "out of reach")
        _shade(sigma, lost, VERMILION, "out of reach")
        _lowest(margin, time, joints.limit_margin_rad * DEG_PER_RAD, "°")
        margin.set_title("To the nearest joint limit", loc="left", fontweight="bold")
        margin.set_ylabel("Margin (°)")
        _lowest(sigma, time, joints.sigma_min, "")
        sigma.set_title("Distance from a singularity", loc="left", fontweight="bold")
        sigma.set_ylabel("$\\sigma_{min}$ (translations in m)")
        sigma.set_ylim(bottom=0.0)
        margin.set_xlabel("Time (s)")
        sigma.set_xlabel("Time (s)")
        _time_limits(margin, motion)
        entries = {}
        for axes in figure.axes:
            axes.xaxis.set_major_locator(MaxNLocator(6))
            handles, labels = axes.get_legend_handles_labels()
            entries.update(dict(zip(labels, handles, strict=True)))
        figure.legend(entries.values(), entries.keys(), loc="outside lower center", ncols=len(entries))
        figure.suptitle("Joints along the path")
    return figure


def save_figures(
    figures: Mapping[str, Figure], folder: Path, inputs: Iterable[str | Path] = ()
) -> list[Path]:
    """Write each figure as ``<name>.png`` at 150 dpi and return the paths, in the order of ``figures``.

    The folder is made if its parent exists. The same figures give the same bytes: no date is written.
    ``inputs`` are never overwritten.
    """
    make_folder(folder)
    files = {
        folder / f"{name}.png": partial(figure.savefig, format="png", dpi=_DPI, metadata={"Software": None})
        for name, figure in figures.items()
    }
    with look():
        write_together(files, inputs)
    return list(files)


def _need_samples(motion: Motion) -> None:
    if not len(motion):
        raise ValueError("the motion has no sample: nothing to draw")


def _title(what: str, toolpath: Toolpath) -> str:
    return f"{what}: {Path(toolpath.source).name}" if toolpath.source else what


def _programmed_mm(targets: Targets, motion: Motion) -> Floats:
    """Return (k, 3) the programmed vertices that the motion covers, with a NaN row where lines end."""
    planned = targets.move >= max(int(motion.move.min()), 0)
    points = targets.position_mm[planned]
    row = np.flatnonzero(planned)
    jump = (np.diff(row, prepend=row[:1]) > 1) | (targets.ptp | targets.home)[planned]
    jump[:1] = False
    return np.insert(points, np.flatnonzero(jump), np.nan, axis=0)


def _draw_path(axes: Axes, programmed: Floats, path: Floats, rapid: Bools, corner: Bools) -> None:
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
    if corner.any():
        dots = thin_dots(path[corner])
        axes.plot(
            *dots.T,
            ".",
            color=ORANGE,
            ms=2.5 if len(dots) < 2000 else 1.2,
            zorder=4,
            label="samples in approximated corners",
        )
    axes.plot(*path[0], "^", color=GREEN, mec=BLACK, mew=0.7, ms=8, zorder=5, label="start")
    axes.plot(*path[-1], "s", color=VERMILION, mec=BLACK, mew=0.7, ms=7, zorder=5, label="end")


def _draw_corner(axes: Axes, corner: Corner, targets: Targets, motion: Motion) -> None:
    """Draw the worst corner in its own plane, true to scale, with the vertex at 0, 0."""
    vertex = targets.position_mm[corner.target]
    plane = np.stack([corner.along, corner.across], axis=1)
    before, after = ((targets.position_mm[corner.target + step] - vertex) @ plane for step in (-1, 1))
    half = min(1.35 * corner.reach_mm, 8.0 * corner.distance_mm)
    near = np.flatnonzero(np.linalg.norm(motion.position_mm - vertex, axis=1) <= 3.0 * corner.reach_mm)
    beside = (
        np.abs((motion.position_mm[near] - vertex) @ np.cross(corner.along, corner.across)) <= corner.reach_mm
    )
    near = near[beside & np.isin(motion.move[near], targets.move[corner.target : corner.target + 2])]
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
        f"{end}\n{_length(corner.distance_mm)} mm from the path",
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


def _number(value: float) -> str:
    return f"{value:,.0f}" if abs(value) >= 1000.0 else f"{value:.4g}"


def _length(value_mm: float) -> str:
    return f"{value_mm:.4f}" if value_mm < 0.01 else f"{value_mm:.3f}"


def _shade(axes: Axes, bars: list[tuple[float, float]], colour: str, label: str) -> None:
    """Shade intervals of time over the full height."""
    if bars:
        axes.broken_barh(
            bars,
            (0.0, 1.0),
            transform=axes.get_xaxis_transform(),
            color=colour,
            alpha=0.3,
            lw=0.3,
            zorder=0,
            label=label,
        )


def _time_limits(axes: Axes, motion: Motion) -> None:
    start, end = float(motion.time_s[0]), float(motion.time_s[-1])
    axes.set_xlim(start, end if end > start else start + 1.0)


def _line_axis(axes: Axes, motion: Motion, line: Ints32) -> None:
    """Put G-code lines along the top, each where it begins."""
    upper = axes.secondary_xaxis("top")
    times, labels = line_ticks(motion.time_s, line)
    upper.set_xticks(times, labels=labels)
    upper.set_xlabel("G-code line, where it begins")


def _programmed_feed(axes: Axes, time_s: Floats, feed_mm_s: Floats) -> None:
    """Draw the programmed feed as steps: dashed over the speed, or pale behind it where it changes often."""
    often = np.count_nonzero(np.diff(feed_mm_s[np.isfinite(feed_mm_s)])) > 100
    dashes: dict[str, Any] = (
        {"color": GREY, "lw": 0.5} if often else {"color": BLACK, "lw": 0.8, "ls": (0, (4, 3)), "zorder": 3}
    )
    axes.plot(*thin(time_s, feed_mm_s), drawstyle="steps-post", label="programmed feed", **dashes)


def _angle_limits(axes: Axes, angle_deg: Floats, limit: Floats | None) -> None:
    """Draw the joint's limits where they are near its range; note their distance otherwise."""
    present = angle_deg[np.isfinite(angle_deg)]
    if not len(present):
        axes.set_title("out of reach", loc="right", fontsize=8, color=VERMILION)
        axes.set_yticks([])
        return
    low, high = float(present.min()), float(present.max())
    room = max(0.25 * (high - low), 5.0)
    shown = [low, high]
    if limit is not None:
        margin = min(low - limit[0], limit[1] - high)
        for value in limit:
            if low - room <= value <= high + room:
                axes.axhline(value, color=VERMILION, lw=1.2, ls="--", label="limit")
                shown.append(float(value))
        text = f"limit {margin:.0f}° away" if margin >= 0.0 else f"beyond its limit by {-margin:.1f}°"
        axes.set_title(text, loc="right", fontsize=8, color=GREY if margin >= 0.0 else VERMILION)
    pad = max(0.08 * (max(shown) - min(shown)), 0.5)
    axes.set_ylim(min(shown) - pad, max(shown) + pad)
    axes.yaxis.set_major_locator(MaxNLocator(5))


def _speed_share(axes: Axes, time_s: Floats, share: Floats, joint: int) -> None:
    """Draw a joint's speed in percent of its limit, on a common scale for all six."""
    present = share[np.isfinite(share)]
    largest = float(present.max()) if len(present) else 0.0
    axes.plot(*thin(time_s, share[:, joint]), color=GREEN, lw=1.0, label="joint speed")
    axes.set_ylim(0.0, max(1.15 * largest, 1.0))
    if largest >= 70.0:
        axes.set_ylim(0.0, max(1.15 * largest, 115.0))
        axes.axhline(100.0, color=VERMILION, lw=1.2, ls="--", label="limit")
    axes.yaxis.set_major_locator(MaxNLocator(3))
    if joint % 3 == 0:
        axes.set_ylabel("Speed\n(% of limit)")


def _lowest(axes: Axes, time_s: Floats, values: Floats, unit: str) -> None:
    """Draw a quantity whose smallest value matters, and note that."""
    axes.plot(*thin(time_s, values), color=BLUE, lw=1.1)
    present = np.isfinite(values)
    if present.any():
        row = int(np.nanargmin(np.where(present, values, np.nan)))
        axes.set_title(
            f"smallest {values[row]:.3g}{unit} at {time_s[row]:.2f} s", loc="right", fontsize=8, color=GREY
        )
        if values[row] < 0.0 < np.max(values[present]) or -1.0 < values[row] < 1.0:
            axes.axhline(0.0, color=VERMILION, lw=1.0, ls="--", label="limit" if unit else None)
    axes.yaxis.set_major_locator(MaxNLocator(5))
