"""A case: what is wrong (or not), several measured runs of it, and a label kept apart."""

from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from tests.plant import instruments, surface, truth, writing
from tests.plant.effects import LIBRARY, SLIPS, UNKNOWN, Draw, Kind
from tests.plant.instruments import Instruments
from tests.plant.robot import Mismatch, Run, simulate
from tests.plant.scene import CELL_TOML, World
from tests.plant.waypoints import CUTTING, PROGRAMS

BOUNDS = {  # of the normal mismatch, all drawn evenly between plus and minus (or zero and) the bound
    "stiffness": 0.08,
    "coefficients": 0.03,
    "gain": 0.02,
    "lag_s": 0.0005,
    "play_deg": 0.0005,
    "transmission_deg": 0.0005,
    "shift_mm": 0.04,
    "turn_rad": 3e-5,
    "clock_s": 0.002,
    "force_zero_N": 3.0,
}
RATIOS = (0.25, 4.0)  # of an effect's RMS to the noise
CLOCKS = ("tracker", "force", "controller", "q_load")


@dataclass(frozen=True)
class Fault:
    """One acting effect: its kind and form, and its parameters at a size."""

    kind: Kind
    form: str
    target: str | None
    at: object

    def hooks(self, size: float) -> dict:
        """Hooks at a size."""
        return self.at(size)[1]


def find(name: str) -> Kind:
    """The kind behind `name` or `open:name`."""
    plain = name.removeprefix("open:")
    shelves = (UNKNOWN,) if name.startswith("open:") else (LIBRARY, SLIPS)
    for shelf in shelves:
        if plain in shelf:
            return shelf[plain]
    known = [*LIBRARY, *SLIPS, *(f"open:{n}" for n in UNKNOWN)]
    raise ValueError(f"no effect {name!r}; known: none, {', '.join(known)}")


def _fault(name: str, form: str, seed: int) -> Fault:
    name, _, wanted = name.partition("@")
    kind = find(name)
    draw = Draw(seed, wanted or None)
    if form == "other" and kind.others:
        build = kind.others[int(draw.rng.integers(len(kind.others)))]
    elif form in ("same", "other"):
        build = kind.same
    else:
        raise ValueError(f"form {form!r}: allowed are 'same' and 'other'")
    target, at = build(draw)
    return Fault(kind, build.__name__, target, at)


def has_other_form(name: str) -> bool:
    """Whether the plant has another form of the same physics."""
    return bool(find(name.partition("@")[0]).others)


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
        return "+".join(rng.choice(sorted(set(LIBRARY) - {"tool_diameter"}), 2, replace=False))
    return str(rng.choice(sorted(LIBRARY)))


def _ball(rng: np.random.Generator, radius: float) -> np.ndarray:
    v = rng.normal(size=3)
    return radius * rng.random() ** (1 / 3) * v / np.linalg.norm(v)


def _robot_mismatch(rng: np.random.Generator) -> Mismatch:
    b = BOUNDS
    return Mismatch(
        stiffness=1.0 + rng.uniform(-b["stiffness"], b["stiffness"], 10),
        coefficients=1.0 + rng.uniform(-b["coefficients"], b["coefficients"], 6),
        gain=1.0 + rng.uniform(-b["gain"], b["gain"], 3),
        lag_s=rng.uniform(0.0, b["lag_s"], 6),
        play_deg=rng.uniform(0.0, b["play_deg"], 6),
        play_start=rng.uniform(-1.0, 1.0, 6),
        transmission_deg=rng.uniform(0.0, b["transmission_deg"], 6),
        phase=rng.uniform(0.0, 2.0 * np.pi, 6),
    )


def _day_mismatch(robot: Mismatch, rng: np.random.Generator) -> Mismatch:
    b = BOUNDS
    return replace(
        robot,
        shift_mm=_ball(rng, b["shift_mm"]),
        turn_rad=_ball(rng, b["turn_rad"]),
        clocks_s={name: float(rng.uniform(-b["clock_s"], b["clock_s"])) for name in CLOCKS},
        force_zero_N=rng.uniform(-b["force_zero_N"], b["force_zero_N"], 3),
    )


@dataclass(frozen=True)
class Day:
    """One run of a case before it is driven."""

    number: int
    program: str
    mismatch: Mismatch
    started: datetime
    age_s: float
    seed: int


