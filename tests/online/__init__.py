"""The server beside the controller, and what it reads of a program."""

import numpy as np

from gcode2krl.pilot import Knots, PilotHeader


def pilot_of(time_s, force_N, frame="base", form="index", checksum=1):
    """Return knots at 25 mm/s, told 40 ms ahead, and the header of their file."""
    time_s, count = np.array(time_s), len(time_s)
    knots = Knots(
        line=np.ones(count, dtype=np.int32),
        path_mm=25.0 * time_s,
        time_s=time_s,
        lead_s=np.full(count, 0.04),
        force_N=np.array(force_N, dtype=float),
        deflection_mm=np.zeros((count, 3)),
    )
    return knots, PilotHeader(frame, form, "$SEN_PINT[1]", 0.04, checksum)
