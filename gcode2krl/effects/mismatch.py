"""Normal mismatch: what a sound robot, tool and sensor differ by from their model, and nobody calls a gap."""

import math
from dataclasses import dataclass

from gcode2krl.effects import Applied
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
    k_s: float = 0.004
    acc_m_s2: float = 0.1
    """What 2 ms in the time law are worth in its constants."""
    joint_zero_rad: float = math.radians(1.0)
    """Between two encoders of one joint: their zeros are set by hand, so this is no finding at all."""

    def limits(self, applied: Applied, duration_s: float, clocks: int = 1) -> dict[str, float]:
        """Return by how much each parameter of an effect may be off its nominal value and be no finding.

        ``clocks``: how many clocks of their own the compared signals have. Parameters that are not named may
        not be off at all.
        """
        degrees = self.play_rad * DEG_PER_RAD
        frame = dict.fromkeys(("x_mm", "y_mm", "z_mm"), self.frame_mm)
        turn = dict.fromkeys(("a_deg", "b_deg", "c_deg"), self.frame_rad * DEG_PER_RAD)
        known: dict[str, dict[str, float]] = {
            "stiffness": {"scale": self.stiffness},
            "force_scale": {"scale": self.coefficients},
            "edge_force": {"scale": self.coefficients},
            "clock": {"offset_s": clocks * self.clock_s, "skew": clocks * self.clock_s / duration_s},
            "force_delay": {"delay_s": clocks * self.clock_s},
            "servo_lag": {"tau_s": self.lag_s},
            "backlash": {"gap_deg": degrees},
            "transmission": {"amplitude_deg": degrees},
            "base_frame": frame | turn,
            "tool_frame": frame | turn,
            "tool_diameter": {"offset_mm": self.diameter_mm},
            "velocity_rule": {"k_s": self.k_s, "acc_cp_m_s2": self.acc_m_s2},
            "force_offset": dict.fromkeys(("fx_N", "fy_N", "fz_N"), self.force_zero_N),
        }
        return known.get(applied.effect.name, {})


def sigma(bound: float) -> float:
    """Return the standard deviation of a uniform draw within ± ``bound``."""
    return bound / math.sqrt(3.0)
