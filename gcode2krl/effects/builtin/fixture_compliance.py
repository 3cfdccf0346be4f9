"""The workpiece gives way under the cutter."""

from dataclasses import replace
from types import MappingProxyType

from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect
from gcode2krl.effects.parameter import size_from_zero
from gcode2krl.effects.signals import Signals
from gcode2krl.units import UM_PER_MM

_NAMES = ("x_um_per_N", "y_um_per_N", "z_um_per_N")


class FixtureCompliance(Effect):
    """The part moves by um_per_N of the force on it, which is against that on the tool, along ``$BASE``.

    Static. No instrument at the robot sees it: the tip is where it was in ``$BASE``, and the part springs
    back. What is left is in the finished part, where the tip was cutting elsewhere than it seems, by the
    opposite of the part's way. The chip that changes with it is not in it.
    """

    name = "fixture_compliance"
    family = "part"
    links = frozenset({"part"})
    where = frozenset({Where.TIP})
    depends_on = frozenset({Dependence.FORCE})
    vectors = MappingProxyType({"um_per_N": _NAMES})
    parameters = tuple(
        size_from_zero(
            name,
            "µm/N",
            high=20.0,
            start=0.1,
            source="vices and clamped blocks 10-100 N/µm, plates on pillars and thin walls 0.1-5 N/µm",
        )
        for name in _NAMES
    )

    def instruments(self, signals: Signals, applied: Applied) -> Signals:
        """Return the signals with the way of the part."""
        shift_mm = -applied.vector(_NAMES) / UM_PER_MM * signals.force_base_N
        if signals.part_shift_mm is not None:
            shift_mm = shift_mm + signals.part_shift_mm
        return replace(signals, part_shift_mm=shift_mm)


EFFECT = FixtureCompliance()
