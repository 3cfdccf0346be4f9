"""The cutter is larger or smaller than stated."""

from dataclasses import replace

from gcode2krl.effects.arm import Load
from gcode2krl.effects.coefficients import with_larger_tools
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter
from gcode2krl.effects.signals import Signals


class ToolDiameter(Effect):
    """True diameter = stated diameter + ``offset_mm``, of every tool of the program.

    Walls of the part move by half of it; where forces are known the material is removed again.
    """

    name = "tool_diameter"
    family = "part"
    links = frozenset({"part", "force"})
    where = frozenset({Where.TIP, Where.FORCE_AXIS})
    depends_on = frozenset({Dependence.CONSTANT, Dependence.FORCE})
    parameters = (
        Parameter(
            name="offset_mm",
            unit="mm",
            low=-2.0,
            high=2.0,
            nominal=0.0,
            start=0.05,
            usual=lambda mismatch: mismatch.diameter_mm,
            source="new end mills -0.03 mm, reground ones to -0.5 mm",
        ),
    )

    def cut(self, load: Load, inputs: Inputs, applied: Applied) -> Load:
        """Return the load of the true cutter."""
        if applied["offset_mm"] == 0.0 or "cut" not in inputs.offers:
            return load
        force_N, moment_Nmm = inputs.recut(with_larger_tools(inputs.cell, applied["offset_mm"]))
        return load[0] + force_N - inputs.force_base_N, load[1] + moment_Nmm - inputs.moment_base_Nmm

    def instruments(self, signals: Signals, applied: Applied) -> Signals:
        """Return the signals with the radius that the finished part shows."""
        return replace(signals, radius_offset_mm=signals.radius_offset_mm + applied["offset_mm"] / 2.0)


EFFECT = ToolDiameter()
