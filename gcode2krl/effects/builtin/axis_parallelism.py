"""An axis of the arm is tilted against the one before it."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.effects.chain import rotation_of
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import JOINTS, Applied, Effect, Target
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter
from gcode2krl.units import RAD_PER_MRAD

_PARALLEL = "A3"
"""The one axis that is parallel to the axis before it."""


class AxisParallelism(Effect):
    """All that the axis carries is turned by ``mrad`` about a line through the axis, where two links meet.

    The line is at right angles to the axis and to the one before it; for A3, which is parallel to A2, to the
    axis and to the upper arm: Hayati's beta (Hayati & Mirmirani 1985). A turn about the axis before would be
    a `mastering` of that one.
    """

    name = "axis_parallelism"
    family = "geometry"
    links = frozenset({"mechanics"})
    where = frozenset({Where.TIP})
    depends_on = frozenset({Dependence.PLACE})
    parameters = (
        Parameter(
            name="mrad",
            unit="mrad",
            low=-5.0,
            high=5.0,
            nominal=0.0,
            start=0.2,
            linear=True,
            source="machined castings 0.05-0.5 mrad; up to 2 identified on uncalibrated arms",
        ),
    )

    def targets(self, cell: Cell) -> tuple[Target, ...]:
        """Return A2 to A6: the tilt of A1 is that of the robot's frame."""
        return JOINTS[1:]

    def tcp(self, tcp_mm: Floats, deflection_mm: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the tip of the tilted arm."""
        if applied["mrad"] == 0.0:
            return tcp_mm
        lever_mm = tcp_mm - inputs.axes_mm[:, applied.joint]
        line, angle_rad = _line(inputs, applied), applied["mrad"] * RAD_PER_MRAD
        across_mm = np.cross(line, lever_mm)
        moved: Floats = np.sin(angle_rad) * across_mm + (1.0 - np.cos(angle_rad)) * np.cross(line, across_mm)
        return tcp_mm + moved  # Rodrigues

    def orientation(self, rotation: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the rotations of the tilted tool."""
        return _turn(inputs, applied) @ rotation


def _turn(inputs: Inputs, applied: Applied) -> Floats:
    """Return the rotations (m, 3, 3) in ``$BASE`` of what the axis carries."""
    return rotation_of(applied["mrad"] * RAD_PER_MRAD * _line(inputs, applied))


def _line(inputs: Inputs, applied: Applied) -> Floats:
    """Return unit vectors (m, 3) in ``$BASE`` about which the axis is tilted."""
    axes = np.swapaxes(inputs.jacobian[:, 3:], 1, 2)
    before = axes[:, applied.joint - 1]
    if applied.target == _PARALLEL:
        before = inputs.axes_mm[:, applied.joint] - inputs.axes_mm[:, applied.joint - 1]
    line: Floats = np.cross(before, axes[:, applied.joint])
    line /= np.linalg.norm(line, axis=1, keepdims=True)
    return line


EFFECT = AxisParallelism()
