"""One judgement for each record: is the answer right, and how right are its parts.

A cause counts as named from probability 0.5. *Exact*: the named causes are the truth, no more and no less.
*Declared*: each named cause or one that it declares indistinguishable is a truth, and every truth is covered.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from gap_blind_depends import Told, located, told
from gap_blind_depends import probabilities as depends_probabilities
from gap_blind_moments import moment_hit
from gap_blind_names import Truth, covers, declares, is_among, named_of, names, text
from gap_blind_numbers import numbers
from gap_blind_places import NOISE, OWN, overlap, worst_of
from gap_blind_tests import Tested, tested_of
from gap_blind_words import truth_of

from tests.plant.decidability import DECIDABLE, class_of

UNKNOWN = ("unexplained", "partly_explained")
NULLS = ("null", "null_foreign_noise", "null_foreign_mismatch")
VERDICTS = dict.fromkeys(NULLS, ("no_gap",)) | {"open": UNKNOWN, "deleted": UNKNOWN}
"""The right verdicts where no cause is right."""
LEAST_REMOVED = 0.1
"""An oracle that removes less of the power than this gives no figure for shrink."""


@dataclass(frozen=True, kw_only=True)
class Place:
    """Overlap with the label's place, by its two definitions."""

    own: float | None = None
    noise: float | None = None


@dataclass(frozen=True, kw_only=True)
class Judged:
    """One case, judged."""

    seed: int
    kind: str
    truths: tuple[Truth, ...]
    subject: str
    """What the worst of a row is looked for among: the true effects, or what is foreign."""
    form: str
    ratio: float
    """RMS of the smallest true effect over the noise."""
    beyond: float = 0.0
    """The same of what normal mismatch could not do of it; the ratio itself where that is not known."""
    is_imitated: bool = False
    """A simple effect of the library fits the change to within the noise."""
    is_undecided: bool = False
    """What is left of the data cannot say which effect it is."""
    plant_s: float = 0.0
    seconds: float = 0.0
    cpu_s: float = 0.0
    plant_cpu_s: float = 0.0
    beside_cpu_s: float = 0.0
    """Oracle and simple methods."""
    foreign: tuple[str, ...] = ()
    """Each kind of noise, or the law of the mismatch, that the usual cases do not have."""
    failed: bool = True
    """An exception instead of an answer."""
    verdict: str = "failed"
    named: tuple[Truth, ...] = ()
    exact: bool = False
    declared: bool = False
    hit: bool = False
    """Every truth is among the named ones, whatever else is."""
    in_a_set: bool = False
    """Every truth is among the causes listed or their sets, however probable."""
    is_wrongly_named: bool = False
    """A named cause whose declared set holds no truth."""
    probabilities: tuple[tuple[float, bool], ...] = ()
    """Of each cause, and whether it or its set is a truth."""
    depends: tuple[tuple[float, bool], ...] = ()
    """Of each stated dependence, and whether it is right."""
    has_rest: bool = False
    """What is left is significant."""
    told: Told | None = None
    located: bool = False
    """Each truth has a statement of its own with its place."""
    moment: bool | None = None
    """A moment that is told is one of the truth's, to 20 ms; None where the truth has none."""
    nats: float | None = None
    """Distance of the least decidable effect from its best imitators; None where it is not known."""
    gap_nats: float | None = None
    """The same beside mismatch alone."""
    tested: tuple[Tested, ...] = ()
    next_program: str | None = None
    shrink: float | None = None
    errors: tuple[float, ...] = ()
    covered: tuple[bool, ...] = ()
    place: Place = Place()
    baselines: tuple[tuple[str, bool], ...] = ()

    @property
    def observable(self) -> bool:
        """Tell whether the effect is as large as the noise."""
        return self.ratio >= 1.0

    @property
    def decidable(self) -> bool:
        """Tell whether mismatch leaves as much as the noise of it, and no simple effect fits it."""
        return self.beyond >= 1.0 and not self.is_imitated

    @property
    def decidability(self) -> str:
        """Return the class of the case; empty without an effect."""
        if not self.truths:
            return ""
        return "not known" if self.nats is None else class_of(self.nats)

    @property
    def is_plain(self) -> bool:
        """Tell whether mismatch is too far from the truth to explain it away."""
        return self.gap_nats is not None and self.gap_nats >= DECIDABLE

    @property
    def flagged(self) -> bool:
        """Tell whether the answer says that something is unknown."""
        return self.verdict in UNKNOWN

    @property
    def alarms(self) -> bool:
        """Tell whether the answer says that something is wrong at all."""
        return bool(self.named) or self.verdict != "no_gap"

    @property
    def family_or_name(self) -> bool:
        """Tell whether place and family are right; a right name says both."""
        return self.declared or (self.told is not None and self.told.family)

    @property
    def name(self) -> str:
        """Return the true causes."""
        return " + ".join(text(one) for one in self.truths) or "none"

    @property
    def answer(self) -> str:
        """Return the named causes."""
        return " + ".join(text(one) for one in self.named) or self.verdict


def _beyond(entry: dict[str, Any]) -> float:
    left = entry.get("left_by_mismatch")
    return float(entry["ratio"] if left is None else left)


