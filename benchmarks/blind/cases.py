"""Cases of the check: which seed asks for what, and one case made, diagnosed, and set beside an oracle.

Every kind has its own block of seeds behind the first one, so that asking for more cases never changes those
already done, and a part of the check is the first cases of each kind. Seeds below ``SCORED_FROM`` are for
development and calibration; what is scored starts there. The plant makes a case, the diagnosis answers
without its label, a record keeps both. Each record is stored
when made; records of several machines may be copied into one folder.

**Oracle.** How far the gap shrinks if the effect, its target and its parameters are known. The effect is put
into the model by the library's own implementation and with the true parameters. Where the plant's effect has
another form than the library's, the oracle takes the size that fits best instead, normal mismatch of the
signal fitted beside it: per run a shift, a clock, for forces a gain.
"""

import hashlib
import itertools
import json
import math
import multiprocessing
import shutil
import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from dataclasses import asdict, dataclass, replace
from math import ceil
from pathlib import Path
from typing import Any, TypeVar

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np
from blind.score import flat, named_of, truth_of

from gcode2krl import Prediction, load_cell, load_run, predict
from gcode2krl.effects import library
from tests.plant.cases import has_other_form
from tests.plant.cases import store as store_case
from tests.plant.confounded import PAIRS
from tests.plant.effects import LIBRARY, SLIPS, UNKNOWN
from tests.plant.kinds import STORIES, plan_of
from tests.plant.plans import Plan
from tests.plant.scene import CELL_TOML
from tests.plant.waypoints import PROGRAMS

ROOT = Path(__file__).resolve().parents[2]
SCORED_FROM = 30_000
BLOCK = 1_000
NULLS = ("null", "null_foreign_noise", "null_foreign_mismatch")
KINDS = (
    "null",
    "single",
    "slip",
    "open",
    "pair",
    "deleted",
    *NULLS[1:],
    "confounded",
    "missing",
    "story",
    "many",
)
"""The n-th kind has the n-th block of seeds."""
MIXED = {"null": 0.12, "single": 0.40, "slip": 0.06, "open": 0.12, "pair": 0.07, "deleted": 0.08}
MIXED |= {"null_foreign_noise": 0.05, "null_foreign_mismatch": 0.04, "confounded": 0.03, "missing": 0.03}
MIXED |= {"story": 0.02}
FULL = {"null": 300, "null_foreign_noise": 100, "null_foreign_mismatch": 100, "single": 600, "pair": 220}
FULL |= {"open": 500, "slip": 54, "confounded": 60, "missing": 60, "story": 60, "many": 60}
ALIKE = ("servo_lag", "dead_time", "servo_gain", "backlash")
"""Effects that six synchronised servos or gears have alike: asked for at target `all` too."""
DELETED_EACH = 10
"""Cases of each effect with that effect taken out of the library."""
OTHER_IN_FIVE = 2
"""Of five cases of an effect that has another form, so many have it: a third of all single-effect cases."""


@dataclass(frozen=True)
class Case:
    """One case: its seed, its kind, and what the plant is asked for."""

    seed: int
    kind: str
    effect: str | None
    """None where the kind draws it."""
    form: str | None = None
    without: tuple[str, ...] = ()
    """Effects taken out of the library."""

    @property
    def name(self) -> str:
        """Return the name of its record."""
        return f"{self.kind}-{self.seed:05d}"


OTHER_NUMBERS = {
    "collision": "it leaves a joint that has slipped: in the library that is a step, a second effect",
    "current_limit": "a share of the run's largest acceleration; in the library one limit for all runs",
    "force_steps": "which step is nearest hangs on tenths of a newton; the library never searches for it",
}
"""What the plant states otherwise than the library, and why a name could not be scored."""


def simulated() -> list[str]:
    """Return every effect of the library that the plant can do; slips are no effects of the robot."""
    return sorted(name for name in _effects() if name in LIBRARY and name not in OTHER_NUMBERS)


def not_simulated() -> list[str]:
    """Return the effects of the library that are never asked for: the plant lacks them or their numbers."""
    return sorted(name for name in _effects() if name not in LIBRARY or name in OTHER_NUMBERS)


def _effects() -> list[str]:
    return [name for name, effect in library().items() if effect.kind != "slip"]


