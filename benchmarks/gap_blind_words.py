"""A label in the words of the library: targets, and names and units of parameters.

The plant and the library are written apart and count some things otherwise.
"""

from typing import Any

import numpy as np
from gap_blind_names import Truth

PLANT_RPM = 13_000.0
"""Spindle speed of the plant's programs."""
BENT_mm_m_K = 0.93e-6 * 2.0**2 / 2.0 * 1000.0
"""Sag of a beam of 2 m for 1 K/m: dn/dT of air times the length squared over two."""
SPELT_OUT = {
    "frame_off_mm": ("x_mm", "y_mm", "z_mm"),
    "h0_N": ("h0_x_N", "h0_y_N", "h0_z_N"),
    "direction": ("direction_x", "direction_y", "direction_z"),
    "H_N_rad": tuple(f"H_{row}{column}_N_rad" for row in "xyz" for column in "xyz"),
}
"""Vector of a label -> its elements in the library."""
RENAMED = {"kg": "mass_kg"}
CONVERTED: dict[str, dict[str, tuple[tuple[str, ...], float]]] = {
    "bolt_ratchet": {"mm": (("step_mm",), 1.0), "hold_N": (("threshold_N",), 1.0)},
    "cutter_bending": {"mm_per_kN": (("um_per_N",), 1.0)},
    "dead_time": {"dead_time_s": (("delay_s",), 1.0)},
    "encoder_interpolation": {"lines": (("periods",), 1.0)},
    "fixture_compliance": {"mm_per_kN": (("x_um_per_N", "y_um_per_N", "z_um_per_N"), 1.0)},
    "floor_vibration": {"mm": (("amplitude_mm",), 1.0)},
    "jerk_feed_forward": {"s3": (("per_jerk_s3",), -1.0)},
    "spindle_growth": {"mm": (("um_per_krpm",), 1000.0 / (PLANT_RPM / 1000.0))},
    "tracker_refraction": {
        "mm_at_2m": (("K_per_m",), 1.0 / BENT_mm_m_K),
        "stand_mm": (("tracker_x_m", "tracker_y_m"), 1e-3),
    },
}
"""Effect -> parameter of its label -> names in the library, and the factor to its unit."""


def truth_of(entry: dict[str, Any]) -> Truth:
    """Return effect and target of an entry of a label."""
    return entry["effect"], entry["target"]


def flat(entry: dict[str, Any]) -> dict[str, float]:
    """Return the numbers of an entry of a label under the library's names; words are left out."""
    converted = CONVERTED.get(entry["effect"], {})
    found: dict[str, float] = {}
    for key, value in entry["parameters"].items():
        if isinstance(value, str | bool) or value is None:
            continue
        values = [float(each) for each in np.ravel(value)]
        if key in converted:
            names, factor = converted[key]
            found |= {name: factor * each for name, each in zip(names, values, strict=False)}
        elif key in SPELT_OUT and isinstance(value, list):
            found |= dict(zip(SPELT_OUT[key], values, strict=True))
        elif not isinstance(value, list):
            found[RENAMED.get(key, key)] = values[0]
    return _stepped(found, entry["parameters"].get("unit")) if entry["effect"] == "step" else found


def _stepped(found: dict[str, float], unit: str | None) -> dict[str, float]:
    """Return the numbers of a step: of a joint its way round is the sign of its size."""
    size = found.pop("direction", 1.0) * found.pop("size")
    return {**found, f"size_{unit}": size}
