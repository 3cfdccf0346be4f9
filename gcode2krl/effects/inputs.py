"""What the measuring chain of one run starts from: what is planned, where the arm stands, what is cut."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, wraps
from typing import Any, NamedTuple, TypeVar

import numpy as np

from gcode2krl import frames as fr
from gcode2krl import robot
from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.cell import Cell
from gcode2krl.effects import arm
from gcode2krl.effects.arm import Load
from gcode2krl.errors import NotUnderstoodError, input_error
from gcode2krl.tables import Forces, Motion, Targets, Toolpath
from gcode2krl.units import GRAVITY_M_S2, MM_PER_M, S_PER_H

# Links and payload as points with a mass: what gears carry besides the cutting force.
#
# A cell does not state where the centres of its links are; each is taken half-way between the axes at its
# ends, those of the wrist at its centre. Against the centres in the maker's description of a KR 210 R2700-2,
# stretched, that is 21 % too much torque at A2 and 83 % at A3, whose motors sit at the elbow: enough for how
# a torque changes with the posture, not for its size.

_LINKS = 6


class Bodies(NamedTuple):
    """The b bodies of an arm along a run; none where the cell states no mass."""

    centre_mm: Floats
    """(m, b, 3) in ``$BASE``."""
    mass_kg: Floats
    """(m, b)"""
    carried_by: Ints
    """(b,) number of the last axis, 0 to 5, that moves it."""


def bodies_of(cell: Cell, axes_mm: Floats, tip_mm: Floats, rotation: Floats, tool: Ints32) -> Bodies:
    """Return links, where the robot's masses are stated, and payload, where the cell's load is."""
    count = len(axes_mm)
    centres, masses, carried = [], [], []
    if cell.robot.drives.link_mass_kg is not None:
        ends = np.concatenate([axes_mm[:, 1:], axes_mm[:, -1:]], axis=1)
        centres.append((axes_mm + ends) / 2.0)
        masses.append(np.tile(cell.robot.drives.link_mass_kg, (count, 1)))
        carried += list(range(_LINKS))
    payload_kg, payload_mm = _payload(cell, tip_mm, rotation, tool)
    if payload_kg.any():
        centres.append(payload_mm[:, None])
        masses.append(payload_kg[:, None])
        carried.append(_LINKS - 1)
    centre_mm = np.concatenate([np.zeros((count, 0, 3)), *centres], axis=1)
    mass_kg = np.concatenate([np.zeros((count, 0)), *masses], axis=1)
    return Bodies(centre_mm, mass_kg, np.array(carried, dtype=int))


def _payload(cell: Cell, tip_mm: Floats, rotation: Floats, tool: Ints32) -> tuple[Floats, Floats]:
    """Return mass (m,) and centre (m, 3) of the payload, stated from the flange; 0 kg where it is not."""
    mass_kg, centre_mm = np.zeros(len(tip_mm)), np.array(tip_mm)
    for number in np.unique(tool):
        rows, load = tool == number, cell.load_of(int(number))
        if load.mass_kg is None:
            continue
        frame, flange = cell.tool_matrix(int(number)), np.array([load.x_mm, load.y_mm, load.z_mm])
        from_tip = frame[:3, :3].T @ (flange - frame[:3, 3])
        mass_kg[rows] = load.mass_kg
        centre_mm[rows] = tip_mm[rows] + rotation[rows] @ from_tip
    return mass_kg, centre_mm


def torque_Nm(bodies: Bodies, push_N: Floats, axes_mm: Floats, jacobian: Floats) -> Floats:
    """Return the torques (m, 6) of forces (m, b, 3) on the bodies about the axes, positive with the angle.

    The axes' directions are the last rows of the tip's ``jacobian`` (m, 6, 6).
    """
    along = np.swapaxes(jacobian[:, 3:], 1, 2)
    torque = np.zeros(along.shape[:2])
    for body, carried in enumerate(bodies.carried_by):
        lever_mm = bodies.centre_mm[:, body, None] - axes_mm[:, : carried + 1]
        moment = np.cross(lever_mm, push_N[:, body, None])
        torque[:, : carried + 1] += np.sum(along[:, : carried + 1] * moment, axis=2) / MM_PER_M
    return torque


Cut = Callable[[Motion, Cell], Forces]
Plan = Callable[[Targets, Cell], Motion]


Sources = tuple[Any, ...]
Made = TypeVar("Made")


def of_the_path(make: "Callable[[Inputs], Made]") -> "cached_property[Made]":
    """Return a property that follows from the commanded path and the cell alone, whatever the times on it.

    Runs and links share its value: of a long run one of them is as large as all that was measured.
    """

    def once(inputs: "Inputs") -> Made:
        return inputs.remembered(make.__name__, make, inputs.path)

    return cached_property(wraps(make)(once))


def of_the_command(make: "Callable[[Inputs], Made]") -> "cached_property[Made]":
    """Return a property that follows from commanded motion and cell alone: runs and links share its value."""

    def once(inputs: "Inputs") -> Made:
        return inputs.remembered(make.__name__, make)

    return cached_property(wraps(make)(once))


@dataclass(frozen=True, kw_only=True, eq=False)
class Inputs:
    """One run's nominal chain, m samples; `inputs_of` makes it from a prediction."""

    cell: Cell
    time_s: Floats
    move: Ints32
    source_line: Ints32
    path_mm: Floats
    tool: Ints32
    spindle_rad_s: Floats
    q_cmd_rad: Floats
    """(m, 6) commanded joints."""
    position_mm: Floats
    """(m, 3) commanded tip in ``$BASE``: that of ``q_cmd_rad`` for the controller's own kinematics."""
    rotation: Floats
    """(m, 4) commanded quaternion x, y, z, w of the tool frame."""
    force_base_N: Floats
    """(m, 3) nominal cutting force on the tool; zero where none is known."""
    moment_base_Nmm: Floats
    """(m, 3) about the tip."""
    hours: float = 0.0
    """Since the earliest of the runs started."""
    q_act_rad: Floats | None = None
    """(m, 6) measured motor side, in place of the model's for all that follows; NaN: a joint without."""
    q_load_rad: Floats | None = None
    """(m, 6) measured behind the gear; NaN for joints without an encoder there."""
    load_base_N: Floats | None = None
    """(m, 3) measured force that bends the arm."""
    torque_Nm: Floats | None = None
    """(m, 6) logged torque of the drives, or their current in A: what a deviation may depend on."""
    temperature_C: Floats | None = None
    """(m, c) logged temperatures of the cell, the ambient last: what a deviation may depend on."""
    toolpath: Toolpath | None = None
    motion: Motion | None = None
    targets: Targets | None = None
    forces: Forces | None = None
    """What was cut nominally, with its arcs of engagement."""
    cut: Cut | None = None
    """Removes the material again, along another motion or in a changed cell."""
    plan: Plan | None = None
    """Plans the motion again, with other targets or in a changed cell."""
    kept: dict[str, tuple[Sources, Any]] = field(default_factory=dict, repr=False)
    """What was computed of the commanded motion, by name: all inputs with the same columns share it."""

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def path(self) -> Sources:
        """What the commanded path consists of, and the cell."""
        return self.cell, self.q_cmd_rad, self.position_mm, self.rotation, self.tool

    def remembered(self, name: str, make: "Callable[[Inputs], Made]", sources: Sources = ()) -> Made:
        """Return what follows from these sources, or from the commanded motion, made once for all inputs."""
        sources = sources or (*self.path, self.time_s)
        known = self.kept.get(name)
        if known is None or any(old is not new for old, new in zip(known[0], sources, strict=True)):
            known = self.kept[name] = sources, make(self)
        made: Made = known[1]
        return made

    @of_the_path
    def tool_rotation(self) -> Floats:
        """(m, 3, 3) commanded rotations of the tool frame in ``$BASE``."""
        return fr.rotation_from_quaternion(self.rotation)

    @of_the_path
    def sensor_rotation(self) -> Floats:
        """(m, 3, 3) rotations of the force sensor in ``$BASE``; its axes are those of the flange."""
        turned = np.empty((len(self), 3, 3))
        for number, rows in arm.tool_rows(self.tool):
            turned[rows] = self.tool_rotation[rows] @ self.cell.tool_matrix(number)[:3, :3].T
        return turned

    @cached_property
    def gravity(self) -> Floats:
        """(3,) unit vector downwards along ``$BASE``, however the robot is mounted."""
        down: Floats = self.cell.base_in_world()[:3, :3].T @ np.array([0.0, 0.0, -1.0])
        return down

    @of_the_command
    def rate_rad_s(self) -> Floats:
        """(m, 6) velocities of the commanded joints."""
        return gradient(self.q_cmd_rad, self.time_s)

    @of_the_path
    def jacobian(self) -> Floats:
        """(m, 6, 6) of the tip at the commanded joints, along ``$BASE``."""
        return arm.jacobian_base(self.q_cmd_rad, self.cell, self.tool)

    @cached_property
    def own_torque_Nm(self) -> Floats:
        """(m, 6) torque of the nominal loads about each axis, positive with the angle: what its gear carries.

        Cutting load (the measured force where there is one), and weight and inertia of links and payload as
        far as the cell states their masses. Zero where the posture is unknown: relative angles.
        """
        if not self.position_mm.any():
            return np.zeros_like(self.q_cmd_rad)
        force_N = self.force_base_N if self.load_base_N is None else self.load_base_N
        torque = arm.torque_Nm(self.jacobian, force_N, self.moment_base_Nmm)
        return torque + self._weight_Nm

    @of_the_command
    def _weight_Nm(self) -> Floats:
        """(m, 6) torque of weight and inertia of links and payload."""
        return torque_Nm(self.bodies, self.bodies_push_N, self.axes_mm, self.jacobian)

    @of_the_path
    def axes_mm(self) -> Floats:
        """(m, 6, 3) a point of each joint's axis in ``$BASE``: where the links meet."""
        return arm.axes_mm(self.q_cmd_rad, self.lengths_mm, self.cell)

    @of_the_path
    def bodies(self) -> Bodies:
        """Links and payload as points with a mass."""
        return bodies_of(self.cell, self.axes_mm, self.position_mm, self.tool_rotation, self.tool)

    @of_the_command
    def bodies_push_N(self) -> Floats:
        """(m, b, 3) weight and inertia of links and payload along ``$BASE``."""
        speed = [gradient(at, self.time_s) for at in np.moveaxis(self.bodies.centre_mm, 1, 0)]
        acceleration = np.stack([gradient(each, self.time_s) for each in speed], axis=1) / MM_PER_M
        push_N: Floats = self.bodies.mass_kg[..., None] * (GRAVITY_M_S2 * self.gravity - acceleration)
        return push_N

    @cached_property
    def lengths_mm(self) -> Floats:
        """(6,) a1, a2, c1, c2, c3, c4 of the arm."""
        return self.cell.robot.geometry.array()

    @cached_property
    def softness(self) -> Floats | None:
        """(10, 3) of the virtual joints in rad/(N·mm); None where the cell does not state all."""
        return arm.softness_of(self.cell)

    @cached_property
    def is_act_missing(self) -> Bools:
        """(6,) joints whose motor side was not measured where others were."""
        return _is_missing(self.q_act_rad)

    @cached_property
    def is_load_missing(self) -> Bools:
        """(6,) joints without an encoder behind the gear where others have one."""
        return _is_missing(self.q_load_rad)

    @property
    def joints_rad(self) -> Floats:
        """(m, 6) the joints from which the tip follows: the last that were measured, else the commanded."""
        measured = self.q_act_rad if self.q_load_rad is None else self.q_load_rad
        return self.q_cmd_rad if measured is None else measured

    @cached_property
    def deflection_mm(self) -> Floats:
        """(m, 3) nominal deflection under the nominal load."""
        if self.joints_rad is self.q_cmd_rad and self.load_base_N is None:
            return self.bent_mm
        load = (self.force_base_N, self.moment_base_Nmm)
        return arm.bend(self.q_cmd_rad, *load, self.softness, self.cell, self.tool)[0]

    @cached_property
    def bent_mm(self) -> Floats:
        """(m, 3) deflection at `joints_rad` under the cutting force, the measured one where there is one."""
        force_N = self.force_base_N if self.load_base_N is None else self.load_base_N
        load = (force_N, self.moment_base_Nmm)
        return arm.bend(self.joints_rad, *load, self.softness, self.cell, self.tool)[0]

    @of_the_command
    def velocity_mm_s(self) -> Floats:
        """(m, 3) of the commanded tip along ``$BASE``; central differences."""
        return gradient(self.position_mm, self.time_s)

    @cached_property
    def run_hours(self) -> Floats:
        """(m,) hours since the earliest of the runs started."""
        return self.hours + self.time_s / S_PER_H

    @cached_property
    def tip_mm(self) -> Floats:
        """(m, 3) the tip of the stiff arm in ``$BASE`` at `joints_rad`."""
        if self.joints_rad is self.q_cmd_rad:
            return self.position_mm
        return self.rigid_tip_mm(self.joints_rad, self.lengths_mm)

    def rigid_tip_mm(self, q_rad: Floats, lengths_mm: Floats) -> Floats:
        """Return the tip (m, 3) of a stiff arm of these lengths: the commanded one, moved by what differs."""
        tip_mm = arm.tip_mm(q_rad, lengths_mm, self.cell, self.tool)
        return self.position_mm + (tip_mm - self._commanded_tip_mm)

    @of_the_path
    def _commanded_tip_mm(self) -> Floats:
        return arm.tip_mm(self.q_cmd_rad, self.lengths_mm, self.cell, self.tool)

    @property
    def offers(self) -> frozenset[str]:
        """What effects may rely on: ``cut`` where material can be removed again, ``plan`` for the motion."""
        there = {
            "cut": self.cut is not None and self.motion is not None and self.forces is not None,
            "plan": self.plan is not None and self.targets is not None and self.toolpath is not None,
        }
        return frozenset(name for name, is_there in there.items() if is_there)

    def recut(self, cell: Cell | None = None, shift_mm: Floats | None = None) -> Load:
        """Return the cutting load in another cell, or with the tool's path shifted (3,) against the stock.

        Raises an input error where the prediction has no forces.
        """
        if self.cut is None or self.motion is None or self.forces is None:
            raise _not_here("how the part is cut", "predict the forces of the part first")
        motion = self.motion
        if shift_mm is not None:
            motion = replace(motion, position_mm=motion.position_mm + shift_mm)
        forces = self.cut(motion, self.cell if cell is None else cell)
        return forces.force_base_N, forces.moment_base_Nmm

    def replanned(self, targets: Targets, cell: Cell) -> "Inputs":
        """Return the inputs of other targets, or of a controller as in another cell, on their own time."""
        if self.plan is None:
            raise _not_here("how the motion is planned", "predict the part first")
        return self.moved(self.plan(targets, cell), targets)

    def moved(self, motion: Motion, targets: Targets | None = None) -> "Inputs":
        """Return the inputs along another motion of the same program; measured signals keep their times."""
        if self.toolpath is None:
            raise _not_here("the program's moves", "predict the part first")
        forces = self.cut(motion, self.cell) if self.cut is not None and self.forces is not None else None
        nothing = np.zeros((len(motion), 3))
        return replace(
            self,
            time_s=motion.time_s,
            move=motion.move,
            source_line=self.toolpath.source_line[motion.move],
            path_mm=motion.path_mm,
            tool=motion.tool,
            spindle_rad_s=self.toolpath.spindle_rad_s[motion.move],
            q_cmd_rad=robot.angles_near(motion, self.q_cmd_rad[0], self.cell),
            position_mm=motion.position_mm,
            rotation=motion.rotation,
            force_base_N=nothing if forces is None else forces.force_base_N,
            moment_base_Nmm=nothing if forces is None else forces.moment_base_Nmm,
            forces=forces,
            motion=motion,
            targets=self.targets if targets is None else targets,
            q_act_rad=self._at(self.q_act_rad, motion.time_s),
            q_load_rad=self._at(self.q_load_rad, motion.time_s),
            load_base_N=self._at(self.load_base_N, motion.time_s),
            torque_Nm=self._at(self.torque_Nm, motion.time_s),
            temperature_C=self._at(self.temperature_C, motion.time_s),
        )

    def _at(self, values: Floats | None, time_s: Floats) -> Floats | None:
        return None if values is None else resampled(values, self.time_s, time_s)


def _is_missing(measured_rad: Floats | None) -> Bools:
    """Return which columns of (m, 6) are NaN."""
    if measured_rad is None:
        return np.ones(6, dtype=np.bool_)
    return np.asarray(np.isnan(measured_rad).all(axis=0))


def resampled(values: Floats, time_s: Floats, at_s: Floats) -> Floats:
    """Return the columns of (m, c) at other times, linearly between samples; the ends are held."""
    return np.stack([np.interp(at_s, time_s, column) for column in values.T], axis=1)


def gradient(values: Floats, time_s: Floats) -> Floats:
    """Return the time derivative (m, c) by central differences; 0 for a single sample."""
    if len(time_s) < 2:
        return np.zeros_like(values)
    slope: Floats = np.gradient(values, time_s, axis=0)
    return slope


def _not_here(what: str, remedy: str) -> NotUnderstoodError:
    return input_error("effect-impossible", f"this effect needs to know {what}", remedy)
