"""Approximated corners over time: shaded where they can be told apart, else as a share of the time."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from gcode2krl.arrays import Bools, Floats, Ints32
from gcode2krl.report.drawing import ORANGE, intervals
from gcode2krl.report.signals import Clock
from gcode2krl.tables import Motion


def corners_apart(along: Floats, corner: Bools, move: Ints32, least: float) -> Bools:
    """Return (m,) the samples of approximated corners that can be told apart.

    A corner can be told from its neighbours where they are more than ``least`` away, in the unit of ``along``
    (m,): time or path. Samples of more than two moves (m,) without one between are several corners.
    """
    if not corner.any():
        return corner
    edges = np.flatnonzero(np.diff(np.concatenate([[False], corner, [False]]).astype(np.int8)))
    first, last = edges[::2], edges[1::2] - 1
    gap = np.concatenate([[np.inf], along[first[1:]] - along[last[:-1]], [np.inf]])
    is_apart = (np.minimum(gap[:-1], gap[1:]) > least) & (move[last] - move[first] <= 1)
    shown = np.zeros(len(corner) + 1, dtype=np.int64)
    shown[first[is_apart]] += 1
    shown[last[is_apart] + 1] -= 1
    is_marked: Bools = np.cumsum(shown)[:-1] > 0
    return is_marked


def told_in_time(clock: Clock, motion: Motion) -> Bools:
    """Return (m,) the samples of corners that more than a column of the picture keeps apart."""
    least_s = float(clock.columns.edge_s[1] - clock.columns.edge_s[0])
    return corners_apart(clock.time_s, motion.corner, motion.move, least_s)


def mark_corners(panels: Sequence[Axes], clock: Clock, motion: Motion) -> None:
    """Shade the approximated corners that can be told apart over panels of one time axis."""
    bars, _ = intervals(clock.time_s, told_in_time(clock, motion))
    for axes in panels:
        shade(axes, bars, ORANGE, "approximated corner")


def corner_share(axes: Axes, clock: Clock, corner: Bools) -> None:
    """Fill a narrow panel with the share of each column's time that the path is in approximated corners."""
    share = np.nan_to_num(clock.columns.mean(corner)) * 100.0
    axes.fill_between(clock.columns.middle_s, share, step="mid", color=ORANGE, alpha=0.7, lw=0.0)
    axes.set_ylim(0.0, 100.0)
    axes.set_yticks([0, 100])
    axes.set_ylabel("In corners\n(% of time)", fontsize=7.5)


def shade(axes: Axes, bars: list[tuple[float, float]], colour: str, label: str) -> None:
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
