"""How effects are declared and drawn."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from tests.plant.effects.depends import LIBRARY_DEPENDS, Depends
from tests.plant.robot import Hooks
from tests.plant.scene import JOINTS

ALL = "all"
"""Target of what errs alike in all six joints."""
At = Callable[[float], tuple[dict, Hooks]]  # size -> parameters, hooks


@dataclass(frozen=True)
class Kind:
    """One effect: its sizes, what it needs, and how to build its forms."""

    name: str
    family: str
    sizes: tuple[float, float]
    signal: str  # where its size is judged: a name of truth.signals, scan, or any
    needs: frozenset
    same: Callable
    hours: bool = False  # shows only between runs that are hours apart
    all_runs: bool = False  # sized on all runs, and twice: begins late, or is not linear in its size
    depends: Depends | Callable[[str | None], Depends] | None = None  # or by the target
    moments: bool = False  # shows in moments, which the label lists
    others: list = field(default_factory=list)
    others_depend: dict = field(default_factory=dict)

    def depends_of(self, form: str, target: str | None) -> Depends:
        """On what a form depends: as the kind unless it says otherwise."""
        own = self.others_depend.get(form) or self.depends or LIBRARY_DEPENDS.get(self.name)
        if own is None:
            raise ValueError(f"{self.name} does not say on what it depends")
        return own if isinstance(own, Depends) else own(target)


LIBRARY: dict[str, Kind] = {}
UNKNOWN: dict[str, Kind] = {}
SLIPS: dict[str, Kind] = {}


def declare(
    shelf: dict,
    family: str,
    low: float,
    high: float,
    *,
    signal="any",
    needs=(),
    hours=False,
    all_runs=False,
    depends: Depends | Callable[[str | None], Depends] | None = None,
    moments=False,
):
    """Put a builder on a shelf under its own name; sizes from `low` to `high` are plausible."""

    def keep(build):
        name = build.__name__
        shelf[name] = Kind(
            name, family, (low, high), signal, frozenset(needs), build, hours, all_runs, depends, moments
        )
        return build

    return keep


def other_form(name: str, depends: Depends | None = None):
    """Another form of the same physics; a name's forms are tried with equal chance."""

    def keep(build):
        LIBRARY[name].others.append(build)
        if depends is not None:
            LIBRARY[name].others_depend[build.__name__] = depends
        return build

    return keep


class Draw:
    """Random choices of one effect; `wanted` is a target that the caller requires."""

    def __init__(self, seed: int, wanted: str | None = None):
        self.rng = np.random.default_rng(seed)
        self.wanted = wanted

    def target(self, names) -> str:
        """One of the names, or the wanted one."""
        picked = str(self.rng.choice(list(names)))
        if self.wanted is not None and self.wanted not in names:
            raise ValueError(f"{self.wanted} is not a target; allowed: {', '.join(names)}")
        return self.wanted or picked

    def joint(self) -> tuple[str, int]:
        """Name and index of a joint."""
        name = self.target(JOINTS)
        return name, JOINTS.index(name)

    def axes(self) -> tuple[str, list[int]]:
        """Name and indices of a joint; of all six where "all" is wanted, which is never drawn."""
        if self.wanted == ALL:
            return ALL, list(range(6))
        name, j = self.joint()
        return name, [j]

    def uniform(self, low: float, high: float) -> float:
        """Between low and high."""
        return float(self.rng.uniform(low, high))

    def log_uniform(self, low: float, high: float) -> float:
        """Between low and high, every factor of two alike."""
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def sign(self) -> float:
        """-1 or 1."""
        return float(self.rng.choice([-1.0, 1.0]))

    def pick(self, values):
        """One of the values."""
        return values[int(self.rng.integers(len(values)))]

    def direction(self) -> np.ndarray:
        """A unit vector, all alike."""
        v = self.rng.normal(size=3)
        return v / np.linalg.norm(v)


def numbers(**values) -> dict:
    """Parameters as plain Python numbers and lists."""
    return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in values.items()}


SIZE = object()
"""In `acting`: the parameter that is the size itself."""


def acting(do: Callable[..., None], **values) -> At:
    """Return how an effect acts that is one hook, `do(run, size)`, which has the name of its stage.

    Of its parameters `SIZE` is the size, and a function is taken of the size.
    """

    def at(size: float) -> tuple[dict, Hooks]:
        known = {k: size if v is SIZE else v(size) if callable(v) else v for k, v in values.items()}
        return numbers(**known), {do.__name__: lambda run: do(run, size)}

    return at
