"""The input that a gap depends on, along a run: the abscissa of the picture that shows the dependence."""

from collections.abc import Callable, Mapping, Set
from dataclasses import dataclass

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.effects import Dependence, Inputs, arm
from gcode2krl.effects.inputs import gradient
from gcode2krl.effects.operators import since_reversal
from gcode2krl.gap.beside.links import JOINTS
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.units import DEG_PER_RAD


@dataclass(frozen=True, eq=False)
class Against:
    """An input of a run."""

    name: str
    """With its unit, ``torque about A2 (N·m)``."""
    values: Floats
    """(n,)."""
    direction: Floats | None = None
    """(n,) ±1, which way a joint moves, with memory; None where that does not matter."""
    across_runs: bool = False
    """It hardly changes within a run, so that all runs are shown together."""


def knows_place(inputs: Inputs) -> bool:
    """Tell whether the tip's place is known: not in a log of a robot that is not."""
    return bool(np.any(inputs.position_mm))


def against(trace: Trace, samples: Ints, at: str | None, on: Set[Dependence]) -> Against | None:
    """Return the first input of a family that can be shown, None where there is none.

    Parameters
    ----------
    samples : (n,) rows of the trace's inputs.
    at : the joint where the gap is, or None.
    """
    for dependence, shown in _SHOWN.items():
        if dependence in on:
            found = shown(trace, samples, at)
            if found is not None:
                return found
    return None


_Shown = Callable[[Trace, Ints, str | None], Against | None]


def _joint(at: str | None) -> int | None:
    return JOINTS.index(at) if at in JOINTS else None


def _reversals(trace: Trace, samples: Ints, at: str | None) -> Against | None:
    joint = _joint(at)
    if joint is None:
        return None
    inputs = trace.inputs
    direction, since = since_reversal(inputs.q_cmd_rad[:, joint], inputs.time_s)
    shown = np.where(np.isfinite(since), since, np.nan)[samples]
    if not np.isfinite(shown).any():
        return None
    return Against(f"time since {at} reversed (s)", shown, direction[samples])


def _torque(trace: Trace, samples: Ints, at: str | None) -> Against | None:
    joint, inputs = _joint(at), trace.inputs
    if joint is None or not knows_place(inputs):
        return None
    load = inputs.force_base_N if inputs.load_base_N is None else inputs.load_base_N
    torque = arm.torque_Nm(inputs.jacobian, load, inputs.moment_base_Nmm)
    return Against(f"torque about {at} by the load at the tip (N·m)", torque[samples, joint])


def _angle(trace: Trace, samples: Ints, at: str | None) -> Against | None:
    joint = _joint(at)
    if joint is None:
        return None
    q_rad = trace.inputs.q_cmd_rad[:, joint]
    direction, _ = since_reversal(q_rad, trace.inputs.time_s)
    return Against(f"angle of {at} (deg)", DEG_PER_RAD * q_rad[samples], direction[samples])


def _speed(trace: Trace, samples: Ints, at: str | None) -> Against | None:
    joint, inputs = _joint(at), trace.inputs
    if joint is not None:
        speed = gradient(inputs.q_cmd_rad, inputs.time_s)[samples, joint]
        return Against(f"speed of {at} (deg/s)", DEG_PER_RAD * speed)
    if not knows_place(inputs):
        return None
    return Against("speed of the tip (mm/s)", np.linalg.norm(inputs.velocity_mm_s[samples], axis=1))


def _acceleration(trace: Trace, samples: Ints, at: str | None) -> Against | None:
    joint, inputs = _joint(at), trace.inputs
    if joint is not None:
        rate = gradient(gradient(inputs.q_cmd_rad, inputs.time_s), inputs.time_s)[samples, joint]
        return Against(f"acceleration of {at} (deg/s²)", DEG_PER_RAD * rate)
    rate = gradient(inputs.velocity_mm_s, inputs.time_s)[samples]
    return Against("acceleration of the tip (mm/s²)", np.linalg.norm(rate, axis=1))


def _jerk(trace: Trace, samples: Ints, at: str | None) -> Against | None:
    joint, inputs = _joint(at), trace.inputs
    if joint is None:
        return None
    acceleration = gradient(gradient(inputs.q_cmd_rad[:, joint], inputs.time_s), inputs.time_s)
    return Against(f"jerk of {at} (deg/s³)", DEG_PER_RAD * gradient(acceleration, inputs.time_s)[samples])


def _force(trace: Trace, samples: Ints, at: str | None) -> Against | None:
    force = trace.inputs.force_base_N[samples]
    if not np.any(force):
        return None
    return Against("predicted force (N)", np.linalg.norm(force, axis=1))


def _travel(trace: Trace, samples: Ints, at: str | None) -> Against | None:
    return Against("travel (m)", trace.inputs.path_mm[samples] / 1000.0)


def _time(trace: Trace, samples: Ints, at: str | None) -> Against | None:
    return Against("time in the run (s)", trace.time_s)


def _clock(trace: Trace, samples: Ints, at: str | None) -> Against | None:
    return Against("time since the first run's start (h)", trace.inputs.run_hours[samples], across_runs=True)


def _spindle(trace: Trace, samples: Ints, at: str | None) -> Against | None:
    return Against("spindle speed (1/min)", trace.inputs.spindle_rad_s[samples] * 30.0 / np.pi)


_SHOWN: Mapping[Dependence, _Shown] = {
    Dependence.OWN_TORQUE: _torque,
    Dependence.REVERSALS: _reversals,
    Dependence.MOTOR_ANGLE: _angle,
    Dependence.OWN_ANGLE: _angle,
    Dependence.METRES_CUT: _travel,
    Dependence.TRAVEL: _travel,
    Dependence.FORCE: _force,
    Dependence.FORCE_BY_PLACE: _force,
    Dependence.JERK: _jerk,
    Dependence.ACCELERATION: _acceleration,
    Dependence.VELOCITY: _speed,
    Dependence.SPINDLE_SPEED: _spindle,
    Dependence.WALL_CLOCK: _clock,
    Dependence.RUN_TO_RUN: _clock,
    Dependence.PLACE: _travel,
    Dependence.RUN_START: _time,
    Dependence.RUN_TIME_STEP: _time,
    Dependence.RUN_TIME: _time,
    Dependence.TONE: _time,
    Dependence.CONSTANT: _time,
}
"""In this order: the more an input says about a cause, the earlier."""
