"""Figures of the check: rates with bounds, errors of probabilities, the worst group, classes of decidability.

**Classes**: what the data can decide, can narrow down, and cannot decide. A case's class is that of the least
decidable of its effects. A miss counts where the gap itself is plain: at least ten nats beside mismatch
alone. How far the truth of each case is from its best imitators, in nats, is computed by
`tests/plant/decidability.py` from the label alone, so that stored records of any code get it too.
"""

import functools
import json
from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from blind.cases import in_processes
from blind.score import Judged

from tests.plant import plans
from tests.plant.decidability import of_plan
from tests.plant.kinds import MISSING
from tests.plant.mismatch import Law
from tests.plant.plans import Options, Plan
from tests.plant.signatures import Library, digest

Item = TypeVar("Item")
Pairs = Sequence[tuple[float, bool]]
"""Probabilities, each with whether it was right."""
LEAST_PROBABILITY = 1e-3
"""A statement that is certain and wrong costs the log score as much as this one."""


@dataclass(frozen=True)
class Rate:
    """A fraction of cases, with its one-sided 95 % bounds (Clopper and Pearson 1934)."""

    count: int
    of: int

    @property
    def value(self) -> float:
        """Return the fraction, NaN without cases."""
        return self.count / self.of if self.of else float("nan")

    @property
    def lower(self) -> float:
        """Return the lower bound of the true rate."""
        from scipy.stats import beta

        return float(beta.ppf(0.05, self.count, self.of - self.count + 1)) if self.count else 0.0

    @property
    def upper(self) -> float:
        """Return the upper bound of the true rate."""
        from scipy.stats import beta

        return float(beta.ppf(0.95, self.count + 1, self.of - self.count)) if self.count < self.of else 1.0


def rate(flags: Iterable[bool]) -> Rate:
    """Return the fraction of true flags."""
    flags = list(flags)
    return Rate(sum(flags), len(flags))


def grouped(items: Iterable[Item], key: Callable[[Item], Hashable]) -> dict[Hashable, list[Item]]:
    """Return the items of each key, in the order of the keys' names."""
    found: dict[Hashable, list[Item]] = defaultdict(list)
    for item in items:
        found[key(item)].append(item)
    return dict(sorted(found.items(), key=lambda entry: str(entry[0])))


def worst(
    items: Iterable[Item], key: Callable[[Item], Hashable], flag: Callable[[Item], bool], high: bool
) -> tuple[Hashable, Rate] | None:
    """Return the group that is furthest from its aim, and its rate; the larger of equal ones.

    ``high``: the rate ought to be high. None without items, or where no group is off at all.
    """
    rates = {name: rate(flag(item) for item in group) for name, group in grouped(items, key).items()}
    off = {name: each for name, each in rates.items() if each.value != (1.0 if high else 0.0)}
    if not off:
        return None
    return min(off.items(), key=lambda entry: ((1.0 if high else -1.0) * entry[1].value, -entry[1].of))


def calibration_error(pairs: Pairs, bins: int = 10) -> float:
    """Return the expected calibration error (Naeini et al. 2015), bins of equal width; NaN without pairs."""
    if not pairs:
        return float("nan")
    p, right = np.array([pair[0] for pair in pairs]), np.array([pair[1] for pair in pairs], float)
    place = np.minimum((p * bins).astype(int), bins - 1)
    return float(
        sum(
            abs(p[place == b].mean() - right[place == b].mean()) * np.mean(place == b)
            for b in np.unique(place)
        )
    )


def brier(pairs: Pairs) -> float:
    """Return the mean squared error of the probabilities (Brier 1950); NaN without pairs."""
    return float(np.mean([(p - right) ** 2 for p, right in pairs])) if pairs else float("nan")


def log_score(pairs: Pairs) -> float:
    """Return the mean of -log of the probability of what was the case (Good 1952); NaN without pairs."""
    if not pairs:
        return float("nan")
    said = np.array([p if right else 1.0 - p for p, right in pairs])
    return float(np.mean(-np.log(np.clip(said, LEAST_PROBABILITY, 1.0))))


def smallest_seen(ratios: Sequence[tuple[float, bool]], share: float = 0.9) -> float | None:
    """Return the smallest ratio from which on this share of the larger ones is right; None without."""
    ordered = sorted(ratios, key=lambda pair: -pair[0])
    found = None
    right = 0
    for count, (ratio, is_right) in enumerate(ordered, start=1):
        right += is_right
        if is_right and right >= share * count:
            found = ratio
    return found


CLASSES = ("decidable", "open", "undecidable", "not known")
PLAIN = 10.0
"""Nats beside mismatch from which on a gap is plainly there."""
UNKNOWN = ("open", "deleted")
KNOWN = ("single", "missing", "confounded")

Flag = Callable[[Judged], bool]
Line = tuple[str, Flag, Flag, bool]
"""Metric, which cases it counts, what it counts, and whether much of it is good."""

LINES: tuple[Line, ...] = (
    ("said no gap, gap >= 10 nats", lambda e: e.is_plain, lambda e: e.verdict == "no_gap", False),
    ("one effect: something else named", lambda e: e.kind in KNOWN, lambda e: e.is_wrongly_named, False),
    ("  exact", lambda e: e.kind in KNOWN, lambda e: e.exact, True),
    ("  declared set", lambda e: e.kind in KNOWN, lambda e: e.declared, True),
    ("  set holds truth", lambda e: e.kind in KNOWN, lambda e: e.in_a_set, True),
    ("  family and place, or declared", lambda e: e.kind in KNOWN, lambda e: e.family_or_name, True),
    ("unknown: wrongly named", lambda e: e.kind in UNKNOWN, lambda e: bool(e.named), False),
    ("  flagged", lambda e: e.kind in UNKNOWN, lambda e: e.flagged, True),
    ("  set holds an unknown", lambda e: e.kind in UNKNOWN, lambda e: e.in_a_set or e.flagged, True),
    ("  place", lambda e: e.kind in UNKNOWN, lambda e: e.told is not None and e.told.place, True),
    ("  family and place", lambda e: e.kind in UNKNOWN, lambda e: e.told is not None and e.told.family, True),
    ("pair: both exact", lambda e: e.kind == "pair", lambda e: e.exact, True),
    ("  both located", lambda e: e.kind == "pair", lambda e: e.located, True),
    ("event: flagged or named", lambda e: e.kind == "story", lambda e: e.alarms, True),
    ("  moment within 20 ms", lambda e: e.moment is not None, lambda e: bool(e.moment), True),
)


def class_rows(cases: Sequence[Judged]) -> list[tuple[str, ...]]:
    """Return a row for each metric: its rate with a one-sided 95 % bound in each class."""
    rows = [("cases with an effect", *(str(sum(e.decidability == c for e in cases)) for c in CLASSES))]
    for metric, counts, flag, high in LINES:
        of_class = [[e for e in cases if e.decidability == c and counts(e)] for c in CLASSES]
        if any(of_class):
            rows.append((metric, *(_text(rate(flag(e) for e in some), high) for some in of_class)))
    return rows


def _text(one: Rate, high: bool) -> str:
    if not one.of:
        return "-"
    bound = f">= {one.lower:.3f}" if high else f"<= {one.upper:.3f}"
    return f"{one.value:.3f} ({bound}, n {one.of})"


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
