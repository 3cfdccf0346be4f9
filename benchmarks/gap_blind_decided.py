"""How far the truth of each case is from its best imitators, in nats, kept with its label.

Computed by `tests/plant/decidability.py` from the label alone, so that stored records of any code get it too.
"""

import functools
import json
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from gap_blind_workers import in_processes

from tests.plant import plans
from tests.plant.decidability import of_plan
from tests.plant.kinds import MISSING
from tests.plant.mismatch import Law
from tests.plant.plans import Options, Plan
from tests.plant.signatures import Library, digest

KEY = "nats"
"""Entry of an effect in a label: distances, imitators and class; None where they are not known."""
ONE_FORM = ("confounded", "story")
"""Kinds whose effects have their own form whatever was asked for."""


def plan_of(label: dict[str, Any]) -> Plan | None:
    """Return the plant's plan of a stored label; None where today's plant no longer draws that case."""
    made = label.get("made_with") or {}
    form = "same" if made.get("kind") in ONE_FORM else made.get("form")
    options = Options(
        effect=label["asked"],
        form=form,
        law=Law(**label["mismatch_law"]),
        foreign_noise=bool(label["foreign_noise"]),
        missing=MISSING.get(label.get("missing", ""), ()),
    )
    try:
        plan = plans.draw(label["seed"], options)
    except ValueError:
        return None
    drawn = [(fault.kind.name, fault.target, fault.form) for fault in plan.faults]
    stored = [(each["effect"], each["target"], each["form_name"]) for each in label["effects"]]
    days = [(day.program, day.age_s) for day in plan.days]
    alike = days == [(run["program"], run["age_s"]) for run in label["runs"]] and drawn == stored
    return plan if alike and plan.how.tracker_mm == label["instruments"]["tracker_mm"] else None


def decided(label: dict[str, Any], without: Sequence[str], folder: Path) -> list[dict[str, Any] | None]:
    """Return the distances of each effect of a label; None where they are not known."""
    plan = plan_of(label) if label["effects"] else None
    if plan is None:
        return [None] * len(label["effects"])
    found = of_plan(plan, [each["size"] for each in label["effects"]], _library(folder), without)
    return [None if each is None else _plain(each.as_dict()) for each in found]


def decide(
    records: Iterable[dict[str, Any]], folder: Path, jobs: int, until_s: float
) -> Iterator[dict[str, Any]]:
    """Yield each record whose effects lack distances of this state of the plant, with them."""
    state = digest()
    left = [r for r in records if r["label"]["effects"] and r.get("nats_of") != state]
    asked = ((record, folder, state) for record in left)
    yield from in_processes(_with_distances, asked, jobs, until_s)


def _with_distances(record: dict[str, Any], folder: Path, state: str) -> dict[str, Any]:
    label = record["label"]
    found = decided(label, record["case"].get("without") or (), folder)
    for entry, each in zip(label["effects"], found, strict=True):
        entry[KEY] = each
    return record | {"nats_of": state}


@functools.cache
def _library(folder: Path) -> Library:
    """Signatures of this process; the files are shared with the others."""
    return Library(folder)


def _plain(values: dict[str, Any]) -> dict[str, Any]:
    """Return numbers that JSON can write."""
    return json.loads(json.dumps(values, default=lambda value: float(np.asarray(value))))
