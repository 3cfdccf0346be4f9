"""The worst places over time, enlarged so far that every sample and G-code line is seen."""

from collections.abc import Sequence
from typing import NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.ticker import MaxNLocator

from gcode2krl.arrays import Floats
from gcode2krl.report.drawing import BLACK, PALE, VERMILION, line_ticks, number
from gcode2krl.report.signals import Clock
from gcode2krl.report.span import Span
from gcode2krl.report.worst_places import around


class Trace(NamedTuple):
    """A line of an enlarged window."""

    values: Floats
    """(m,)"""
    colour: str
    label: str


def enlarge(axes: Axes, clock: Clock, row: int, traces: Sequence[Trace], title: str) -> None:
    """Draw the samples about a row, each one of them, with the G-code lines that begin there."""
    rows = around(clock.time_s, row)
    time_s = clock.time_s[rows]
    for trace in traces:
        axes.plot(time_s, trace.values[rows], color=trace.colour, lw=1.1, label=trace.label)
    axes.axvline(clock.time_s[row], color=VERMILION, lw=0.8, ls=":", zorder=1)
    axes.set_xlim(time_s[0], time_s[-1] if time_s[-1] > time_s[0] else time_s[0] + 1.0)
    axes.set_title(title, loc="left", fontsize=8.5)
    axes.set_xlabel("Time (s)")
    axes.xaxis.set_major_locator(MaxNLocator(4))
    axes.yaxis.set_major_locator(MaxNLocator(4))
    axes.yaxis.set_major_formatter(lambda value, _: number(value))
    axes.grid(axis="y", color=PALE, lw=0.4)
    upper = axes.secondary_xaxis("top")
    times, labels = line_ticks(time_s, clock.line[rows], most=5)
    upper.set_xticks(times, labels=labels)
    upper.tick_params(labelsize=7)


def number_places(axes: Axes, clock: Clock, values: Floats, rows: Sequence[int], span: Span) -> None:
    """Write 1, 2, 3 where the enlarged places are."""
    for place, row in enumerate(rows, start=1):
        height = min(float(values[row]), span.high)
        axes.annotate(
            str(place),
            (clock.time_s[row], height),
            xytext=(0, 7),
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=7.5,
            color=BLACK,
            bbox={"boxstyle": "circle,pad=0.15", "fc": "white", "ec": VERMILION, "lw": 0.9},
            annotation_clip=False,
            zorder=9,
        )


def enlarge_places(
    figure: Figure, room: SubplotSpec, clock: Clock, rows: Sequence[int], traces: Sequence[Trace], unit: str
) -> None:
    """Enlarge places side by side; the first trace is the one that is worst there."""
    cells = room.subgridspec(1, max(len(rows), 1))
    for place, row in enumerate(rows):
        axes = figure.add_subplot(cells[0, place])
        words = f"{place + 1}: {number(traces[0].values[row])} {unit}\nat {clock.place(row)}"
        enlarge(axes, clock, row, traces, words)
        if place == 0:
            axes.set_ylabel(f"Enlarged ({unit})")
