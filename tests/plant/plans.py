"""What a case will be, drawn from its seed before anything is driven, and how its runs are driven."""

from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta

import numpy as np

from tests.plant import faults as acting
from tests.plant import foreign, instruments, mismatch
from tests.plant.effects import LIBRARY, SLIPS, UNKNOWN
from tests.plant.faults import Fault
from tests.plant.instruments import Instruments
from tests.plant.robot import Mismatch, Run, simulate
from tests.plant.scene import World
from tests.plant.waypoints import CUTTING, PROGRAMS

WITHOUT_SCAN = sorted(name for name, kind in LIBRARY.items() if kind.signal != "scan")


@dataclass(frozen=True)
class Options:
    """What is asked of a case; the rest is drawn."""

    effect: str | None = None
    form: str | None = None
    runs: int = 3
    twist: bool = False
    law: mismatch.Law = mismatch.USUAL
    foreign_noise: bool = False
    missing: tuple[str, ...] = ()  # tables, or columns of the controller's log
    ratios: tuple[float, float] = acting.RATIOS
    sized: tuple[float, float] | None = None  # the size lies between these, whatever the noise


@dataclass(frozen=True)
class Day:
    """One run of a case before it is driven."""

    number: int
    program: str
    mismatch: Mismatch
    started: datetime
    age_s: float
    seed: int


@dataclass(frozen=True)
class Plan:
    """A case before it is driven."""

    seed: int
    options: Options
    name: str
    faults: tuple[Fault, ...]
    how: Instruments
    robot: Mismatch
    days: tuple[Day, ...]
    ratio: float
    luck: tuple[float, ...]  # in 0 ... 1, for sizes that the ratio does not decide
    world: World = field(default_factory=World)

    def drive(self, day: Day, hooks: list) -> Run:
        """One run with these effects at work."""
        way = PROGRAMS[day.program]().waypoints()
        return simulate(way, self.world, hooks, day.mismatch, day.age_s, day.number)

    def sizes(self, without: list[Run]) -> list[float]:
        """Size of each fault."""
        out = []
        for fault, luck in zip(self.faults, self.luck, strict=True):
            if self.options.sized is not None:
                low, high = self.options.sized
                out.append(float(low * (high / low) ** luck))
                continue

            def drive(index: int, size: float, fault: Fault = fault) -> Run:
                return self.drive(self.days[index], [fault.hooks(size)])

            out.append(acting.size_for(fault, self.ratio, luck, drive, without, self.how))
        return out


def draw_effect(rng: np.random.Generator) -> str:
    """A name drawn as in the mixed check: nothing, one, two, an unknown one or a slip."""
    share = rng.random()
    if share < 0.15:
        return "none"
    if share < 0.30:
        return "open:" + str(rng.choice(sorted(UNKNOWN)))
    if share < 0.40:
        return str(rng.choice(sorted(SLIPS)))
    if share < 0.50:
        return "+".join(rng.choice(WITHOUT_SCAN, 2, replace=False))
    return str(rng.choice(sorted(LIBRARY)))


def _days(rng: np.random.Generator, robot: Mismatch, law: mismatch.Law, count: int, hours: bool) -> list[Day]:
    """Programs, start times and the mismatch of each day; the first run cuts, and not all are alike."""
    first = str(rng.choice(CUTTING))
    programs = [first]
    for i in range(1, count):
        programs.append("air" if i == 1 and rng.random() < 0.5 else str(rng.choice(sorted(PROGRAMS))))
    begin = datetime(2024, 3, 4, 8, 0, tzinfo=UTC) + timedelta(minutes=int(rng.integers(0, 60 * 24 * 200)))
    gaps_h = rng.uniform(0.4, 2.5, count) if hours or rng.random() < 0.5 else rng.uniform(0.02, 0.1, count)
    ages = np.round(3600.0 * np.concatenate([[0.0], np.cumsum(gaps_h)[:-1]]))
    return [
        Day(
            i,
            programs[i],
            mismatch.of_day(robot, rng, law),
            begin + timedelta(seconds=int(ages[i])),
            float(ages[i]),
            int(rng.integers(1 << 31)),
        )
        for i in range(count)
    ]


def draw(seed: int, options: Options) -> Plan:
    """The case of a seed; the same seed and options give the same case."""
    rng = np.random.default_rng(seed)
    name = draw_effect(rng) if options.effect is None else options.effect
    names = [] if name == "none" else name.split("+")
    if options.form == "other" and not any(acting.has_other_form(n) for n in names):
        raise ValueError(f"{name} has one form only; ask for form 'same'")
    form = "other" if rng.random() < 1.0 / 3.0 else "same"
    built = tuple(acting.build(n, options.form or form, int(rng.integers(1 << 31))) for n in names)
    how = instruments.drawn(rng, acting.needs(built), options.twist)
    how = instruments.without(how, options.missing)
    if options.foreign_noise:
        how = instruments.disturbed(how, foreign.drawn(np.random.default_rng([seed, 1]), _short(how)))
    robot = mismatch.of_robot(rng, options.law)
    days = _days(rng, robot, options.law, options.runs, any(f.kind.hours for f in built))
    ratio = float(np.exp(rng.uniform(*np.log(options.ratios))))
    luck = tuple(float(rng.random()) for _ in built)
    return Plan(seed, options, name, built, how, robot, tuple(days), ratio, luck)


def _short(how: Instruments) -> dict[str, float]:
    """Short noise of each channel that can be disturbed."""
    return {"tracker": how.tracker_mm, "force": how.force_N, "q_act": how.q_act_deg, "q_load": how.q_load_deg}
