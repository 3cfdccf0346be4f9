"""Signatures: what each effect of the library, and each mismatch, does to the measured links at its start.

A builder of an effect asks a `Draw` for its numbers. `Script` answers with given numbers in place of chance,
so that every effect becomes a function of its size, its directions and shares of its ranges, without a second
description of it. Signatures are finite differences of that function. Directions count as vectors, so that
three columns make all of them; shares of ranges start at a grid, or in the middle with a column for a small
step.
"""

import hashlib
import os
import pickle
from dataclasses import dataclass, field
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np

from tests.plant.effects.registry import ALL, LIBRARY, Draw, Kind
from tests.plant.mismatch import BOUNDS, CLOCKS
from tests.plant.robot import Hooks, ripple, slack
from tests.plant.scenes import Scene, Signals

STEP = 0.02  # of a share, for the column of a small step
MANY = 4  # values of a choice that are all tried; of more the first is taken
GRIDS: dict[str, dict[int, tuple[float, ...]]] = {  # effect -> number of the question -> shares to start at
    "friction": {0: (0.2, 0.7)},
    "thermal": {0: (0.2, 0.8)},
    "spindle_growth": {0: (0.1, 0.4, 0.9)},
    "vibration": {1: (0.08, 0.25, 0.42, 0.58, 0.75, 0.92)},
    "nonlinear_stiffness": {0: (0.2, 0.8)},
    "belt_wind_up": {0: (0.1, 0.5, 0.9)},
    "current_limit": {0: (0.5,)},
}
FACTORS = {  # sizes to start at, in units of the middle one, of effects that are not linear in their size
    "clock": (0.5, 2.5),
    "servo_lag": (0.4, 2.5),
    "force_delay": (0.3, 3.0),
    "corner": (0.4, 3.0),
    "velocity_rule": (0.5, 2.0),
    "backlash": (0.4, 2.5),
    "stock_offset": (0.4, 2.0),
    "dead_time": (0.4, 2.5),
    "tracker_filter": (0.3, 1.0),
    "force_hysteresis": (0.3, 3.0),
    "force_steps": (0.5, 3.0),
    "current_limit": (10.0, 25.0, 60.0),
    "spindle_droop": (1.0, 10.0),
}
SQUARED = ("vibration",)  # a direction counts twice: drive and answer lie along it
EVENTS = {"step": "step", "collision": "impulse", "bolt_ratchet": "step"}
"""Begin at a moment of a run, which is looked for in what mismatch leaves of a case: started case by case."""
TONES = ("floor_vibration",)  # its first share is a frequency, looked for as well
MOST_SHARE = 0.5
UNSEEN = ("scan",)  # signals that no column has


class Script(Draw):
    """Answers of a builder's questions, given in the order in which they are asked.

    `asked` notes each: ("share",), ("sign",), ("pick", count) or ("direction",). Answers: a share in 0 ... 1,
    a sign, a number of a choice, a vector. A question without an answer gets 0.5, 1, 0 or x.
    """

    def __init__(self, given: dict[int, object] | None = None, wanted: str | None = None):
        self.given, self.wanted, self.asked, self.names = given or {}, wanted, [], ()
        self.all_too = False
        self.ranges: dict[int, tuple[float, float]] = {}  # of each share
        self.rng = _Scripted(self)

    def answer(self, kind: tuple, default):
        """The given answer of the next question."""
        self.asked.append(kind)
        return self.given.get(len(self.asked) - 1, default)

    def target(self, names) -> str:
        """The wanted one, or the first."""
        self.names = tuple(dict.fromkeys(names))
        return self.wanted or self.names[0]

    def axes(self) -> tuple[str, list[int]]:
        """As asked for; notes that all joints at once are a target too."""
        self.all_too = True
        return super().axes()

    def uniform(self, low: float, high: float) -> float:
        """A share of the range."""
        self.ranges[len(self.asked)] = (low, high)
        return float(low + (high - low) * self.answer(("share",), 0.5))

    def log_uniform(self, low: float, high: float) -> float:
        """A share of the range of the logarithm."""
        return float(np.exp(self.uniform(np.log(low), np.log(high))))

    def sign(self) -> float:
        """-1 or 1."""
        return float(self.answer(("sign",), 1.0))

    def pick(self, values):
        """One of the values; where they are -1 and 1, a sign."""
        if set(values) == {-1.0, 1.0}:
            return self.sign()
        return values[int(self.answer(("pick", len(values)), 0))]

    def direction(self) -> np.ndarray:
        """A vector of any length, so that it can be one axis or nothing."""
        return np.array(self.answer(("direction",), (1.0, 0.0, 0.0)), float)


