"""Cutting forces and deflection as matplotlib figures: over time, and as colour on the path.

Needs no display; importing this module loads matplotlib, so it is imported only where a figure is asked for.
"""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from gcode2krl.arrays import Floats, Ints32
from gcode2krl.report.drawing import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PALE,
    SKY,
    VERMILION,
    line_ticks,
    lines_of,
    look,
    thin,
)
from gcode2krl.tables import Deflection, Forces, Motion, Toolpath
from gcode2krl.units import DEG_PER_RAD

_MOST_SEGMENTS = 40_000
_AXES = ((BLUE, "x"), (ORANGE, "y"), (GREEN, "z"))
_LINKS = (BLUE, SKY, ORANGE, VERMILION, GREEN, "#CC79A7", "#F0E442", GREY, BLACK, PALE)


def force_figure(toolpath: Toolpath, motion: Motion, forces: Forces) -> Figure:
    """Draw force, depth and width of cut and engagement over time, with the G-code lines along the top.

    The band is the 90 % band of the coefficients. Engagement arcs are drawn as the angles that they cover.
    """
    line = lines_of(toolpath, motion)
    size = np.linalg.norm(forces.force_base_N, axis=1)
    with look():
        figure = Figure(figsize=(11.0, 8.5), layout="constrained")
        first, cut, arcs = figure.subplots(3, 1, sharex=True, height_ratios=(1.6, 1.0, 1.0))
        _band(first, motion.time_s, size, forces.relative_band)
        first.plot(*thin(motion.time_s, forces.peak_N), color=PALE, lw=0.8, label="peak of a revolution")
        first.plot(*thin(motion.time_s, size), color=BLACK, lw=1.2, label="mean of a revolution")
        for axis, (colour, name) in enumerate(_AXES):
            label = f"{name} in $BASE"
            first.plot(*thin(motion.time_s, forces.force_base_N[:, axis]), color=colour, lw=0.8, label=label)
        first.set_ylabel("Force on the tool (N)")
        _largest(first, size, motion, line, "N")
        cut.plot(*thin(motion.time_s, forces.a_p_mm), color=BLUE, lw=1.0, label="depth $a_p$")
        cut.plot(*thin(motion.time_s, forces.a_e_mm), color=ORANGE, lw=1.0, label="width $a_e$")
        cut.set_ylabel("Cut (mm)")
        _draw_arcs(arcs, motion.time_s, forces.phi_rad)
        arcs.set_xlabel("Time (s)")
        _finish(figure, (first, cut, arcs), motion, line, "Cutting force and engagement")
    return figure


def deflection_figure(toolpath: Toolpath, motion: Motion, deflection: Deflection) -> Figure:
    """Draw the deflection of the tool tip over time: its size with the 90 % band, and its components."""
    line = lines_of(toolpath, motion)
    size = np.linalg.norm(deflection.deflection_base_mm, axis=1)
    normal = np.linalg.norm(deflection.correction_base_mm, axis=1)
    with look():
        figure = Figure(figsize=(11.0, 6.5), layout="constrained")
        first, parts = figure.subplots(2, 1, sharex=True, height_ratios=(1.3, 1.0))
        _band(first, motion.time_s, size, deflection.relative_band)
        first.plot(*thin(motion.time_s, size), color=BLACK, lw=1.2, label="deflection")
        label = "normal to the feed: what a correction removes"
        first.plot(*thin(motion.time_s, normal), color=VERMILION, lw=1.0, label=label)
        first.set_ylabel("Deflection (mm)")
        _largest(first, size, motion, line, "mm")
        for axis, (colour, name) in enumerate(_AXES):
            values = deflection.deflection_base_mm[:, axis]
            parts.plot(*thin(motion.time_s, values), color=colour, lw=1.0, label=f"{name} in $BASE")
        parts.axhline(0.0, color=PALE, lw=0.6, zorder=0)
        parts.set_ylabel("Components (mm)")
        parts.set_xlabel("Time (s)")
        _finish(figure, (first, parts), motion, line, "Deflection of the tool tip")
    return figure


def share_figure(toolpath: Toolpath, motion: Motion, names: Sequence[str], share_mm: Floats) -> Figure:
    """Draw how much of the deflection each virtual joint causes.

    Parameters
    ----------
    names : the virtual joints, j of them.
    share_mm : (m, j) part of the deflection that each joint causes, along the whole deflection.
    """
    line = lines_of(toolpath, motion)
    rows = np.linspace(0, len(motion) - 1, min(len(motion), 3000)).astype(np.int64)
    with look():
        figure = Figure(figsize=(11.0, 5.0), layout="constrained")
        axes = figure.subplots()
        stacked = np.maximum(share_mm[rows], 0.0).T
        axes.stackplot(motion.time_s[rows], stacked, labels=names, colors=_LINKS[: len(names)], lw=0.0)
        axes.set_ylabel("Part of the deflection (mm)")
        axes.set_xlabel("Time (s)")
        worst = int(np.argmax(share_mm.sum(axis=1)))
        total = share_mm[worst].sum()
        if total > 0.0:
            most = int(np.argmax(share_mm[worst]))
            words = f"where it bends most, {names[most]} is {share_mm[worst, most] / total:.0%} of it"
            axes.set_title(words, loc="right", fontsize=8, color=GREY)
        _finish(figure, (axes,), motion, line, "Which joint bends")
    return figure


