"""Set-up slip: another cutter in the spindle."""

from dataclasses import replace

from gcode2krl.arrays import Floats
from gcode2krl.effects.arm import Load
from gcode2krl.effects.coefficients import with_larger_tools
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect, Target
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter
from gcode2krl.effects.signals import Signals

_SURE_LENGTH_MM = 0.1
"""Coefficients of force known to 3 % tell a depth of cut of some millimetres no better than this."""


class SwappedTool(Effect):
    """The cutter is larger in diameter, or longer, than the stated one by these amounts.

    A longer one has its tip further from the holder and cuts deeper; where forces are known the material is
    removed again.
    """

    name = "swapped_tool"
    family = "set-up slips"
    links = frozenset({"mechanics", "force", "part"})
    where = frozenset({Where.TIP, Where.FORCE_AXIS})
    depends_on = frozenset({Dependence.CONSTANT, Dependence.PLACE, Dependence.FORCE})
    kind = "slip"
    searched_in = frozenset({"force", "mechanics"})
    parameters = (
        Parameter(
            name="diameter_mm",
            unit="mm",
            low=-30.0,
            high=30.0,
            nominal=0.0,
            start=2.0,
            usual=lambda mismatch: mismatch.diameter_mm,
            source="the next tool of a rack: 1-10 mm",
        ),
        Parameter(
            name="length_mm",
            unit="mm",
            low=-200.0,
            high=200.0,
            nominal=0.0,
            start=5.0,
            linear=True,
            usual=lambda mismatch: mismatch.length_mm,
            source="another length of the same cutter: 5-100 mm",
        ),
    )

    def searched(self, link: str, target: Target, examined: frozenset[str]) -> bool:
        """Try it against forces, against the tip only without them: each try removes the material again."""
        told_by_force = link == "mechanics" and "force" in examined
        return not told_by_force and super().searched(link, target, examined)

    def learned(self, applied: Applied, link: str) -> Applied:
        """Return the tool without a length that forces cannot tell from none."""
        if link != "force" or abs(applied["length_mm"]) > _SURE_LENGTH_MM:
            return applied
        return replace(applied, values={**applied.values, "length_mm": 0.0})

    def cut(self, load: Load, inputs: Inputs, applied: Applied) -> Load:
        """Return the load of that cutter."""
        larger_mm, longer_mm = applied["diameter_mm"], applied["length_mm"]
        if (larger_mm == 0.0 and longer_mm == 0.0) or "cut" not in inputs.offers:
            return load
        shift_mm = -longer_mm * inputs.tool_rotation[:, :, 2] if longer_mm else None
        force_N, moment_Nmm = inputs.recut(with_larger_tools(inputs.cell, larger_mm), shift_mm)
        return load[0] + force_N - inputs.force_base_N, load[1] + moment_Nmm - inputs.moment_base_Nmm

    def tcp(self, tcp_mm: Floats, deflection_mm: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the tip of that cutter."""
        longer_mm = applied["length_mm"]
        return tcp_mm if longer_mm == 0.0 else tcp_mm - longer_mm * inputs.tool_rotation[:, :, 2]

    def instruments(self, signals: Signals, applied: Applied) -> Signals:
        """Return the signals with the radius that the finished part shows."""
        return replace(signals, radius_offset_mm=signals.radius_offset_mm + applied["diameter_mm"] / 2.0)


EFFECT = SwappedTool()
