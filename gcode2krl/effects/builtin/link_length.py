"""A link of the arm is longer than the model's."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect, Target
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter

_LENGTHS = ("a1", "a2", "c1", "c2", "c3", "c4")


class LinkLength(Effect):
    """True length = the model's + ``mm``, for the lengths of Brandstötter, Angerer and Hofbaur 2014."""

    name = "link_length"
    family = "geometry"
    links = frozenset({"mechanics"})
    where = frozenset({Where.TIP})
    depends_on = frozenset({Dependence.PLACE})
    parameters = (
        Parameter(
            name="mm",
            unit="mm",
            low=-5.0,
            high=5.0,
            nominal=0.0,
            start=0.5,
            linear=True,
            source="uncalibrated absolute accuracy of large arms 1-3 mm",
        ),
    )

    def targets(self, cell: Cell) -> tuple[Target, ...]:
        """Return a1, a2, c1, c2, c3, c4."""
        return _LENGTHS

    def geometry(self, lengths_mm: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the true lengths."""
        if applied["mm"] == 0.0:
            return lengths_mm
        lengths: Floats = lengths_mm + applied["mm"] * np.eye(6)[_LENGTHS.index(applied.target or "")]
        return lengths


EFFECT = LinkLength()
