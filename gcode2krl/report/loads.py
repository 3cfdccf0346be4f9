"""What the figures of forces and of deflection over time share."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from gcode2krl.arrays import Floats
from gcode2krl.report.columns import TimeColumns
from gcode2krl.report.drawing import BLUE, GREEN, ORANGE, PALE, SKY, thin
from gcode2krl.report.signals import Clock, panel, time_axis

AXES = ((BLUE, "x"), (ORANGE, "y"), (GREEN, "z"))
"""Colour and name of a component."""


def is_hatch(columns: TimeColumns, *signals: Floats) -> bool:
    """Return whether one of the signals (m,) or vectors (m, 3) would fill its panel as a line."""
    for signal in signals:
        size = np.linalg.norm(signal, axis=1) if signal.ndim == 2 else signal
        height = float(np.max(size, initial=0.0, where=np.isfinite(size)))
        parts = signal.T if signal.ndim == 2 else ()
        if any(columns.is_hatch(values, height) for values in (size, *parts)):
            return True
    return False


def draw_components(panels: Sequence[Axes], clock: Clock, vectors: Floats, unit: str) -> None:
    """Draw x, y and z, each in a panel of its own, to one scale."""
    for axes, (colour, name), values in zip(panels, AXES, vectors.T, strict=True):
        panel(axes, clock, values, unit, colour, f"{name} in $BASE")
        axes.set_ylabel(f"{name} ({unit})")
        axes.yaxis.set_major_locator(MaxNLocator(4))
    limits = np.array([axes.get_ylim() for axes in panels])
    for axes in panels:
        axes.set_ylim(limits[:, 0].min(), limits[:, 1].max())


def draw_confidence(axes: Axes, time_s: Floats, size: Floats, relative_band: float) -> None:
    """Draw the 90 % band of the coefficients about a line."""
    if relative_band <= 0.0:
        return
    time, drawn = thin(time_s, size)
    low, high = drawn * max(0.0, 1.0 - relative_band), drawn * (1.0 + relative_band)
    axes.fill_between(time, low, high, color=SKY, alpha=0.35, lw=0.0, label=f"90 %: ± {relative_band:.0%}")


def finish(figure: Figure, panels: Sequence[Axes], clock: Clock, title: str) -> None:
    """Give all panels the time axis, the first one the G-code lines, each its legend beside it."""
    time_axis(panels[0], clock)
    for axes in panels:
        axes.grid(axis="y", color=PALE, lw=0.4)
        axes.tick_params(labelbottom=axes is panels[-1])
        if axes.get_legend_handles_labels()[0]:
            axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.0)
    panels[-1].set_xlabel("Time (s)")
    figure.suptitle(title)
