"""The finished part from three sides as a matplotlib figure: the error that the deflection leaves, or the
difference to the nominal part.

Beside the view from above stands where it is off most, with the lines of G-code.
"""

from typing import NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from gcode2krl.arrays import Floats, Ints32
from gcode2krl.prediction import Prediction
from gcode2krl.report.drawing import lines_of, look
from gcode2krl.report.drawing import title as titled
from gcode2krl.report.part_error import above_on, error_on, scale_end
from gcode2krl.tables import Motion, PartHistory, SurfaceHistory

OFF_COLOURS = "RdBu_r"
_UNCUT, _UNKNOWN = (0.80, 0.75, 0.63), (0.59, 0.62, 0.65)
_LIGHT = np.array([-1.0, -2.0, 3.0]) / np.sqrt(14.0)
_LEAST_WEIGHT = 0.02
_WORST, _APART = 8, 0.08
"""How many of the worst places are listed, and how far apart they lie, as a share of the way's extent."""


class _Side(NamedTuple):
    """A direction to look from."""

    name: str
    turn_deg: float
    """About the tool axis; 0 looks along +y,"""
    tilt_deg: float
    """and down."""


_SIDES = (
    _Side("From above", 0.0, 90.0),
    _Side("From the front left", -35.0, 35.0),
    _Side("From the rear right", 145.0, 35.0),
)


class _Faces(NamedTuple):
    """Squares of a surface."""

    corners_mm: Floats
    """(f, 4, 3) turning left as seen from outside."""
    colours: Floats
    """(f, 3)"""


def part_figure(prediction: Prediction, history: PartHistory | SurfaceHistory) -> Figure:
    """Draw the finished part from above, from the front left and from the rear right.

    What was cut is coloured by the error, where it is known: above 0 material is left.
    """
    error_mm = error_on(history, prediction)
    if error_mm is None:
        unknown_mm = np.full(history.left_by.shape, np.nan)
        return _figure(prediction, history, unknown_mm, "Finished part; its error is not known", "")
    words = "Error of the finished part by deflection"
    return _figure(prediction, history, error_mm, words, "Error normal to the surface (mm)")


def nominal_figure(
    prediction: Prediction, history: PartHistory | SurfaceHistory, above_mm: Floats, at_mm: Floats | None
) -> Figure:
    """Draw the same, coloured by the difference to the nominal part, see `part_error.above_on`."""
    off_mm = above_on(history, above_mm, at_mm)
    words = "Finished part against the nominal one"
    return _figure(prediction, history, off_mm, words, "Above the nominal part (mm)")


def _figure(
    prediction: Prediction,
    history: PartHistory | SurfaceHistory,
    off_mm: Floats,
    words: str,
    label: str,
) -> Figure:
    """Draw a part with how far it is off (r, c) or (s,), NaN where that is not known."""
    known = bool(label)
    end_mm = scale_end(off_mm) if known else 1.0
    shade = ScalarMappable(Normalize(-end_mm, end_mm), colormaps[OFF_COLOURS])
    colours = shade.to_rgba(np.nan_to_num(off_mm))[..., :3]
    colours[np.isnan(off_mm)] = _UNKNOWN
    colours[(history.left_by < 0) & ~(np.abs(np.nan_to_num(off_mm)) > 0.0)] = _UNCUT
    weight = np.where(history.left_by < 0, _LEAST_WEIGHT, 1.0)
    if isinstance(history, PartHistory):
        steep = 1.0 - np.abs(np.nan_to_num(history.normal[:, :, 2]))
        weight *= steep + 0.2  # walls are narrow, and shall be seen
        faces, upright = _of_heights(history, colours, weight), bool(np.allclose(history.to_field, np.eye(3)))
    else:
        faces, upright = _of_surface(history, colours, weight), True
    with look():
        figure = Figure(figsize=(11.0, 8.5), layout="constrained")
        grid = figure.add_gridspec(2, 2)
        places = [figure.add_subplot(place) for place in (grid[0, 0], grid[1, 0], grid[1, 1])]
        for axes, side in zip(places, _SIDES, strict=True):
            _draw(axes, faces, side)
        if not upright:
            places[0].set_title("Along the tool axis", loc="left")
        for name, set_label in (("X", places[0].set_xlabel), ("Y", places[0].set_ylabel)):
            set_label(f"{name} (mm)" if upright else "Across the tool axis (mm)")
        if known:
            if prediction.motion is not None:
                lines = lines_of(prediction.toolpath, prediction.motion)
                table = figure.add_subplot(grid[0, 1])
                _list_worst(table, places[0], prediction.motion, lines, history, off_mm)
            whole = f"{label}: above 0 material is left, below 0 too much is cut"
            figure.colorbar(shade, ax=places, label=whole, aspect=45, extend="both")
        figure.suptitle(titled(words, prediction.toolpath))
    return figure


