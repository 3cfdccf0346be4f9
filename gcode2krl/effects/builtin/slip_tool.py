"""Set-up slip: another cutter in the spindle."""

from dataclasses import replace

from gcode2krl.arrays import Floats
from gcode2krl.effects.coefficients import with_larger_tools
from gcode2krl.effects.effect import Applied, Effect, Load, Parameter
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.signals import Signals


class SwappedTool(Effect):
    """The cutter is larger in diameter, or longer, than the stated one by these amounts.

    A longer one has its tip further from the holder and cuts deeper; where forces are known the material is
    removed again.
    """

    name = "swapped_tool"
    family = "set-up slips"
    links = frozenset({"mechanics", "force", "part"})
    kind = "slip"
    parameters = (
        Parameter(
            "diameter_mm", "mm", -30.0, 30.0, nominal=0.0, start=2.0,
            source="the next tool of a rack: 1-10 mm",
        ),
        Parameter(
            "length_mm", "mm", -200.0, 200.0, nominal=0.0, start=5.0, linear=True,
            source="another length of the same cutter: 5-100 mm",
        ),
    )  # fmt: skip

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
