"""Stiffness maps as matplotlib figures: over the workspace, over the spin, and the deflection by joint.

Needs no display; importing this module loads matplotlib, so it is imported only where a figure is asked for.
"""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from gcode2krl.arrays import Bools, Floats
from gcode2krl.report.drawing import BLACK, BLUE, GREY, ORANGE, PALE, VERMILION, look


def workspace_figure(x_mm: Floats, y_mm: Floats, deflection_mm: Floats, title: str) -> Figure:
    """Draw the deflection over a plane of ``$BASE``.

    Parameters
    ----------
    x_mm, y_mm : (i,), (j,) lines of the grid.
    deflection_mm : (j, i), NaN = out of reach: left blank.
    title : load and height in words.
    """
    with look():
        figure = Figure(figsize=(8.5, 7.5), layout="constrained")
        axes = figure.subplots()
        axes.set_facecolor("white")
        if np.isfinite(deflection_mm).any():
            shown = axes.pcolormesh(
                x_mm, y_mm, np.ma.masked_invalid(deflection_mm), cmap="viridis", shading="nearest"
            )
            lines = (
                axes.contour(x_mm, y_mm, np.ma.masked_invalid(deflection_mm), colors=BLACK, linewidths=0.5)
                if min(deflection_mm.shape) > 1
                else None
            )
            if lines is not None:
                axes.clabel(lines, fontsize=7)
            figure.colorbar(shown, ax=axes, label="Deflection (mm)")
            low = np.unravel_index(np.nanargmin(deflection_mm), deflection_mm.shape)
            axes.plot(x_mm[low[1]], y_mm[low[0]], "o", mfc="white", mec=BLACK, ms=6)
            words = f"least {deflection_mm[low]:.4g} mm at X {x_mm[low[1]]:.0f} Y {y_mm[low[0]]:.0f}"
            axes.set_title(words, loc="right", fontsize=8, color=GREY)
        else:
            axes.set_title("no pose of this plane can be reached", loc="right", fontsize=8, color=VERMILION)
        axes.set_aspect("equal", adjustable="box")
        axes.set_xlim(x_mm.min(), x_mm.max())
        axes.set_ylim(y_mm.min(), y_mm.max())
        axes.set_xlabel("X in $BASE (mm)")
        axes.set_ylabel("Y in $BASE (mm)")
        figure.suptitle(title)
    return figure


def spin_figure(
    spin_deg: Floats,
    deflection_mm: Floats,
    beyond: Bools,
    singular: Bools,
    chosen_deg: float | None,
    title: str,
) -> Figure:
    """Draw the deflection over the spin about the tool axis.

    Parameters
    ----------
    spin_deg : (n,) rising.
    deflection_mm : (n,), NaN = out of reach.
    beyond : (n,) True where a joint would be beyond its limit, or the pose out of reach.
    singular : (n,) True where the wrist is singular.
    chosen_deg : the spin that the cell states, None where it is searched.
    """
    with look():
        figure = Figure(figsize=(9.0, 5.0), layout="constrained")
        axes = figure.subplots()
        half = 0.5 * float(np.diff(spin_deg).min()) if len(spin_deg) > 1 else 0.5
        for mask, colour, label in (
            (beyond, VERMILION, "beyond a limit, or out of reach"),
            (singular & ~beyond, ORANGE, "wrist singular"),
        ):
            bars = [(float(spin) - half, 2.0 * half) for spin in spin_deg[mask]]
            if bars:
                axes.broken_barh(
                    bars,
                    (0.0, 1.0),
                    transform=axes.get_xaxis_transform(),
                    color=colour,
                    alpha=0.3,
                    lw=0.0,
                    label=label,
                    zorder=0,
                )
        axes.plot(spin_deg, deflection_mm, color=BLUE, lw=1.3, label="deflection")
        usable = np.isfinite(deflection_mm) & ~beyond & ~singular
        if usable.any():
            row = int(np.nanargmin(np.where(usable, deflection_mm, np.nan)))
            axes.plot(spin_deg[row], deflection_mm[row], "o", mfc="white", mec=BLACK, ms=6)
            words = f"least {deflection_mm[row]:.4g} mm at {spin_deg[row]:.0f}°"
            axes.set_title(words, loc="right", fontsize=8, color=GREY)
        if chosen_deg is not None:
            axes.axvline(chosen_deg, color=BLACK, lw=0.8, ls="--", label="spin of the cell")
        axes.set_xlim(-180.0, 180.0)
        axes.set_xticks(np.arange(-180, 181, 45))
        if np.isfinite(deflection_mm).any():
            axes.set_ylim(0.0, 1.1 * float(np.nanmax(deflection_mm)))
        axes.set_xlabel("Spin about the tool axis (°)")
        axes.set_ylabel("Deflection (mm)")
        axes.grid(axis="y", color=PALE, lw=0.4)
        figure.legend(loc="outside lower center", ncols=4)
        figure.suptitle(title)
    return figure


def joint_cost_figure(names: Sequence[str], share_mm: Floats, title: str) -> Figure:
    """Draw the deflection that each virtual joint causes at one pose.

    ``share_mm`` (j,) is each joint's part of the deflection along the whole of it; a negative one reduces it.
    """
    total = float(share_mm.sum())
    with look():
        figure = Figure(figsize=(8.0, 4.5), layout="constrained")
        axes = figure.subplots()
        bars = axes.barh(range(len(names)), share_mm, color=[BLUE if s >= 0 else ORANGE for s in share_mm])
        labels = [f"{s:.4f} mm, {s / total:.0%}" if total > 0 else "0 mm" for s in share_mm]
        axes.bar_label(bars, labels, padding=3, fontsize=8)
        axes.set_yticks(range(len(names)), names)
        axes.invert_yaxis()
        axes.margins(x=0.25)
        axes.set_xlabel("Part of the deflection (mm)")
        axes.set_title(f"together {total:.4g} mm", loc="right", fontsize=8, color=GREY)
        figure.suptitle(title)
    return figure
