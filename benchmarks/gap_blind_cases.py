"""Cases of the check on withheld data: which seed asks for what, and one case from plant to record.

Every kind of case has its own block of seeds behind the first one, so that asking for more cases never
changes those already done. Seeds below ``SCORED_FROM`` are for development and calibration; what is scored
starts there.
"""

import contextlib
import hashlib
import importlib
import inspect
import json
import shutil
import sys
import time
import traceback
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [each for each in (str(ROOT), str(Path(__file__).parent)) if each not in sys.path]

import numpy as np  # noqa: E402

from gcode2krl import Prediction, load_cell, load_run, predict  # noqa: E402
from tests.plant.cases import make_case  # noqa: E402
from tests.plant.effects import LIBRARY, SLIPS, UNKNOWN  # noqa: E402
from tests.plant.scene import CELL_TOML  # noqa: E402
from tests.plant.waypoints import PROGRAMS  # noqa: E402

SCORED_FROM = 10_000
BLOCK = 1_000
KINDS = ("null", "single", "slip", "open", "pair", "deleted")
MIXED = {"null": 0.15, "single": 0.55, "slip": 0.08, "open": 0.10, "pair": 0.07, "deleted": 0.05}
FULL = {"null": 300, "single": 400}
DELETED = (
    "backlash",
    "friction",
    "transmission",
    "mastering",
    "stiffness",
    "servo_lag",
    "force_delay",
    "tool_wear",
    "thermal",
    "vibration",
)
"""Effects that are also tried with themselves taken out of the library."""


NOT_SIMULATED = ("other_program",)
"""Causes that can be found but not predicted, so there is no oracle."""


@dataclass(frozen=True)
class Case:
    """One case: its seed, its kind, and what the plant is asked for."""

    seed: int
    kind: str
    effect: str
    without: tuple[str, ...] = ()
    """Effects taken out of the library."""

    @property
    def name(self) -> str:
        """Return the name of its record."""
        return f"{self.kind}-{self.seed:05d}"


@dataclass(frozen=True)
class How:
    """Further computations for every case."""

    oracle: bool = True
    baselines: bool = True
    keep: bool = False
    """Keep the runs of the case."""
    code: str = ""
    """Fingerprint of the code under test; records of another one are made again."""
    predictions: dict[str, str] = field(default_factory=dict)


def plan(first_seed: int, counts: dict[str, int], effects: Sequence[str] = ()) -> list[Case]:
    """Return the cases of each kind; named effects alone where some are given, every one in turn.

    Raises ValueError where a block overflows, an effect is unknown, or both sorts of seeds mix.
    """
    last = first_seed + len(KINDS) * BLOCK - 1
    if first_seed < SCORED_FROM <= last:
        raise ValueError(
            f"seed {first_seed}: cases would reach seed {last}; calibration stays below {SCORED_FROM}, so "
            f"give at most {SCORED_FROM - len(KINDS) * BLOCK}, or {SCORED_FROM} and more for what is scored"
        )
    shelves = {
        "single": sorted(LIBRARY),
        "slip": sorted(SLIPS),
        "open": [f"open:{n}" for n in sorted(UNKNOWN)],
    }
    unknown = {name.partition("@")[0] for name in effects} - {
        name for shelf in shelves.values() for name in shelf
    }
    if unknown:
        raise ValueError(f"no effect {', '.join(sorted(unknown))}; python -m tests.plant.make_cases --list")
    cases: list[Case] = []
    for number, kind in enumerate(KINDS):
        count = counts.get(kind, 0)
        if count > BLOCK:
            raise ValueError(f"{count} cases of kind {kind}: at most {BLOCK}")
        names = [name for name in effects if name.partition("@")[0] in shelves.get(kind, ())]
        names = names or shelves.get(kind, [])
        for i in range(count if names or kind in ("null", "pair", "deleted") else 0):
            seed = first_seed + number * BLOCK + i
            cases.append(_case(kind, seed, i, names))
    return cases


