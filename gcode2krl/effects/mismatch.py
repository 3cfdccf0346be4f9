"""Normal mismatch: by how much a sound robot, tool and sensor differ from their model. It is never a gap.

The table of bounds, which a user may change. Each effect says which bound is that of which of its parameters.
"""

import math
from dataclasses import dataclass

from gcode2krl.units import DEG_PER_RAD, RAD_PER_DEG


@dataclass(frozen=True)
class Mismatch:
    """Bounds of what is no gap; as nuisance each has the standard deviation of a uniform draw within them."""

    stiffness: float = 0.08
    """Relative, each virtual joint: what calibration by static weights leaves (Haehn & Weigold 2020: 6 %)."""
    coefficients: float = 0.03
    """Relative, each of tangential, radial and axial force."""
    sensor_gain: float = 0.02
    """Relative, each axis of the force sensor."""
    frame_mm: float = 0.04
    frame_rad: float = 3e-5
    """Per run: tracker to ``$BASE``."""
    clock_s: float = 2e-3
    lag_s: float = 5e-4
    play_rad: float = 5e-4 * RAD_PER_DEG
    """Backlash and transmission error of each joint."""
    force_zero_N: float = 3.0
    diameter_mm: float = 0.03
    """Of a ground end mill (ISO 286 h9, 16 mm: 0.043 mm below its nominal diameter)."""
    length_mm: float = 0.1
    """Of a tool that is touched off at the robot (assumed; a presetter is ten times better)."""
    k_s: float = 0.004
    acc_m_s2: float = 0.1
    """What 2 ms in the time law are worth in its constants."""
    joint_zero_rad: float = math.radians(1.0)
    """Between two encoders of one joint: their zeros are set by hand, so it is never reported."""

    air_K_m: float = 1.0
    """Of the air between tracker and tip, warmer further up: 5 m away 12 µm, within that of the frame."""

    @property
    def play_deg(self) -> float:
        """Return the play in degrees."""
        return self.play_rad * DEG_PER_RAD

    @property
    def frame_deg(self) -> float:
        """Return the turn of the frame in degrees."""
        return self.frame_rad * DEG_PER_RAD


def sigma(bound: float) -> float:
    """Return the standard deviation of a uniform draw within ± ``bound``."""
    return bound / math.sqrt(3.0)
