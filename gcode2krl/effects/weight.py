"""A weight on the arm as a load at the tip."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.arm import Load
from gcode2krl.effects.inputs import Inputs
from gcode2krl.units import GRAVITY_M_S2


def with_weight(load: Load, inputs: Inputs, mass_kg: float, lever_mm: Floats) -> Load:
    """Return the load with a weight whose centre is ``lever_mm`` (m, 3) from the tip, along ``$BASE``."""
    weight_N = mass_kg * GRAVITY_M_S2 * inputs.gravity
    return load[0] + weight_N, load[1] + np.cross(lever_mm, weight_N)
