"""The places where a quantity is worst, one window of time for each."""

import numpy as np

from gcode2krl.arrays import Bools, Floats

PLACES = 3
HALF_S = 0.6
"""Half a window: some 100 samples of the controller's cycle."""
_APART = 0.02
"""Share of the whole time that lies between two places, so that they are not one."""


def worst_rows(time_s: Floats, values: Floats, places: int = PLACES, half_s: float = HALF_S) -> list[int]:
    """Return rows of the largest values (m,) above zero, the worst first, no two in one window.

    Of a plateau it is the row where it begins.
    """
    remaining = np.where(np.isfinite(values), values, 0.0)
    apart_s = max(2.0 * half_s, _APART * float(time_s[-1] - time_s[0]))
    rows: list[int] = []
    for _ in range(places):
        largest = float(remaining.max(initial=0.0))
        if largest <= 0.0:
            break
        row = int(np.argmax(remaining >= largest * (1.0 - 1e-6)))
        rows.append(row)
        start, end = np.searchsorted(time_s, (time_s[row] - apart_s, time_s[row] + apart_s))
        remaining[start:end] = 0.0
    return rows


def around(time_s: Floats, row: int, half_s: float = HALF_S) -> slice:
    """Return the rows of the window about a row."""
    start, end = np.searchsorted(time_s, (time_s[row] - half_s, time_s[row] + half_s))
    return slice(int(start), int(end))


def lost_s(time_s: Floats, speed_mm_s: Floats, feed_mm_s: Floats, rapid: Bools) -> Floats:
    """Return (m,) the time lost against the programmed feed in the window that is centred on each sample."""
    step_s = np.diff(time_s, append=time_s[-1:])
    slow = np.isfinite(feed_mm_s) & ~rapid & (feed_mm_s > 0.0)
    share = np.where(slow, 1.0 - np.divide(speed_mm_s, feed_mm_s, where=slow, out=np.ones(len(time_s))), 0.0)
    total = np.append(0.0, np.cumsum(np.maximum(share, 0.0) * step_s))
    start, end = (np.searchsorted(time_s, time_s + side * HALF_S) for side in (-1, 1))
    lost: Floats = total[end] - total[start]
    return lost
