"""The block lies elsewhere than stated."""

import numpy as np

from gcode2krl.cell import Cell
from gcode2krl.effects.arm import Load
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect, Target
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter

_AXES = ("x", "y")


class StockOffset(Effect):
    """The block is moved (not grown) by ``offset_mm`` along x or y of ``$BASE``.

    The material is removed again with the path shifted the other way against the block.
    """

    name = "stock_offset"
    family = "force"
    links = frozenset({"force"})
    where = frozenset({Where.FORCE_AXIS})
    depends_on = frozenset({Dependence.FORCE_BY_PLACE, Dependence.PLACE})
    needs = frozenset({"cut"})
    parameters = (
        Parameter(
            name="offset_mm",
            unit="mm",
            low=-10.0,
            high=10.0,
            nominal=0.0,
            start=0.5,
            source="a sawn block against stops 0.5-2 mm, clamped by eye several mm",
        ),
    )

    def targets(self, cell: Cell) -> tuple[Target, ...]:
        """Return x and y."""
        return _AXES

    def cut(self, load: Load, inputs: Inputs, applied: Applied) -> Load:
        """Return the load with the block moved."""
        if applied["offset_mm"] == 0.0:
            return load
        shift_mm = -applied["offset_mm"] * np.eye(3)[_AXES.index(applied.target or "")]
        force_N, moment_Nmm = inputs.recut(shift_mm=shift_mm)
        return load[0] + force_N - inputs.force_base_N, load[1] + moment_Nmm - inputs.moment_base_Nmm


EFFECT = StockOffset()
