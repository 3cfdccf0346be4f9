"""The tool hits something."""

from types import MappingProxyType

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.arm import Load
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import DIRECTION, Parameter, Role, direction_parameters, size_from_zero
from gcode2krl.units import S_PER_H


class Collision(Effect):
    """From ``at_s`` on, for ``lasts_s``, the tool is pushed by half a sine of ``size_N``.

    The direction is one in ``$BASE``. ``at_s`` counts from the start of the earliest run, as that of `step`:
    one number says in which run. The sensor shows the push and the arm bends by it, at rest as the model
    bends. Each sample has the mean over its time, so that the impulse is right whatever the sampling. What
    slips stays off: that is a `step` of the tip or of a joint at the same moment, an effect of its own.
    """

    name = "collision"
    family = "force"
    links = frozenset({"force"})
    where = frozenset({Where.FORCE_AXIS, Where.TIP})
    depends_on = frozenset({Dependence.EVENT})
    vectors = MappingProxyType({"direction": DIRECTION})
    direction = DIRECTION
    parameters = (
        Parameter(
            name="at_s",
            unit="s",
            low=0.0,
            high=864000.0,
            nominal=None,
            start=10.0,
            minimum=0.0,
            role=Role.MOMENT,
            source="any moment of the runs compared, up to ten days after the first began",
        ),
        size_from_zero(
            "size_N",
            "N",
            high=20000.0,
            start=500.0,
            source="a tool that grazes a clamp 0.1-2 kN; a large arm at 0.1 m/s into steel up to 20 kN",
        ),
        Parameter(
            name="lasts_s",
            unit="s",
            low=0.005,
            high=1.0,
            nominal=None,
            start=0.06,
            grid=(0.06,),
            minimum=1e-3,
            source="half a period of an arm at 7-25 Hz is 20-70 ms; a snag that gives way some tenths of a s",
        ),
        *direction_parameters("any"),
    )

    def cut(self, load: Load, inputs: Inputs, applied: Applied) -> Load:
        """Return the load with the push; at the tip, so that its moment about that is none."""
        if applied["size_N"] == 0.0:
            return load
        push_N = applied["size_N"] * _pushed(inputs, applied)[:, None] * applied.unit_vector()
        return load[0] + push_N, load[1]


def _pushed(inputs: Inputs, applied: Applied) -> Floats:
    """Return the share (m,) of the largest push, the mean over the time of each sample."""
    middle = (inputs.run_hours[1:] + inputs.run_hours[:-1]) / 2.0
    edges = np.concatenate([inputs.run_hours[:1], middle, inputs.run_hours[-1:]]) * S_PER_H
    done = np.clip((edges - applied["at_s"]) / applied["lasts_s"], 0.0, 1.0)
    impulse_s = applied["lasts_s"] / np.pi * (1.0 - np.cos(np.pi * done))
    width_s = np.diff(edges)
    return np.divide(np.diff(impulse_s), width_s, out=np.zeros(len(width_s)), where=width_s > 0.0)


EFFECT = Collision()
