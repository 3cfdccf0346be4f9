"""The controller's time law uses other constants than the cell states."""

import math

from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect, Target
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter

_OWN = math.nan


class VelocityRule(Effect):
    """The controller's smoothing time k and path acceleration are really these; not given = as in the cell.

    The motion is planned anew by the laws of `krc4` (Bigliardi et al. 2022), with the material removed anew
    where forces are known: the chip follows the speed.
    """

    name = "velocity_rule"
    family = "timing"
    links = frozenset({"timing", "path"})
    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.VELOCITY, Dependence.ACCELERATION, Dependence.TRAVEL})
    needs = frozenset({"plan"})
    parameters = (
        Parameter(
            name="k_s",
            unit="s",
            low=0.0,
            high=0.5,
            nominal=_OWN,
            start=0.2,
            minimum=0.0,
            usual=lambda mismatch: mismatch.k_s,
            source="0.168 s measured on one KR 210 (Bigliardi et al. 2022); others unknown",
        ),
        Parameter(
            name="acc_cp_m_s2",
            unit="m/s2",
            low=0.2,
            high=10.0,
            nominal=_OWN,
            start=1.5,
            minimum=0.01,
            usual=lambda mismatch: mismatch.acc_m_s2,
            source="$ACC.CP of programs 0.5-5 m/s2, drives of large arms up to 10",
        ),
    )

    def nominal(self, inputs: Inputs, target: Target = None) -> dict[str, float]:
        """Return the cell's own constants."""
        controller = inputs.cell.controller
        return {"k_s": controller.k_s, "acc_cp_m_s2": controller.acc_cp_m_s2}

    def start(self, inputs: Inputs, target: Target = None) -> dict[str, float]:
        """Return constants a fifth above and below the cell's."""
        controller = inputs.cell.controller
        return {"k_s": 1.2 * controller.k_s or 0.05, "acc_cp_m_s2": 0.8 * controller.acc_cp_m_s2}

    def replan(self, inputs: Inputs, applied: Applied) -> Inputs:
        """Return the inputs of the motion with these constants."""
        nominal = self.nominal(inputs)
        used = {name: nominal[name] if math.isnan(applied[name]) else applied[name] for name in nominal}
        if used == nominal or inputs.targets is None:
            return inputs
        controller = inputs.cell.controller.model_copy(update=used)
        return inputs.replanned(inputs.targets, inputs.cell.model_copy(update={"controller": controller}))


EFFECT = VelocityRule()