def _case(kind: str, seed: int, i: int, names: Sequence[str]) -> Case:
    if kind == "null":
        return Case(seed, kind, "none")
    if kind == "pair":
        choice = np.random.default_rng(seed).choice(
            sorted(set(LIBRARY) - {"tool_diameter"}), 2, replace=False
        )
        return Case(seed, kind, "+".join(choice))
    if kind == "deleted":
        return Case(seed, kind, DELETED[i % len(DELETED)], (DELETED[i % len(DELETED)],))
    return Case(seed, kind, names[i % len(names)])


def mixed(count: int) -> dict[str, int]:
    """Return how many cases of each kind a mixed check has."""
    counts = {kind: round(share * count) for kind, share in MIXED.items()}
    counts["single"] += count - sum(counts.values())
    return counts


def fingerprint() -> str:
    """Return a digest of the code that a diagnosis depends on."""
    digest = hashlib.sha256()
    for room in ("gap", "effects"):
        for file in sorted((ROOT / "gcode2krl" / room).rglob("*.py")):
            digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


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


def run_case(case: Case, folder: Path, how: How) -> dict[str, Any]:
    """Make a case, diagnose it without its label, and return the record; an exception is part of it."""
    place = folder / "cases" / case.name
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    record: dict[str, Any] = {"case": asdict(case), "code": how.code, "error": None, "result": None}
    start = time.perf_counter()
    # the label is written beside the case, and taken away before the diagnosis starts
    parent = Path(next(iter(how.predictions.values()))).parent.as_posix()
    make_case(case.seed, place / "case", case.effect, predictions=parent)
    record["label"] = json.loads((place / "case.label.json").read_text(encoding="utf-8"))
    (place / "case.label.json").unlink()
    record["plant_s"] = time.perf_counter() - start
    try:
        _diagnose(case, place / "case", how, record)
        _beside(case, place / "case", how, record)
    except Exception:  # the check goes on, and shows it
        record["error"] = traceback.format_exc()
    if not how.keep:
        shutil.rmtree(place, ignore_errors=True)
    return record


def loaded(place: Path, names: Sequence[str]) -> tuple[list[Any], list[Prediction]]:
    """Return the runs of a case and the prediction that each names."""
    runs = [load_run(place / name) for name in names]
    return runs, [Prediction.load(run.path("prediction") or "") for run in runs]


def _diagnose(case: Case, place: Path, how: How, record: dict[str, Any]) -> None:
    from gcode2krl.gap import diagnose

    start, own = time.perf_counter(), time.process_time()
    names = sorted(each.name for each in place.glob("run-*"))
    runs = [load_run(place / name) for name in names]
    prediction = Prediction.load(runs[0].path("prediction") or "")
    with removed(case.without) as extra:
        record["result"] = diagnose(prediction, runs, **extra).as_dict()
    record["diagnosis_s"] = time.perf_counter() - start
    record["diagnosis_cpu_s"] = time.process_time() - own


def _beside(case: Case, place: Path, how: How, record: dict[str, Any]) -> None:
    """Add the results of an oracle and of simple methods on the same case."""
    label = record["label"]
    names = [run["run"] for run in label["runs"]]
    first = label["effects"][0] if label["effects"] else {"effect": "", "ratio": 0.0}
    possible = case.kind in ("single", "slip") and first["effect"] not in NOT_SIMULATED
    if how.oracle and possible and first["ratio"] >= 1.0:
        from gap_blind_oracle import oracle

        record["oracle"] = oracle(label, record["result"], place, names)
    if how.baselines and case.kind in ("null", "single"):
        from gap_blind_baselines import baselines

        record["baselines"] = baselines(place, names, how.predictions)


@contextlib.contextmanager
def removed(effects: Sequence[str]) -> Iterator[dict[str, Any]]:
    """Yield what `diagnose` is called with so that these effects are not in its library."""
    module = importlib.import_module("gcode2krl.gap.diagnosis")
    if not effects:
        yield {}
    elif "exclude" in inspect.signature(module.diagnose).parameters:
        yield {"exclude": tuple(effects)}
    else:
        whole = module.known_effects
        module.known_effects = lambda extra: {k: v for k, v in whole(extra).items() if k not in effects}
        try:
            yield {}
        finally:
            module.known_effects = whole
