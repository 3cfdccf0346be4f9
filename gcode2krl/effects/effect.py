"""What an effect is: a name, where it shows, its parameters, and one implementation as hooks of the chain.

An effect is one physical thing that the nominal model leaves out. It overrides the hooks of the stages it
touches; `chain.simulate` calls them in the order of the physics, each with the signal so far, and each
returns the signal with the effect. A hook never changes an array it is given. What a diagnosis must know of
an effect is stated here too, so that no other module knows it by its name.
"""

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.cell.sections import VIRTUAL_JOINTS
from gcode2krl.effects.arm import Load
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.effects.parameter import DIRECTION, Parameter, Role
from gcode2krl.effects.signals import Signals

Values = Mapping[str, float]
Target = str | None

LINKS = ("timing", "path", "servo", "gear", "force", "mechanics", "part")
JOINTS = ("A1", "A2", "A3", "A4", "A5", "A6")
ALL = "all"
"""The target of a common-mode effect: one number that all six joints have, as servos tuned alike do."""
NO_TARGET: tuple[Target, ...] = (None,)
_DOWNSTREAM = {
    "timing": "path",
    "path": "servo",
    "servo": "gear",
    "gear": "mechanics",
    "force": "mechanics",
    "mechanics": "part",
}
_MODELLED = ("timing", "force", "mechanics")
"""Links behind which the model's signal stays at work when they are measured. Behind the others the measured
joints replace it: the mismatch of a drive is then in the data."""


@dataclass(frozen=True)
class Applied:
    """An effect at one target with the values of all its parameters."""

    effect: "Effect"
    target: Target = None
    values: Values = field(default_factory=dict)
    planned: bool = False
    """The inputs it is simulated from hold its plan already."""
    held: frozenset[str] = frozenset()
    """Numbers that a fit does not move: data do not show them."""

    def __getitem__(self, name: str) -> float:
        return self.values[name]

    def vector(self, names: tuple[str, ...]) -> Floats:
        """Return the values of some parameters as an array."""
        return np.array([self.values[name] for name in names])

    def unit_vector(self) -> Floats:
        """Return the direction (3,) at length 1; zero where it has none."""
        along = self.vector(self.effect.direction or DIRECTION)
        length = float(np.linalg.norm(along))
        return along / length if length > 0.0 else along

    def __str__(self) -> str:
        """Return the text that `registry.parse` reads, ``backlash:target=A2,gap_deg=0.02``."""
        target = [] if self.target is None else [f"target={self.target}"]
        values = [f"{name}={value!r}" for name, value in self.values.items() if math.isfinite(value)]
        return f"{self.effect.name}:{','.join((*target, *values))}".rstrip(":")

    @property
    def key(self) -> tuple[str, Target]:
        """Return the names of effect and target."""
        return self.effect.name, self.target

    @property
    def label(self) -> str:
        """Return name and target, ``backlash A2``."""
        return self.effect.name if self.target is None else f"{self.effect.name} {self.target}"

    @property
    def joint(self) -> int:
        """Return the index 0 to 5 of the target A1 to A6."""
        return JOINTS.index(self.target or "")

    @property
    def axes(self) -> tuple[int, ...]:
        """Return the indices 0 to 5 of the joints at the target: all six where it is `ALL`."""
        return tuple(range(len(JOINTS))) if self.target == ALL else (self.joint,)


