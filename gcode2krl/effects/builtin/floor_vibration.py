"""The floor shakes."""

import math

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect, Target
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter, Role, phase_parameter, size_from_zero
from gcode2krl.units import S_PER_H

_AXES = ("x", "y", "z")


class FloorVibration(Effect):
    """The tip moves by amplitude·sin(2·pi·hz·t + phase) along one axis of ``$BASE``, whatever the robot does.

    t from the start of the earliest run, so the phase goes on from run to run as far as ``hz`` is held: of a
    machine nearby that is off by one in a thousand it is lost after a minute at 10 Hz, and each run then has
    its own. Not driven by the robot, unlike `vibration`.
    """

    name = "floor_vibration"
    family = "compliance"
    links = frozenset({"mechanics"})
    where = frozenset({Where.TIP})
    depends_on = frozenset({Dependence.TONE})
    parameters = (
        Parameter(
            name="hz",
            unit="Hz",
            low=1.0,
            high=60.0,
            nominal=None,
            start=15.0,
            grid=(8.0, 15.0, 25.0),
            minimum=0.01,
            role=Role.FREQUENCY,
            source="presses 1-10 Hz, floors 8-20, fans and compressors 10-50",
        ),
        size_from_zero(
            "amplitude_mm",
            "mm",
            high=1.0,
            start=0.02,
            source="10-50 µm beside presses and compressors, on the arm's own mode several times that",
        ),
        phase_parameter(),
    )

    def targets(self, cell: Cell) -> tuple[Target, ...]:
        """Return the axes of ``$BASE``."""
        return _AXES

    def tcp(self, tcp_mm: Floats, deflection_mm: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the shaken tip."""
        if applied["amplitude_mm"] == 0.0:
            return tcp_mm
        turn = 2.0 * math.pi * applied["hz"] * S_PER_H * inputs.run_hours + applied["phase"]
        tip = np.array(tcp_mm)
        tip[:, _AXES.index(applied.target or "")] += applied["amplitude_mm"] * np.sin(turn)
        return tip


EFFECT = FloorVibration()
