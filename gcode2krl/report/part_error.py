"""How far the finished part is off: by the deflection, and from the nominal part; where such a scale ends."""

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.prediction import Prediction
from gcode2krl.tables import PartHistory, SurfaceHistory

_MOST_OF_CELLS = 99.5
_STEPS_MM = (0.01, 0.02, 0.03, 0.05, 0.1, 0.2, 0.3, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 5.0)


def scale_end(off_mm: Floats) -> float:
    """Return where a scale about zero ends that nearly all values are within, mm."""
    most = float(np.nanpercentile(np.abs(off_mm), _MOST_OF_CELLS))
    return next((step for step in _STEPS_MM if step >= most), _STEPS_MM[-1])


def error_on(history: PartHistory | SurfaceHistory, prediction: Prediction) -> Floats | None:
    """Return the error (r, c) that the deflection leaves, above 0 where material is left; None if unknown.

    It is unknown for a compensated program, whose path is moved against the deflection.
    """
    bent = prediction.deflection
    if bent is None or "compensate" in prediction.inputs:
        return None
    off_mm = history.error_mm(bent.deflection_base_mm)
    return off_mm if bool(np.isfinite(off_mm).any()) else None


def above_on(history: PartHistory | SurfaceHistory, above_mm: Floats, at_mm: Floats | None) -> Floats:
    """Return by how much the part is above the nominal one: (r, c) as the history, or (s,) of a surface.

    ``above_mm`` (r, c) over the whole part, or (n,) at places ``at_mm`` (n, 3); of several near a cell or a
    site that which is farthest from 0 counts.
    """
    if isinstance(history, PartHistory):
        shape = history.raw_mm.shape
        places = [
            ((np.arange(count) + 0.5) / count * wanted).astype(np.int64)
            for count, wanted in zip(above_mm.shape, shape, strict=True)
        ]
        row, column = np.meshgrid(*places, indexing="ij")
        return _farthest((row, column), above_mm, shape)
    from scipy.spatial import cKDTree

    points_mm, squares = history.surface()
    stands = np.unique(squares)
    nearest = cKDTree(points_mm[stands]).query(np.zeros((0, 3)) if at_mm is None else at_mm)[1]
    return _farthest((stands[nearest],), above_mm, history.site.shape)


def _farthest(place: tuple[Ints, ...], off_mm: Floats, shape: tuple[int, ...]) -> Floats:
    """Return in an array that of the values at each place which is farthest from 0."""
    worst = np.zeros((2, *shape))
    np.maximum.at(worst[0], place, off_mm)
    np.minimum.at(worst[1], place, off_mm)
    farthest: Floats = np.where(worst[0] >= -worst[1], worst[0], worst[1])
    return farthest