class Effect:
    """Base of all effects: no hook does anything.

    A library file defines ``EFFECT = SomeEffect()``. To build signatures a diagnosis uses `settings`, the
    unit settings whose signals span the effect at a given shape, and `combined`, the values of a combination.
    """

    name: str = ""
    family: str = ""
    links: frozenset[str] = frozenset()
    """Links of the measuring chain in which it shows when every signal is measured; see `visible_links`."""
    kind: Literal["cause", "slip"] = "cause"
    parameters: tuple[Parameter, ...] = ()
    vectors: Mapping[str, tuple[str, ...]] = MappingProxyType({})
    """Names under which several parameters may be given at once: ``direction`` -> its three components."""
    needs: frozenset[str] = frozenset()
    """What `Inputs.offers` must contain for the effect to be simulated: ``cut``, ``plan``."""
    direction: tuple[str, str, str] | None = None
    """Three parameters that are a direction only: their length does not matter, the size has its own."""
    searched_in: frozenset[str] = frozenset()
    """Links in which a slip is tried like a cause."""
    is_clock: bool = False
    """It is the clock of a table, or of some of its columns: the target says which."""
    is_misread: bool = False
    """Encoders state what the tip does not do: links behind them must know of it."""
    own_model: bool = False
    """The controller moves by a model of the robot other than the cell's: joints differ, the tip does not."""
    where: frozenset[Where] = frozenset()
    depends_on: frozenset[Dependence] = frozenset()
    """Of what it is a function; with ``where`` its family. Empty: not stated."""
    feels_weight: bool = False
    """Its size depends on weight and inertia of the links, as far as the cell states their masses."""
    of_set_up: Literal["", "frame", "small"] = ""
    """What a set-up leaves off: the part's frame as a whole, or a little of each joint and tool beside it."""
    is_nuisance: bool = False
    """Its usual size is at work in every run, the same in all, and a fit allows for it: see `disturbed`.

    False where the mismatch of an instrument (a clock, a frame, a zero, run by run) already stands for it.
    """

    # What it is

    def targets(self, cell: Cell) -> tuple[Target, ...]:
        """Return its targets in this cell: ``(None,)`` where it has no target, () if it is not possible."""
        return NO_TARGET

    def why_not(self, cell: Cell, target: Target) -> str:
        """Return why a target is not among `targets` of this cell, and what would make it one."""
        return ""

    def links_at(self, target: Target) -> frozenset[str]:
        """Return the links in which the effect shows at this target."""
        return self.links

    def at(self, target: Target) -> "Effect":
        """Return the effect with the parameters that it has at a target, of the same name.

        Another one than itself only where a target has a number in another unit: mm of a tip, degrees of a
        joint.
        """
        return self

    def joints_at(self, target: Target) -> frozenset[str]:
        """Return the joints that it moves where it shows in one; none where the target does not say which."""
        return frozenset(joint for joint in JOINTS if joint == target)

    def visible_links(self, examined: frozenset[str], target: Target = None) -> frozenset[str]:
        """Return the examined links in which it shows; what is not measured adds to the next link downstream.

        Without a load encoder, say, a backlash shows in the mechanics. An error of an instrument shows in
        what that instrument measures and nowhere else.
        """
        if self.family == "sensor":
            return self.links_at(target) & examined
        visible = set()
        for link in self.links_at(target):
            here: str | None = link
            while here is not None and here not in examined:
                here = _DOWNSTREAM.get(here)
            if here is not None:
                visible.add(here)
        return frozenset(visible)

    def searched(self, link: str, target: Target, examined: frozenset[str]) -> bool:
        """Tell whether a diagnosis tries the effect in a link, given the links that have data.

        Causes are tried wherever they show, slips in `searched_in` only: most have a test of their own.
        """
        tried = self.kind == "cause" or link in self.searched_in
        return tried and link in self.visible_links(examined, target)

    def learned(self, applied: Applied, link: str) -> Applied | None:
        """Return the effect as later links take it over from a link where it was fitted; None for not at all.

        An error of the force sensor does not bend the arm.
        """
        return None if self.family == "sensor" else applied

    # Normal mismatch

    def usual(self, mismatch: Mismatch, duration_s: float, clocks: int = 1) -> dict[str, float]:
        """Return by how much each size may be off its nominal value and be no finding, in its own unit.

        ``clocks``: how many clocks of their own the compared signals have. What is not named may not be off
        at all.
        """
        return {p.name: p.usual(mismatch) for p in self.parameters if p.usual is not None}

    def disturbed(self, target: Target, unmeasured: frozenset[str]) -> Iterator[str]:
        """Yield the links in which its usual size is a nuisance, given those without data.

        It goes down the chain from its own links to the first where measured joints replace the model's.
        """
        if not self.is_nuisance or target == ALL:  # that of each joint already stands for what they share
            return
        for link in sorted(self.links_at(target)):
            here: str | None = link
            while here is not None:
                yield here
                goes_on = here in unmeasured or here in _MODELLED
                here = _DOWNSTREAM.get(here) if goes_on else None

    # Its values

    def parameter(self, name: str) -> Parameter:
        """Return a parameter by name; raises KeyError."""
        return {p.name: p for p in self.parameters}[name]

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the parameters."""
        return tuple(p.name for p in self.parameters)

    @property
    def sizes(self) -> tuple[Parameter, ...]:
        """Return the parameters that say how much of the effect there is."""
        return tuple(p for p in self.parameters if p.role is Role.SIZE)

    @property
    def phase(self) -> Parameter | None:
        """Return the parameter that is the phase of a sine; None where it is no sine."""
        return self._with_role(Role.PHASE)

    @property
    def moment(self) -> Parameter | None:
        """Return the parameter that is a moment in s; None where it does not begin at one."""
        return self._with_role(Role.MOMENT)

    @property
    def frequency(self) -> Parameter | None:
        """Return the parameter that is a frequency in Hz; None where there is none."""
        return self._with_role(Role.FREQUENCY)

    def _with_role(self, role: Role) -> Parameter | None:
        return next((p for p in self.parameters if p.role is role), None)

    def nominal(self, inputs: Inputs, target: Target = None) -> dict[str, float]:
        """Return the values at which the effect is not there, the model's own where they depend on the cell.

        Shapes have their typical value.
        """
        return {p.name: p.unset for p in self.parameters}

    def start(self, inputs: Inputs, target: Target = None) -> dict[str, float]:
        """Return typical values with the effect."""
        return {p.name: p.start for p in self.parameters}

    def shapes(self) -> tuple[dict[str, float], ...]:
        """Return the combinations of the shapes' grids; a single empty one for an effect without shapes."""
        forms = [p for p in self.parameters if p.is_shape and p.name not in (self.direction or ())]
        grids = [[(p.name, value) for value in p.grid or (p.start,)] for p in forms]
        return tuple(dict(combination) for combination in itertools.product(*grids))

    def settings(
        self, inputs: Inputs, target: Target = None, shape: Values | None = None, size: float = 1.0
    ) -> tuple[dict[str, float], ...]:
        """Return settings of all parameters whose signals, minus the nominal ones, span the effect.

        One setting for each size, at nominal + ``size``·(start - nominal) with the other sizes nominal; where
        the effect has a direction, one for each size along each axis.
        """
        base = self.nominal(inputs, target) | dict(shape or {})
        start = self.start(inputs, target)
        axes: list[dict[str, float]] = [{}]
        if self.direction:
            axes = [dict(zip(self.direction, axis.tolist(), strict=True)) for axis in np.eye(3)]
        values = {p.name: float(base[p.name] + size * (start[p.name] - base[p.name])) for p in self.sizes}
        return tuple(base | {name: value} | axis for name, value in values.items() for axis in axes)

    def combined(
        self, coefficients: Floats, inputs: Inputs, target: Target = None, shape: Values | None = None
    ) -> dict[str, float]:
        """Return the values of a combination of `settings` (at size 1) with these coefficients."""
        base = self.nominal(inputs, target) | dict(shape or {})
        start = self.start(inputs, target)
        vectors = np.asarray(coefficients, dtype=float).reshape(-1, 3 if self.direction else 1)
        for p, vector in zip(self.sizes, vectors, strict=True):
            length = float(np.linalg.norm(vector)) if self.direction else float(vector[0])
            base[p.name] = base[p.name] + length * (start[p.name] - base[p.name])
            if self.direction and length > 0.0:
                base |= dict(zip(self.direction, (vector / length).tolist(), strict=True))
        return base

    def alternatives(self, values: Values) -> tuple[dict[str, float], ...]:
        """Return values that look the same to first order: a fit begins at the best of them."""
        return (dict(values),)

    @property
    def plans_anew(self) -> bool:
        """Tell whether the motion is planned again. Signals are then far from linear in the size."""
        return "plan" in self.needs

    @property
    def is_linear(self) -> bool:
        """Tell whether the signals are proportional to its size."""
        return all(p.linear for p in self.sizes)

    # What it does: the hooks, in the order in which `simulate` calls them

    def replan(self, inputs: Inputs, applied: Applied) -> Inputs:
        """Return the inputs of the motion that is really planned: timing, path, commanded joints."""
        return inputs

    def servo(self, q_act_rad: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the motor side joints (m, 6); ``q_act_rad`` comes in as what is commanded."""
        return q_act_rad

    def gear(self, q_load_rad: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the joints behind the gears (m, 6); ``q_load_rad`` comes in as the motor side."""
        return q_load_rad

    def joints(self, q_true_rad: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the joints as they truly are (m, 6); comes in as what encoders behind the gear would say."""
        return q_true_rad

    def cut(self, load: Load, inputs: Inputs, applied: Applied) -> Load:
        """Return the true cutting force and moment on the tool."""
        return load

    def load(self, load: Load, inputs: Inputs, applied: Applied) -> Load:
        """Return the load that bends the arm; comes in as the true cutting load, or the measured one."""
        return load

    def softness(self, softness: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return 1/k_C, 1/k_B, 1/k_A (10, 3) in rad/(N·mm) of the virtual joints."""
        return softness

    def elastic(self, angle_rad: Floats, torque_Nm: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return what the axes turn by beyond the linear model (m, 6), under joint torques (m, 6) in N·m."""
        return angle_rad

    def geometry(self, lengths_mm: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return a1, a2, c1, c2, c3, c4 (6,) of the arm in mm."""
        return lengths_mm

    def yielding(self, tcp_mm: Floats, load: Load, inputs: Inputs, applied: Applied) -> Floats:
        """Return the tip (m, 3) with what gives way under the cutting load besides the arm.

        ``load`` is the true one, or the measured one where the arm is bent by that.
        """
        return tcp_mm

    def tcp(self, tcp_mm: Floats, deflection_mm: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the tool tip (m, 3) in mm in ``$BASE``, deflection included."""
        return tcp_mm

    def orientation(self, rotation: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the rotations (m, 3, 3) of the tool frame in ``$BASE``; called where they are asked for."""
        return rotation

    def sensor(self, load: Load, inputs: Inputs, applied: Applied) -> Load:
        """Return force and moment as the sensor states them, turned to the axes of ``$BASE``."""
        return load

    def instruments(self, signals: Signals, applied: Applied) -> Signals:
        """Return the signals with what belongs to the instruments: clocks, units, the finished part."""
        return signals


def every_joint(cell: Cell) -> tuple[Target, ...]:
    """Return A1 to A6."""
    return JOINTS


def every_joint_and_all(cell: Cell) -> tuple[Target, ...]:
    """Return A1 to A6, and all of them with one number."""
    return (*JOINTS, ALL)


def every_virtual_joint(cell: Cell) -> tuple[Target, ...]:
    """Return the virtual joints whose stiffness the cell states."""
    return tuple(name for name in VIRTUAL_JOINTS if name in cell.compliance.virtual_joints)
