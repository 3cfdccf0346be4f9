"""The spindle slows down under load."""

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.cutting import cutting_load
from gcode2krl.cutting.law import feed_per_tooth, law_array
from gcode2krl.effects import arm
from gcode2krl.effects.arm import Load
from gcode2krl.effects.builtin.runout import along_base
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import size_from_zero
from gcode2krl.units import NMM_PER_NM

_LEAST = 0.05
"""Of the speed, what is left at most torque: a spindle that stalls is no droop."""


class SpindleDroop(Effect):
    """True speed = programmed speed·(1 - percent_per_Nm/100·torque), torque that of the nominal cut.

    The feed per tooth rises with the time between two teeth, and so the force: the law of the material at
    the thicker chip, on the nominal arcs and depth. That the torque then rises too is left out: of a droop
    of 10 % it makes 11. Static: the drive's own recovery, some tenths of a second, is not in it. The moment
    about the tip stays the nominal one.
    """

    name = "spindle_droop"
    family = "force"
    links = frozenset({"force"})
    where = frozenset({Where.FORCE_AXIS})
    depends_on = frozenset({Dependence.FORCE, Dependence.SPINDLE_SPEED})
    needs = frozenset({"cut"})
    parameters = (
        size_from_zero(
            "percent_per_Nm",
            "%/(N·m)",
            high=50.0,
            start=1.0,
            source="asynchronous spindles slip 2-5 % at their 5-20 N·m; universal motors 10 times that",
        ),
    )

    def cut(self, load: Load, inputs: Inputs, applied: Applied) -> Load:
        """Return the load of the thicker chip."""
        if applied["percent_per_Nm"] == 0.0:
            return load
        force_N = np.array(load[0])
        cuts = np.any(inputs.force_base_N, axis=1)
        for number, rows in arm.tool_rows(inputs.tool):
            at = np.arange(len(inputs))[rows]
            at = at[cuts[at]]
            force_N[at] += _more_N(number, at, inputs, applied["percent_per_Nm"])
        return force_N, load[1]


def _more_N(number: int, rows: Ints, inputs: Inputs, percent_per_Nm: float) -> Floats:
    """Return the force (n, 3) along ``$BASE`` that the slower spindle adds."""
    forces, motion, material = inputs.forces, inputs.motion, inputs.cell.material
    if forces is None or motion is None or material is None:
        return np.zeros((len(rows), 3))
    tool, law = inputs.cell.tool[number], law_array(material)
    torque_Nm = forces.torque_Nmm[rows] / NMM_PER_NM
    share = np.maximum(1.0 - percent_per_Nm / 100.0 * torque_Nm, _LEAST)
    f_z = feed_per_tooth(motion.speed_mm_s[rows], inputs.spindle_rad_s[rows], tool.teeth)
    slow, fast = (
        cutting_load(tool, law, forces.phi_rad[rows], forces.a_p_mm[rows], chip, peak=False).force_N
        for chip in (f_z / share, f_z)
    )
    return along_base(slow - fast, inputs, rows)


EFFECT = SpindleDroop()
