"""What may be wrong with an arm: the small numbers of its chain, with the width that makers' tolerances give.

The chain is eq. 1 of `gcode2krl.robot.kinematics` between the frame of the instrument and the tip, with one
turn or shift for each way in which an axis can miss the next: as many as Denavit and Hartenberg's with
Hayati's turn for the parallel A2 and A3 (Hayati and Mirmirani 1985). Where an axis is tilted, the line of the
turn is that of the effect ``axis_parallelism``. Numbers that no poses can tell apart (zero of A1 and turn of
the base) are all there; their widths share them out, and what is not told apart is said.
"""

from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.units import RAD_PER_DEG, RAD_PER_MRAD


@dataclass(eq=False)
class Motion:
    """One elementary motion of all rows (n): a turn (rad) or a shift (mm) about or along a local axis."""

    axis: int
    """0, 1, 2: x, y, z."""
    turns: bool
    nominal: Floats
    """(n,)"""
    terms: list[tuple[int, Floats | float]] = field(default_factory=list)
    """Number of a small number, and by how much the motion changes with it: (n,), or one for all rows."""

    def values(self, theta: Floats) -> Floats:
        """Return the motion (n,) with the small numbers (p,)."""
        value = self.nominal
        for number, slope in self.terms:
            if theta[number] != 0.0:
                value = value + slope * theta[number]
        return value


