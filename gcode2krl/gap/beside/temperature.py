"""Temperatures that a run has logged, at the samples of its model."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.runs import Controller, Poses


def temperature_at(table: Controller | Poses | None, time_s: Floats) -> Floats | None:
    """Return the logged temperatures (m, c) at times (m,), the ambient last; None where none was logged.

    They change over minutes: gaps are filled linearly, and clocks of tables do not matter.
    """
    if table is None:
        return None
    logged = [each for each in (table.temperature_C, table.ambient_C) if each is not None]
    columns = [column for each in logged for column in each.T if np.isfinite(column).any()]
    if not columns:
        return None
    known = [np.isfinite(column) for column in columns]
    return np.stack(
        [
            np.interp(time_s, table.time_s[rows], column[rows])
            for column, rows in zip(columns, known, strict=True)
        ],
        axis=1,
    )
