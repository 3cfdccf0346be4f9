"""How well the parameters of a right cause agree with those of the label."""

from typing import Any

import numpy as np
from gap_blind_words import flat

NOMINAL = {"scale": 1.0, "factor": 1.0}
OWN_SIZE = frozenset({"k_s", "acc_cp_m_s2", "cdis_mm", "percent"})
"""Parameters whose error is relative to the value itself, not to its deviation from nominal."""
VECTORS = (("x_mm", "y_mm", "z_mm"), ("fx_N", "fy_N", "fz_N"), ("h0_x_N", "h0_y_N", "h0_z_N"))
TURNS = frozenset({"a_deg", "b_deg", "c_deg"})
DIRECTION = ("direction_x", "direction_y", "direction_z")
SHAPES = TURNS | frozenset(DIRECTION)
SHAPES |= {"decay_s", "harmonic", "phase", "time_constant_h", "hz", "damping", "torque_Nm", "skew", "count"}
SHAPES |= {"cx_mm", "cy_mm", "cz_mm", "time_constant_s", "at_s", "lines", "stand_mm", "length_mm"}
"""Parameters that say how an effect looks, not how large it is: their interval is scored, not their error."""
LINES = frozenset({"vibration"})
"""Effects along a line, whose direction may be told either way round."""
LEAST_SIZE = 1e-12

Said = dict[str, dict[str, float]]
"""Parameter -> value and the ends of its interval."""


def numbers(entry: dict[str, Any], cause: dict[str, Any]) -> tuple[tuple[float, ...], tuple[bool, ...]]:
    """Return relative errors of the sizes, vectors as one, and whether each interval holds the true value."""
    true, said = flat(entry), cause["parameters"]
    if entry["effect"] in LINES:
        said = _same_way_round(true, said)
    covered = tuple(_holds(name, true[name], said[name]) for name in said if name in true)
    return tuple(_errors(true, said)), covered


def _errors(true: dict[str, float], said: Said) -> list[float]:
    single = [name for name in said if name in true and name not in SHAPES]
    errors = []
    for vector in VECTORS:
        if set(vector) <= set(single):
            apart = np.array([said[name]["value"] - true[name] for name in vector])
            length = float(np.linalg.norm([true[name] for name in vector]))
            errors.append(float(np.linalg.norm(apart)) / max(length, LEAST_SIZE))
            single = [name for name in single if name not in vector]
    for name in single:
        size = abs(true[name] - (0.0 if name in OWN_SIZE else NOMINAL.get(name, 0.0)))
        if size > LEAST_SIZE:
            errors.append(abs(said[name]["value"] - true[name]) / size)
    return errors


def _same_way_round(true: dict[str, float], said: Said) -> Said:
    """Return the parameters with their direction the truth's way round."""
    if not set(DIRECTION) <= set(said) & set(true):
        return said
    if sum(said[name]["value"] * true[name] for name in DIRECTION) >= 0.0:
        return said
    turned = {
        name: {"value": -said[name]["value"], "low": -said[name]["high"], "high": -said[name]["low"]}
        for name in DIRECTION
    }
    return {**said, **turned}


def _holds(name: str, true: float, said: dict[str, float]) -> bool:
    low, high = said.get("low"), said.get("high")
    if low is None or high is None:
        return False
    turns = (-2.0 * np.pi, 0.0, 2.0 * np.pi) if name == "phase" else (0.0,)
    return any(low <= true + turn <= high for turn in turns)