def _of_heights(history: PartHistory, colours: Floats, weight: Floats) -> _Faces:
    """Return the squares between cells, with colours (r, c, 3) that are mixed by weights (r, c)."""
    x, y = (
        origin + (np.arange(count) + 0.5) * size
        for origin, count, size in zip(history.origin_mm, colours.shape[1::-1], history.cell_mm, strict=True)
    )
    heights = np.pad(history.heights_mm(), 1, constant_values=history.bottom_mm)
    plane = np.meshgrid(np.pad(x, 1, mode="edge"), np.pad(y, 1, mode="edge"))
    shades = np.concatenate([colours * weight[:, :, None], weight[:, :, None]], axis=2)
    mixed = _corners(np.pad(shades, ((1, 1), (1, 1), (0, 0)), mode="edge")).sum(axis=1)
    return _Faces(_corners(np.stack([*plane, heights], axis=2)), mixed[:, :3] / mixed[:, 3:])


def _of_surface(history: SurfaceHistory, colours: Floats, weight: Floats) -> _Faces:
    """Return the squares of a surface, with colours (s, 3) that are mixed by weights (s,)."""
    points, squares = history.surface()
    shades = np.concatenate([colours * weight[:, None], weight[:, None]], axis=1)
    mixed = shades[squares].sum(axis=1)
    return _Faces(points[squares], mixed[:, :3] / mixed[:, 3:])


def _draw(axes: Axes, faces: _Faces, side: _Side) -> None:
    """Draw squares that face a side, those in the back first; axes only where it looks straight down."""
    corners = faces.corners_mm
    across = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    normal = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    turn, tilt = np.radians(side.turn_deg), np.radians(side.tilt_deg)
    right = np.array([np.cos(turn), np.sin(turn), 0.0])
    ahead = np.array([-np.sin(turn), np.cos(turn), 0.0])
    up = np.sin(tilt) * ahead + np.cos(tilt) * np.array([0.0, 0.0, 1.0])
    to_eye = np.sin(tilt) * np.array([0.0, 0.0, 1.0]) - np.cos(tilt) * ahead
    order = np.argsort(corners.mean(axis=1) @ to_eye, kind="stable")
    order = order[(normal @ to_eye)[order] > 1e-6]
    colours = np.clip(faces.colours * _lit(normal)[:, None], 0.0, 1.0)[order]
    drawn = np.stack([corners @ right, corners @ up], axis=2)[order]
    squares = PolyCollection(list(drawn), facecolors=colours, edgecolors=colours, linewidths=0.2)
    squares.set_rasterized(True)
    axes.add_collection(squares)
    axes.autoscale_view()
    axes.set_aspect("equal")
    if side.tilt_deg < 90.0:
        axes.set_axis_off()
    axes.set_title(side.name, loc="left")


def _list_worst(
    table: Axes,
    above: Axes,
    motion: Motion,
    lines: Ints32,
    history: PartHistory | SurfaceHistory,
    off_mm: Floats,
) -> None:
    """List the places with the largest errors, and number them in the view from above.

    ``lines`` (m,) of the G-code by sample of the motion.
    """
    table.set_axis_off()
    table.set_title("Where it is off most", loc="left")
    is_off = np.isfinite(off_mm) & (off_mm != 0.0) & (history.left_by >= 0)
    samples, off_mm = history.left_by[is_off], off_mm[is_off]
    extent_mm = float(np.ptp(motion.position_mm, axis=0).max())
    chosen: list[int] = []
    for row in np.argsort(-np.abs(off_mm), kind="stable").tolist():
        away = motion.position_mm[samples[chosen]] - motion.position_mm[samples[row]]
        if (away**2).sum(axis=1).min(initial=np.inf) > (_APART * extent_mm) ** 2:
            chosen.append(row)
        if len(chosen) == _WORST:
            break
    rows: list[tuple[str, ...]] = [("", "error (mm)", "line", "X", "Y", "Z of the tip (mm)")]
    for number, row in enumerate(chosen, 1):
        tip, line = motion.position_mm[samples[row]], int(lines[samples[row]])
        rows.append((f"{number}", f"{off_mm[row]:+.3f}", f"{line}", *(f"{at:.1f}" for at in tip)))
        if isinstance(history, PartHistory):
            tip = history.to_field @ tip
        above.annotate(
            f"{number}",
            tip[:2],
            ha="center",
            va="center",
            fontsize=7,
            bbox={"boxstyle": "circle,pad=0.2", "facecolor": "white", "linewidth": 0.6},
        )
    for place, cells in enumerate(rows):
        for right, words in zip((0.04, 0.24, 0.4, 0.56, 0.72, 1.0), cells, strict=True):
            table.text(right, 0.95 - 0.09 * place, words, ha="right", transform=table.transAxes)


def _corners(values: Floats) -> Floats:
    """Return what stands at the four corners (f, 4, k) of the squares between points (r, c, k)."""
    corners = [values[:-1, :-1], values[:-1, 1:], values[1:, 1:], values[1:, :-1]]
    return np.stack(corners, axis=2).reshape(-1, 4, values.shape[2])


def _lit(normal: Floats) -> Floats:
    """Return how bright (f,) what faces so is."""
    return np.asarray(0.62 + 0.38 * np.clip(np.abs(normal @ _LIGHT), 0.0, 1.0))
