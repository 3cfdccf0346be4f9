"""How a deviation goes over the input that it depends on: a few points, for a fitter to draw or to fit."""

from collections.abc import Sequence

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.effects.dependence import Dependence
from gcode2krl.gap.beside.admissible import Admissible
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.tell.result import Course
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.units import DEG_PER_RAD, MM_PER_M, S_PER_MIN

_LIMITS = THRESHOLDS.tell
_IN_EACH_RUN = frozenset({Dependence.RUN_TIME})
"""Each run has a course of its own."""
_AXES = ("x", "y", "z")

_Input = tuple[str, str, Floats]
"""Name, unit and values (n,)."""


def course_of(
    traces: Sequence[Trace], values: Sequence[Floats], on: Dependence, joint: int | None, unit: str
) -> Course | None:
    """Return how a deviation (n,) of each trace goes over an input; None of what is no function of one.

    An input with several components is told by that which shows most of the deviation.
    """
    inputs = [_inputs(Admissible(trace), on, joint) for trace in traces]
    run = None
    if on in _IN_EACH_RUN:
        number = int(np.argmax([np.ptp(each) for each in values]))
        inputs, values, run = [inputs[number]], [values[number]], traces[number].run
    deviation = np.concatenate(values)
    told: tuple[float, Course] | None = None
    for components in zip(*inputs, strict=True):
        name, over_unit, _ = components[0]
        x = np.concatenate([each[2] for each in components])
        bins = _bins(x)
        means = np.array([deviation[rows].mean() for rows in bins])
        shown = float(
            sum(len(rows) * (y - deviation.mean()) ** 2 for rows, y in zip(bins, means, strict=True))
        )
        if len(bins) > 1 and (told is None or shown > told[0]):
            points = tuple((float(x[rows].mean()), float(y)) for rows, y in zip(bins, means, strict=True))
            told = shown, Course(over=name, over_unit=over_unit, unit=unit, points=points, run=run)
    return None if told is None else told[1]


def _bins(x: Floats) -> list[Ints]:
    """Return the rows in each of a few equal stretches of an input's range, empty ones left out."""
    low, high = float(x.min()), float(x.max())
    if not high > low:
        return [np.arange(len(x), dtype=np.int64)]
    number = np.minimum(
        (_LIMITS.course_points * (x - low) / (high - low)).astype(int), _LIMITS.course_points - 1
    )
    return [np.flatnonzero(number == each).astype(np.int64) for each in np.unique(number)]


def _inputs(own: Admissible, on: Dependence, joint: int | None) -> list[_Input]:
    """Return the components of an input that a deviation can be drawn over."""
    if joint is not None:
        of_joint = _of_joint(own, on, joint)
        if of_joint is not None:
            return [of_joint]
    if on in (Dependence.RUN_TIME, Dependence.RUN_START):
        return [("time in the run", "s", own.since_start_s)]
    if on in (Dependence.WALL_CLOCK, Dependence.RUN_TO_RUN):
        return [("time since the first run's start", "h", own.hours)]
    if on is Dependence.TRAVEL:
        return [("travel", "m", own.travel_mm / MM_PER_M)]
    if on is Dependence.METRES_CUT:
        return [("way cut", "m", own.cut_m)]
    if on is Dependence.SPINDLE_SPEED:
        return [("spindle speed", "1/min", S_PER_MIN / (2.0 * np.pi) * own.spindle[:, 0])]
    if on is Dependence.PLACE:
        return _along("place", "mm", own.position_mm)
    if on is Dependence.VELOCITY:
        return _along("velocity", "mm/s", own.velocity_mm_s)
    if on is Dependence.ACCELERATION:
        return _along("acceleration", "mm/s²", own.acceleration_mm_s2)
    if on in (Dependence.FORCE, Dependence.FORCE_BY_PLACE):
        return _along("force", "N", own.force_N)
    if on is Dependence.TEMPERATURE:
        return [(f"temperature {i + 1}", "°C", each) for i, each in enumerate(own.temperature_C.T)]
    return []


def _of_joint(own: Admissible, on: Dependence, joint: int) -> _Input | None:
    name = f"A{joint + 1}"
    if on is Dependence.OWN_ANGLE:
        return f"angle of {name}", "deg", DEG_PER_RAD * own.q_rad[:, joint]
    if on is Dependence.OWN_TORQUE:
        return f"torque of {name}", "Nm", own.torque_Nm[:, joint]
    if on is Dependence.VELOCITY:
        return f"velocity of {name}", "deg/s", DEG_PER_RAD * own.rate_rad_s[:, joint]
    if on is Dependence.ACCELERATION:
        return f"acceleration of {name}", "deg/s²", DEG_PER_RAD * own.acceleration_rad_s2[:, joint]
    if on is Dependence.JERK:
        return f"jerk of {name}", "deg/s³", DEG_PER_RAD * own.jerk(joint)[:, 0]
    return None


def _along(name: str, unit: str, vectors: Floats) -> list[_Input]:
    """Return the components of vectors (n, 3) in ``$BASE``."""
    return [(f"{name} along {axis}", unit, vectors[:, i]) for i, axis in enumerate(_AXES)]
