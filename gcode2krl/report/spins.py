"""The turn about the tool axis along the path, over a map of what the others would be."""

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from gcode2krl.arrays import Bools, Floats
from gcode2krl.report.drawing import BLACK, GREY, PALE, VERMILION, look
from gcode2krl.units import DEG_PER_RAD, MM_PER_M

_JUMP_RAD = np.pi


def spin_map_figure(
    path_mm: Floats, spin_rad: Floats, chosen_rad: Floats, reachable: Bools, collides: Bools, margin: Floats
) -> Figure:
    """Draw a `pose.SpinMap`: path (n,), spins (s,), the spin (n,), and the columns (s, n) of its quality."""
    way_m, spin_deg = path_mm / MM_PER_M, spin_rad * DEG_PER_RAD
    is_free = reachable & ~collides
    with look():
        figure = Figure(figsize=(10.0, 5.5), layout="constrained")
        axes = figure.subplots()
        axes.set_facecolor(PALE)
        shown = axes.pcolormesh(
            way_m,
            spin_deg,
            np.ma.masked_where(~is_free, margin),
            cmap="viridis",
            vmin=0.0,
            vmax=1.0,
            shading="nearest",
        )
        axes.pcolormesh(
            way_m,
            spin_deg,
            np.ma.masked_where(~collides, np.ones_like(margin)),
            cmap=ListedColormap([VERMILION]),
            shading="nearest",
        )
        figure.colorbar(
            shown, ax=axes, label="least of: distance from limits and singularities / 30°, clearance"
        )
        drawn = np.where(np.abs(np.diff(chosen_rad, prepend=chosen_rad[:1])) > _JUMP_RAD, np.nan, chosen_rad)
        for colour, width in (("white", 3.0), (BLACK, 1.4)):
            axes.plot(way_m, drawn * DEG_PER_RAD, color=colour, lw=width)
        axes.set_xlim(way_m.min(), max(float(way_m.max()), float(way_m.min()) + 1e-6))
        axes.set_ylim(-180.0, 180.0)
        axes.set_yticks(np.arange(-180, 181, 45))
        axes.set_xlabel("Path (m)")
        axes.set_ylabel("Spin about the tool axis (°)")
        axes.grid(visible=False)
        worst = float(np.min(_along(np.where(is_free, margin, -1.0), spin_rad, chosen_rad)))
        axes.set_title(f"least on the chosen spin: {worst:.2f}", loc="right", fontsize=8, color=GREY)
        keys = [
            Patch(color=BLACK, label="chosen"),
            Patch(color=PALE, label="beyond a limit, or out of reach"),
        ]
        if collides.any():
            keys.append(Patch(color=VERMILION, label="arm, spindle or tool hits something"))
        figure.legend(handles=keys, loc="outside lower center", ncols=3)
        figure.suptitle("Spin about the tool axis")
    return figure


def _along(values: Floats, spin_rad: Floats, chosen_rad: Floats) -> Floats:
    """Return the map's values (n,) at the nearest spins to those chosen."""
    nearest = np.abs(spin_rad[:, None] - chosen_rad).argmin(axis=0)
    shown: Floats = values[nearest, np.arange(len(chosen_rad))]
    return shown
