"""Joint angles, speeds, margin and conditioning over time as a matplotlib figure."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from gcode2krl.arrays import Bools, Floats
from gcode2krl.report.columns import COLUMNS, TimeColumns
from gcode2krl.report.corner_marks import shade
from gcode2krl.report.drawing import (
    BLUE,
    GREEN,
    GREY,
    VERMILION,
    intervals,
    lines_of,
    look,
    need_samples,
)
from gcode2krl.report.signals import Clock, draw_signal, legend_below
from gcode2krl.tables import Joints, Motion, Toolpath
from gcode2krl.units import DEG_PER_RAD


def joints_figure(
    motion: Motion,
    joints: Joints,
    limits_deg: Floats | None = None,
    speed_limits_deg_s: Floats | None = None,
    toolpath: Toolpath | None = None,
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
    toolpath : Toolpath or None
        Names the G-code lines of the smallest margin and conditioning.

    Raises
    ------
    ValueError
        Where the motion has no sample or the tables differ in length.
    """
    need_samples(motion)
    if len(joints) != len(motion):
        raise ValueError(f"joints have {len(joints)} rows, the motion {len(motion)}")
    line = lines_of(toolpath, motion) if toolpath else np.zeros(len(motion), dtype=np.int32)
    clock = Clock(motion.time_s, TimeColumns.of(motion.time_s, COLUMNS // 3), line)
    wide = Clock(motion.time_s, TimeColumns.of(motion.time_s, COLUMNS // 2), line)
    q_deg = joints.q_rad * DEG_PER_RAD
    unreached: Bools = np.logical_not(np.isfinite(joints.q_rad).all(axis=1))
    lost, _ = intervals(motion.time_s, unreached)
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
            shade(angle, lost, VERMILION, "out of reach")
            angle.set_title(f"A{joint + 1}", loc="left", fontweight="bold")
            limit = None if limits_deg is None else np.asarray(limits_deg, dtype=np.float64)[joint]
            _draw(angle, clock, q_deg[:, joint], BLUE, "joint angle")
            _angle_limits(angle, q_deg[:, joint], limit)
            if joint % 3 == 0:
                angle.set_ylabel("Angle (°)")
            if share is not None:
                angle.tick_params(labelbottom=False)
                speed = figure.add_subplot(grid[row + 1, columns], sharex=shared)
                shade(speed, lost, VERMILION, "out of reach")
                _speed_share(speed, clock, share, joint)
        margin = figure.add_subplot(grid[-1, :3], sharex=shared)
        sigma = figure.add_subplot(grid[-1, 3:], sharex=shared)
        shade(margin, lost, VERMILION, "out of reach")
        shade(sigma, lost, VERMILION, "out of reach")
        _lowest(margin, wide, joints.limit_margin_rad * DEG_PER_RAD, "°")
        margin.set_title("To the nearest joint limit", loc="left", fontweight="bold")
        margin.set_ylabel("Margin (°)")
        _lowest(sigma, wide, joints.sigma_min, "")
        sigma.set_title("Distance from a singularity", loc="left", fontweight="bold")
        sigma.set_ylabel("$\\sigma_{min}$ (translations in m)")
        sigma.set_ylim(bottom=0.0)
        margin.set_xlabel("Time (s)")
        sigma.set_xlabel("Time (s)")
        start, end = float(motion.time_s[0]), float(motion.time_s[-1])
        margin.set_xlim(start, end if end > start else start + 1.0)
        for axes in figure.axes:
            axes.xaxis.set_major_locator(MaxNLocator(6))
        legend_below(figure, figure.axes)
        figure.suptitle("Joints along the path")
    return figure


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


def _draw(axes: Axes, clock: Clock, values: Floats, colour: str, label: str) -> None:
    """Draw a line or a band, whose height is that of all its values."""
    present = values[np.isfinite(values)]
    draw_signal(axes, clock, values, float(np.ptp(present)) if len(present) else 0.0, colour, label)


def _speed_share(axes: Axes, clock: Clock, share: Floats, joint: int) -> None:
    """Draw a joint's speed in percent of its limit, on a common scale for all six."""
    present = share[np.isfinite(share)]
    largest = float(present.max()) if len(present) else 0.0
    draw_signal(axes, clock, share[:, joint], largest, GREEN, "joint speed", 1.0)
    axes.set_ylim(0.0, max(1.15 * largest, 1.0))
    if largest >= 70.0:
        axes.set_ylim(0.0, max(1.15 * largest, 115.0))
        axes.axhline(100.0, color=VERMILION, lw=1.2, ls="--", label="limit")
    axes.yaxis.set_major_locator(MaxNLocator(3))
    if joint % 3 == 0:
        axes.set_ylabel("Speed\n(% of limit)")


def _lowest(axes: Axes, clock: Clock, values: Floats, unit: str) -> None:
    """Draw a quantity whose smallest value matters, and note that."""
    _draw(axes, clock, values, BLUE, "_no entry in the legend")
    present = np.isfinite(values)
    if present.any():
        row = int(np.nanargmin(np.where(present, values, np.nan)))
        words = f"smallest {values[row]:.3g}{unit} at {clock.place(row)}"
        axes.set_title(words, loc="right", fontsize=8, color=GREY)
        if values[row] < 0.0 < np.max(values[present]) or -1.0 < values[row] < 1.0:
            axes.axhline(0.0, color=VERMILION, lw=1.0, ls="--", label="limit" if unit else None)
    axes.yaxis.set_major_locator(MaxNLocator(5))