def _days(rng: np.random.Generator, robot: Mismatch, count: int, hours: bool) -> list[Day]:
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
            _day_mismatch(robot, rng),
            begin + timedelta(seconds=int(ages[i])),
            float(ages[i]),
            int(rng.integers(1 << 31)),
        )
        for i in range(count)
    ]


def _drive(day: Day, hooks: list, world: World) -> Run:
    return simulate(PROGRAMS[day.program]().waypoints(), world, hooks, day.mismatch, day.age_s, day.number)


def _ratio(kind: Kind, sized: dict[str, dict]) -> float:
    """Ratio of an effect to the noise in the signal it is judged in, or in the best one."""
    if kind.signal in sized:
        return sized[kind.signal]["ratio"]
    return sized[_clearest(sized)]["ratio"] if sized else 0.0


def _clearest(sized: dict[str, dict]) -> str:
    """Signal in which an effect stands out most; commanded signals have no noise and do not count."""
    return max(sized, key=lambda name: sized[name]["ratio"] if name != "joint_commanded" else -1.0)


def _sized(fault: Fault, days, runs, how: Instruments, world: World, ratio: float, rng) -> float:
    """Size at which the effect has this ratio to the noise, kept within what is plausible."""
    low, high = fault.kind.sizes
    if fault.kind in SLIPS.values():
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))
    if fault.kind.signal == "scan":
        return float(np.clip(2.0 * ratio * how.scan_mm, low, high))
    trial = np.sqrt(max(low, 0.02 * high) * high)
    with_it = _drive(days[-1 if fault.kind.hours else 0], [fault.hooks(trial)], world)
    index = -1 if fault.kind.hours else 0
    change = truth.differences(instruments.clean(with_it, how), instruments.clean(runs[index], how))
    found = _ratio(fault.kind, truth.sizes([change], how))
    size = trial * ratio / max(found, 1e-9)
    if size < low:  # too small to be plausible: a small plausible size instead
        return float(low * np.exp(rng.uniform(0.0, np.log(min(6.0, high / low)))))
    return float(min(size, high))


def make_case(
    seed: int,
    folder: str | Path,
    effect: str | None = None,
    form: str | None = None,
    runs: int = 3,
    predictions: str = "../predictions",
    twist: bool = False,
) -> dict:
    """Write a case, `folder/run-1 …`, and beside it `folder.label.json`; returns the label.

    `effect`: a name, `name@target`, `open:name`, several joined by "+", "none", or None to draw one.
    `form`: "same" or "other" (None: a third are other forms where one exists). `predictions`: where
    `run.toml` says that the predictions lie. `twist`: the load encoders also see the elastic twist.
    """
    folder = Path(folder)
    if folder.exists() and any(folder.iterdir()):
        raise ValueError(f"{folder} is not empty; give a new folder for the case")
    rng = np.random.default_rng(seed)
    name = draw_effect(rng) if effect is None else effect
    names = [] if name == "none" else name.split("+")
    if form == "other" and not any(has_other_form(n) for n in names):
        raise ValueError(f"{name} has one form only; ask for form 'same'")
    drawn_form = "other" if rng.random() < 1.0 / 3.0 else "same"
    faults = [_fault(n, form or drawn_form, int(rng.integers(1 << 31))) for n in names]
    needs = _needs(faults)
    how = instruments.drawn(rng, needs, twist)
    world = World()
    days = _days(rng, _robot_mismatch(rng), runs, any(f.kind.hours for f in faults))
    without = [_drive(day, [], world) for day in days]
    ratio = float(np.exp(rng.uniform(*np.log(RATIOS))))
    sizes = [_sized(f, days, without, how, world, ratio, rng) for f in faults]
    hooks = [f.hooks(size) for f, size in zip(faults, sizes, strict=True)]
    driven = [_drive(day, hooks, world) for day in days] if faults else without
    label = _label(seed, name, faults, sizes, ratio, days, driven, without, how, world)
    _write(folder, days, driven, how, predictions)
    writing.write_label(folder.with_name(folder.name + ".label.json"), label)
    return label


def _needs(faults: list[Fault]) -> frozenset:
    """Tables without which an effect cannot be seen."""
    table = {"tcp": "tracker", "force": "force", "scan": ""}
    needs = set()
    for fault in faults:
        needs |= fault.kind.needs | {table.get(fault.kind.signal, "controller")}
        if fault.target in ("tracker", "force", "controller"):
            needs.add(fault.target)
        if fault.target in ("q_load", "q_cmd"):
            needs |= {"controller", fault.target}
    return frozenset(needs)


