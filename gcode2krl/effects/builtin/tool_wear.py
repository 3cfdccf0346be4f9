"""Forces grow while the tool wears."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects import arm
from gcode2krl.effects.arm import Load
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import size_from_zero
from gcode2krl.units import MM_PER_M


class ToolWear(Effect):
    """True force = force·(1 + growth·metres cut), each tool from 0 in each run.

    Metres cut: the path over which the tool cuts in the nominal model. All parts of the force grow alike.
    """

    name = "tool_wear"
    family = "force"
    links = frozenset({"force"})
    where = frozenset({Where.FORCE_AXIS})
    depends_on = frozenset({Dependence.FORCE, Dependence.METRES_CUT})
    parameters = (
        size_from_zero(
            "growth_per_m",
            "1/m",
            high=3.0,
            start=0.05,
            source="+20-100 % force over a tool's life of 0.5 m (hard steel) to kilometres (aluminium)",
        ),
    )

    def cut(self, load: Load, inputs: Inputs, applied: Applied) -> Load:
        """Return the load of the worn tool."""
        if applied["growth_per_m"] == 0.0:
            return load
        factor = 1.0 + applied["growth_per_m"] * metres_cut(inputs)[:, None]
        return load[0] * factor, load[1] * factor


def metres_cut(inputs: Inputs) -> Floats:
    """Return the path (m,) in metres that each sample's tool has cut so far."""
    step_mm = np.diff(inputs.path_mm, prepend=inputs.path_mm[:1])
    step_mm = np.where(inputs.force_base_N.any(axis=1), step_mm, 0.0)
    cut_m = np.empty(len(inputs))
    for _, rows in arm.tool_rows(inputs.tool):
        cut_m[rows] = np.cumsum(step_mm[rows]) / MM_PER_M
    return cut_m


EFFECT = ToolWear()
