"""A structural mode that rings."""

from types import MappingProxyType

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect, Target, Values
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.operators import second_order
from gcode2krl.effects.parameter import DIRECTION, Parameter, Role, direction_parameters
from gcode2krl.units import RAD_PER_REV

_NEARBY = (0.97, 0.98, 0.99, 1.0, 1.01, 1.02, 1.03)
_DAMPINGS = (0.01, 0.02, 0.05)


class Vibration(Effect):
    """One mode along a direction n in ``$BASE``: u'' + 2·zeta·w·u' + w²·u = drive, tip += participation·n·u.

    Driven by force, through the static deflection d(t) it takes part in, and by the commanded acceleration
    a(t): u = H·(n·d - n·a/w²) - n·d with H the second-order lag of the mode, so that at rest under a steady
    force nothing is added to the static model.
    """

    name = "vibration"
    family = "compliance"
    links = frozenset({"mechanics"})
    where = frozenset({Where.TIP})
    depends_on = frozenset({Dependence.ACCELERATION, Dependence.FORCE, Dependence.TONE})
    vectors = MappingProxyType({"direction": DIRECTION})
    direction = DIRECTION
    parameters = (
        Parameter(
            name="hz",
            unit="Hz",
            low=3.0,
            high=40.0,
            nominal=None,
            start=12.0,
            grid=(7.0, 10.0, 14.0, 19.0, 25.0),
            minimum=0.1,
            role=Role.FREQUENCY,
            source="modes of large arms 7-25 Hz",
        ),
        Parameter(
            name="damping",
            unit="",
            low=0.005,
            high=0.2,
            nominal=None,
            start=0.03,
            grid=(0.03,),
            minimum=0.0,
            source="structural damping 1-6 %",
        ),
        Parameter(
            name="participation",
            unit="",
            low=0.0,
            high=3.0,
            nominal=0.0,
            start=0.5,
            minimum=0.0,
            source="share of the mode in the static deflection; above 1 where several act as one",
        ),
        *direction_parameters("any"),
    )

    def combined(
        self, coefficients: Floats, inputs: Inputs, target: Target = None, shape: Values | None = None
    ) -> dict[str, float]:
        """Return the values whose squared direction has these shares: the effect goes with n·nᵀ."""
        values = self.nominal(inputs, target) | dict(shape or {})
        parts = np.maximum(np.asarray(coefficients, dtype=float), 0.0)
        values["participation"] = float(parts.sum()) * self.start(inputs, target)["participation"]
        if parts.sum() > 0.0:
            values |= dict(zip(DIRECTION, np.sqrt(parts / parts.sum()).tolist(), strict=True))
        return values

    def alternatives(self, values: Values) -> tuple[dict[str, float], ...]:
        """Return these values with the direction's other signs, nearby frequencies and other dampings.

        The first order goes with n·nᵀ; a mode rings for many turns, so that a frequency off by one in a
        hundred is out of step soon.
        """
        return tuple(
            dict(values)
            | {"direction_y": sign_y * values["direction_y"], "direction_z": sign_z * values["direction_z"]}
            | {"hz": factor * values["hz"], "damping": damping}
            for sign_y in (1.0, -1.0)
            for sign_z in (1.0, -1.0)
            for factor in _NEARBY
            for damping in _DAMPINGS
        )

    def tcp(self, tcp_mm: Floats, deflection_mm: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the tip with the mode's motion."""
        if applied["participation"] == 0.0:
            return tcp_mm
        along, w_rad_s = applied.unit_vector(), RAD_PER_REV * applied["hz"]
        static = deflection_mm @ along
        damping = min(applied["damping"], 0.999)
        # H·(-a/w²) = H·(p + 2·zeta/w·p') - p: places between samples are nearer to a line than accelerations
        place = (inputs.position_mm - inputs.position_mm[:1]) @ along
        driven = static + place
        drive = driven + 2.0 * damping / w_rad_s * (inputs.velocity_mm_s @ along)
        ringing = second_order(drive, inputs.time_s, applied["hz"], damping) - driven
        return tcp_mm + applied["participation"] * ringing[:, None] * along


EFFECT = Vibration()
