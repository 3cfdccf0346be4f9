"""The path before and after offline compensation, with deviations magnified by a stated factor."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gcode2krl.arrays import Bools, Floats
from gcode2krl.report.drawing import BLACK, BLUE, GREEN, GREY, PALE, VERMILION, look, thin, thin_path

_FACTORS = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)
_SHARE = 0.06
"""The largest deviation is drawn at most this fraction of the path's extent."""


def exaggeration(path_mm: Floats, largest_mm: float) -> float:
    """Return the factor, 1, 2 or 5 times a power of ten, that makes a deviation visible on a path (m, 3)."""
    span = float(np.ptp(path_mm, axis=0).max()) if len(path_mm) else 0.0
    most = _SHARE * span / max(largest_mm, 1e-9)
    return max(factor for factor in _FACTORS if factor <= max(most, 1.0))


def compensation_figure(
    before: tuple[Floats, Floats, Bools],
    after: tuple[Floats, Floats, Bools],
    commanded_mm: Floats,
    factor: float | None = None,
) -> Figure:
    """Draw intended path, bent path without and with the correction, and the deviation along both.

    Parameters
    ----------
    before, after : intended points (m, 3), offsets from them (m, 3) and whether the tool cuts there (m,), as
        in the columns of `compensation.intended_path.Deviation`; the two differ in their rows.
    commanded_mm : (m, 3) what is commanded with the correction, rows as in ``after``.
    factor : magnification of the offsets; by default one that makes them visible, 1 to 1000.
    """
    cut_mm = before[0][before[2]]
    sizes = [np.linalg.norm(offset, axis=1) for _, offset, _ in (before, after)]
    if factor is None:
        factor = exaggeration(cut_mm, float(sizes[0][before[2]].max(initial=0.0)))
    span = np.ptp(cut_mm, axis=0) if len(cut_mm) else np.ones(3)
    side = 0 if span[0] >= span[1] else 1
    with look():
        figure = Figure(figsize=(11.0, 9.0), layout="constrained")
        top, below, along = figure.subplots(3, 1, height_ratios=(2.2, 1.0, 1.0))
        for axes, columns in ((top, [0, 1]), (below, [side, 2])):
            _line(axes, before[0], before[2], columns, BLACK, 1.4, "intended")
            _line(
                axes, before[0] + factor * before[1], before[2], columns, VERMILION, 1.0, "without correction"
            )
            corrected = after[0] + factor * (commanded_mm - after[0])
            _line(axes, corrected, after[2], columns, GREY, 0.7, "commanded with correction")
            _line(axes, after[0] + factor * after[1], after[2], columns, GREEN, 1.0, "with correction")
            axes.set_xlabel(f"{'XYZ'[columns[0]]} (mm)")
            axes.set_ylabel(f"{'XYZ'[columns[1]]} (mm)")
        top.set_aspect("equal", adjustable="datalim")
        top.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
        for (points, _, cuts), size, colour, label in zip(
            (before, after), sizes, (VERMILION, BLUE), ("without", "with"), strict=True
        ):
            way = np.cumsum(np.linalg.norm(np.diff(points, axis=0, prepend=points[:1]), axis=1))
            along.plot(*thin(way, np.where(cuts, size, np.nan)), color=colour, lw=1.0, label=label)
        along.set_xlabel("Intended path (mm)")
        along.set_ylabel("Off the path (mm)")
        along.set_ylim(bottom=0.0)
        along.grid(axis="y", color=PALE, lw=0.4)
        along.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
        largest = [
            float(size[row[2]].max(initial=0.0)) for size, row in zip(sizes, (before, after), strict=True)
        ]
        words = f"largest {largest[0]:.3f} mm without, {largest[1]:.3f} mm with correction"
        along.set_title(words, loc="right", fontsize=8, color=GREY)
        scale = "true to size" if factor == 1.0 else f"{factor:g} times as large"
        figure.suptitle(f"Offline compensation: offsets drawn {scale}")
    return figure


def _line(
    axes: Axes, points_mm: Floats, cuts: Bools, columns: list[int], colour: str, width: float, label: str
) -> None:
    """Draw the cutting parts of a path, with gaps in between."""
    shown = np.where(cuts[:, None], points_mm[:, columns], np.nan)
    axes.plot(*thin_path(shown).T, color=colour, lw=width, label=label)
