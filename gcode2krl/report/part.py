"""The finished part from three sides as a matplotlib figure, with the error that the deflection leaves."""

from typing import NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from gcode2krl.arrays import Floats
from gcode2krl.prediction import Prediction
from gcode2krl.report.drawing import look
from gcode2krl.report.drawing import title as titled
from gcode2krl.report.part_error import error_on, scale_end
from gcode2krl.tables import PartHistory

OFF_COLOURS = "RdBu_r"
_UNCUT, _UNKNOWN = (0.80, 0.75, 0.63), (0.59, 0.62, 0.65)
_LIGHT = np.array([-1.0, -2.0, 3.0]) / np.sqrt(14.0)
_TILT_DEG = 35.0
_LEAST_WEIGHT = 0.02


class _Side(NamedTuple):
    """A direction to look from."""

    name: str
    turn_deg: float
    """About the tool axis; 0 looks along +y."""


_SIDES = (_Side("From the front left", -35.0), _Side("From the rear right", 145.0))


def part_figure(prediction: Prediction, history: PartHistory) -> Figure:
    """Draw the finished part from above, from the front left and from the rear right.

    What was cut is coloured by the error, where it is known: above 0 material is left.
    """
    error_mm = error_on(history, prediction)
    known = error_mm is not None
    off_mm = np.full(history.left_by.shape, np.nan) if error_mm is None else error_mm
    end_mm = scale_end(off_mm) if known else 1.0
    shade = ScalarMappable(Normalize(-end_mm, end_mm), colormaps[OFF_COLOURS])
    colours = shade.to_rgba(np.nan_to_num(off_mm))[:, :, :3]
    colours[np.isnan(off_mm)] = _UNKNOWN
    colours[history.left_by < 0] = _UNCUT
    steep = 1.0 - np.abs(np.nan_to_num(history.normal[:, :, 2]))
    weight = np.where(history.left_by < 0, _LEAST_WEIGHT, steep + 0.2)  # walls are narrow, and shall be seen
    with look():
        figure = Figure(figsize=(11.0, 8.5), layout="constrained")
        grid = figure.add_gridspec(2, 2, height_ratios=(1.1, 1.0))
        above = figure.add_subplot(grid[0, :])
        _draw_above(above, history, colours)
        oblique = [figure.add_subplot(grid[1, k]) for k in range(2)]
        for axes, side in zip(oblique, _SIDES, strict=True):
            _draw_side(axes, history, colours, weight, side)
        if known:
            label = "Error normal to the surface (mm): above 0 material is left, below 0 too much is cut"
            figure.colorbar(shade, ax=[above, *oblique], label=label, aspect=45, extend="both")
        words = (
            "Error of the finished part by deflection" if known else "Finished part; its error is not known"
        )
        figure.suptitle(titled(words, prediction.toolpath))
    return figure


def _draw_above(axes: Axes, history: PartHistory, colours: Floats) -> None:
    """Draw what the tool sees; axes are those of ``$BASE`` where the tool stands upright in it."""
    low, size = history.origin_mm, history.cell_mm * colours.shape[1::-1]
    extent = (low[0], low[0] + size[0], low[1], low[1] + size[1])
    axes.imshow(colours, origin="lower", extent=extent, interpolation="nearest")
    upright = bool(np.allclose(history.to_field, np.eye(3)))
    axes.set_title("From above" if upright else "Along the tool axis", loc="left")
    axes.set_xlabel("X (mm)" if upright else "Across the tool axis (mm)")
    axes.set_ylabel("Y (mm)" if upright else "Across the tool axis (mm)")


def _draw_side(axes: Axes, history: PartHistory, colours: Floats, weight: Floats, side: _Side) -> None:
    """Draw the part obliquely: squares between cells, those in the back first."""
    x, y = (
        origin + (np.arange(count) + 0.5) * size
        for origin, count, size in zip(history.origin_mm, colours.shape[1::-1], history.cell_mm, strict=True)
    )
    heights = np.pad(history.heights_mm(), 1, constant_values=history.bottom_mm)
    plane = np.meshgrid(np.pad(x, 1, mode="edge"), np.pad(y, 1, mode="edge"))
    corners = _corners(np.stack([*plane, heights], axis=2))
    shades = np.concatenate([colours * weight[:, :, None], weight[:, :, None]], axis=2)
    mixed = _corners(np.pad(shades, ((1, 1), (1, 1), (0, 0)), mode="edge")).sum(axis=2)
    across = np.cross(corners[:, :, 2] - corners[:, :, 0], corners[:, :, 3] - corners[:, :, 1])
    normal = across / np.maximum(np.linalg.norm(across, axis=2, keepdims=True), 1e-12)
    face = np.clip(mixed[:, :, :3] / mixed[:, :, 3:] * _lit(normal)[:, :, None], 0.0, 1.0).reshape(-1, 3)
    corners = corners.reshape(-1, 4, 3)
    turn, tilt = np.radians(side.turn_deg), np.radians(_TILT_DEG)
    right = np.array([np.cos(turn), np.sin(turn), 0.0])
    ahead = np.array([-np.sin(turn), np.cos(turn), 0.0])
    up = np.sin(tilt) * ahead + np.cos(tilt) * np.array([0.0, 0.0, 1.0])
    to_eye = np.sin(tilt) * np.array([0.0, 0.0, 1.0]) - np.cos(tilt) * ahead
    order = np.argsort(-(corners.mean(axis=1) @ ahead), kind="stable")
    order = order[(normal.reshape(-1, 3) @ to_eye)[order] > 0.0]
    drawn = np.stack([corners @ right, corners @ up], axis=2)[order]
    squares = PolyCollection(list(drawn), facecolors=face[order], edgecolors=face[order], linewidths=0.2)
    squares.set_rasterized(True)
    axes.add_collection(squares)
    axes.autoscale_view()
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set_title(side.name, loc="left")


def _corners(values: Floats) -> Floats:
    """Return what stands at the four corners (r - 1, c - 1, 4, k) of the squares between points (r, c, k)."""
    return np.stack([values[:-1, :-1], values[:-1, 1:], values[1:, 1:], values[1:, :-1]], axis=2)


def _lit(normal: Floats) -> Floats:
    """Return how bright (r, c) what faces so is."""
    return np.asarray(0.62 + 0.38 * np.clip(np.abs(normal @ _LIGHT), 0.0, 1.0))
