"""Something lets go in the middle of a run and stays where it is, in that run and in all later ones.

A tool that slips in its holder or a fixture that slips under the clamp moves the tip; a belt that jumps
over moves the load side of one joint against its motor. Either takes 20 to 60 ms.
"""

import numpy as np

from tests.plant.effects.depends import Depends
from tests.plant.effects.depends import joint as joint_
from tests.plant.effects.depends import tip as tip_
from tests.plant.effects.registry import LIBRARY, Draw, declare, numbers, other_form
from tests.plant.robot import Run
from tests.plant.scene import DEGREE, JOINTS

LEVER_mm = np.array([1800.0, 1800.0, 1300.0, 300.0, 300.0, 260.0])  # rough, so that sizes are alike in mm
TARGETS = ("tip", "tip", "tip", *JOINTS)


def ramp(t_s: np.ndarray, at_s: float, takes_s: float) -> np.ndarray:
    """0 before, 1 after, half a cosine in between."""
    u = np.clip((t_s - at_s) / takes_s, 0.0, 1.0)
    return 0.5 - 0.5 * np.cos(np.pi * u)


def gone(run: Run, number: int, course) -> np.ndarray:
    """Share of the way at the fast samples: none in earlier runs, all of it in later ones."""
    if run.number != number:
        return np.full(len(run.t_s), float(run.number > number))
    return course(run.t_s)


def _stepping(draw: Draw, course_of):
    """A step with a course in time: `course_of(draw)` gives more parameters and course(t, at, takes)."""
    target = draw.target(TARGETS)
    number, at_s = int(draw.rng.integers(2)), draw.uniform(3.0, 9.0)
    takes_s, way, sign = draw.uniform(0.02, 0.06), draw.direction(), draw.sign()
    more, course = course_of(draw)
    j = JOINTS.index(target) if target in JOINTS else None

    def at(size):
        values = numbers(run=f"run-{number + 1}", at_s=at_s, takes_s=takes_s, **more)

        def share(run: Run) -> np.ndarray:
            return gone(run, number, lambda t: course(t, at_s, takes_s))

        def gear(run: Run) -> None:
            run.q_load[:, j] += sign * size / LEVER_mm[j] * share(run)

        def tip(run: Run) -> None:
            run.tip_mm = run.tip_mm + size * share(run)[:, None] * way

        if j is None:
            return values | numbers(size=size, unit="mm", direction=way), {"tip": tip}
        turned = size / LEVER_mm[j] / DEGREE
        return values | numbers(size=turned, unit="deg", direction=sign), {"gear": gear}

    return target, at


def _place(target: str | None) -> Depends:
    """A step's place is its target's."""
    return joint_("step", "time_step") if target in JOINTS else tip_("step", "time_step")


@declare(LIBRARY, "set-up", 0.004, 3.0, signal="tcp", all_runs=True, depends=_place)
def step(draw: Draw):
    return _stepping(draw, lambda draw: ({}, ramp))


@other_form("step")
def step_that_settles(draw: Draw):
    """Most of the way at once, the rest creeps: a clamp that seats itself."""

    def course_of(draw: Draw):
        share, tail_s = draw.uniform(0.2, 0.5), draw.log_uniform(0.4, 3.0)

        def course(t_s, at_s, takes_s):
            late = np.maximum(t_s - at_s, 0.0)
            return ramp(t_s, at_s, takes_s) * (1.0 - share * np.exp(-late / tail_s))

        return {"tail_share": share, "tail_s": tail_s}, course

    return _stepping(draw, course_of)


@other_form("step")
def step_in_two(draw: Draw):
    """It slips, catches, and slips again."""

    def course_of(draw: Draw):
        share, later_s = draw.uniform(0.3, 0.6), draw.uniform(0.8, 3.0)

        def course(t_s, at_s, takes_s):
            again = ramp(t_s, at_s + later_s, takes_s)
            return (1.0 - share) * ramp(t_s, at_s, takes_s) + share * again

        return {"second_share": share, "second_s": later_s}, course

    return _stepping(draw, course_of)
