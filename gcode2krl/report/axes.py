"""Tip and tool axis as a matplotlib figure: a person sees at a glance where the tool comes from."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from gcode2krl.arrays import Bools, Floats
from gcode2krl.report.drawing import BLACK, BLUE, GREY, ORANGE, SKY, VERMILION, look, title
from gcode2krl.report.tool_axes import drawn_tools
from gcode2krl.tables import Toolpath

_VIEWS = ((0, 1, "From above"), (0, 2, "From the front"), (1, 2, "From the right"))
_TOOL_WIDTH = 0.9

Box = tuple[tuple[float, float, float], tuple[float, float, float]]


def axes_figure(toolpath: Toolpath, stock_mm: Box | None, table_mm: float | None) -> Figure:
    """Draw the tips of a Toolpath in three views, with the tool from tip towards holder as a short line.

    ``stock_mm`` are the corners of the raw part, ``table_mm`` the height of the table, each None where it is
    not stated. A tool whose axis points below the horizon is red.
    """
    tools = drawn_tools(toolpath)
    tips = toolpath.position_mm
    with look():
        figure = Figure(figsize=(12.0, 5.2), layout="constrained")
        for at, (across, up, name) in enumerate(_VIEWS, start=1):
            axes = figure.add_subplot(1, 3, at)
            _draw_place(axes, across, up, stock_mm, table_mm)
            _draw_tips(axes, tips[:, [across, up]], tools.has_place, tools.is_feed)
            lines = tools.ends_mm[:, :, [across, up]]
            colours = np.where(toolpath.axis[tools.rows, 2] < -1e-6, VERMILION, ORANGE)
            axes.add_collection(LineCollection(list(lines), colors=colours, linewidths=_TOOL_WIDTH, zorder=4))
            axes.plot(*lines[:, 0].T, ".", color=BLACK, ms=2.5, zorder=5, label="tips of the tools drawn")
            axes.plot([], [], color=ORANGE, lw=_TOOL_WIDTH, label="tool, from tip towards holder")
            axes.update_datalim(lines.reshape(-1, 2))
            axes.autoscale_view()
            axes.set_aspect("equal", adjustable="datalim")
            axes.set_xlabel(f"{'XYZ'[across]} (mm)")
            axes.set_ylabel(f"{'XYZ'[up]} (mm)")
            axes.set_title(name, loc="left")
        handles, labels = axes.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
        figure.suptitle(title("Tip and tool axis", toolpath))
    return figure


def _draw_place(axes: Axes, across: int, up: int, stock_mm: Box | None, table_mm: float | None) -> None:
    if stock_mm is not None:
        low, high = np.array(stock_mm)
        size = high - low
        corner = (float(low[across]), float(low[up]))
        axes.add_patch(
            Rectangle(
                corner,
                float(size[across]),
                float(size[up]),
                fc="0.95",
                ec=GREY,
                lw=1.0,
                label="stock",
                zorder=1,
            )
        )
    if table_mm is not None and up == 2:
        axes.axhline(table_mm, color=BLACK, lw=1.2, label="table", zorder=1)


def _draw_tips(axes: Axes, tips: Floats, place: Bools, feed: Bools) -> None:
    """Draw the ways of the tip: a move is drawn from the row before it."""
    way = np.stack([tips[:-1], tips[1:]], axis=1)
    drawn = place[1:] & place[:-1]
    for mask, colour, name in ((drawn & ~feed[1:], SKY, "rapid"), (drawn & feed[1:], BLUE, "feed")):
        if mask.any():
            axes.add_collection(
                LineCollection(list(way[mask]), colors=colour, linewidths=0.7, zorder=3, label=name)
            )
            axes.update_datalim(way[mask].reshape(-1, 2))
