"""What gives way beside the arm's own springs, and an axis that does not stand as the drawing says."""

import numpy as np
from scipy.spatial.transform import Rotation

from tests.plant import arm as arms
from tests.plant import masses, memory
from tests.plant.effects.depends import Depends
from tests.plant.effects.depends import tip as tip_
from tests.plant.effects.registry import LIBRARY, Draw, acting, declare, numbers, other_form
from tests.plant.robot import SLOW, Run, fast, to_root
from tests.plant.scene import JOINTS

BY_FORCE = tip_("smooth", "force")
SHANK_mm = 16.0
CARBIDE_N_mm2 = 600e3
CORE = 0.7  # share of the full section's moment of area that flutes leave
ROOT_mm = np.zeros(3)  # the robot's own foot
FOOT_mm = np.array([0.0, 0.0, -600.0])  # of a pedestal under it
SEATS = ("A3", "A3", "A2", "A4", "A5", "A6")


def free_length_mm(mm_per_kN: float) -> float:
    """Length of a clamped shank that bends so much at its end: L³ / (3·E·I) is the compliance."""
    area = CORE * np.pi * SHANK_mm**4 / 64.0
    return float(np.cbrt(mm_per_kN / 1000.0 * 3.0 * CARBIDE_N_mm2 * area))


def _across(run: Run) -> np.ndarray:
    """Force along `$BASE` at the slow samples, without its part along the tool's axis."""
    along = run.force_N @ run.world.base.axes
    axis = run.tip_axes[::SLOW, :, 2]
    return along - np.sum(along * axis, axis=1, keepdims=True) * axis


@declare(LIBRARY, "compliance", 0.01, 10.0, signal="tcp", needs=("cut",), all_runs=True, depends=BY_FORCE)
def cutter_bending(draw: Draw):
    """`size` in mm per kN across the axis: a clamped carbide shank of some free length."""

    def at(size):
        give = size / 1000.0

        def tip(run: Run):
            run.tip_mm = run.tip_mm + fast(run, give * _across(run))

        return numbers(mm_per_kN=size, length_mm=free_length_mm(size)), {"tip": tip}

    return None, at


@other_form("cutter_bending")
def cutter_in_a_loose_holder(draw: Draw):
    """Beside the shank a collet gives: soft until it seats, at some 50 to 150 N."""
    seat_N = draw.uniform(50.0, 150.0)

    def at(size):
        give = size / 1000.0

        def tip(run: Run):
            across = _across(run)
            pressed = np.linalg.norm(across, axis=1, keepdims=True)
            seated = seat_N * np.tanh(pressed / seat_N) / np.maximum(pressed, 1e-9)
            run.tip_mm = run.tip_mm + fast(run, give * across * (0.7 + 0.8 * seated))

        return numbers(mm_per_kN=size, length_mm=free_length_mm(size), seat_N=seat_N), {"tip": tip}

    return None, at


YIELDS = Depends("part", ("force", "force_by_place"), "smooth", ("part",))


def _yields(run: Run, slow_mm: np.ndarray) -> None:
    """The part stands aside by so much where it is cut, and is back when it is scanned; the tip stays."""
    run.part_mm = run.part_mm + slow_mm


@declare(
    LIBRARY, "compliance", 0.01, 10.0, signal="scan", needs=("cut", "scan"), all_runs=True, depends=YIELDS
)
def fixture_compliance(draw: Draw):
    """The fixture gives way under the force on the part, which is the reaction of that on the tool."""
    soft = draw.rng.uniform([0.3, 0.3, 0.05], [1.0, 1.0, 0.4])

    def tip(run: Run, size: float):
        _yields(run, -size / 1000.0 * soft * (run.force_N @ run.world.base.axes))

    return None, acting(tip, mm_per_kN=lambda size: size * soft)


@other_form(
    "fixture_compliance", Depends("part", ("force_memory", "force", "force_by_place"), "loop", ("part",))
)
def fixture_that_rubs(draw: Draw):
    """Half of the way is held by friction under the clamps: a loop over the force."""
    soft, grip_N = draw.rng.uniform([0.3, 0.3, 0.05], [1.0, 1.0, 0.4]), draw.uniform(40.0, 120.0)

    def tip(run: Run, size: float):
        along = -run.force_N @ run.world.base.axes
        grip = np.full(len(along), grip_N)
        held = np.stack([memory.play(along[:, k].copy(), grip, 0.0) for k in range(3)], axis=1)
        held -= held[0]
        _yields(run, size / 1000.0 * soft * (0.5 * along + 0.5 * held))

    return None, acting(tip, mm_per_kN=lambda size: size * soft, grip_N=grip_N)


