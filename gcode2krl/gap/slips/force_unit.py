"""The force table is in another unit than newtons."""

from collections.abc import Mapping, Sequence
from math import log

import numpy as np

from gcode2krl.effects import Applied, Effect
from gcode2krl.gap.beside.links import FORCE
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.slips.slip import Slip, rms_left, slip_if_explained
from gcode2krl.gap.thresholds import THRESHOLDS

_NAME = "unit"
_UNITS = {
    1e-3: "kilonewtons",
    0.1019716: "kilograms-force",
    0.2248089: "pounds-force",
    1e3: "millinewtons",
    10.0: "decinewtons",
}
"""How many of a unit a newton is."""


class ForceUnitTest:
    """Another unit of force, by the factor between measured and predicted forces."""

    effects = (_NAME,)

    def find(self, pairs: Sequence[Pair], library: Mapping[str, Effect]) -> list[Slip]:
        """Return the unit, where the forces are those of the prediction in it."""
        traces, effect = FORCE.traces(pairs), library.get(_NAME)
        if effect is None or not any(trace.nominal.any() for trace in traces):
            return []
        power = sum(float(np.sum(trace.nominal**2)) for trace in traces)
        factor = max(sum(float(np.sum(trace.nominal * trace.measured)) for trace in traces) / power, 1e-12)
        unit = min(_UNITS, key=lambda known: abs(log(factor / known)))
        if abs(log(factor / unit)) > THRESHOLDS.slips.force_unit_log:
            return []
        applied = Applied(effect, "force", {"factor": unit})
        words = f"force.csv is {unit:g} times the predicted force: {_UNITS[unit]} in place of newtons"
        return slip_if_explained(traces, applied, rms_left(traces, applied), words)
