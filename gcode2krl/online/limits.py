"""The limits of every correction (sum, rate, step) and the PID controller before them."""

from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.cell.sections.online import Gains, Online
from gcode2krl.compiled.core import BOOLS, FLOAT, FLOATS, INT, OUT_FLOATS, core_function
from gcode2krl.compiled.inputs import shaped
from gcode2krl.units import RAD_PER_DEG

NO_CORRECTION = 1e6
"""mm or rad: a wanted value of this size or more is treated as invalid."""

_limit = core_function(
    "online_limit",
    *(FLOATS, BOOLS, OUT_FLOATS, OUT_FLOATS, OUT_FLOATS),
    *(FLOATS, FLOATS, INT, FLOATS, FLOAT),
    OUT_FLOATS,
)
_shrink = core_function("online_shrink", OUT_FLOATS, FLOATS, INT)


class Bounds(NamedTuple):
    """Limits of a correction, and the gains."""

    most: Floats
    """(w,) largest value of each component; of a vector its length."""
    step: Floats
    """(w,) largest change from one cycle to the next; of a vector its length."""
    is_vector: bool
    """True: the limits apply to the length of the vector, and its direction is kept."""
    gains: Floats
    """(w, 3) P, I in 1/s, D in s."""
    cycle_s: float


class LimitState(NamedTuple):
    """State of the controller."""

    sent: Floats
    """(w,) the last correction."""
    integral: Floats
    wanted: Floats
    """(w,) the last set value; NaN before the first."""


def cartesian_bounds(settings: Online) -> Bounds:
    """Return the bounds of a correction x, y, z in mm."""
    step_mm = min(settings.step_mm, settings.rate_mm_s * settings.cycle_s)
    three = np.ones(3)
    return Bounds(
        settings.most_mm * three, step_mm * three, True, _gains((settings.gains,) * 3), settings.cycle_s
    )


def axis_bounds(settings: Online) -> Bounds:
    """Return the bounds of a correction of A1 to A6 in rad."""
    most = np.array(settings.axis_most_deg) * RAD_PER_DEG
    step = np.array(settings.axis_rate_deg_s) * RAD_PER_DEG * settings.cycle_s
    return Bounds(most, step, False, _gains(settings.axis_gains), settings.cycle_s)


def _gains(gains: tuple[Gains, ...]) -> Floats:
    return np.array([(g.p, g.i_1_s, g.d_s) for g in gains])


def limit_start(width: int) -> LimitState:
    """Return the state before the first sample: no correction."""
    return LimitState(np.zeros(width), np.zeros(width), np.full(width, np.nan))


def limited(state: LimitState, wanted: Floats, held: Bools, bounds: Bounds) -> tuple[LimitState, Floats]:
    """Return the corrections (n, w) that are sent for the wanted ones (n, w).

    u = P·r + I·∫(r - u)dt + D·dr/dt, with r limited to the largest correction; then u is limited to the
    largest correction and step. The integral uses the correction that was sent, so it neither winds up nor
    changes a correction that is reached. Where ``held`` (n,), or where r is NaN or beyond `NO_CORRECTION`,
    the correction does not change.
    """
    width = len(bounds.most)
    values = shaped("wanted", wanted, -1, width)
    after = LimitState(*(part.copy() for part in state))
    out = np.empty(values.shape)
    _limit(
        values,
        np.ascontiguousarray(held),
        *after,
        bounds.most,
        bounds.step,
        bounds.is_vector,
        bounds.gains,
        bounds.cycle_s,
        out,
    )
    return after, out


def towards(sent: Floats, wanted: Floats, bounds: Bounds) -> Floats:
    """Return the correction (w,) one step closer to a wanted one (w,), for moves without a force."""
    change = wanted - sent
    _shrink(change, bounds.step, bounds.is_vector)
    return sent + change
