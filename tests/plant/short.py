"""A short program for tests: one effect acting for a few seconds."""

from tests.plant.effects import LIBRARY, UNKNOWN, Draw
from tests.plant.robot import Run, simulate
from tests.plant.scene import World
from tests.plant.waypoints import PROGRAMS, Waypoints

WORLD = World()


def two_rows() -> Waypoints:
    """The start of a program: dive, a row along y, a step, the row back."""
    way = PROGRAMS["zigzag"]().waypoints()
    cdis = way.cdis_mm[:7].copy()
    cdis[-1] = 0.0
    return Waypoints(way.position_mm[:7], way.speed_mm_s[:7], cdis, way.hold_s[:7], way.cutting[:7])


def driven(hooks: dict, number: int = 0, program: str | None = None) -> Run:
    way = two_rows() if program is None else PROGRAMS[program]().waypoints()
    return simulate(way, WORLD, [hooks], age_s=3600.0, number=number)


def form(build, size: float, seed: int = 1, target: str | None = None) -> tuple[dict, dict]:
    """Parameters and hooks of a builder at a size."""
    return build(Draw(seed, target))[1](size)


def only(name: str, size: float, target: str | None = None, number: int = 0) -> tuple[dict, Run]:
    """Parameters of one effect in its own form, and the run in which it acts alone."""
    shelf = UNKNOWN if name.startswith("open:") else LIBRARY
    values, hooks = form(shelf[name.removeprefix("open:")].same, size, 1, target)
    return values, driven(hooks, number)
