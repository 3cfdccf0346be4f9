"""One direction of the cutting force is larger than the coefficients say."""

from gcode2krl.cell import Cell
from gcode2krl.effects.arm import Load
from gcode2krl.effects.coefficients import with_scaled_direction
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect, Target
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter

_DIRECTIONS = ("tangential", "radial", "axial")


class ForceScale(Effect):
    """Cutting and edge coefficients of one direction on the tooth are ``scale`` times the material's.

    Forces are linear in them: the material is removed again once, with twice these coefficients; what that
    adds is scaled.
    """

    name = "force_scale"
    family = "force"
    links = frozenset({"force"})
    where = frozenset({Where.FORCE_AXIS})
    depends_on = frozenset({Dependence.FORCE})
    is_nuisance = True
    needs = frozenset({"cut"})
    parameters = (
        Parameter(
            name="scale",
            unit="",
            low=0.3,
            high=3.0,
            nominal=1.0,
            start=1.2,
            linear=True,
            minimum=0.0,
            usual=lambda mismatch: mismatch.coefficients,
            source="coefficients of a prior are 30-50 % off; wear +20-100 %",
        ),
    )

    def targets(self, cell: Cell) -> tuple[Target, ...]:
        """Return tangential, radial, axial."""
        return _DIRECTIONS

    def cut(self, load: Load, inputs: Inputs, applied: Applied) -> Load:
        """Return the load with that direction scaled."""
        more = applied["scale"] - 1.0
        if more == 0.0:
            return load
        force_N, moment_Nmm = inputs.recut(with_scaled_direction(inputs.cell, applied.target or "", 2.0))
        return (
            load[0] + more * (force_N - inputs.force_base_N),
            load[1] + more * (moment_Nmm - inputs.moment_base_Nmm),
        )


EFFECT = ForceScale()