def _label(seed, name, faults, sizes, ratio, days, driven, without, how, world) -> dict:
    clean = [instruments.clean(run, how) for run in driven]
    bare = [instruments.clean(run, how) for run in without]
    changes = [truth.differences(a, b) for a, b in zip(clean, bare, strict=True)]
    entries = []
    for fault, size in zip(faults, sizes, strict=True):
        alone = changes
        if len(faults) > 1:
            single = [instruments.clean(_drive(day, [fault.hooks(size)], world), how) for day in days]
            alone = [truth.differences(a, b) for a, b in zip(single, bare, strict=True)]
        entries.append(_entry(fault, size, alone, how))
    return {
        "schema": "plant/label/1",
        "seed": seed,
        "asked": name,
        "null": not faults,
        "slip": any(f.kind in SLIPS.values() for f in faults),
        "in_library": all(f.kind in LIBRARY.values() or f.kind in SLIPS.values() for f in faults),
        "wanted_ratio": ratio,
        "effects": entries,
        "instruments": asdict(how),
        "robot_mismatch": asdict(days[0].mismatch),
        "runs": [
            {
                "run": f"run-{day.number + 1}",
                "program": day.program,
                "started": day.started.isoformat(),
                "age_s": day.age_s,
                "duration_s": float(run.t_s[-1]),
                "shift_mm": day.mismatch.shift_mm,
                "turn_rad": day.mismatch.turn_rad,
                "clocks_s": day.mismatch.clocks_s,
                "force_zero_N": day.mismatch.force_zero_N,
            }
            for day, run in zip(days, driven, strict=True)
        ],
    }


def _entry(fault: Fault, size: float, changes: list[dict], how: Instruments) -> dict:
    sized = truth.sizes(changes, how)
    if fault.kind.signal == "scan":
        main, main_ratio = "scan", 0.5 * size / how.scan_mm
    else:
        main = fault.kind.signal
        if main not in sized:
            main = _clearest(sized) if sized else None
        main_ratio = sized[main]["ratio"] if main else 0.0
    where = truth.places(changes, main) if main in sized else []
    return {
        "effect": fault.kind.name,
        "family": fault.kind.family,
        "target": fault.target,
        "form": "same" if fault.form == fault.kind.same.__name__ else "other",
        "form_name": fault.form,
        "parameters": fault.at(size)[0],
        "main_signal": main,
        "ratio": main_ratio,
        "signals": sized,
        "where": [
            {"run": f"run-{i + 1}", "t_start_s": a, "t_end_s": b}
            for i, intervals in enumerate(where)
            for a, b in intervals
        ],
    }


def _write(folder: Path, days: list[Day], driven: list[Run], how: Instruments, predictions: str) -> None:
    writing.write_text(folder / "cell.toml", CELL_TOML)
    for day, run in zip(days, driven, strict=True):
        rng = np.random.default_rng(day.seed)
        writing.write_text(folder / "programs" / f"{day.program}.nc", PROGRAMS[day.program]().text())
        place = folder / f"run-{day.number + 1}"
        place.mkdir(parents=True, exist_ok=True)
        tables = instruments.noisy(instruments.clean(run, how), how, run.units, rng)
        for name, table in tables.items():
            writing.write_table(place / name, table, parquet=bool(rng.random() < 0.3))
        if how.scan:
            cloud = surface.scanned(run, rng, how.scan_mm)
            if len(cloud):
                scan = {f"{a}_mm": np.round(cloud[:, i], 4) for i, a in enumerate("xyz")}
                writing.write_table(place / "scan", scan, parquet=False)
        keys = {
            "cell": "../cell.toml",
            "program": f"../programs/{day.program}.nc",
            "prediction": f"{predictions}/{day.program}",
            "started": day.started.isoformat(),
            "angles": "absolute",
        }
        sections = {"frames": {"tracker": "base", "force": how.force_frame}}
        if rng.random() < 0.5:
            sections["noise"] = {
                "tcp_mm": how.tracker_mm,
                "force_N": how.force_N,
                "q_act_deg": how.q_act_deg,
                "q_load_deg": how.q_load_deg,
            }
        writing.write_text(place / "run.toml", writing.run_toml(keys, sections))
