"""Exact stops where the program has a rounded corner."""

from dataclasses import replace

import numpy as np

from gcode2krl.arrays import Ints
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter


class AdvanceStop(Effect):
    """Something stops the advance run: ``count`` approximated corners become exact stops of ``hold_s``.

    Which ones is not known beforehand; they are taken evenly spread over the approximated corners. The count
    is rounded to a whole number.
    """

    name = "advance_stop"
    family = "timing"
    links = frozenset({"timing", "path"})
    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.STOPS, Dependence.VELOCITY, Dependence.TRAVEL})
    needs = frozenset({"plan"})
    parameters = (
        Parameter(
            name="count",
            unit="",
            low=0.0,
            high=50.0,
            nominal=0.0,
            start=3.0,
            minimum=0.0,
            source="each WAIT or output outside a TRIGGER is one",
        ),
        Parameter(
            name="hold_s",
            unit="s",
            low=0.0,
            high=5.0,
            nominal=None,
            start=0.1,
            grid=(0.0, 0.1, 0.5),
            minimum=0.0,
            source="a mere stop, a cycle of the submit interpreter, a WAIT SEC",
        ),
    )

    def replan(self, inputs: Inputs, applied: Applied) -> Inputs:
        """Return the inputs of the motion with these stops."""
        count = round(applied["count"])
        if count < 1 or inputs.targets is None:
            return inputs
        targets = inputs.targets
        corners = np.flatnonzero(targets.cdis_mm > 0.0)
        if len(corners) == 0:
            return inputs
        chosen = corners[((np.arange(count) + 0.5) / count * len(corners)).astype(int)]
        return with_stops(inputs, chosen, applied["hold_s"])


def with_stops(inputs: Inputs, rows: Ints, hold_s: float) -> Inputs:
    """Return the inputs of the motion that stops exactly at some targets and stands there so long."""
    targets = inputs.targets
    if targets is None or len(rows) == 0:
        return inputs
    cdis_mm, wait_s = np.array(targets.cdis_mm), np.array(targets.wait_s)
    cdis_mm[rows], wait_s[rows] = 0.0, wait_s[rows] + hold_s
    return inputs.replanned(replace(targets, cdis_mm=cdis_mm, wait_s=wait_s), inputs.cell)


EFFECT = AdvanceStop()