class _Scripted:
    """The part of numpy's generator that builders use."""

    def __init__(self, script: Script):
        self.script = script

    def uniform(self, low=0.0, high=1.0, size=None):
        low, high = np.asarray(low, float), np.asarray(high, float)
        shape = np.broadcast_shapes(low.shape, high.shape) if size is None else size
        if shape == ():
            return self.script.uniform(float(low), float(high))
        shares = np.array([self.script.answer(("share",), 0.5) for _ in range(int(np.prod(shape)))])
        return low + (high - low) * shares.reshape(shape)

    def integers(self, low, high=None):
        first, count = (0, low) if high is None else (low, high - low)
        return first + (int(self.script.answer(("pick", count), 0)) if count <= MANY else 0)

    def permutation(self, n):
        return np.arange(n)


@dataclass(frozen=True)
class Start:
    """Where an effect starts: its target, the answers of its choices and its grid, and its size."""

    name: str
    target: str | None
    given: tuple[tuple[int, object], ...]
    size: float
    asked: tuple[tuple, ...]
    first_range: tuple[float, float] = (0.0, 1.0)
    """Of the first share: a moment in s, a frequency in Hz."""

    @property
    def label(self) -> str:
        """Effect and target, as in `name@target`."""
        return self.name if self.target is None else f"{self.name}@{self.target}"

    @property
    def signed(self) -> bool:
        """Whether the other sign is as plausible."""
        return ("sign",) in self.asked

    @property
    def directions(self) -> list[int]:
        """Questions that are directions."""
        return [i for i, kind in enumerate(self.asked) if kind == ("direction",)]

    @property
    def shares(self) -> list[int]:
        """Questions that are shares of a range."""
        return [i for i, kind in enumerate(self.asked) if kind == ("share",)]

    def hooks(self, size: float, given: dict[int, object]) -> Hooks:
        """The effect at a size and answers beside those of the start."""
        _, at = LIBRARY[self.name].same(Script({**dict(self.given), **given}, self.target))
        return at(size)[1]


@dataclass(frozen=True)
class Column:
    """One column: a unit is the start's size; `given` is what is answered, `less` what is taken off."""

    start: Start
    given: tuple[tuple[int, object], ...]
    less: tuple[tuple[int, object], ...] | None
    lower: float
    upper: float

    def change(self, scene: Scene, age_s: float, number: int) -> Signals:
        """The column's signals on a scene."""
        size = self.start.size
        out = scene.change(self.start.hooks(size, dict(self.given)), age_s, number)
        if self.less is None:
            return out
        back = scene.change(self.start.hooks(size, dict(self.less)), age_s, number)
        return {name: (out[name] - back[name]) / (2.0 * STEP) for name in out}


def middle(kind: Kind) -> float:
    """A plausible size in the middle of the range."""
    low, high = kind.sizes
    return float(np.sqrt(max(low, 1e-3 * high) * high))


@cache
def starts(name: str) -> tuple[Start, ...]:
    """All starts of an effect of the library: targets, choices, grids, sizes."""
    kind = LIBRARY[name]
    if kind.signal in UNSEEN and kind.name != "tool_diameter":
        return ()
    first = Script()
    kind.same(first)
    out = []
    for target in (*(first.names or (None,)), *((ALL,) if first.all_too else ())):
        script = Script({}, target)
        kind.same(script)
        kinds = list(script.asked)
        free = {i: tuple(range(k[1])) for i, k in enumerate(kinds) if k[0] == "pick" and k[1] <= MANY}
        shares = [i for i, k in enumerate(kinds) if k == ("share",)]
        free |= {shares[n]: grid for n, grid in GRIDS.get(name, {}).items() if n < len(shares)}
        for chosen in product(*free.values()):
            for factor in FACTORS.get(name, (1.0,)):
                size = min(middle(kind) * factor, kind.sizes[1])
                given = tuple(zip(free, chosen, strict=True))
                first = script.ranges.get(shares[0], (0.0, 1.0)) if shares else (0.0, 1.0)
                out.append(Start(name, target, given, size, tuple(kinds), first))
    return tuple(out)


