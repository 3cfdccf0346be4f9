"""What gives way beside the arm's own springs, and an axis that does not stand as the drawing says."""

import numpy as np
from scipy.spatial.transform import Rotation

from tests.plant import arm as arms
from tests.plant import memory
from tests.plant.effects.depends import tip as tip_
from tests.plant.effects.registry import LIBRARY, Draw, declare, numbers, other_form
from tests.plant.robot import SLOW, Run, fast, to_root
from tests.plant.scene import DEGREE

BY_FORCE = tip_("smooth", "force")
SHANK_mm = 16.0
CARBIDE_N_mm2 = 600e3
CORE = 0.7  # share of the full section's moment of area that flutes leave
FOOT_mm = np.array([0.0, 0.0, -600.0])  # of the pedestal, in the robot's root


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


@declare(LIBRARY, "compliance", 0.01, 10.0, signal="tcp", needs=("cut",), all_runs=True, depends=BY_FORCE)
def fixture_compliance(draw: Draw):
    """The fixture, with the tracker's reference on it, gives way under the reaction of the cut."""
    soft = draw.rng.uniform([0.3, 0.3, 0.05], [1.0, 1.0, 0.4])

    def at(size):
        def tip(run: Run):
            along = run.force_N @ run.world.base.axes
            run.tip_mm = run.tip_mm + fast(run, size / 1000.0 * soft * along)

        return numbers(mm_per_kN=size * soft), {"tip": tip}

    return None, at


@other_form("fixture_compliance", tip_("loop", "force_memory", "force"))
def fixture_that_rubs(draw: Draw):
    """Half of the way is held by friction under the clamps: a loop over the force."""
    soft, grip_N = draw.rng.uniform([0.3, 0.3, 0.05], [1.0, 1.0, 0.4]), draw.uniform(40.0, 120.0)

    def at(size):
        def tip(run: Run):
            along = run.force_N @ run.world.base.axes
            grip = np.full(len(along), grip_N)
            held = np.stack([memory.play(along[:, k].copy(), grip, 0.0) for k in range(3)], axis=1)
            held -= held[0]
            run.tip_mm = run.tip_mm + fast(run, size / 1000.0 * soft * (0.5 * along + 0.5 * held))

        return numbers(mm_per_kN=size * soft, grip_N=grip_N), {"tip": tip}

    return None, at


def _tilted(run: Run, moment_Nmm: np.ndarray, rad_per_Nmm: np.ndarray) -> np.ndarray:
    """Way of the tip, in `$BASE`, when the pedestal tilts about its foot under a moment."""
    place = to_root(run.world, run.tip_mm)[::SLOW]
    return np.cross(rad_per_Nmm * moment_Nmm, place - FOOT_mm) @ run.world.base.axes


def _about_foot(run: Run) -> np.ndarray:
    """Moment of the cut about the pedestal's foot, N·mm."""
    place = to_root(run.world, run.tip_mm)[::SLOW]
    return np.cross(place - FOOT_mm, run.force_N) + run.moment_Nmm


@declare(LIBRARY, "compliance", 1e-4, 0.3, signal="tcp", needs=("cut",), all_runs=True, depends=BY_FORCE)
def pedestal_compliance(draw: Draw):
    """`size` in deg per kN·m about x and y at the foot, 600 mm under the robot; stiff about z."""
    even = draw.uniform(0.6, 1.0)

    def at(size):
        soft = size * DEGREE / 1e6 * np.array([1.0, even, 0.0])

        def tip(run: Run):
            run.tip_mm = run.tip_mm + fast(run, _tilted(run, _about_foot(run), soft))

        return numbers(deg_per_kNm=[size, size * even, 0.0], foot_mm=FOOT_mm), {"tip": tip}

    return None, at


@other_form("pedestal_compliance", tip_("smooth", "force", "place"))
def pedestal_under_the_arm(draw: Draw):
    """It also gives way under the arm's own weight as the arm reaches out and turns."""
    even, arm_N = draw.uniform(0.6, 1.0), draw.uniform(3000.0, 8000.0)

    def at(size):
        soft = size * DEGREE / 1e6 * np.array([1.0, even, 0.0])

        def tip(run: Run):
            middle = 0.5 * to_root(run.world, run.tip_mm)[::SLOW]  # of the arm's mass, on half of the way
            weight = np.cross(middle, np.array([0.0, 0.0, -arm_N]))
            weight -= np.cross(0.5 * run.world.base.origin_mm, np.array([0.0, 0.0, -arm_N]))
            run.tip_mm = run.tip_mm + fast(run, _tilted(run, _about_foot(run) + weight, soft))

        return numbers(deg_per_kNm=[size, size * even, 0.0], arm_N=arm_N), {"tip": tip}

    return None, at


BY_ANGLE = tip_("smooth", "own_angle", "place", "constant")


@declare(LIBRARY, "geometry", 5e-4, 0.3, signal="tcp", all_runs=True, depends=BY_ANGLE)
def axis_parallelism(draw: Draw):
    """A3 is not parallel to A2: all behind it is turned about the link's y (Hayati and Mirmirani 1985)."""
    sign = draw.sign()

    def at(size):
        turn = Rotation.from_rotvec(-sign * size * DEGREE * arms.Z).as_matrix()

        def world(run: Run):
            run.reshape.append(lambda arm: arms.crooked(arm, arms.ELBOW, turn))

        return numbers(b_deg=sign * size), {"world": world}

    return None, at


@other_form("axis_parallelism")
def axis_skew(draw: Draw):
    """Tilted about the link's y and twisted about its x."""
    sign, twist = draw.sign(), draw.uniform(0.4, 1.0) * draw.sign()

    def at(size):
        vector = size * DEGREE * np.array([twist, 0.0, -sign])
        turn = Rotation.from_rotvec(vector).as_matrix()

        def world(run: Run):
            run.reshape.append(lambda arm: arms.crooked(arm, arms.ELBOW, turn))

        return numbers(b_deg=sign * size, a_deg=twist * size), {"world": world}

    return None, at
