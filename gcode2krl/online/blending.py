"""Blends the measured force with the pilot's estimate (Haehn & Weigold 2020, section 2.3).

While both differ by less than a threshold the measurement is used: it includes wear and the real material.
Beyond the threshold a change of direction or the cutter's exit is assumed, which the filtered measurement
shows too late: the signal changes to the estimate linearly within the blend time, and back in the same way.

Our choices where the paper is silent: the difference is the length of the vector; blending back takes the
same time; and an estimate that stays beyond the threshold while it does not change is a wrong estimate, not
an event. It is then not used until both agree again.
"""

from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.cell.sections.online import Online
from gcode2krl.compiled.core import BOOLS, FLOAT, FLOATS, OUT_BOOLS, OUT_FLOATS, core_function
from gcode2krl.compiled.inputs import shaped

STEADY_SHARE = 0.2
"""An estimate is steady while it changes by less than this fraction of the threshold; our choice."""
WEIGHT, BEYOND_S, DISTRUSTED = 0, 1, 2
ANCHOR, LAST = 3, 6

_blend = core_function(
    "online_blend",
    *(FLOATS, FLOATS, BOOLS, OUT_FLOATS),
    *(FLOAT, FLOAT, FLOAT, FLOAT),
    *(OUT_FLOATS, OUT_FLOATS, OUT_BOOLS),
)


class BlendState(NamedTuple):
    """State of the blend."""

    values: Floats
    """(9,) weight of the estimate, time beyond the threshold in a steady cut, distrust; the estimate at the
    start of that time (3), and the last known estimate (3)."""


class Blend(NamedTuple):
    """The load to compensate, and how it was blended."""

    load: Floats
    """(n, 6)"""
    weight: Floats
    """(n,) weight of the estimate, 0 to 1."""
    distrusted: Bools
    """(n,) True while an estimate is not trusted."""


def blend_start() -> BlendState:
    """Return the state before the first sample: the measurement is used."""
    return BlendState(np.zeros(9))


def blended(
    state: BlendState, measured: Floats, estimate_N: Floats, known: Bools, settings: Online
) -> tuple[BlendState, Blend]:
    """Return the superposition of measured loads (n, 6) and estimated forces (n, 3).

    ``known`` (n,) is False where there is no estimate; the last one is then blended out as above.
    The estimate has no moment: its part of the load has none.
    """
    values = shaped("measured", measured, -1, 6)
    after = BlendState(state.values.copy())
    blend = Blend(np.empty(values.shape), np.empty(len(values)), np.zeros(len(values), dtype=np.bool_))
    patience_s = settings.pilot_lead_s + settings.blend_s + 2.0 * settings.filter_s
    estimate = shaped("estimate_N", estimate_N, len(values), 3)
    _blend(
        values,
        estimate,
        np.ascontiguousarray(known),
        after.values,
        settings.cycle_s,
        settings.threshold_N,
        settings.blend_s,
        patience_s,
        blend.load,
        blend.weight,
        blend.distrusted,
    )
    return after, blend
