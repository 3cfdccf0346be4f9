"""The worst corner in its own plane, enlarged."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from gcode2krl.report.corner_search import Corner, smooth
from gcode2krl.report.drawing import BLACK, BLUE, GREY, ORANGE, PALE, VERMILION, length, thin_path
from gcode2krl.tables import Motion, Targets


def draw_corner(axes: Axes, corner: Corner, targets: Targets, motion: Motion) -> None:
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
