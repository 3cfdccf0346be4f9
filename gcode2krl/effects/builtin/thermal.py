"""The tip drifts while the arm warms up."""

from types import MappingProxyType

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import DIRECTION, Parameter, direction_parameters, size_from_zero


class Thermal(Effect):
    """The tip moves by mm_per_h·T·(1 - exp(-t/T)) along a direction in ``$BASE``.

    t in hours from the start of the earliest run, T = ``time_constant_h``. One exponential is the arm's slow
    part; the spindle's own growth is faster.
    """

    name = "thermal"
    family = "geometry"
    links = frozenset({"mechanics"})
    where = frozenset({Where.TIP})
    depends_on = frozenset({Dependence.RUN_TIME, Dependence.WALL_CLOCK})
    vectors = MappingProxyType({"direction": DIRECTION})
    direction = DIRECTION
    parameters = (
        size_from_zero("mm_per_h", "mm/h", high=2.0, start=0.2, source="0.1-0.5 mm in 1-3 h of warming up"),
        Parameter(
            name="time_constant_h",
            unit="h",
            low=0.05,
            high=5.0,
            nominal=None,
            start=1.0,
            grid=(0.3, 1.0, 3.0),
            minimum=1e-3,
            source="warming up of large arms takes 1-3 h",
        ),
        *direction_parameters("along the arm and downwards are usual"),
    )

    def tcp(self, tcp_mm: Floats, deflection_mm: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the tip as it has drifted."""
        if applied["mm_per_h"] == 0.0:
            return tcp_mm
        constant_h = applied["time_constant_h"]
        grown_mm = -applied["mm_per_h"] * constant_h * np.expm1(-inputs.run_hours / constant_h)
        return tcp_mm + grown_mm[:, None] * applied.unit_vector()


EFFECT = Thermal()
