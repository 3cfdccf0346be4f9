"""Set-up slip: the override was not at 100 %."""

from dataclasses import replace

from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter


class Override(Effect):
    """Every programmed speed was ``percent`` of itself; path and accelerations stay ($OV_PRO).

    The motion is planned anew, the material removed anew where forces are known.
    """

    name = "override"
    family = "set-up slips"
    links = frozenset({"timing"})
    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.VELOCITY, Dependence.TRAVEL})
    kind = "slip"
    needs = frozenset({"plan"})
    parameters = (
        Parameter(
            name="percent",
            unit="%",
            low=1.0,
            high=200.0,
            nominal=100.0,
            start=50.0,
            minimum=0.1,
            source="the switch goes to 100 %; programs made at half speed look like 200 %",
        ),
    )

    def replan(self, inputs: Inputs, applied: Applied) -> Inputs:
        """Return the inputs at that speed."""
        share = applied["percent"] / 100.0
        if share == 1.0 or inputs.targets is None:
            return inputs
        controller = inputs.cell.controller
        slower = controller.model_copy(
            update={
                "rapid_m_s": controller.rapid_m_s * share,
                "vel_ori_deg_s": controller.vel_ori_deg_s * share,
            }
        )
        targets = replace(inputs.targets, speed_mm_s=inputs.targets.speed_mm_s * share)
        return inputs.replanned(targets, inputs.cell.model_copy(update={"controller": slower}))


EFFECT = Override()
