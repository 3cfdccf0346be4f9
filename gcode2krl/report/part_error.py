"""How far the finished part is off by the deflection, and where the scale of such a map ends."""

import numpy as np

from gcode2krl.arrays import Floats
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
