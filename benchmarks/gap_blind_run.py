"""One case of the check: the plant makes it, the diagnosis answers without its label, a record keeps both."""

import hashlib
import json
import shutil
import time
import traceback
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from gap_blind_cases import NULLS, ROOT, Case

from gcode2krl import Prediction, load_run
from tests.plant.cases import store
from tests.plant.kinds import plan_of
from tests.plant.plans import Plan

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
    baselines: int = 5
    """Simple methods beside each case whose seed is a multiple of this; 0: none."""
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
        _beside(case, place / "case", how, record, predictions)
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
    store(plan, folder, Path(next(iter(predictions.values()))).parent.as_posix(), more)
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


def _beside(case: Case, folder: Path, how: How, record: dict[str, Any], predictions: dict[str, str]) -> None:
    """Add the results of an oracle and of simple methods on the same case."""
    label = record["label"]
    first = label["effects"][0] if label["effects"] else {"effect": "", "ratio": 0.0}
    possible = case.kind in ("single", "slip") and first["effect"] not in NOT_PREDICTED
    if how.oracle and possible and first["ratio"] >= 1.0:
        from gap_blind_oracle import oracle

        record["oracle"] = oracle(label, record["result"], *loaded(folder))
    beside = how.baselines and case.seed % how.baselines == 0
    if beside and case.kind in (*NULLS, "single"):
        from gap_blind_baselines import baselines

        record["baselines"] = baselines(loaded(folder)[0], predictions)
