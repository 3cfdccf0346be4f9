"""The force signal comes late."""

from gcode2krl.effects.arm import Load
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect
from gcode2krl.effects.inputs import Inputs, resampled
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.effects.parameter import Parameter


class ForceDelay(Effect):
    """The sensor states at t what was true at t - ``delay_s``: filters and buses of its chain.

    The time stamps are right, unlike under `clock`; a shift alone cannot tell the two apart.
    """

    name = "force_delay"
    family = "sensor"
    links = frozenset({"force"})
    where = frozenset({Where.FORCE_AXIS})
    depends_on = frozenset({Dependence.VELOCITY, Dependence.FORCE})
    parameters = (
        Parameter(
            name="delay_s",
            unit="s",
            low=0.0,
            high=0.5,
            nominal=0.0,
            start=0.02,
            minimum=0.0,
            source="force chain plus the robot's reaction 100-150 ms, the chain alone 5-50 ms",
        ),
    )

    def usual(self, mismatch: Mismatch, duration_s: float, clocks: int = 1) -> dict[str, float]:
        """Return what the clocks may be off by: a delay shows as a clock does."""
        return {"delay_s": clocks * mismatch.clock_s}

    def sensor(self, load: Load, inputs: Inputs, applied: Applied) -> Load:
        """Return what the sensor states."""
        if applied["delay_s"] == 0.0:
            return load
        then_s = inputs.time_s - applied["delay_s"]
        return resampled(load[0], inputs.time_s, then_s), resampled(load[1], inputs.time_s, then_s)


EFFECT = ForceDelay()