def shelves() -> dict[str, list[str]]:
    """Return what each kind takes in turn; the plant draws for kinds that are not here."""
    return {
        "single": [*simulated(), *(f"{name}@all" for name in simulated() if name in ALIKE)],
        "slip": sorted(SLIPS),
        "open": [f"open:{name}" for name in sorted(set(UNKNOWN) - set(library()))],
        "deleted": simulated(),
        "confounded": sorted(PAIRS),
        "story": sorted(STORIES),
    }


def full_counts() -> dict[str, int]:
    """Return how many cases of each kind the whole check has."""
    return FULL | {"deleted": DELETED_EACH * len(simulated())}


def mixed(count: int) -> dict[str, int]:
    """Return how many cases of each kind a mixed check has."""
    counts = {kind: round(share * count) for kind, share in MIXED.items()}
    counts["single"] += count - sum(counts.values())
    return counts


def in_turn(cases: Sequence[Case]) -> list[Case]:
    """Return the cases with their kinds mixed, so that a check that is cut short has some of each."""
    of_kind = Counter(case.kind for case in cases)
    seen: Counter[str] = Counter()
    shares = []
    for case in cases:
        seen[case.kind] += 1
        shares.append(seen[case.kind] / of_kind[case.kind])
    return [case for _, case in sorted(zip(shares, cases, strict=True), key=lambda pair: pair[0])]


def scaled(counts: dict[str, int], scale: float) -> dict[str, int]:
    """Return the counts of a part of a check; at least one case of each kind that has any."""
    return {kind: ceil(scale * count) for kind, count in counts.items()}


def plan(first_seed: int, counts: dict[str, int], effects: Sequence[str] = ()) -> list[Case]:
    """Return the cases of each kind; named effects alone where some are given, every one in turn.

    Raises ValueError where a block overflows, an effect is unknown, or both sorts of seeds mix.
    """
    _check_seeds(first_seed)
    every = shelves()
    known = {name for shelf in every.values() for name in shelf}
    unknown = {name.partition("@")[0] for name in effects} - known
    if unknown:
        raise ValueError(f"no effect {', '.join(sorted(unknown))}; python -m tests.plant.kinds names")
    cases: list[Case] = []
    for number, kind in enumerate(KINDS):
        count = counts.get(kind, 0)
        if count > BLOCK:
            raise ValueError(f"{count} cases of kind {kind}: at most {BLOCK}")
        shelf = every.get(kind, [])
        wanted = [name for name in effects if name.partition("@")[0] in shelf] or shelf
        cases += [_case(kind, first_seed + number * BLOCK + i, i, wanted) for i in range(count)]
    return cases


TWINS = {"force_delay": ("clock",), "tool_diameter": ("swapped_tool",), "gravity": ("load",)}
"""What is the same thing under another name, and is taken out of the library with it."""


def _check_seeds(first_seed: int) -> None:
    last = first_seed + len(KINDS) * BLOCK - 1
    if first_seed < SCORED_FROM <= last:
        raise ValueError(
            f"seed {first_seed}: cases would reach seed {last}; calibration stays below {SCORED_FROM}, so "
            f"give at most {SCORED_FROM - len(KINDS) * BLOCK}, or {SCORED_FROM} and more for what is scored"
        )


def _case(kind: str, seed: int, i: int, names: Sequence[str]) -> Case:
    if not names:
        return Case(seed, kind, "none" if kind in NULLS else None)
    name = names[i % len(names)]
    if kind == "single":
        return Case(seed, kind, name, _form(name, i, len(names)))
    if kind == "deleted":
        effect = name.partition("@")[0]
        return Case(seed, kind, name, without=(effect, *TWINS.get(effect, ())))
    return Case(seed, kind, name)