def coloured_path_figure(motion: Motion, values: Floats, label: str, title: str) -> Figure:
    """Draw the path from above and from the side, coloured by a quantity (m,); what is zero stays pale."""
    step = max(1, len(motion) // _MOST_SEGMENTS)
    points, shade = motion.position_mm[::step], _kept_peaks(values, step)
    span = np.ptp(points, axis=0)
    side = 0 if span[0] >= span[1] else 1
    with look():
        figure = Figure(figsize=(11.0, 7.0), layout="constrained")
        top, below = figure.subplots(2, 1, height_ratios=(2.4, 1.0))
        for axes, columns in ((top, [0, 1]), (below, [side, 2])):
            flat = points[:, columns]
            segments = np.stack([flat[:-1], flat[1:]], axis=1)
            moving = shade[1:] > 0.0
            axes.add_collection(LineCollection(list(segments[~moving]), colors=PALE, linewidths=0.6))
            coloured = LineCollection(list(segments[moving]), cmap="viridis", linewidths=1.8, zorder=3)
            coloured.set_array(shade[1:][moving])
            coloured.set_clim(0.0, max(float(shade.max(initial=0.0)), 1e-12))
            axes.add_collection(coloured)
            axes.autoscale_view()
            axes.set_xlabel(f"{'XYZ'[columns[0]]} (mm)")
            axes.set_ylabel(f"{'XYZ'[columns[1]]} (mm)")
        top.set_aspect("equal", adjustable="datalim")
        below.margins(y=0.15)
        figure.colorbar(coloured, ax=[top, below], label=label, aspect=40)
        figure.suptitle(title)
    return figure


def _kept_peaks(values: Floats, step: int) -> Floats:
    """Return every ``step``-th value, each the largest of its stretch."""
    if step == 1:
        return values
    padded = np.append(values, np.zeros(-len(values) % step))
    peaks: Floats = padded.reshape(-1, step).max(axis=1)
    return peaks


def _band(axes: Axes, time_s: Floats, size: Floats, relative_band: float) -> None:
    if relative_band <= 0.0:
        return
    time, low = thin(time_s, size * (1.0 - relative_band))
    _, high = thin(time_s, size * (1.0 + relative_band))
    axes.fill_between(time, low, high, color=SKY, alpha=0.35, lw=0.0, label=f"90 %: ± {relative_band:.0%}")


def _draw_arcs(axes: Axes, time_s: Floats, phi_rad: Floats) -> None:
    for pair in range(phi_rad.shape[1] // 2):
        entry, leave = (phi_rad[:, 2 * pair + end] * DEG_PER_RAD for end in (0, 1))
        if np.isfinite(entry).any():
            rows = np.linspace(0, len(time_s) - 1, min(len(time_s), 6000)).astype(np.int64)
            label = "engaged" if pair == 0 else None
            axes.fill_between(
                time_s[rows], entry[rows], leave[rows], color=GREEN, alpha=0.5, lw=0.0, label=label
            )
    axes.set_ylabel("Angle from the\nfeed normal (°)")
    axes.set_ylim(0.0, 180.0)
    axes.set_yticks([0, 90, 180])


def _largest(axes: Axes, size: Floats, motion: Motion, line: Ints32, unit: str) -> None:
    if not np.isfinite(size).any():
        return
    row = int(np.nanargmax(size))
    where = f", line {line[row]}" if line[row] > 0 else ""
    words = f"largest {size[row]:.4g} {unit} at {motion.time_s[row]:.2f} s{where}"
    axes.set_title(words, loc="right", fontsize=8, color=GREY)


def _finish(figure: Figure, panels: Sequence[Axes], motion: Motion, line: Ints32, title: str) -> None:
    """Give all panels the time axis, the first one the G-code lines, and the figure its legend."""
    start, end = float(motion.time_s[0]), float(motion.time_s[-1])
    panels[0].set_xlim(start, end if end > start else start + 1.0)
    upper = panels[0].secondary_xaxis("top")
    times, labels = line_ticks(motion.time_s, line)
    upper.set_xticks(times, labels=labels)
    upper.set_xlabel("G-code line, where it begins")
    for axes in panels:
        axes.grid(axis="y", color=PALE, lw=0.4)
        if axes.get_legend_handles_labels()[0]:
            axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    figure.suptitle(title)
