"""The twin as matplotlib figures: deviation maps after figures 10-13, and force signals after figure 3, of
Haehn & Weigold 2020.

Needs no display; importing this module loads matplotlib, so it is imported only where a figure is asked for.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gcode2krl.arrays import Floats
from gcode2krl.report.drawing import BLACK, BLUE, GREEN, GREY, ORANGE, PALE, SKY, VERMILION, look

_MOST_DOTS = 20_000
_COLOURS = "RdBu_r"
_STEPS_MM = (0.1, 0.2, 0.3, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 5.0)


class Map(NamedTuple):
    """Deviation of a part from nominal in mm, seen along the tool axis; above 0 material is left."""

    x_mm: Floats
    """(nx + 1,) edges of the cells."""
    y_mm: Floats
    floor_mm: Floats
    """(ny, nx), NaN where no floor was cut."""
    wall_mm: Floats
    """(w, 3) points on the walls."""
    wall_off_mm: Floats
    """(w,)"""
    stated_mm: float | None
    """The largest deviation normal to the feed, for the title."""
    rms_mm: float | None = None
    """Its root mean square over the time in the cut, for the title."""


def deviation_figure(maps: Mapping[str, Map]) -> Figure:
    """Draw up to four machined parts against nominal, in one colour scale; ``maps`` by title.

    Floors are drawn in place, walls as dots beside them. The scale ends at the largest stated deviation;
    larger values have the last colour.
    """
    stated = [surface.stated_mm for surface in maps.values() if surface.stated_mm is not None]
    most = next((step for step in _STEPS_MM if step >= max(stated, default=0.0)), _STEPS_MM[-1])
    with look():
        figure = Figure(figsize=(11.0, 8.0), layout="constrained")
        panels = figure.subplots(2, 2, sharex=True, sharey=True).ravel()
        for axes, (title, surface) in zip(panels, maps.items(), strict=False):
            drawn = axes.pcolormesh(
                surface.x_mm,
                surface.y_mm,
                surface.floor_mm,
                cmap=_COLOURS,
                vmin=-most,
                vmax=most,
                rasterized=True,
            )
            step = max(1, len(surface.wall_mm) // _MOST_DOTS)
            axes.scatter(
                *surface.wall_mm[::step, :2].T,
                c=surface.wall_off_mm[::step],
                s=5.0,
                lw=0.0,
                cmap=_COLOURS,
                vmin=-most,
                vmax=most,
                rasterized=True,
            )
            axes.set_aspect("equal")
            axes.set_facecolor("#F2F2F2")
            axes.set_title(f"{title}: {_stated(surface)}", loc="left")
        for axes in panels[len(maps) :]:
            axes.set_axis_off()
        for axes in panels[2:]:
            axes.set_xlabel("X (mm)")
        for axes in panels[::2]:
            axes.set_ylabel("Y (mm)")
        if maps:
            label = "Deviation (mm); above 0 material is left, below 0 too much is cut"
            figure.colorbar(drawn, ax=panels.tolist(), label=label, aspect=40, shrink=0.8, extend="both")
        figure.suptitle("Machined part against nominal")
    return figure


def _stated(surface: Map) -> str:
    """Return the figures of a title."""
    if surface.stated_mm is None:
        return "nothing to judge"
    rms = f"RMS {surface.rms_mm:.2f}, " if surface.rms_mm is not None else ""
    return f"{rms}at most {surface.stated_mm:.2f} mm"


class Signals(NamedTuple):
    """Forces of one run along time, n samples."""

    time_s: Floats
    true_N: Floats
    """(n, 3)"""
    measured_N: Floats
    """(n, 3) filtered."""
    estimate_N: Floats
    """(n, 3) the pilot's."""
    used_N: Floats
    """(n, 3) force that is compensated."""
    weight: Floats
    """(n,) weight of the estimate."""
    wanted_mm: Floats
    """(n,) length of the correction that the true force would need."""
    moved_mm: Floats
    """(n,) length of the robot's resulting motion."""
    threshold_N: float


def signal_figure(signals: Signals, around_s: float, half_s: float = 0.45) -> Figure:
    """Draw forces, weight of the pilot and correction about an instant, such as the cutter's exit."""
    shown = np.abs(signals.time_s - around_s) <= half_s
    time = signals.time_s[shown]
    with look():
        figure = Figure(figsize=(11.0, 7.0), layout="constrained")
        force, weight, moved = figure.subplots(3, 1, sharex=True, height_ratios=(2.2, 0.7, 1.2))
        lines = (
            (signals.true_N, BLACK, 1.4, "true"),
            (signals.measured_N, BLUE, 1.1, "measured, filtered"),
            (signals.estimate_N, ORANGE, 1.1, "pilot, ahead by the lead"),
            (signals.used_N, VERMILION, 1.6, "used"),
        )
        for values, colour, width, label in lines:
            force.plot(time, _length(values[shown]), color=colour, lw=width, label=label)
        difference = _length(signals.estimate_N[shown] - signals.measured_N[shown])
        force.plot(time, difference, color=GREY, lw=0.8, ls="--", label="pilot minus measured")
        force.axhline(signals.threshold_N, color=PALE, lw=0.8)
        force.set_ylabel("Force (N)")
        weight.fill_between(time, signals.weight[shown], color=SKY, lw=0.0)
        weight.set_ylim(0.0, 1.05)
        weight.set_ylabel("Weight of\nthe pilot")
        moved.plot(time, signals.wanted_mm[shown], color=BLACK, lw=1.2, label="needed")
        moved.plot(time, signals.moved_mm[shown], color=GREEN, lw=1.4, label="moved")
        moved.set_ylabel("Correction (mm)")
        moved.set_xlabel("Time (s)")
        for axes in (force, weight, moved):
            _finish(axes)
        force.set_xlim(around_s - half_s, around_s + half_s)
        figure.suptitle("Force signals with pilot at the cutter's exit")
    return figure


def _finish(axes: Axes) -> None:
    axes.grid(axis="y", color=PALE, lw=0.4)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))


def _length(vectors: Floats) -> Floats:
    length: Floats = np.linalg.norm(vectors, axis=1)
    return length
