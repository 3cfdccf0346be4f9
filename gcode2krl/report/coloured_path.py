"""A quantity as colour on the path as a matplotlib figure: the worst on top, each pass beside the others."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from gcode2krl.arrays import Floats
from gcode2krl.report.drawing import BLACK, VERMILION, look, need_samples, number
from gcode2krl.report.drawing import title as titled
from gcode2krl.report.maps import (
    Shading,
    draw_map,
    draw_passes,
    height_in,
    hide_each_other,
    near,
    passes_height_in,
    side_columns,
    side_title,
)
from gcode2krl.report.passes import passes_of
from gcode2krl.report.signals import Clock
from gcode2krl.report.span import span_of
from gcode2krl.report.worst_places import worst_rows
from gcode2krl.tables import Motion, Toolpath

_WIDTH_IN, _LOWEST_IN, _HIGHEST_IN = 8.8, 1.8, 7.5
"""Width of the view from above in inches, and the range of its height."""
_OFFSETS = ((11, 11), (11, -11), (-11, 11))
"""Where the number stands beside its place, in points: places may lie over each other."""


def coloured_path_figure(
    toolpath: Toolpath, motion: Motion, values: Floats, label: str, title: str
) -> Figure:
    """Draw the path from above and from the side, coloured by a quantity (m,); what is zero stays pale.

    Where the path passes a place more than once the largest value is seen. Passes of other tools or at
    other depths that cover each other are drawn once more in small maps. The worst places are numbered.
    """
    need_samples(motion)
    clock = Clock.of(toolpath, motion)
    position = motion.position_mm
    span = span_of(clock.columns, values)
    top_value = span.high if span.cut_high else float(np.max(values, initial=0.0))
    cuts = values > 0.0
    shading = Shading(values, cuts, Normalize(0.0, top_value or 1.0), "viridis")
    passes = passes_of(position[:, 2], motion.tool, cuts)
    several = hide_each_other(position, passes)
    shown = position[near(position, cuts)]
    side, stretch = side_columns(shown)
    with look():
        heights = [height_in(shown, _WIDTH_IN, _LOWEST_IN, _HIGHEST_IN), 1.8]
        heights += [passes_height_in(position, passes)] if several else []
        figure = Figure(figsize=(11.0, sum(heights) + 1.2), layout="constrained")
        grid = figure.add_gridspec(len(heights), 1, height_ratios=heights)
        top, below = figure.add_subplot(grid[0]), figure.add_subplot(grid[1])
        coloured = draw_map(top, position, [0, 1], shading, 1.0)
        draw_map(below, position, side, shading, stretch)
        if several:
            words = [f"worst {values[each.rows].max():.3g}" for each in passes]
            draw_passes(figure, grid[2], position, passes, shading, words)
        top.set_title("From above, the largest value on top", loc="left")
        below.set_title(side_title(stretch), loc="left")
        _number_worst(top, clock, position, values, label)
        extend = "max" if span.cut_high else "neither"
        figure.colorbar(coloured, ax=[top, below], label=label, aspect=40, extend=extend)
        figure.suptitle(titled(title, toolpath))
    return figure


def _number_worst(axes: Axes, clock: Clock, position_mm: Floats, values: Floats, label: str) -> None:
    """Number the worst places, with value and line over the panel."""
    rows = worst_rows(clock.time_s, values)
    words = []
    for place, row in enumerate(rows, start=1):
        axes.annotate(
            str(place),
            (position_mm[row, 0], position_mm[row, 1]),
            xytext=_OFFSETS[place - 1],
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=7.5,
            color=BLACK,
            bbox={"boxstyle": "circle,pad=0.15", "fc": "white", "ec": VERMILION, "lw": 0.9},
            arrowprops={"arrowstyle": "-", "color": VERMILION, "lw": 0.9, "shrinkB": 0.0},
            zorder=9,
        )
        line = f"line {clock.line[row]}" if clock.line[row] > 0 else f"{clock.time_s[row]:.2f} s"
        words.append(f"{place}: {number(values[row])} at {line}")
    if words:
        axes.set_title(f"worst {label}  " + ",  ".join(words), loc="right", fontsize=8)