def _form(name: str, i: int, names: int) -> str:
    """Return the form of the i-th single case: both in every round of all effects, another one each round.

    Where all axes have it alike the plant has one form.
    """
    other = (i % names + i // names) % 5 < OTHER_IN_FIVE and has_other_form(name) and "@" not in name
    return "other" if other else "same"


def predictions(folder: Path) -> dict[str, str]:
    """Predict every program of the plant once; returns the folder of each."""
    folder.mkdir(parents=True, exist_ok=True)
    cell_file = folder / "cell.toml"
    cell_file.write_text(CELL_TOML, encoding="utf-8", newline="\n")
    places = {}
    for name, program in PROGRAMS.items():
        place = folder / name
        if not (place / "prediction.toml").exists():
            part = folder / f"{name}.nc"
            part.write_text(program().text(), encoding="utf-8", newline="\n")
            predict(part, load_cell(cell_file)).save(place)
        places[name] = place.resolve().as_posix()
    return places


LINK = {"timing": "PATH", "joint_commanded": "PATH", "joint_actual": "SERVO", "joint_load": "GEAR"}
LINK |= {"force": "FORCE", "tcp": "MECHANICS"}
"""Signal of the answer -> its link's name in ``gcode2krl.gap.compare.links``."""
TRIALS = (0.25, 0.4, 0.6, 0.8, 1.0, 1.2, 1.5, 2.0, 3.0)


def oracle(label: dict, result: dict, runs: Sequence[Any], prediction: Any) -> dict[str, Any] | None:
    """Return the power that the truth takes from the signal that the diagnosis reports; None if it cannot.

    In the squared unit of the report, a mean over the rows of all runs; none of them chose anything here, so
    all are held out. ``removed`` is counted after normal mismatch, as it is with the truth in the model.
    """
    signal = (result.get("gap") or {}).get("signal")
    if signal not in LINK:
        return None
    traces = _traces(LINK[signal], runs, prediction)
    entry = label["effects"][0]
    truth = _applied(entry, traces[0].inputs) if traces else None
    if truth is None:
        return None
    nominal = truth.effect.nominal(traces[0].inputs, truth.target)
    tried = [truth] if entry["form"] == "same" else [_times(truth, nominal, size) for size in TRIALS]
    best = min(tried, key=lambda one: _left(traces, one))
    usual = [_mismatch(trace, best) for trace in traces]
    before = _mean_square([trace.residual for trace in traces])
    gap = _mean_square([trace.residual - own for trace, own in zip(traces, usual, strict=True)])
    left = _mean_square(
        [trace.measured - trace.sample([best]) - own for trace, own in zip(traces, usual, strict=True)]
    )
    unit = traces[0].factor ** 2
    return {"signal": signal, "before": before * unit, "removed": (gap - left) * unit}


def rests(label: dict, result: dict, runs: Sequence[Any], prediction: Any) -> dict[str, list[float]]:
    """Return for each link the RMS of its signal [before, with what is named, with the truth] in the model.

    The clock of each run is taken off all three, no other mismatch: it is left beside the truth too. In the
    link's own unit.
    """
    found = {}
    for link in LINK.values():
        traces = _traces(link, runs, prediction)
        if not traces:
            continue
        inputs = traces[0].inputs
        named = [each for cause in named_of(result) for each in _of_cause(cause, inputs)]
        true = [_applied(entry, inputs) for entry in label["effects"]]
        sets = ([], named, [each for each in true if each is not None])
        found[link] = [_rest(traces, acting) * traces[0].factor for acting in sets]
    return found


def _of_cause(cause: dict[str, Any], inputs: Any) -> Iterator[Any]:
    """Yield the effects of a cause as the library applies them: its members where it is a group."""
    from gcode2krl.effects import library
    from gcode2krl.effects.registry import build

    for each in cause.get("members") or [cause]:
        values = {name: number["value"] for name, number in each["parameters"].items()}
        if values and each["effect"] in library():
            yield build(each["effect"], each["target"], values, library(), inputs.cell)


def _rest(traces: Sequence[Any], acting: Sequence[Any]) -> float:
    """Return the RMS that effects and the clock leave of a link's traces."""
    left = []
    for trace in traces:
        residual, late = trace.measured - trace.sample(list(acting)), replace(trace, minus=None).rate
        left.append(residual - late * (np.sum(late * residual) / max(np.sum(late**2), 1e-300)))
    return math.sqrt(_mean_square(left))


def _traces(link: str, runs: Sequence[Any], prediction: Any) -> list[Any]:
    """Return the measured signal of a link beside its model, run by run."""
    from gcode2krl.gap.compare import links
    from gcode2krl.gap.compare.pair import pairs_of

    found: list[Any] = getattr(links, link).traces(list(pairs_of(prediction, runs)))
    return found


def _applied(entry: dict, inputs: Any) -> Any:
    from gcode2krl.effects import Applied, library

    effect = library().get(entry["effect"])
    if effect is None:
        return None
    target = truth_of(entry)[1]
    if target not in effect.targets(inputs.cell):
        return None
    effect = effect.at(target)
    known = flat(entry)
    if not set(known) & set(effect.names):
        return None
    values = effect.nominal(inputs, target) | {name: known[name] for name in effect.names if name in known}
    return Applied(effect, target, values)


def _times(one: Any, nominal: dict[str, float], size: float) -> Any:
    """Return an effect with its deviations from nominal multiplied by a factor; shapes unchanged."""
    values = {
        name: value if one.effect.parameter(name).is_shape else nominal[name] + size * (value - nominal[name])
        for name, value in one.values.items()
    }
    return replace(one, values=values)


def _nuisance(trace: Any) -> np.ndarray:
    """Return (n·k, c): a shift of each column, the clock, and for forces a gain of each column."""
    n, k = trace.shape
    late = replace(trace, minus=None).rate
    columns = [np.kron(np.eye(k), np.ones((n, 1))), late.T.reshape(-1, 1)]
    if trace.signal == "force":
        columns.append(np.kron(np.eye(k), np.ones((n, 1))) * trace.nominal.T.reshape(-1, 1))
    return np.concatenate(columns, axis=1)


def _left(traces: Sequence[Any], one: Any) -> float:
    """Return the sum of squares that an effect and the nuisance leave."""
    return sum(
        float(np.sum((trace.measured - trace.sample([one]) - _mismatch(trace, one)) ** 2)) for trace in traces
    )


def _mismatch(trace: Any, one: Any) -> np.ndarray:
    """Return the part of the residual (n, k) with an effect in the model that the nuisance explains."""
    residual = (trace.measured - trace.sample([one])).T.ravel()
    wide = _nuisance(trace)
    return (wide @ np.linalg.lstsq(wide, residual, rcond=None)[0]).reshape(trace.shape[1], -1).T


def _mean_square(residuals: Sequence[np.ndarray]) -> float:
    return float(np.mean(np.concatenate([np.sum(each**2, axis=1) for each in residuals])))


CODE = ("gcode2krl/effects", "gcode2krl/gap", "gcode2krl/runs", "gcode2krl/prediction", "tests/plant")
"""What a record depends on: folders below the checkout."""
PLANT_KINDS = {"pair": "double"}
"""Kinds that the plant has under another name."""
CLEAR = ("open", "deleted", "missing")
"""Kinds of which only what shows is scored, so that it is asked for."""
LARGEST_RATIO = 4.0
"""The plant's effects are at most so many times as large as the noise."""
NOT_PREDICTED = ("other_program",)
"""Causes that can be found but not predicted, so there is no oracle."""


@dataclass(frozen=True)
class How:
    """What is computed for every case."""

    oracle: bool = True
    keep: bool = False
    """Keep the runs of the case."""
    code: str = ""
    """Fingerprint of the code under test; records of another one are made again."""


def fingerprint() -> str:
    """Return a digest of the code that a record depends on, tests apart."""
    digest = hashlib.sha256()
    for room in CODE:
        for file in sorted((*(ROOT / room).rglob("*.py"), *(ROOT / room).rglob("*.json"))):
            if not file.name.startswith("test_"):
                digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def run_case(case: Case, folder: Path, how: How, predictions: dict[str, str]) -> dict[str, Any]:
    """Make a case, diagnose it without its label, and return the record; an exception is part of it."""
    place = folder / "cases" / case.name
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    record: dict[str, Any] = {"case": asdict(case), "code": how.code, "error": None, "result": None}
    start, own = time.perf_counter(), time.process_time()
    record["label"] = made(case, place / "case", predictions)
    record["plant_s"] = time.perf_counter() - start
    record["plant_cpu_s"] = time.process_time() - own
    try:
        _diagnose(case, place / "case", record)
        own = time.process_time()
        _beside(case, place / "case", how, record)
        record["beside_cpu_s"] = time.process_time() - own
    except Exception:  # the check goes on, and shows it
        record["error"] = traceback.format_exc()
    if not how.keep:
        shutil.rmtree(place, ignore_errors=True)
    return record


def drawn(case: Case) -> tuple[Plan, dict[str, Any]]:
    """Return the plant's plan of a case, and what its label says beside it."""
    kind = PLANT_KINDS.get(case.kind, case.kind)
    plan, more = plan_of(kind, case.seed, case.effect, case.form)
    if case.kind in CLEAR:  # 0.25 ... 4 times the noise become 1 ... 4
        plan = replace(plan, ratio=(LARGEST_RATIO * plan.ratio) ** 0.5)
    made_with = {"kind": kind, "seed": case.seed, "effect": case.effect, "form": case.form}
    return plan, {"kind": case.kind, "made_with": made_with, **more}


def made(case: Case, folder: Path, predictions: dict[str, str]) -> dict[str, Any]:
    """Let the plant write the runs of a case; returns the label, which is taken away from beside them."""
    plan, more = drawn(case)
    return driven(plan, more, folder, predictions)


def driven(plan: Plan, more: dict[str, Any], folder: Path, predictions: dict[str, str]) -> dict[str, Any]:
    """Drive a plan, write its runs and return its label, which is taken away from beside them."""
    store_case(plan, folder, Path(next(iter(predictions.values()))).parent.as_posix(), more)
    file = folder.with_name(folder.name + ".label.json")
    label: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    file.unlink()
    return label


def loaded(folder: Path) -> tuple[list[Any], Prediction]:
    """Return the runs of a case and the prediction of the first."""
    runs = [load_run(each) for each in sorted(folder.glob("run-*"))]
    return runs, Prediction.load(runs[0].path("prediction") or "")


def answer(folder: Path, without: Sequence[str] = ()) -> dict[str, Any]:
    """Return the JSON object that the diagnosis of a case's runs gives."""
    from gcode2krl.gap import diagnose

    runs, prediction = loaded(folder)
    return diagnose(prediction, runs, exclude=tuple(without)).as_dict()


def _diagnose(case: Case, folder: Path, record: dict[str, Any]) -> None:
    start, own = time.perf_counter(), time.process_time()
    record["result"] = answer(folder, case.without)
    record["diagnosis_s"] = time.perf_counter() - start
    record["diagnosis_cpu_s"] = time.process_time() - own


def _beside(case: Case, folder: Path, how: How, record: dict[str, Any]) -> None:
    """Add the result of an oracle on the same case, and of many effects what named causes leave."""
    label = record["label"]
    first = label["effects"][0] if label["effects"] else {"effect": "", "ratio": 0.0}
    possible = case.kind in ("single", "slip") and first["effect"] not in NOT_PREDICTED
    if how.oracle and possible and first["ratio"] >= 1.0:
        record["oracle"] = oracle(label, record["result"], *loaded(folder))
    if case.kind == "many":
        record["rests"] = rests(label, record["result"], *loaded(folder))


Result = TypeVar("Result")


def done(case: Case, folder: Path, code: str | None) -> dict[str, Any] | None:
    """Return the record of a case that this code has made already; of any code where None is given."""
    file = folder / "results" / f"{case.name}.json"
    if not file.exists():
        return None
    record: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    asked = record["case"]
    same = (asked["effect"], asked.get("form")) == (case.effect, case.form)
    return record if same and code in (None, record["code"]) else None


def store(record: dict[str, Any], folder: Path) -> None:
    """Keep a record; a half-written one is never left behind."""
    case = record["case"]
    file = folder / "results" / f"{case['kind']}-{case['seed']:05d}.json"
    file.parent.mkdir(exist_ok=True)
    unfinished = file.with_suffix(".part")
    unfinished.write_text(json.dumps(record), encoding="utf-8")
    unfinished.replace(file)


def fresh_records(
    cases: Sequence[Case], folder: Path, how: How, jobs: int, until_s: float = math.inf
) -> Iterator[dict[str, Any]]:
    """Yield the record of each case as soon as it is made; none begins later than this `time.monotonic`."""
    if cases:
        places = predictions(folder / "predictions" / how.code)
        asked = ((case, folder, how, places) for case in cases)
        yield from in_processes(run_case, asked, jobs, until_s)


def in_processes(
    work: Callable[..., Result], asked: Iterable[tuple[Any, ...]], jobs: int, until_s: float = math.inf
) -> Iterator[Result]:
    """Yield what a function returns for each tuple of arguments, as it comes; none begins after a time."""
    timely = itertools.takewhile(lambda _: time.monotonic() < until_s, asked)
    if jobs <= 1:
        yield from (work(*each) for each in timely)
        return
    fresh = multiprocessing.get_context("spawn")  # so that the threads of numpy stay at one
    with ProcessPoolExecutor(jobs, mp_context=fresh) as pool:
        under_way = {pool.submit(work, *each) for each in itertools.islice(timely, jobs)}
        while under_way:
            finished, under_way = wait(under_way, return_when=FIRST_COMPLETED)
            under_way |= {pool.submit(work, *each) for each in itertools.islice(timely, len(finished))}
            yield from (each.result() for each in finished)


def say(line: str) -> None:
    """Tell how far the check is."""
    print(line, file=sys.stderr, flush=True)
