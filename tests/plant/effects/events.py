"""What happens at a moment: the tool hits something, a bolt slips under load."""

import numpy as np

from tests.plant import memory
from tests.plant.effects.depends import force as force_
from tests.plant.effects.depends import tip as tip_
from tests.plant.effects.registry import LIBRARY, SIZE, Draw, acting, declare, numbers, other_form
from tests.plant.effects.steps import gone, ramp
from tests.plant.robot import Run, fast
from tests.plant.scene import DEGREE, JOINTS

HIT = force_("step", "time_step", "time_smooth", links=("force", "mechanics", "gear"))
SLIP_deg_per_kN = 0.0225
"""What a clutch or a tooth gives under 1 kN at the tip."""
HIT_JOINTS = ("A2", "A1", "A3")


def _hitting(draw: Draw, share_of_slip: float):
    """A half sine of force at a moment, and what a joint gives from then on."""
    target = draw.target(HIT_JOINTS)
    j, number, at_s = JOINTS.index(target), int(draw.rng.integers(2)), draw.uniform(3.0, 12.0)
    lasts_s, way, sign = draw.uniform(0.010, 0.030), draw.direction(), draw.sign()

    def at(size):
        slip = sign * share_of_slip * SLIP_deg_per_kN * size / 1000.0

        def load(run: Run) -> None:
            if run.number == number:
                since = np.clip((run.slow_s - at_s) / lasts_s, 0.0, 1.0)
                run.force_N = run.force_N + size * np.sin(np.pi * since)[:, None] * way

        def gear(run: Run) -> None:
            course = gone(run, number, lambda t: ramp(t, at_s, lasts_s))
            run.q_load[:, j] += slip * DEGREE * course

        values = numbers(N=size, lasts_s=lasts_s, direction=way, slip_deg=slip, slips=target)
        values |= numbers(run=f"run-{number + 1}", at_s=at_s, size=slip, unit="deg")
        moments = [{"run": f"run-{number + 1}", "t_s": at_s + 0.5 * lasts_s, "lasts_s": lasts_s}]
        return values | {"moments": moments}, {"load": load, "gear": gear}

    return target, at


@declare(LIBRARY, "force", 10.0, 3000.0, signal="force", all_runs=True, depends=HIT)
def collision(draw: Draw):
    """The tool hits something: `size` newtons for 10 to 30 ms, and a joint has slipped from then on."""
    return _hitting(draw, 1.0)


@other_form("collision")
def collision_without_a_slip(draw: Draw):
    """Nothing gives: the force alone."""
    return _hitting(draw, 0.0)


LOOSE = tip_("step", "force", "force_memory", "time_step", "own_torque_memory")


def _slips(run: Run, hold_N: float) -> np.ndarray:
    """Slips so far, at the fast samples: one each time that the load comes above what the bolt holds."""
    press = np.linalg.norm(run.force_N, axis=1)
    return np.floor(fast(run, memory.ratchet(press, hold_N)[:, None])[:, 0] + 1e-9)


def _ratcheting(draw: Draw, way_of):
    """The tip after so many slips; `way_of(count)` in units of the first."""
    target, hold_N, way = draw.target(("tip",)), draw.uniform(90.0, 210.0), draw.direction()

    def tip(run: Run, size: float) -> None:
        run.tip_mm = run.tip_mm + size * way_of(_slips(run, hold_N))[:, None] * way

    return target, acting(tip, mm=SIZE, hold_N=hold_N, direction=way)


@declare(
    LIBRARY, "set-up", 1e-5, 1.0, signal="tcp", needs=("cut",), all_runs=True, depends=LOOSE, moments=True
)
def bolt_ratchet(draw: Draw):
    """A loose bolt gives `size` mm each time that the force exceeds a level; each run starts tightened."""
    return _ratcheting(draw, lambda count: count)


@other_form("bolt_ratchet")
def bolt_ratchet_that_seats(draw: Draw):
    """Each slip is a fifth shorter than the one before: the joint beds in."""
    return _ratcheting(draw, lambda count: (1.0 - 0.8**count) / 0.2)
