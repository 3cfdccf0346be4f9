"""What the stored records of the check teach: the tests of each cause, and what was right of it."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from blind.cases import SCORED_FROM
from blind.score import VERDICTS, Truth, allowed_by, is_among, names, probabilities, says_family, truth_of

from gcode2krl.gap.posterior.calibrated import (
    DEPENDENCE,
    FAMILY,
    FAMILY_NAMES,
    FAMILY_TERMS,
    NAME,
    NAMES,
    UNKNOWN,
    goodnesses,
)
from gcode2krl.gap.thresholds import THRESHOLDS

OUTSIDE = ("open", "deleted")
"""Kinds whose cause the library lacks."""


class RecordsError(Exception):
    """The records cannot be used; the message says why."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """One cause, or one family of a rest, of one case."""

    case: str
    kind: str
    group: frozenset[str]
    """The true effects; that of an effect-free case is its kind."""
    u: tuple[float | None, ...]
    right: dict[str, bool]
    """Probability -> whether it should have been 1."""
    before: float
    """The probability that the answer stated."""
    conditions_failed: bool = False


def records_of(folder: Path) -> list[dict[str, Any]]:
    """Return the records of a folder that the check has resumed, failed ones left out.

    Raises RecordsError without any, for sealed seeds, and for records of other tests.
    """
    records = [json.loads(file.read_text(encoding="utf-8")) for file in sorted(_files(folder))]
    records = [record for record in records if record.get("result")]
    if not records:
        raise RecordsError(f"no records in {folder}: run benchmarks/blind/check.py --resume {folder}")
    sealed = [record["case"]["seed"] for record in records if record["case"]["seed"] >= SCORED_FROM]
    if sealed:
        raise RecordsError(f"seed {sealed[0]} is scored: nothing is calibrated on seeds from {SCORED_FROM}")
    for record in records:
        _check(record)
    return [record for record in records if _teaches(record)]


def _teaches(record: dict[str, Any]) -> bool:
    """Tell whether a case says anything of names.

    Where the library lacks the cause and a simple effect of it fits as well, no data can tell them apart; a
    clock that is really twice as far off as clocks usually are is rightly found.
    """
    kind, entries = record["case"]["kind"], record["label"]["effects"]
    imitated = kind in OUTSIDE and any(entry.get("stand_ins") for entry in entries)
    return not imitated and kind != "null_foreign_mismatch"


def _files(folder: Path) -> list[Path]:
    return list((folder / "results").glob("*.json"))


def _check(record: dict[str, Any]) -> None:
    result = record["result"]
    tested = [(cause.get("tests"), NAMES) for cause in _causes(result)]
    tested += [(each.get("tests"), FAMILY_NAMES) for each in _rest(result)]
    if any(tests is None or tuple(tests) != tuple(wanted) for tests, wanted in tested):
        raise RecordsError(f"the record {name_of(record)} has other tests than this code: make it again")


def name_of(record: dict[str, Any]) -> str:
    """Return the name of a record's case."""
    return f"{record['case']['kind']}-{record['case']['seed']:05d}"


def _causes(result: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the causes that tests were made of: no slips, and none of the part's surface."""
    return [cause for cause in result["causes"] if cause.get("tests")]


def _rest(result: dict[str, Any]) -> list[dict[str, Any]]:
    return list(result["unexplained"].get("depends_on") or ())


def truths_of(record: dict[str, Any]) -> tuple[Truth, ...]:
    """Return effects and targets that a name may be, none where the library lacks them."""
    truths = tuple(truth_of(entry) for entry in record["label"]["effects"])
    return truths if VERDICTS.get(record["case"]["kind"]) is None else ()


def group_of(record: dict[str, Any]) -> frozenset[str]:
    """Return the true effects, of a case without any its kind."""
    effects = frozenset(entry["effect"] for entry in record["label"]["effects"])
    return effects or frozenset({record["case"]["kind"]})


def with_set(cause: dict[str, Any], alike_nats: float) -> dict[str, Any]:
    """Return a cause with the set that this threshold declares."""
    behind = sorted(compared(cause), key=lambda each: each["behind_nats"])
    alike = [each for each in behind if each["behind_nats"] < alike_nats]
    return cause | {"indistinguishable_from": alike[: THRESHOLDS.answer.most_alike]}


def compared(cause: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the effects that were refitted in place of a cause."""
    every = [*(cause.get("indistinguishable_from") or ()), *(cause.get("rivals") or ())]
    return [each for each in every if each.get("behind_nats") is not None]


def cause_rows(records: Sequence[dict[str, Any]], alike_nats: float) -> Iterator[Row]:
    """Yield a row for each cause."""
    for record in records:
        allowed = [each for entry in record["label"]["effects"] if (each := allowed_by(entry)) is not None]
        for cause in _causes(record["result"]):
            named = is_among(with_set(cause, alike_nats), truths_of(record))
            yield Row(
                case=name_of(record),
                kind=record["case"]["kind"],
                group=group_of(record),
                u=tuple(goodnesses(cause["tests"])),
                right={
                    NAME: named,
                    FAMILY: named or any(says_family(cause, each) for each in allowed),
                    UNKNOWN: record["case"]["kind"] in OUTSIDE,
                },
                before=cause["probability"],
                conditions_failed=bool(cause["tests"]["conditions_failed"]),
            )


def family_rows(records: Sequence[dict[str, Any]]) -> Iterator[Row]:
    """Yield a row for the family with the most evidence in each signal, where one effect is at work."""
    for record in records:
        entries = record["label"]["effects"]
        if len(entries) > 1:
            continue
        rest = _rest(record["result"])
        stated = probabilities(entries[0], record["result"]) if entries else [(0.0, False)] * len(rest)
        for each, (_, right) in zip(rest, stated, strict=False):
            if each["tests"]["lead_nats"] < 0.0:
                continue
            yield Row(
                case=name_of(record),
                kind=record["case"]["kind"],
                group=group_of(record),
                u=tuple(goodnesses(each["tests"], FAMILY_TERMS)),
                right={DEPENDENCE: right},
                before=each["probability"],
            )


@dataclass(frozen=True)
class Behind:
    """A truth of a case, and by how much the answer has it behind its best; None where not compared."""

    group: frozenset[str]
    nats: float | None


def behind_of(records: Sequence[dict[str, Any]]) -> Iterator[Behind]:
    """Yield each truth that a name may be, where causes were found."""
    for record in records:
        causes = _causes(record["result"])
        if not causes:
            continue
        for truth in truths_of(record):
            found = [0.0 for cause in causes if names(cause, truth)]
            found += [
                max(each["behind_nats"], 0.0)
                for cause in causes
                for each in compared(cause)
                if names(each, truth)
            ]
            yield Behind(group_of(record), min(found, default=None))


def without_cause(records: Sequence[dict[str, Any]]) -> list[bool]:
    """Return of each gap for which no effect was accepted whether the library lacks its cause."""
    return [
        record["case"]["kind"] in OUTSIDE
        for record in records
        if record["result"]["verdict"] == "unexplained" and not record["result"]["causes"]
    ]
