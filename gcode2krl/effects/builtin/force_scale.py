"""One direction of the cutting force is larger than the coefficients say."""

from gcode2krl.cell import Cell
from gcode2krl.effects.coefficients import with_scaled_part
from gcode2krl.effects.effect import Applied, Effect, Load, Parameter, Target
from gcode2krl.effects.inputs import Inputs

_PARTS = ("tangential", "radial", "axial")


class ForceScale(Effect):
    """Cutting and edge coefficients of one direction on the tooth are ``scale`` times the material's.

    Forces are linear in them: what the part brings is found once, with the material removed under twice the
    coefficients, and then scaled.
    """

    name = "force_scale"
    family = "force"
    links = frozenset({"force"})
    needs = frozenset({"cut"})
    parameters = (
        Parameter(
            "scale", "", 0.3, 3.0, nominal=1.0, start=1.2, linear=True, minimum=0.0,
            source="coefficients of a prior are 30-50 % off; wear +20-100 %",
        ),
    )  # fmt: skip

    def targets(self, cell: Cell) -> tuple[Target, ...]:
        """Return tangential, radial, axial."""
        return _PARTS

    def cut(self, load: Load, inputs: Inputs, applied: Applied) -> Load:
        """Return the load with that part scaled."""
        more = applied["scale"] - 1.0
        if more == 0.0:
            return load
        force_N, moment_Nmm = inputs.recut(with_scaled_part(inputs.cell, applied.target or "", 2.0))
        return (
            load[0] + more * (force_N - inputs.force_base_N),
            load[1] + more * (moment_Nmm - inputs.moment_base_Nmm),
        )


EFFECT = ForceScale()
