"""Bolts that slip a little each time the load is large."""

from dataclasses import replace
from types import MappingProxyType

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.cell import Cell
from gcode2krl.effects.arm import Load
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import JOINTS, Applied, Effect, Target
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import DIRECTION, Parameter, direction_parameters, size_from_zero
from gcode2krl.effects.signals import Signals
from gcode2krl.units import RAD_PER_DEG

TIP, FIXTURE = "tip", "fixture"
_REARMED = 0.9
"""Share of the threshold below which the load has to fall before the next step: friction holds again at once,
and what chatters about the threshold is one step (convention)."""


class _Ratchet(Effect):
    """What the ratchets of tip, fixture and joints have in common."""

    name = "bolt_ratchet"
    family = "geometry"
    links = frozenset({"gear", "mechanics", "part"})

    def targets(self, cell: Cell) -> tuple[Target, ...]:
        """Return the tip, the fixture of the part and the six joints."""
        return (TIP, FIXTURE, *JOINTS)

    def at(self, target: Target) -> Effect:
        """Return the ratchet of a joint, in degrees and N·m, for a joint, else that of tip and fixture."""
        return OF_JOINT if target in JOINTS else EFFECT

    def links_at(self, target: Target) -> frozenset[str]:
        """Return the gear for a joint, the part for its fixture, else the mechanics."""
        return frozenset({"part" if target == FIXTURE else "gear" if target in JOINTS else "mechanics"})


class BoltRatchet(_Ratchet):
    """The tip or the part moves by ``step_mm`` each time the cutting force rises above ``threshold_N``.

    It stays there and slips again once the force has been below nine tenths of the threshold in between.
    Along a direction in ``$BASE``, whatever that of the force, and counted from none in each run: what
    earlier ones have left is a `step` between them. A fixture shows in the finished part alone. Of a joint:
    by ``step_deg`` with its own torque, see `at`.
    """

    where = frozenset({Where.TIP})
    depends_on = frozenset({Dependence.RUN_TIME_STEP, Dependence.FORCE})
    feels_weight = True
    vectors = MappingProxyType({"direction": DIRECTION})
    direction = DIRECTION
    parameters = (
        size_from_zero(
            "step_mm",
            "mm",
            high=0.5,
            start=0.01,
            source="a flange that creeps under its bolts 1-20 µm a cycle; nearly loose ones ten times that",
        ),
        Parameter(
            name="threshold_N",
            unit="N",
            low=5.0,
            high=5000.0,
            nominal=None,
            start=150.0,
            grid=(80.0, 300.0),
            minimum=1e-3,
            source="friction of a loose clamp some 10 N, of a bolted flange kilonewtons",
        ),
        *direction_parameters("any"),
    )

    def yielding(self, tcp_mm: Floats, load: Load, inputs: Inputs, applied: Applied) -> Floats:
        """Return the tip where it has slipped to."""
        if applied["step_mm"] == 0.0 or applied.target != TIP:
            return tcp_mm
        return tcp_mm + _slipped_mm(load[0], applied)

    def instruments(self, signals: Signals, applied: Applied) -> Signals:
        """Return the signals with the part where its fixture has slipped to."""
        if applied["step_mm"] == 0.0 or applied.target != FIXTURE:
            return signals
        shift_mm = _slipped_mm(signals.force_base_N, applied)
        if signals.part_shift_mm is not None:
            shift_mm = shift_mm + signals.part_shift_mm
        return replace(signals, part_shift_mm=shift_mm)


class JointRatchet(_Ratchet):
    """The ratchet of a joint: behind the gear it turns with its own torque, by ``step_deg`` each time."""

    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.RUN_TIME_STEP, Dependence.OWN_TORQUE})
    feels_weight = True
    parameters = (
        size_from_zero(
            "step_deg",
            "deg",
            high=0.1,
            start=0.002,
            source="a hub or a gear's flange 0.1-1 arcmin a cycle",
        ),
        Parameter(
            name="threshold_Nm",
            unit="N·m",
            low=5.0,
            high=20000.0,
            nominal=None,
            start=200.0,
            grid=(100.0, 1000.0),
            minimum=1e-3,
            source="loose clamps of a wrist some 10 N·m, flanges of a large arm kilonewton metres",
        ),
    )

    def start(self, inputs: Inputs, target: Target = None) -> dict[str, float]:
        """Return a typical step at the middle of the torques of the run."""
        torque_Nm = np.abs(inputs.own_torque_Nm[:, JOINTS.index(target or "")])
        middle_Nm = (torque_Nm.max(initial=0.0) + torque_Nm.min(initial=np.inf)) / 2.0
        start = super().start(inputs, target)
        return start | {"threshold_Nm": float(middle_Nm)} if 0.0 < middle_Nm < np.inf else start

    def gear(self, q_load_rad: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return what is behind the gear."""
        if applied["step_deg"] == 0.0:
            return q_load_rad
        torque_Nm = inputs.own_torque_Nm[:, applied.joint]
        steps = np.cumsum(np.sign(torque_Nm) * slips(np.abs(torque_Nm), applied["threshold_Nm"]))
        q = np.array(q_load_rad)
        q[:, applied.joint] += applied["step_deg"] * RAD_PER_DEG * steps
        return q


def _slipped_mm(force_N: Floats, applied: Applied) -> Floats:
    """Return the way (m, 3) of all slips so far."""
    steps = np.cumsum(slips(np.linalg.norm(force_N, axis=1), applied["threshold_N"]))
    way_mm: Floats = applied["step_mm"] * steps[:, None] * applied.unit_vector()
    return way_mm


def slips(load: Floats, threshold: float) -> Bools:
    """Return at which samples (m,) a load rises above a threshold for the first time since it was low.

    A load that is large from the first sample on has slipped before.
    """
    level = np.where(load > threshold, 1, np.where(load < _REARMED * threshold, -1, 0))
    known = np.maximum.accumulate(np.where(level != 0, np.arange(len(load)), 0))
    high = level[known] == 1  # between the two levels it is what it was last
    rises: Bools = np.concatenate([[False], high[1:] & ~high[:-1]])
    return rises


EFFECT = BoltRatchet()
OF_JOINT = JointRatchet()
