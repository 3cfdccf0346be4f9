"""The force signal comes late."""

from gcode2krl.effects.effect import Applied, Effect, Load, Parameter
from gcode2krl.effects.inputs import Inputs, resampled


class ForceDelay(Effect):
    """The sensor states at t what was true at t - ``delay_s``: filters and buses of its chain.

    The time stamps are right, unlike under `clock`; a shift alone cannot tell the two apart.
    """

    name = "force_delay"
    family = "sensor"
    links = frozenset({"force"})
    parameters = (
        Parameter(
            "delay_s", "s", 0.0, 0.5, nominal=0.0, start=0.02, minimum=0.0,
            source="force chain plus the robot's reaction 100-150 ms, the chain alone 5-50 ms",
        ),
    )  # fmt: skip

    def sensor(self, load: Load, inputs: Inputs, applied: Applied) -> Load:
        """Return what the sensor states."""
        if applied["delay_s"] == 0.0:
            return load
        then_s = inputs.time_s - applied["delay_s"]
        return resampled(load[0], inputs.time_s, then_s), resampled(load[1], inputs.time_s, then_s)


EFFECT = ForceDelay()