def _known(entries: list[dict[str, Any]], which: str) -> list[float] | None:
    found = [(entry.get("nats") or {}).get(which) for entry in entries]
    return None if not found or any(each is None for each in found) else [float(each) for each in found]


def _least(entries: list[dict[str, Any]], which: str) -> float | None:
    known = _known(entries, which)
    return None if known is None else min(known)


def _most(entries: list[dict[str, Any]], which: str) -> float | None:
    known = _known(entries, which)
    return None if known is None else max(known)


def judge(record: dict[str, Any]) -> Judged:
    """Return the judgement of a record; one without a result counts as wrong."""
    label, case, result = record["label"], record["case"], record.get("result")
    entries = label["effects"]
    truths = tuple(truth_of(entry) for entry in entries)
    known = {} if result is None else _answered(case["kind"], entries, truths, record)
    return Judged(
        seed=case["seed"],
        kind=case["kind"],
        truths=truths,
        subject=" + ".join(sorted(effect for effect, _ in truths)) or " + ".join(_foreign(label)) or "usual",
        form="other" if any(entry["form"] == "other" for entry in entries) else "same",
        ratio=min((entry["ratio"] for entry in entries), default=0.0),
        beyond=min((_beyond(entry) for entry in entries), default=0.0),
        is_imitated=any(entry.get("stand_ins") for entry in entries),
        is_undecided=bool(label.get("undecided")),
        plant_s=record.get("plant_s", 0.0),
        seconds=record.get("diagnosis_s", 0.0),
        cpu_s=record.get("diagnosis_cpu_s", 0.0),
        plant_cpu_s=record.get("plant_cpu_s", 0.0),
        beside_cpu_s=record.get("beside_cpu_s", 0.0),
        foreign=_foreign(label),
        nats=_least(entries, "two"),
        gap_nats=_most(entries, "mismatch"),
        failed=record.get("error") is not None,
        baselines=_baselines(record, truths),
        **known,
    )


def _foreign(label: dict[str, Any]) -> tuple[str, ...]:
    """Return what is foreign about a case: channel and kind of each noise, or the law of its mismatch."""
    noise = sorted({f"{each['channel']} {each['kind']}" for each in label.get("foreign_noise") or ()})
    law = label.get("mismatch_law") or {"shape": "uniform"}
    wide = [] if law["shape"] == "uniform" else [f"{law['scale']:g} x {law['shape']}"]
    return (*noise, *wide)


def _answered(
    kind: str, entries: list[dict[str, Any]], truths: tuple[Truth, ...], record: dict[str, Any]
) -> dict[str, Any]:
    result = record["result"]
    allowed = VERDICTS.get(kind)
    right = truths if allowed is None else ()
    causes, named = result["causes"], named_of(result)
    possible = len(named) == len(right) and (allowed is None or result["verdict"] in allowed)
    found = {
        "verdict": result["verdict"],
        "named": tuple((cause["effect"], cause["target"]) for cause in named),
        "exact": possible and covers(named, right),
        "declared": possible and covers(named, right, declares),
        "hit": bool(right) and covers(named, right),
        "in_a_set": bool(right) and covers(causes, right, declares),
        "is_wrongly_named": not all(is_among(cause, right) for cause in named),
        "probabilities": tuple((cause["probability"], is_among(cause, right)) for cause in causes),
        "tested": tested_of(result, right),
        "has_rest": bool(result["unexplained"].get("significant")),
        "next_program": (result.get("next_run") or {}).get("program"),
        "located": located(entries, result),
        "moment": moment_hit(entries, result),
    }
    return found | (_one_effect(kind, entries[0], record) if len(entries) == 1 else {})


def _one_effect(kind: str, entry: dict[str, Any], record: dict[str, Any]) -> dict[str, Any]:
    """Return place, family, size and shrink where one effect is at work."""
    result = record["result"]
    found: dict[str, Any] = {
        "told": told(entry, result),
        "depends": tuple(depends_probabilities(entry, result)),
        "shrink": _relative_shrink(record),
    }
    if result["verdict"] != "no_gap":
        said = result["where"].get("intervals") or []
        found["place"] = Place(own=overlap(entry, worst_of(said), OWN), noise=overlap(entry, said, NOISE))
    truth = truth_of(entry)
    right = [cause for cause in named_of(result) if names(cause, truth)]
    if right and kind == "single" and entry["form"] == "same":
        found["errors"], found["covered"] = numbers(entry, right[0])
    return found


def _relative_shrink(record: dict[str, Any]) -> float | None:
    """Return the power that the named causes remove over what the truth removes, on held-out data."""
    gap, known = record["result"]["gap"], record.get("oracle")
    if not gap.get("held_out") or gap.get("shrink") is None or known is None:
        return None
    if known["removed"] <= LEAST_REMOVED * known["before"]:
        return None
    gone = gap["rms_before"] ** 2 - gap["rms_after"] ** 2
    return float(np.clip(gone / known["removed"], 0.0, 1.0))


def _baselines(record: dict[str, Any], truths: tuple[Truth, ...]) -> tuple[tuple[str, bool], ...]:
    """Return for each simple method whether it names the truth and nothing else."""
    right = sorted(truths, key=str)
    return tuple(
        (method, sorted(map(tuple, named), key=str) == right)
        for method, named in (record.get("baselines") or {}).items()
    )
