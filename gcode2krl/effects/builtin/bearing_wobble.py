"""A bearing whose axis wobbles while it turns."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import JOINTS, Applied, Effect, Target
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter, phase_parameter, size_from_zero
from gcode2krl.units import RAD_PER_MRAD, RAD_PER_REV

SPINDLE = "spindle"


def _per_turn(low: float, start: float, grid: tuple[float, ...], source: str) -> Parameter:
    return Parameter(
        name="per_turn",
        unit="",
        low=low,
        high=60.0,
        nominal=None,
        start=start,
        grid=grid,
        minimum=0.0,
        source=source,
    )


class _Wobble(Effect):
    """What the wobble of a joint and of the spindle have in common."""

    name = "bearing_wobble"
    family = "geometry"
    links = frozenset({"mechanics"})
    where = frozenset({Where.TIP})

    def targets(self, cell: Cell) -> tuple[Target, ...]:
        """Return the six joints and the spindle."""
        return (*JOINTS, SPINDLE)

    def at(self, target: Target) -> Effect:
        """Return the wobble of the spindle, whose size is a length, for the spindle, else that of a joint."""
        return OF_SPINDLE if target == SPINDLE else EFFECT


class BearingWobble(_Wobble):
    """All that the axis carries tilts by ``amplitude_mrad`` about a line across the axis, which goes round.

    The line turns by ``per_turn`` a turn of the joint, from ``phase`` at 0 degrees, seen from the link
    before: a cage turns 0.4-0.5 times, rollers pass a spot of a ring somewhat fewer times than half of them
    are (Harris 2001, Rolling Bearing Analysis). To first order in the angle; joints as commanded. Of the
    spindle: the tip goes round the tool's axis by ``amplitude_mm`` (see `at`).
    """

    depends_on = frozenset({Dependence.OWN_ANGLE, Dependence.PLACE})
    parameters = (
        size_from_zero(
            "amplitude_mrad",
            "mrad",
            high=1.0,
            start=0.05,
            source="tilt of slewing bearings 5-20 µm over 0.3 m: 0.02-0.07; worn ones ten times that",
        ),
        _per_turn(0.2, 0.43, (0.43, 8.0), "cages 0.4-0.5, rings with 10-100 rollers 4-50"),
        phase_parameter(),
    )

    def tcp(self, tcp_mm: Floats, deflection_mm: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the tip of the arm that wobbles."""
        if applied["amplitude_mrad"] == 0.0:
            return tcp_mm
        joint, angle = applied.joint, inputs.q_cmd_rad[:, applied.joint]
        axis = inputs.jacobian[:, 3:, joint]
        across = _across(inputs, joint, axis)
        turn = applied["per_turn"] * angle + applied["phase"]
        line = np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * np.cross(axis, across)
        lever_mm = tcp_mm - inputs.axes_mm[:, joint]
        return tcp_mm + applied["amplitude_mrad"] * RAD_PER_MRAD * np.cross(line, lever_mm)


class SpindleWobble(_Wobble):
    """The same of the spindle: a circle of the tip, ``per_turn`` times a turn of the spindle.

    Each sample has the mean over its time, so that nothing is left of what is faster than the samples: a cage
    at 600/min shows, one at 13000/min does not. The spindle's angle is that of its programmed speed from the
    run's start on, so a spindle that slips by one turn is out of step.
    """

    depends_on = frozenset({Dependence.SPINDLE_SPEED, Dependence.TONE})
    parameters = (
        size_from_zero(
            "amplitude_mm",
            "mm",
            high=0.2,
            start=0.01,
            source="run-out that does not repeat with the turn: 1-2 µm new, some 10 µm worn",
        ),
        _per_turn(0.2, 0.43, (0.43,), "cages of spindle bearings 0.38-0.46"),
        phase_parameter(),
    )

    def tcp(self, tcp_mm: Floats, deflection_mm: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the tip that goes round the tool's axis."""
        if applied["amplitude_mm"] == 0.0:
            return tcp_mm
        step_s = np.diff(inputs.time_s, append=inputs.time_s[-1:])
        step = applied["per_turn"] * inputs.spindle_rad_s * step_s
        turn = applied["phase"] + np.cumsum(step) - step / 2.0
        seen_mm = applied["amplitude_mm"] * np.sinc(step / RAD_PER_REV)
        x, y = inputs.tool_rotation[:, :, 0], inputs.tool_rotation[:, :, 1]
        return tcp_mm + (seen_mm * np.cos(turn))[:, None] * x + (seen_mm * np.sin(turn))[:, None] * y


def _across(inputs: Inputs, joint: int, axis: Floats) -> Floats:
    """Return unit vectors (m, 3) across a joint's axis that the link before it carries along."""
    if joint == 0:
        before = np.broadcast_to(inputs.cell.base_matrix()[0, :3], axis.shape)  # the root's x in $BASE
    elif joint == 2:
        before = (
            inputs.axes_mm[:, 2] - inputs.axes_mm[:, 1]
        )  # A2 is parallel to A3: the upper arm is across it
    else:
        before = inputs.jacobian[:, 3:, joint - 1]
    across = before - np.sum(before * axis, axis=1, keepdims=True) * axis
    unit: Floats = across / np.linalg.norm(across, axis=1, keepdims=True)
    return unit


EFFECT = BearingWobble()
OF_SPINDLE = SpindleWobble()
