"""Something slips, and stays where it then is."""

from types import MappingProxyType

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import JOINTS, Applied, Effect, Target
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import DIRECTION, Parameter, Role, direction_parameters, size_from_zero
from gcode2krl.units import RAD_PER_DEG, S_PER_H

TIP = "tip"
SLIP_S = 0.04
"""How long it slips, half of it before the moment: clamps need some tens of ms (convention)."""
_AT_S = Parameter(
    name="at_s",
    unit="s",
    low=0.0,
    high=864000.0,
    nominal=None,
    start=10.0,
    minimum=0.0,
    role=Role.MOMENT,
    source="any moment of the runs compared, up to ten days after the first began",
)


class _Step(Effect):
    """What the steps of tip and joints have in common."""

    name = "step"
    family = "geometry"
    links = frozenset({"gear", "mechanics"})
    depends_on = frozenset({Dependence.RUN_TIME_STEP})

    def targets(self, cell: Cell) -> tuple[Target, ...]:
        """Return the tip and the six joints."""
        return (TIP, *JOINTS)

    def at(self, target: Target) -> Effect:
        """Return the step of a joint, whose size is an angle, for a joint, else that of the tip."""
        return JOINT_STEP if target in JOINTS else EFFECT

    def links_at(self, target: Target) -> frozenset[str]:
        """Return the mechanics for the tip, the gear for a joint."""
        return frozenset({"gear" if target in JOINTS else "mechanics"})


class Step(_Step):
    """From ``at_s`` on the tip, or a joint behind its gear, stands elsewhere: in this run and all later ones.

    ``at_s`` counts from the start of the earliest run, so that one number says in which run and when. The tip
    moves by ``size_mm`` along a direction in ``$BASE``; a joint turns by ``size_deg`` (see `at`).
    """

    where = frozenset({Where.TIP})
    vectors = MappingProxyType({"direction": DIRECTION})
    direction = DIRECTION
    parameters = (
        _AT_S,
        size_from_zero(
            "size_mm",
            "mm",
            high=5.0,
            start=0.1,
            source="a tool, spindle bracket or pedestal that slips 0.05-1 mm; a collision some mm",
        ),
        *direction_parameters("any"),
    )

    def tcp(self, tcp_mm: Floats, deflection_mm: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the tip where it has slipped to."""
        if applied["size_mm"] == 0.0:
            return tcp_mm
        return tcp_mm + applied["size_mm"] * slipped(inputs, applied)[:, None] * applied.unit_vector()


class JointStep(_Step):
    """The step of a joint."""

    where = frozenset({Where.JOINT})
    parameters = (
        _AT_S,
        Parameter(
            name="size_deg",
            unit="deg",
            low=-1.0,
            high=1.0,
            nominal=0.0,
            start=0.01,
            linear=True,
            source="a coupling or a clamped hub slips 0.005-0.1 deg; a tooth of a belt about 1 deg",
        ),
    )

    def gear(self, q_load_rad: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return what is behind the gear."""
        if applied["size_deg"] == 0.0:
            return q_load_rad
        q = np.array(q_load_rad)
        q[:, applied.joint] += applied["size_deg"] * RAD_PER_DEG * slipped(inputs, applied)
        return q


def slipped(inputs: Inputs, applied: Applied) -> Floats:
    """Return the share (m,) of the step that has happened: 0 before it, 1 after, straight within `SLIP_S`."""
    since_s = inputs.run_hours * S_PER_H - applied["at_s"]
    return np.clip(since_s / SLIP_S + 0.5, 0.0, 1.0)


EFFECT = Step()
JOINT_STEP = JointStep()
