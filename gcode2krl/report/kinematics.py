"""Speed, acceleration and jerk over time as a matplotlib figure, after figure 5 of Bigliardi et al. 2022."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec

from gcode2krl.arrays import Floats
from gcode2krl.report.corner_marks import corner_share, mark_corners, told_in_time
from gcode2krl.report.drawing import BLACK, BLUE, GREY, PALE, look, need_samples, number, thin, title
from gcode2krl.report.enlarged import Trace, enlarge
from gcode2krl.report.signals import Clock, legend_below, panel, time_axis
from gcode2krl.report.span import span_of
from gcode2krl.report.worst_places import HALF_S, lost_s, worst_rows
from gcode2krl.tables import Motion, Toolpath

_OFTEN = 100
"""A feed that changes more often is drawn pale behind the speed."""


def kinematics_figure(toolpath: Toolpath, motion: Motion) -> Figure:
    """Draw speed, acceleration and jerk of the tool tip over time, with the G-code lines along the top.

    The magnitudes are those of the table; the programmed feed is a thin step line (rapids have none) and
    approximated corners that can be told apart are shaded. Where the lines would fill the picture they are
    bands, and the places of the largest loss of time, acceleration and jerk are enlarged below.

    Raises
    ------
    ValueError
        Where the motion has no sample.
    """
    need_samples(motion)
    clock = Clock.of(toolpath, motion)
    feed_mm_s = toolpath.feed_mm_s[np.clip(motion.move, 0, len(toolpath) - 1)]
    quantities: tuple[tuple[str, str, Floats, Floats | float], ...] = (
        ("Speed", "mm/s", motion.speed_mm_s, feed_mm_s),
        ("Acceleration", "mm/s²", motion.acceleration_mm_s2, 0.0),
        ("Jerk", "mm/s³", motion.jerk_mm_s3, 0.0),
    )
    spans = [span_of(clock.columns, values, keep) for _, _, values, keep in quantities]
    long = any(
        clock.columns.is_hatch(values, span.height)
        for (_, _, values, _), span in zip(quantities, spans, strict=True)
    )
    crowded = bool(np.any(motion.corner & ~told_in_time(clock, motion)))
    heights = [1.0, 1.0, 1.0, *([0.16] if crowded else []), *([0.9] if long else [])]
    with look():
        figure = Figure(figsize=(11.0, 10.0 if long else 7.5), layout="constrained")
        grid = figure.add_gridspec(len(heights), 1, height_ratios=heights)
        panels = [figure.add_subplot(grid[0])]
        panels += [figure.add_subplot(grid[row], sharex=panels[0]) for row in range(1, 3 + crowded)]
        _programmed_feed(panels[0], clock, feed_mm_s)
        for axes, (name, unit, values, keep) in zip(panels[:3], quantities, strict=True):
            panel(axes, clock, values, unit, BLUE, "commanded", keep)
            axes.set_ylabel(f"{name} ({unit})")
            axes.grid(axis="y", color=PALE, lw=0.4)
        mark_corners(panels[:3], clock, motion)
        if crowded:
            corner_share(panels[3], clock, motion.corner)
        for axes in panels[:-1]:
            axes.tick_params(labelbottom=False)
        panels[-1].set_xlabel("Time (s)")
        time_axis(panels[0], clock)
        if long:
            _enlarge_worst(figure, grid[-1], clock, motion, feed_mm_s)
        legend_below(figure, panels, columns=3)
        figure.suptitle(title("Speed, acceleration and jerk of the tool tip", toolpath))
    return figure


def _programmed_feed(axes: Axes, clock: Clock, feed_mm_s: Floats) -> None:
    """Draw the programmed feed as steps: dashed over the speed, or pale behind it where it changes often."""
    often = np.count_nonzero(np.diff(feed_mm_s[np.isfinite(feed_mm_s)])) > _OFTEN
    if often and clock.columns.is_hatch(feed_mm_s, float(np.max(feed_mm_s[np.isfinite(feed_mm_s)]))):
        low, high = clock.columns.extremes(feed_mm_s)
        label = "programmed feed, lowest to highest"
        axes.fill_between(
            clock.columns.middle_s, low, high, step="mid", color=GREY, alpha=0.3, lw=0.0, label=label
        )
        return
    dashes: dict[str, Any] = (
        {"color": GREY, "lw": 0.5} if often else {"color": BLACK, "lw": 0.8, "ls": (0, (4, 3)), "zorder": 3}
    )
    axes.plot(*thin(clock.time_s, feed_mm_s), drawstyle="steps-post", label="programmed feed", **dashes)


def _enlarge_worst(
    figure: Figure, room: SubplotSpec, clock: Clock, motion: Motion, feed_mm_s: Floats
) -> None:
    """Enlarge the places of the most time lost against the feed, the largest acceleration and jerk."""
    lost = lost_s(clock.time_s, motion.speed_mm_s, feed_mm_s, ~np.isfinite(feed_mm_s))
    speed = (Trace(feed_mm_s, GREY, "programmed feed"), Trace(motion.speed_mm_s, BLUE, "commanded"))
    acceleration, jerk = motion.acceleration_mm_s2, motion.jerk_mm_s3
    places: tuple[tuple[str, str, Floats, tuple[Trace, ...], str], ...] = (
        ("most time lost:", f"s of {2.0 * HALF_S:g} s", lost, speed, "Speed (mm/s)"),
        ("largest", "mm/s²", acceleration, (Trace(acceleration, BLUE, "commanded"),), "Acceleration (mm/s²)"),
        ("largest", "mm/s³", jerk, (Trace(jerk, BLUE, "commanded"),), "Jerk (mm/s³)"),
    )
    cells = room.subgridspec(1, len(places))
    for column, (what, unit, values, traces, label) in enumerate(places):
        for row in worst_rows(clock.time_s, values, places=1):
            axes = figure.add_subplot(cells[0, column])
            words = f"{what} {number(values[row])} {unit}\nat {clock.place(row)}"
            enlarge(axes, clock, row, traces, words)
            axes.set_ylabel(label)
            axes.set_ylim(bottom=0.0)