E = np.eye(3)


def columns(start: Start) -> list[Column]:
    """The columns of a start, with bounds in units of its size."""
    most = LIBRARY[start.name].sizes[1] / start.size
    least = -most if start.signed or start.directions else 0.0
    none = dict.fromkeys(start.directions, (0.0, 0.0, 0.0))
    out = []
    if start.name in SQUARED:  # xx, yy, zz and the mixed ones
        ways = [*E, *((E[i] + E[j]) / np.sqrt(2.0) for i, j in ((0, 1), (0, 2), (1, 2)))]
        for way in ways:
            given = {i: tuple(way) for i in start.directions}
            out.append(Column(start, tuple(given.items()), None, -most, most))
        return out
    if start.name in TONES and start.directions:  # two phases of each axis
        way, phase = start.directions[0], start.shares[1]
        return [
            Column(start, ((way, tuple(e)), (phase, share)), None, -most, most)
            for share in (0.0, 0.25)
            for e in E
        ]
    for i in start.directions:
        out += [Column(start, tuple({**none, i: tuple(e)}.items()), None, -most, most) for e in E]
    if not start.directions:
        out.append(Column(start, (), None, least, most))
    fixed = dict(start.given)
    for i in (i for i in start.shares if i not in fixed and start.name not in EVENTS):
        at = 0.5
        up, down = ({**none, i: at + s} for s in (STEP, -STEP))
        bound = 0.5 * most
        out.append(Column(start, tuple(up.items()), tuple(down.items()), -bound, bound))
    return out


# mismatch ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Nuisance:
    """A column of mismatch: a unit is its bound; `own` where each run has another."""

    label: str
    hooks: Hooks = field(compare=False)
    lower: float = -1.0
    own: bool = False


def _scaled(entry: str, row: int, share: float) -> Hooks:
    def world(run):
        if entry == "stiffness":
            k = run.world.stiffness_Nmm_rad.copy()
            k[row] *= 1.0 + share
            run.world = run.world.but(stiffness_Nmm_rad=k)
        else:
            k = run.world.cutter.coefficients.copy()
            k[row] *= 1.0 + share
            run.world = run.world.cutting(coefficients=k)

    return {"world": world}


def _gain(row: int) -> Hooks:
    def sense(run):
        run.sensed_N[:, row] *= 1.0 + BOUNDS["gain"]

    return {"sense": sense}


def _lag(row: int) -> Hooks:
    def lags(run):
        run.lag_s[:, row] += BOUNDS["lag_s"]

    return {"lags": lags}


def _play(row: int) -> Hooks:
    def gear(run):
        run.q_load[:, row] += slack(run.q_act[:, row], BOUNDS["play_deg"], 0.0)

    return {"gear": gear}


def _ripple(row: int, phase: float) -> Hooks:
    def gear(run):
        run.q_load[:, row] += ripple(run.q_act[:, row], row, BOUNDS["transmission_deg"], 1, phase)

    return {"gear": gear}


def _shift(row: int) -> Hooks:
    def tip(run):
        run.tip_mm = run.tip_mm + BOUNDS["shift_mm"] * E[row]

    return {"tip": tip}


def _turn(row: int) -> Hooks:
    def tip(run):
        run.tip_mm = run.tip_mm + np.cross(BOUNDS["turn_rad"] * E[row], run.tip_mm)

    return {"tip": tip}


def _zero(row: int) -> Hooks:
    def sense(run):
        run.sensed_N = run.sensed_N + BOUNDS["force_zero_N"] * E[row]

    return {"sense": sense}


def _clock(name: str) -> Hooks:
    def sense(run):
        run.delay(name, BOUNDS["clock_s"])

    return {"sense": sense}


