"""The stiffness of an arm that nobody has measured, estimated from its class.

Model: a joint's stiffness about its own axis is k = c·(m·l)^p, with rated payload m, reach l, and c the
geometric mean over measured robots, each counted once (``models/stiffness.toml``, with sources). The exponent
is that of drive torque over m·l: the stiffness of a gear goes with its rated torque. Tilting stiffness and
links are those of the KR 300 R2500 ultra, the only published ones, scaled likewise.

Band: the residuals of log k, each robot predicted from the others, have the root mean square s, so 90 % of
the compliances lie within a factor f = exp(1.645·s) either way. The estimate is the middle of that interval,
f/2 + 1/(2·f) times the typical compliance: ± then reaches both of its ends, and the estimate bends rather too
much than too little. Range: arms of six axes with gears in the joints, 3 to 1000 kg.
"""

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell import library
from gcode2krl.cell.sections import VIRTUAL_JOINTS
from gcode2krl.units import MM_PER_M

ARM = VIRTUAL_JOINTS[:8]
"""The virtual joints of the arm, without those of its end effector."""
TYPICAL = "KR 300 R2500 ultra"
"""The robot whose links and tilting joints are published."""
_AXES = ("A1", "A2", "A3", "A4", "A5", "A6")
_KEYS = ("k_c", "k_b", "k_a")
_QUANTILE = 1.6448536269514722
"""Of the normal distribution: 90 % lie within so many standard deviations."""


class Estimate(NamedTuple):
    """What is estimated of one arm."""

    softness: Floats
    """(8, 3) 1/k_C, 1/k_B, 1/k_A in rad/(N·mm) of `ARM`."""
    relative_band: float
    """Half-width of the 90 % band of each compliance, relative."""


class Published(NamedTuple):
    """One published set of joint stiffness."""

    robot: str
    class_kgm: float
    """Rated payload times reach."""
    log_k: Floats
    """(6,) of N·m/rad about A1 to A6, NaN where none is stated."""


def estimated(payload_kg: float, reach_mm: float) -> Estimate:
    """Return the estimate for an arm of this class."""
    factor, p = _factor(), exponent()
    class_kgm = payload_kg * reach_mm / MM_PER_M
    typical_class, k = _typical()
    k = k * (class_kgm / typical_class) ** p
    k[[ARM.index(name) for name in _AXES], 2] = MM_PER_M * np.exp(predicted(published(), class_kgm))
    middle = 0.5 * (factor + 1.0 / factor)
    return Estimate(middle / k, (factor**2 - 1.0) / (factor**2 + 1.0))


def predicted(sets: tuple[Published, ...], class_kgm: float) -> Floats:
    """Return log k (6,) about A1 to A6 for a class, from published sets of which each robot counts once."""
    p = exponent()
    robots = list(dict.fromkeys(each.robot for each in sets))
    scaled = np.array([each.log_k - p * math.log(each.class_kgm) for each in sets])
    rows = [[each.robot == robot for each in sets] for robot in robots]
    of_robot = np.array([_mean(scaled[row]) for row in rows])
    return _mean(of_robot) + p * math.log(class_kgm)


def left_out() -> list[tuple[Published, Floats]]:
    """Return each published set with its residuals of log k (6,), predicted from the other robots."""
    sets = published()
    return [
        (
            published_set,
            published_set.log_k
            - predicted(tuple(s for s in sets if s.robot != published_set.robot), published_set.class_kgm),
        )
        for published_set in sets
    ]


@lru_cache(maxsize=1)
def published() -> tuple[Published, ...]:
    """Return the published sets of the library."""
    return tuple(
        Published(
            entry["robot"],
            entry["payload_kg"] * entry["reach_mm"] / MM_PER_M,
            np.log(np.array(entry["k_Nm_rad"], dtype=float)),
        )
        for entry in _file()["set"]
    )


def exponent() -> float:
    """Return how stiffness grows with payload times reach."""
    return float(_file()["exponent"])


@lru_cache(maxsize=1)
def _factor() -> float:
    residuals = np.concatenate([residual for _, residual in left_out()])
    return math.exp(_QUANTILE * math.sqrt(float(np.nanmean(residuals**2))))


@lru_cache(maxsize=1)
def _file() -> dict[str, Any]:
    return library.read_toml(library.models_folder() / "stiffness.toml")


@lru_cache(maxsize=1)
def _typical() -> tuple[float, Floats]:
    """Return the class of `TYPICAL` in kg·m and its stiffness (8, 3) in N·mm/rad."""
    robot = library.read_model("robots", TYPICAL)
    joints = robot["compliance"]["virtual_joints"]
    k = np.array([[joints[name][key] for key in _KEYS] for name in ARM])
    return robot["payload"]["mass_kg"] * robot["payload"]["reach_mm"] / MM_PER_M, k


def _mean(rows: Floats) -> Floats:
    """Return the mean of each column (n, 6) over what is stated; NaN where nothing is."""
    stated = np.isfinite(rows)
    total, count = np.where(stated, rows, 0.0).sum(axis=0), stated.sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