@dataclass(eq=False)
class MotionChain:
    """Elementary motions by name, in order from the frame in which is measured to the tip."""

    rows: int
    motions: dict[str, Motion] = field(default_factory=dict)

    def turn(self, name: str, axis: int, nominal: Floats | float = 0.0) -> None:
        """Add a turn in rad about a local axis."""
        self.motions[name] = Motion(axis, True, np.broadcast_to(np.asarray(nominal, float), self.rows))

    def shift(self, name: str, axis: int, nominal: Floats | float = 0.0) -> None:
        """Add a shift in mm along a local axis."""
        self.motions[name] = Motion(axis, False, np.broadcast_to(np.asarray(nominal, float), self.rows))

    def walk(self, theta: Floats) -> tuple[Floats, Floats, dict[str, tuple[Floats, Floats]]]:
        """Return tips (n, 3), rotations (n, 3, 3), and by motion its axis and where it acts (n, 3)."""
        columns = [np.tile(unit, (self.rows, 1)) for unit in np.eye(3)]
        place = np.zeros((self.rows, 3))
        acts = {}
        for name, motion in self.motions.items():
            value = motion.values(theta)[:, None]
            axis = columns[motion.axis]
            acts[name] = (axis, place)
            if motion.turns:
                i, j = (motion.axis + 1) % 3, (motion.axis + 2) % 3
                cos, sin = np.cos(value), np.sin(value)
                first, second = columns[i], columns[j]
                columns[i], columns[j] = cos * first + sin * second, cos * second - sin * first
            else:
                place = place + value * axis
        return place, np.stack(columns, axis=2), acts

    def slopes(self, theta: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Return tips (n, 3), rotations (n, 3, 3) and their derivatives by theta (n, 3, p), twice.

        The derivative of a rotation is the vector of the turn, along the axes of the first frame.
        """
        tip, rotation, acts = self.walk(theta)
        moved, turned = (np.zeros((self.rows, 3, len(theta))) for _ in range(2))
        for name, motion in self.motions.items():
            if not motion.terms:
                continue
            axis, place = acts[name]
            effect = np.cross(axis, tip - place) if motion.turns else axis
            for number, slope in motion.terms:
                slope = slope[:, None] if isinstance(slope, np.ndarray) else slope
                moved[:, :, number] += slope * effect
                if motion.turns:
                    turned[:, :, number] += slope * axis
        return tip, rotation, moved, turned


FREE = np.inf
"""The width of a number of which nothing is known."""
GROUPS = {
    "base": "instrument's frame",
    "tool": "tool",
    "zeros": "zeros",
    "lengths": "lengths",
    "axes": "directions of axes",
    "wrist": "axes that miss the wrist's centre",
    "weight": "bending under gravity",
    "play": "play by direction of approach",
    "gears": "couplings and eccentricity",
    "drift": "drift",
    "air": "scale and refraction",
}
GEOMETRY = ("zeros", "lengths", "axes", "wrist", "weight", "play", "gears")
"""Groups that are the arm's own."""
_SIGNS = (-1.0, 1.0, 1.0, -1.0, 1.0, -1.0)
_JOINTS = range(1, 7)
_ZERO_RAD = 0.1 * RAD_PER_DEG
"""A zero set with the maker's gauge is within some 0.02 deg, one set at a mark within some 0.1."""
_LENGTH_MM = 0.5
"""Castings and their machining 0.1-0.5 mm; uncalibrated absolute accuracy of large arms 1-3 mm."""
_AXIS_RAD = 0.5e-3
"""Machined castings 0.05-0.5 mrad (as in `axis_parallelism`)."""
_WRIST_MM = 0.1
"""Axes of a wrist miss each other by 0.02-0.1 mm."""
_SAG_RAD = 0.5e-3
"""Weight of a link on the gear that bears it, arm outstretched: 0.1-1 mrad with 1e6-1e7 N·m/rad."""
_PLAY_RAD = 0.01 * RAD_PER_DEG
"""Half the reversal error: 0.3-1 arcmin, worn gears several times that (as in `backlash`)."""
_ECCENTRIC_RAD = 0.006 * RAD_PER_DEG
"""10-50 µm on a radius of 100 mm are 0.006-0.03 deg (as in `joint_eccentricity`)."""
_COUPLING = 1e-4
"""What is left of a coupling that the controller takes out (as in `wrist_coupling`), rad/rad."""
_DRIFT_MM, _DRIFT_RAD = 0.1, 0.02e-3
"""An arm that warms up 0.1-0.5 mm in 1-3 h, a tracker that was just switched on 0.1 mm/h."""
_SCALE = 20e-6
"""1e-6/K of the air's refraction, 12e-6/K of a steel scale; some kelvins."""
_BEND_PER_MM = 1.5e-9
"""Half of 1e-6/K·3 K/m, in 1/mm: a beam sinks by it times distance² (as in `tracker_refraction`)."""


@dataclass(frozen=True)
class Number:
    """One small number."""

    name: str
    group: str
    width: float
    """1-sigma before any pose is seen, in rad, mm or without a unit; `FREE` where nothing is known."""
    unit: str
    size: float
    """Of 1 rad, 1 mm or 1 in the unit that is shown."""


@dataclass(frozen=True, eq=False)
class ArmPoses:
    """What is known of each row: one target on one pose."""

    q_rad: Floats
    """(n, 6) KUKA's signs and zero."""
    measured_mm: Floats
    """(n, 3)"""
    target: np.ndarray
    """(n,) number of the target on the tool, from 0."""
    approach: Floats
    """(n, 6) -1, 0 or 1: from which side each joint came."""
    time: Floats
    """(n,) from -1 to 1 over all poses."""
    own_rad: Floats
    """(n, 6) joints of the arm's own controller."""
    a3_by_a2: float = 0.0
    """Where it is not 0, what turns A2 against its encoder may turn A3 too."""


@dataclass(eq=False)
class Model:
    """The chain of all rows and its small numbers; ``extras`` move the measured points themselves."""

    chain: MotionChain
    only: Container[str] | None = None
    numbers: list[Number] = field(default_factory=list)
    extras: list[tuple[int, Floats]] = field(default_factory=list)

    def add(
        self,
        name: str,
        group: str,
        width: float,
        terms: Iterable[tuple[str, Floats | float]] = (),
        *,
        unit: str = "",
        extra: Floats | None = None,
    ) -> None:
        """Add a number that changes some motions of the chain, or moves the measured points (n, 3)."""
        if self.only is not None and group in GEOMETRY and name not in self.only:
            return
        number = len(self.numbers)
        shown, size = {
            "mm": ("mm", 1.0),
            "deg": ("deg", 1.0 / RAD_PER_DEG),
            "mrad": ("mrad", 1.0 / RAD_PER_MRAD),
            "ppm": ("ppm", 1e6),
        }[unit]
        self.numbers.append(Number(name, group, width, shown, size))
        for motion, slope in terms:
            self.chain.motions[motion].terms.append((number, slope))
        if extra is not None:
            self.extras.append((number, extra))

    @property
    def widths(self) -> Floats:
        """(p,) 1-sigma of all numbers."""
        return np.array([number.width for number in self.numbers])

    def tips(self, theta: Floats) -> Floats:
        """Return where the instrument should see the tips (n, 3)."""
        tip, _, _ = self.chain.walk(theta)
        for number, extra in self.extras:
            if theta[number] != 0.0:
                tip = tip + theta[number] * extra
        return tip

    def slopes(self, theta: Floats) -> tuple[Floats, Floats]:
        """Return the tips (n, 3) and their derivatives (n, 3, p)."""
        tip, _, moved, _ = self.chain.slopes(theta)
        for number, extra in self.extras:
            tip = tip + theta[number] * extra
            moved[:, :, number] += extra
        return tip, moved


def nominal_chain(q_rad: Floats, mm: Floats) -> MotionChain:
    """Return the chain of an arm without errors, of n rows in KUKA's joints and lengths (8,).

    Where A6 is offset along A5 (``d5``), A4 is parallel to A2 and A3: its axis, along the forearm of other
    arms, is turned by 90 deg, and a turn of it about the forearm is an error of its own.
    """
    a1, a2, b, c1, c2, c3, c4, d5 = mm
    chain = MotionChain(len(q_rad))
    for axis, letter in enumerate("xyz"):
        chain.shift(f"base {letter}", axis)
    for axis, letter in ((2, "z"), (1, "y"), (0, "x")):
        chain.turn(f"base turn {letter}", axis)
    turns = np.array(_SIGNS) * q_rad
    chain.turn("A1", 2, turns[:, 0])
    chain.shift("a1", 0, a1)
    chain.shift("c1", 2, c1)
    chain.turn("A2 tilt", 0)
    chain.turn("A2", 1, turns[:, 1])
    chain.shift("c2", 0, c2)
    chain.turn("A3 twist", 0)
    chain.turn("A3 tilt", 2)
    chain.turn("A3", 1, turns[:, 2])
    chain.shift("a2", 2, -a2)
    chain.shift("b", 1, b)
    chain.shift("c3", 0, c3)
    if d5:
        chain.turn("A4 twist", 0)
    chain.turn("A4 tilt", 2, np.pi / 2.0 if d5 else 0.0)
    chain.turn("A4", 0, turns[:, 3])
    chain.shift("A5 beside A4", 2)
    chain.shift("A5 across", 1, d5)
    chain.turn("A5 tilt", 2)
    chain.turn("A5", 1, turns[:, 4])
    chain.shift("A6 beside A5", 2)
    chain.turn("A6 tilt", 2)
    chain.shift("c4", 0, c4)
    chain.turn("A6", 0, turns[:, 5])
    chain.turn("flange", 1, np.pi / 2.0)
    for axis, letter in enumerate("xyz"):
        chain.shift(f"tool {letter}", axis)
    return chain


def flange_of(q_rad: Floats, mm: Floats) -> tuple[Floats, Floats]:
    """Return the flanges (n, 3), (n, 3, 3) of an arm without errors in its root."""
    place, rotation, _ = nominal_chain(q_rad, mm).walk(np.zeros(0))
    return place, rotation


def model_of(
    poses: ArmPoses,
    mm: Floats,
    base: tuple[Floats, Floats],
    tools_mm: Floats,
    *,
    groups: Sequence[str] = tuple(GROUPS),
    gravity: Floats | None = None,
    masses_kg: Sequence[float] | None = None,
    only: Container[str] | None = None,
) -> Model:
    """Return the chain of poses with all its small numbers.

    Parameters
    ----------
    mm : (8,) lengths of the arm.
    base : place (3,) in mm and rotation (3, 3) of the root in the instrument's frame, about which is fitted.
    tools_mm : (t, 3) targets in the flange, about which is fitted.
    groups : keys of `GROUPS` that are fitted; base and tool always are.
    gravity : (3,) direction of gravity in the robot's root; down by default.
    masses_kg : of upper arm, forearm, and hand with tool; None: each link's weight is a number of its own.
    only : names of the arm's numbers that are fitted; None: all of the groups.
    """
    chain = nominal_chain(poses.q_rad, mm)
    _place(chain, base, tools_mm[poses.target])
    model = Model(chain, only)
    for letter in "xyz":
        model.add(f"base {letter}", "base", FREE, [(f"base {letter}", 1.0)], unit="mm")
    for letter in "xyz":
        model.add(f"base turn {letter}", "base", FREE, [(f"base turn {letter}", 1.0)], unit="deg")
    for target in range(len(tools_mm)):
        which = f" {target + 1}" if len(tools_mm) > 1 else ""
        is_own = (poses.target == target).astype(float)
        for letter in "xyz":
            model.add(f"tool{which} {letter}", "tool", FREE, [(f"tool {letter}", is_own)], unit="mm")
    for group, maker in _MAKERS.items():
        if group in groups:
            maker(model, poses)
    if "weight" in groups:
        upright = np.array([0.0, 0.0, -1.0])
        _add_weight(model, poses, base[1] @ (upright if gravity is None else gravity), masses_kg)
    return model


def _place(chain: MotionChain, base: tuple[Floats, Floats], tip_mm: Floats) -> None:
    """Put base and tool where they are about, so that their numbers are small."""
    place, rotation = base
    for axis, letter in enumerate("xyz"):
        chain.motions[f"base {letter}"].nominal = np.full(chain.rows, place[axis])
        chain.motions[f"tool {letter}"].nominal = tip_mm[:, axis]
    beta = np.arcsin(np.clip(-rotation[2, 0], -1.0, 1.0))
    turns = {
        "z": np.arctan2(rotation[1, 0], rotation[0, 0]),
        "y": beta,
        "x": np.arctan2(rotation[2, 1], rotation[2, 2]),
    }
    for letter, angle in turns.items():
        chain.motions[f"base turn {letter}"].nominal = np.full(chain.rows, angle)


def _add_zeros(model: Model, poses: ArmPoses) -> None:
    for joint in _JOINTS:
        model.add(f"A{joint} zero", "zeros", _ZERO_RAD, [(f"A{joint}", _SIGNS[joint - 1])], unit="deg")


def _add_lengths(model: Model, poses: ArmPoses) -> None:
    for name in ("a1", "a2", "b", "c1", "c2", "c3", "c4"):
        model.add(name, "lengths", _LENGTH_MM, [(name, -1.0 if name == "a2" else 1.0)], unit="mm")


def _add_axes(model: Model, poses: ArmPoses) -> None:
    for name in ("A2 tilt", "A3 tilt", "A3 twist", "A4 tilt", "A4 twist", "A5 tilt", "A6 tilt"):
        if name in model.chain.motions:
            model.add(name, "axes", _AXIS_RAD, [(name, 1.0)], unit="mrad")


def _add_wrist(model: Model, poses: ArmPoses) -> None:
    for name in ("A5 beside A4", "A5 across", "A6 beside A5"):
        model.add(name, "wrist", _WRIST_MM, [(name, 1.0)], unit="mm")


def _add_play(model: Model, poses: ArmPoses) -> None:
    for name, motion, driver in _driven(poses):
        slope = _SIGNS[int(motion[1]) - 1] * poses.approach[:, driver - 1]
        if slope.any():
            model.add(f"{name}half play", "play", _PLAY_RAD, [(motion, slope)], unit="deg")


def _add_gears(model: Model, poses: ArmPoses) -> None:
    for name, motion, driver in _driven(poses):
        q, sign = poses.own_rad[:, driver - 1], _SIGNS[int(motion[1]) - 1]
        for form, wave in (("cos", np.cos(q)), ("sin", np.sin(q))):
            terms: list[tuple[str, Floats | float]] = [(motion, sign * wave)]
            model.add(f"{name}eccentric {form}", "gears", _ECCENTRIC_RAD, terms, unit="deg")
    for driven, driver in ((3, 2), (5, 4), (6, 4), (6, 5)):
        slope = _SIGNS[driven - 1] * poses.q_rad[:, driver - 1]
        model.add(f"A{driven} with A{driver}", "gears", _COUPLING, [(f"A{driven}", slope)], unit="ppm")


def _driven(poses: ArmPoses) -> list[tuple[str, str, int]]:
    """Return what to call a gear's error, the motion that it changes, and the joint whose gear it is."""
    gears = [(f"A{joint} ", f"A{joint}", joint) for joint in _JOINTS]
    return [*gears, ("A3 by A2's ", "A3", 2)] if poses.a3_by_a2 else gears


def _add_drift(model: Model, poses: ArmPoses) -> None:
    if not np.ptp(poses.time):
        return
    courses = {"": poses.time, "²": 1.5 * poses.time**2 - 0.5, "³": 2.5 * poses.time**3 - 1.5 * poses.time}
    for letter in "xyz":
        for power, course in courses.items():
            model.add(f"drift {letter}{power}", "drift", _DRIFT_MM, [(f"base {letter}", course)], unit="mm")
    for letter in "xyz":
        model.add(
            f"drift turn {letter}", "drift", _DRIFT_RAD, [(f"base turn {letter}", poses.time)], unit="mrad"
        )


def _add_air(model: Model, poses: ArmPoses) -> None:
    """Add scale, and a beam that sinks with distance² from an instrument that stands anywhere."""
    middle = poses.measured_mm - poses.measured_mm.mean(axis=0)
    model.add("scale", "air", _SCALE, unit="ppm", extra=middle)
    up = model.chain.walk(np.zeros(len(model.numbers)))[2]["A1"][0]
    square = np.sum(poses.measured_mm**2, axis=1) / np.sum(poses.measured_mm**2, axis=1).max(initial=1e-9)
    reach = np.linalg.norm(poses.measured_mm, axis=1).max(initial=1.0)
    model.add("beam", "air", _BEND_PER_MM * reach**2, unit="mm", extra=square[:, None] * up)
    for axis, letter in enumerate("xyz"):
        model.add(f"beam along {letter}", "air", _SCALE, unit="ppm", extra=middle[:, [axis]] * up)


_MAKERS = {
    "zeros": _add_zeros,
    "lengths": _add_lengths,
    "axes": _add_axes,
    "wrist": _add_wrist,
    "play": _add_play,
    "gears": _add_gears,
    "drift": _add_drift,
    "air": _add_air,
}
_LUMPS = {"upper arm": ("A2", "A3", 0.5), "forearm": ("A3", "A5", 0.5), "wrist and tool": ("A5", "tip", 1.0)}
"""Where a link's weight is thought to be: this part of the way from one place to another."""
_BORNE = {
    "A1": ("upper arm", "forearm", "wrist and tool"),
    "A2": ("upper arm", "forearm", "wrist and tool"),
    "A3": ("forearm", "wrist and tool"),
    "A4": ("wrist and tool",),
    "A5": ("wrist and tool",),
}


def _add_weight(model: Model, poses: ArmPoses, down: Floats, masses_kg: Sequence[float] | None) -> None:
    """Add the joints' turns under gravity, along ``down`` (3,) in the instrument's frame.

    With masses each joint has its stiffness: a number is its turn under the largest torque of all poses.
    Without them each link's weight on each joint is a number: the turn with the link's lever at its longest.
    """
    tip, _, acts = model.chain.walk(np.zeros(len(model.numbers)))
    places = {**{name: place for name, (_, place) in acts.items()}, "tip": tip}
    for joint, borne in _BORNE.items():
        axis, place = acts[joint]
        slopes, longest = {}, 1.0
        for lump in borne:
            start, end, share = _LUMPS[lump]
            lever = places[start] + share * (places[end] - places[start]) - place
            slopes[lump] = np.sum(np.cross(axis, lever) * down, axis=1)
            longest = max(longest, float(np.linalg.norm(lever, axis=1).max(initial=0.0)))
        if masses_kg is not None:
            slopes = {
                "weight": sum(masses_kg[list(_LUMPS).index(lump)] * slope for lump, slope in slopes.items())
            }
        for lump, slope in slopes.items():
            most = float(np.abs(slope).max(initial=0.0))
            if most > 1e-6 * longest:
                size = most if masses_kg is not None else longest
                model.add(f"{joint} under {lump}", "weight", _SAG_RAD, [(joint, slope / size)], unit="mrad")
