"""Panels over time: a line where it can be seen, a band where it would be a hatch, the worst place named."""

from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gcode2krl.arrays import Floats, Ints32
from gcode2krl.report.columns import TimeColumns
from gcode2krl.report.drawing import (
    GREY,
    PALE,
    VERMILION,
    line_ticks,
    lines_of,
    number,
    thin,
)
from gcode2krl.report.span import Span, span_of
from gcode2krl.tables import Motion, Toolpath

_MOST_ARROWS = 40
"""No more places beyond the frame are marked."""
_LABEL_ROOM = 64
"""Digits and gaps of the G-code lines that have room along the top."""
_MIDDLE = 0.8
"""The darker band holds this share of the samples of a column."""


class Clock(NamedTuple):
    """What all panels over one time share."""

    time_s: Floats
    columns: TimeColumns
    line: Ints32
    """(m,) line of G-code, 0 where there is none."""

    @classmethod
    def of(cls, toolpath: Toolpath, motion: Motion) -> Self:
        """Return the clock of a motion."""
        return cls(motion.time_s, TimeColumns.of(motion.time_s), lines_of(toolpath, motion))

    def place(self, row: int) -> str:
        """Return the time and the G-code line of a row in words."""
        where = f", line {self.line[row]}" if self.line[row] > 0 else ""
        return f"{self.time_s[row]:.2f} s{where}"


def draw_signal(
    axes: Axes, clock: Clock, values: Floats, height: float, colour: str, label: str, width: float = 1.1
) -> bool:
    """Draw values (m,) as a line; as a band where it would be a hatch, and return whether it is one.

    The pale band reaches from the lowest to the highest sample of each column, the darker one holds 80 % of
    them, and the line is their average.
    """
    if not clock.columns.is_hatch(values, height):
        axes.plot(*thin(clock.time_s, values), color=colour, lw=width, label=label)
        return False
    low, high = clock.columns.extremes(values)
    edges = ((1.0 - _MIDDLE) / 2.0, (1.0 + _MIDDLE) / 2.0)
    tenth, ninth = clock.columns.quantiles(values, edges)
    time_s = clock.columns.middle_s
    band: dict[str, Any] = {"step": "mid", "color": colour, "lw": 0.0}
    axes.fill_between(time_s, low, high, alpha=0.3, label=f"{label}, lowest to highest", **band)
    axes.fill_between(time_s, tenth, ninth, alpha=0.5, label=f"{label}, 80 % of samples", **band)
    mean = clock.columns.mean(values)
    axes.plot(time_s, mean, color=colour, lw=0.8, drawstyle="steps-mid", label=f"{label}, average")
    return True


def name_largest(axes: Axes, clock: Clock, values: Floats, span: Span, unit: str) -> None:
    """Write the largest value with its time and line; point to it where it is beyond the frame."""
    present = np.where(np.isfinite(values), values, -np.inf)
    if not np.isfinite(present).any():
        return
    row = int(np.argmax(present >= present.max() - 1e-6 * abs(present.max())))  # where a plateau begins
    words = f"largest {number(values[row])} {unit} at {clock.place(row)}"
    if not span.cut_high:
        axes.set_title(words, loc="right", fontsize=8, color=GREY)
        return
    highest = clock.columns.highest_rows(present)
    beyond = highest[present[highest] > span.high]
    few = len(beyond) <= _MOST_ARROWS
    if not few:
        beyond = beyond[np.argsort(-present[beyond], kind="stable")[:_MOST_ARROWS]]
    axes.plot(
        clock.time_s[beyond],
        np.ones(len(beyond)),
        "^",
        transform=axes.get_xaxis_transform(),
        color=VERMILION,
        mec="none",
        ms=4.0,
        clip_on=False,
        zorder=8,
        label="beyond the frame" + ("" if few else f", the {_MOST_ARROWS} largest"),
    )
    early = clock.time_s[row] < (clock.time_s[0] + clock.time_s[-1]) / 2.0
    axes.annotate(
        words,
        (clock.time_s[row], 1.0),
        xycoords=axes.get_xaxis_transform(),
        xytext=(12 if early else -12, -14),
        textcoords="offset points",
        ha="left" if early else "right",
        va="top",
        fontsize=8,
        color=VERMILION,
        arrowprops={"arrowstyle": "->", "color": VERMILION, "lw": 0.9, "shrinkA": 0.0, "shrinkB": 1.0},
        bbox={"boxstyle": "round,pad=0.2", "fc": "white", "ec": "none", "alpha": 0.85},
        zorder=9,
    )
    count = int(np.count_nonzero(present > span.high))
    share = f"{count:,} of {len(values):,} samples beyond the frame"
    axes.set_title(share, loc="right", fontsize=8, color=GREY)


def name_worst_part(axes: Axes, clock: Clock, values: Floats, unit: str) -> None:
    """Write the largest size of a signed quantity over its panel."""
    if np.isfinite(values).any():
        row = int(np.nanargmax(np.abs(values)))
        words = f"largest {number(values[row])} {unit} at {clock.place(row)}"
        axes.set_title(words, loc="right", fontsize=8, color=GREY)


def panel(
    axes: Axes,
    clock: Clock,
    values: Floats,
    unit: str,
    colour: str,
    label: str,
    keep: Floats | float = 0.0,
    width: float = 1.1,
) -> bool:
    """Fill a panel with one quantity: range, line or band, largest value; return whether it is a band."""
    span = span_of(clock.columns, values, keep)
    banded = draw_signal(axes, clock, values, span.height, colour, label, width)
    axes.set_ylim(span.low, span.high)
    if span.low < 0.0:
        axes.axhline(0.0, color=PALE, lw=0.6, zorder=0)
        name_worst_part(axes, clock, values, unit)
    else:
        name_largest(axes, clock, values, span, unit)
    return banded


def time_axis(axes: Axes, clock: Clock) -> None:
    """Give a panel the limits of the time axis, and the G-code lines along the top, each where it begins."""
    start, end = float(clock.time_s[0]), float(clock.time_s[-1])
    axes.set_xlim(start, end if end > start else start + 1.0)
    upper = axes.secondary_xaxis("top")
    digits = len(str(int(clock.line.max(initial=1))))
    times, labels = line_ticks(clock.time_s, clock.line, min(14, _LABEL_ROOM // (digits + 1)))
    upper.set_xticks(times, labels=labels)
    upper.set_xlabel("G-code line, where it begins")


def legend_below(figure: Figure, panels: Sequence[Axes], columns: int = 4) -> None:
    """Put the labels of all panels, each once, below the figure."""
    entries = {}
    for axes in panels:
        handles, labels = axes.get_legend_handles_labels()
        entries.update(dict(zip(labels, handles, strict=True)))
    if entries:
        shown = min(len(entries), columns)
        figure.legend(entries.values(), entries.keys(), loc="outside lower center", ncols=shown)
