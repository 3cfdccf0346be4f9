"""Deflection of the tool tip over time, and which joint causes it, as matplotlib figures."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gcode2krl.arrays import Floats
from gcode2krl.report.drawing import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PALE,
    SKY,
    VERMILION,
    look,
    need_samples,
    thin,
    title,
)
from gcode2krl.report.enlarged import Trace, enlarge_places, number_places
from gcode2krl.report.loads import (
    AXES,
    draw_components,
    draw_confidence,
    finish,
    is_hatch,
)
from gcode2krl.report.signals import Clock, name_largest, panel
from gcode2krl.report.span import span_of
from gcode2krl.report.worst_places import worst_rows
from gcode2krl.tables import Deflection, Motion, Toolpath

_LINKS = (BLUE, SKY, ORANGE, VERMILION, GREEN, "#CC79A7", "#F0E442", GREY, BLACK, PALE)
_NORMAL = "normal to the feed: what a correction removes"


def deflection_figure(toolpath: Toolpath, motion: Motion, deflection: Deflection) -> Figure:
    """Draw the deflection of the tool tip over time: its size with the 90 % band, and its components.

    Where lines would fill the picture, each quantity is a band in a panel of its own, and the largest
    deflections are enlarged below.
    """
    need_samples(motion)
    clock = Clock.of(toolpath, motion)
    size_mm = np.linalg.norm(deflection.deflection_base_mm, axis=1)
    normal_mm = np.linalg.norm(deflection.correction_base_mm, axis=1)
    with look():
        draw = _of_bands if is_hatch(clock.columns, deflection.deflection_base_mm) else _of_lines
        figure, panels = draw(clock, deflection, size_mm, normal_mm)
        finish(figure, panels, clock, title("Deflection of the tool tip", toolpath))
    return figure


def _of_lines(
    clock: Clock, deflection: Deflection, size_mm: Floats, normal_mm: Floats
) -> tuple[Figure, list[Axes]]:
    """Draw size and part normal to the feed in one panel, the components in another."""
    figure = Figure(figsize=(11.0, 6.5), layout="constrained")
    panels = list(figure.subplots(2, 1, sharex=True, height_ratios=(1.3, 1.0)))
    first, parts = panels
    draw_confidence(first, clock.time_s, size_mm, deflection.relative_band)
    first.plot(*thin(clock.time_s, size_mm), color=BLACK, lw=1.2, label="deflection")
    first.plot(*thin(clock.time_s, normal_mm), color=VERMILION, lw=1.0, label=_NORMAL)
    first.set_ylabel("Deflection (mm)")
    whole = span_of(clock.columns, size_mm, float(size_mm.max(initial=0.0)))
    name_largest(first, clock, size_mm, whole, "mm")
    for axis, (colour, name) in enumerate(AXES):
        values = deflection.deflection_base_mm[:, axis]
        parts.plot(*thin(clock.time_s, values), color=colour, lw=1.0, label=f"{name} in $BASE")
    parts.axhline(0.0, color=PALE, lw=0.6, zorder=0)
    parts.set_ylabel("Components (mm)")
    return figure, panels


def _of_bands(
    clock: Clock, deflection: Deflection, size_mm: Floats, normal_mm: Floats
) -> tuple[Figure, list[Axes]]:
    """Draw each quantity as a band in its own panel, and the three largest deflections sample by sample."""
    figure = Figure(figsize=(11.0, 11.0), layout="constrained")
    heights = (1.5, 1.0, 0.7, 0.7, 0.7, 1.5)
    grid = figure.add_gridspec(len(heights), 1, height_ratios=heights)
    first = figure.add_subplot(grid[0])
    panels = [first, *(figure.add_subplot(grid[row], sharex=first) for row in range(1, 5))]
    largest = float(size_mm.max(initial=0.0))
    panel(first, clock, size_mm, "mm", BLACK, "deflection", largest)
    first.set_ylabel("Deflection (mm)")
    words = f"90 % of forces and stiffness: ± {deflection.relative_band:.0%} (not drawn)"
    first.set_title(words, loc="left", fontsize=8)
    panel(panels[1], clock, normal_mm, "mm", VERMILION, "normal to the feed", largest)
    panels[1].set_ylabel("Normal to the\nfeed (mm)")
    draw_components(panels[2:], clock, deflection.deflection_base_mm, "mm")
    rows = worst_rows(clock.time_s, size_mm)
    number_places(first, clock, size_mm, rows, span_of(clock.columns, size_mm, largest))
    traces = (Trace(size_mm, BLACK, "deflection"), Trace(normal_mm, VERMILION, _NORMAL))
    enlarge_places(figure, grid[5], clock, rows, traces, "mm")
    return figure, panels


def share_figure(toolpath: Toolpath, motion: Motion, names: Sequence[str], share_mm: Floats) -> Figure:
    """Draw how much of the deflection each virtual joint causes, where each stretch of time bends most.

    Parameters
    ----------
    names : the virtual joints, j of them.
    share_mm : (m, j) part of the deflection that each joint causes, along the whole deflection.
    """
    need_samples(motion)
    clock = Clock.of(toolpath, motion)
    total_mm = share_mm.sum(axis=1)
    rows = clock.columns.highest_rows(total_mm)
    step = "mid" if len(rows) < len(motion) else None
    with look():
        figure = Figure(figsize=(11.0, 5.0), layout="constrained")
        axes = figure.subplots()
        stacked = np.maximum(share_mm[rows], 0.0).T
        colours = _LINKS[: len(names)]
        axes.stackplot(clock.time_s[rows], stacked, labels=names, colors=colours, lw=0.0, step=step)
        axes.set_ylabel("Part of the deflection (mm)")
        worst = int(np.argmax(total_mm))
        if total_mm[worst] > 0.0:
            most = int(np.argmax(share_mm[worst]))
            share = f"{names[most]} is {share_mm[worst, most] / total_mm[worst]:.0%} of it"
            words = f"where it bends most, {clock.place(worst)}, {share}"
            axes.set_title(words, loc="right", fontsize=8, color=GREY)
        if step:
            words = f"largest deflection of every {np.diff(clock.columns.edge_s[:2])[0]:.2g} s"
            axes.set_title(words, loc="left", fontsize=8, color=GREY)
        finish(figure, (axes,), clock, title("Which joint bends", toolpath))
    return figure
