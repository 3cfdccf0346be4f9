"""Corners are rounded with another approximation distance than programmed."""

import math
from dataclasses import replace

import numpy as np

from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect, Target
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter


class Corner(Effect):
    """``$APO.CDIS`` really used at every corner that is approximated; exact stops stay exact stops.

    Where the program has several distances all become this one. The motion is planned anew.
    """

    name = "corner"
    family = "timing"
    links = frozenset({"timing", "path"})
    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.CORNERS, Dependence.VELOCITY, Dependence.TRAVEL, Dependence.PLACE})
    needs = frozenset({"plan"})
    parameters = (
        Parameter(
            name="cdis_mm",
            unit="mm",
            low=0.0,
            high=50.0,
            nominal=math.nan,
            start=1.0,
            minimum=0.0,
            source="$APO.CDIS of milling programs 0.05-5 mm; KUKA's examples up to 50 mm",
        ),
    )

    def nominal(self, inputs: Inputs, target: Target = None) -> dict[str, float]:
        """Return the distance that most corners have."""
        programmed = np.zeros(0) if inputs.targets is None else inputs.targets.cdis_mm
        distances, counts = np.unique(programmed[programmed > 0.0], return_counts=True)
        most = distances[np.argmax(counts)] if len(distances) else inputs.cell.controller.cdis_mm
        return {"cdis_mm": float(most)}

    def start(self, inputs: Inputs, target: Target = None) -> dict[str, float]:
        """Return twice the distance that most corners have."""
        return {"cdis_mm": 2.0 * self.nominal(inputs)["cdis_mm"] or 0.1}

    def replan(self, inputs: Inputs, applied: Applied) -> Inputs:
        """Return the inputs of the motion with this distance."""
        if inputs.targets is None or math.isnan(applied["cdis_mm"]):
            return inputs
        programmed = inputs.targets.cdis_mm
        used = np.where(programmed > 0.0, applied["cdis_mm"], programmed)
        if np.array_equal(used, programmed):
            return inputs
        return inputs.replanned(replace(inputs.targets, cdis_mm=used), inputs.cell)


EFFECT = Corner()