@cache
def nuisances() -> tuple[Nuisance, ...]:
    """All mismatch, a column each; encoders' zeros are no signature and stand in the fit itself."""
    out = [Nuisance(f"stiffness {k}", _scaled("stiffness", k, BOUNDS["stiffness"])) for k in range(10)]
    out += [Nuisance(f"force {k}", _scaled("force", k, BOUNDS["coefficients"])) for k in range(6)]
    out += [Nuisance(f"gain {k}", _gain(k)) for k in range(3)]
    out += [Nuisance(f"lag {j}", _lag(j), 0.0) for j in range(6)]
    out += [Nuisance(f"play {j}", _play(j), 0.0) for j in range(6)]
    out += [Nuisance(f"ripple {j} {p:.0f}", _ripple(j, p)) for j in range(6) for p in (0.0, np.pi / 2.0)]
    out += [Nuisance(f"shift {k}", _shift(k), own=True) for k in range(3)]
    out += [Nuisance(f"turn {k}", _turn(k), own=True) for k in range(3)]
    out += [Nuisance(f"zero {k}", _zero(k), own=True) for k in range(3)]
    out += [Nuisance(f"clock {name}", _clock(name), own=True) for name in CLOCKS]
    return tuple(out)


# kept -------------------------------------------------------------------------------------------------------


PHYSICS = (
    "arm",
    "chips",
    "instruments",
    "masses",
    "memory",
    "mismatch",
    "path",
    "programs",
    "robot",
    "scene",
)
PHYSICS += ("scenes", "signatures", "turning", "waypoints")


def digest() -> str:
    """A mark of the code that signatures depend on."""
    here = Path(__file__).parent
    out = hashlib.sha256()
    for file in (*(here / f"{name}.py" for name in PHYSICS), *sorted((here / "effects").glob("*.py"))):
        out.update(file.read_bytes())
    return out.hexdigest()[:16]


class Library:
    """Columns of effects and mismatch by program, made once; `folder` keeps them between processes."""

    def __init__(self, folder: Path | None = None, names: tuple[str, ...] | None = None):
        every = sorted(LIBRARY) if names is None else names
        self.names = tuple(name for name in every if name not in EVENTS and name not in TONES)
        self.by_case = tuple(name for name in every if name in EVENTS or name in TONES)
        self.folder = None if folder is None else Path(folder) / digest()
        self.scenes: dict[str, Scene] = {}
        self.kept: dict[tuple, dict] = {}

    def scene(self, program: str) -> Scene:
        """The nominal run of a program."""
        if program not in self.scenes:
            self.scenes[program] = Scene(program)
        return self.scenes[program]

    def ready(self, days) -> None:
        """Make all columns that the runs of a case need."""
        for day in days:
            self.mismatch(day.program)
            for name in self.names:
                self.of(name, day.program, day.age_s, day.number)

    def mismatch(self, program: str) -> list[dict]:
        """Sparse signals of each nuisance."""
        scene = self.scene
        return self._of(
            (program, "mismatch"), lambda: [sparse(scene(program).change(n.hooks)) for n in nuisances()]
        )

    def of(self, name: str, program: str, age_s: float, number: int) -> dict[Start, list[dict]]:
        """Sparse signals of each column of each start of an effect, on one run."""
        kind = LIBRARY[name]
        key = (program, name, *((age_s,) if kind.hours else ()))

        def made() -> dict[Start, list[dict]]:
            scene = self.scene(program)
            return {s: [sparse(c.change(scene, age_s, number)) for c in columns(s)] for s in starts(name)}

        return self._of(key, made, keep=not kind.hours)

    def _of(self, key: tuple, make, keep: bool = True):
        if key not in self.kept:
            file = (
                None
                if self.folder is None or not keep
                else self.folder / ("-".join(map(str, key)) + ".pickle")
            )
            if file is not None and file.exists():
                self.kept[key] = pickle.loads(file.read_bytes())
                return self.kept[key]
            self.kept[key] = make()
            if file is not None:
                file.parent.mkdir(parents=True, exist_ok=True)
                unfinished = file.with_suffix(f".{os.getpid()}")
                unfinished.write_bytes(pickle.dumps(self.kept[key]))
                unfinished.replace(file)
        return self.kept[key]


def sparse(change: Signals) -> dict[tuple[str, int], np.ndarray]:
    """The columns that are not zero, by channel and axis."""
    return {
        (name, k): values[:, k].astype(np.float32)
        for name, values in change.items()
        for k in range(values.shape[1])
        if np.any(values[:, k] != 0.0)
    }
