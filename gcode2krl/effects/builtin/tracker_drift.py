"""The tracker drifts."""

from dataclasses import replace
from types import MappingProxyType

from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect
from gcode2krl.effects.parameter import DIRECTION, direction_parameters, size_from_zero
from gcode2krl.effects.signals import Signals


class TrackerDrift(Effect):
    """What the tracker states moves with mm_per_h along a direction in ``$BASE``, from the earliest run on.

    Its stand settles, its head warms up: the tip is where it was, and the part does not show it. With a
    tracker alone it is told from `thermal` by its size only.
    """

    name = "tracker_drift"
    family = "sensor"
    links = frozenset({"mechanics"})
    where = frozenset({Where.TIP})
    depends_on = frozenset({Dependence.RUN_TIME, Dependence.WALL_CLOCK})
    vectors = MappingProxyType({"direction": DIRECTION})
    direction = DIRECTION
    parameters = (
        size_from_zero(
            "mm_per_h",
            "mm/h",
            high=0.1,
            start=0.03,
            source="a warm tracker on a stable stand 0.005-0.03 mm/h, one just switched on up to 0.1",
        ),
        *direction_parameters("any"),
    )

    def instruments(self, signals: Signals, applied: Applied) -> Signals:
        """Return the signals with what the tracker states."""
        if applied["mm_per_h"] == 0.0:
            return signals
        drift_mm = applied["mm_per_h"] * signals.inputs.run_hours[:, None] * applied.unit_vector()
        return replace(signals, tcp_base_mm=signals.tcp_base_mm + drift_mm)


EFFECT = TrackerDrift()