def _tilted(run: Run, moment_Nmm: np.ndarray, rad_per_Nmm, foot_mm: np.ndarray) -> np.ndarray:
    """Way of the tip, in `$BASE`, when what is under the robot tilts about a foot under a moment."""
    place = to_root(run.world, run.tip_mm)[::SLOW]
    return np.cross(rad_per_Nmm * moment_Nmm, place - foot_mm) @ run.world.base.axes


def _cut_about(run: Run, foot_mm: np.ndarray) -> np.ndarray:
    """Moment of the cut about a foot, N·mm."""
    place = to_root(run.world, run.tip_mm)[::SLOW]
    return np.cross(place - foot_mm, run.force_N) + run.moment_Nmm


TILTS = tip_("smooth", "force_by_place", "force", "acceleration", "place", "constant")


@declare(LIBRARY, "compliance", 1e-3, 5.0, signal="tcp", needs=("cut",), all_runs=True, depends=TILTS)
def pedestal_compliance(draw: Draw):
    """The robot tilts about its foot, `size` in mrad per kN·m: of the cut, of weight and of inertia."""

    def at(size):
        def tip(run: Run):
            moment = _cut_about(run, ROOT_mm) + masses.moment_about(run, ROOT_mm)
            run.tip_mm = run.tip_mm + fast(run, _tilted(run, moment, size / 1e9, ROOT_mm))

        both = numbers(x_mrad_per_kNm=size, y_mrad_per_kNm=size)
        return both | numbers(foot_mm=0.0, own_weight=1.0), {"tip": tip}

    return None, at


@other_form("pedestal_compliance", tip_("smooth", "force", "force_by_place"))
def pedestal_that_also_shifts(draw: Draw):
    """A frame 600 mm high: softer about one axis than the other; it also shears; the cut alone counts."""
    even, shears = draw.uniform(0.6, 1.0), draw.uniform(0.1, 0.5)

    def at(size):
        soft = size / 1e9 * np.array([1.0, even, 0.0])

        def tip(run: Run):
            give = size * shears / 1000.0 * np.array([1.0, 1.0, 0.0])  # mm per N; a moment of 1 m lever is 1
            shift = (give * run.force_N) @ run.world.base.axes
            tilt = _tilted(run, _cut_about(run, FOOT_mm), soft, FOOT_mm)
            run.tip_mm = run.tip_mm + fast(run, tilt + shift)

        both = numbers(x_mrad_per_kNm=size, y_mrad_per_kNm=size * even)
        return both | numbers(foot_mm=600.0, own_weight=0.0, mm_per_kN=size * shears), {"tip": tip}

    return None, at


BY_ANGLE = tip_("smooth", "own_angle", "place", "constant")


@declare(LIBRARY, "geometry", 0.01, 5.0, signal="tcp", all_runs=True, depends=BY_ANGLE)
def axis_parallelism(draw: Draw):
    """An axis stands askew in its seat by `size` mrad: it and all that it carries is turned.

    Turned about (axis before) x (axis); A3 is parallel to A2, so about (upper arm) x (axis), up where the arm
    lies forward: the angle beta of Hayati and Mirmirani 1985 but for its sign.
    """
    name, sign = draw.target(SEATS), draw.sign()

    def world(run: Run, size: float):
        run.reshape.append(lambda arm: _askew(arm, name, sign * size / 1000.0))

    return name, acting(world, mrad=lambda size: sign * size)


def _askew(arm: arms.Arm, name: str, angle_rad: float, twist_rad: float = 0.0) -> arms.Arm:
    """The arm with an axis turned in its seat, and twisted about a line at right angles to that."""
    j = JOINTS.index(name)
    axis = arm.screws[j]
    before = arms.X if j == arms.ELBOW else arm.screws[j - 1]
    line = np.cross(before, axis)
    vector = angle_rad * line + twist_rad * np.cross(axis, line)
    return arms.crooked(arm, j, Rotation.from_rotvec(vector).as_matrix())


@other_form("axis_parallelism")
def axis_skew(draw: Draw):
    """Askew in both directions."""
    name, sign, twist = draw.target(SEATS), draw.sign(), draw.uniform(0.4, 1.0) * draw.sign()

    def world(run: Run, size: float):
        both = (sign * size / 1000.0, twist * size / 1000.0)
        run.reshape.append(lambda arm: _askew(arm, name, *both))

    return name, acting(world, mrad=lambda size: sign * size, twist_mrad=lambda size: twist * size)
