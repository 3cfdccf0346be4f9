"""Fit the probabilities of the diagnosis to stored cases of the check, and write their table.

``python benchmarks/blind/calibrate.py FOLDER`` reads the records that ``check.py`` has left in the folder
of its ``--resume``, fits what ``gcode2krl/gap/posterior/calibrated.py`` uses, prints its errors
with whole effects left out and what each test is worth, and writes ``gcode2krl/gap/probabilities.json`` (or
``-o TABLE``).

The weights w >= 0 and the bias b are the most probable ones under a prior of conditional means (Bedrick,
Christensen & Johnson 1996): as if a few cases had been seen in which one test alone is as bad as can be. It
speaks for tests that hardly ever fail in the cases there are, and becomes small beside some hundred of them.
Scores are then stretched so that they are right of effects that the model was not fitted to.
Effect-free cases and those whose cause the library lacks count together as much as all others.
"""

import argparse
import json
import math
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from blind.cases import SCORED_FROM
from blind.figures import rate
from blind.score import VERDICTS, Truth, allowed_by, is_among, names, probabilities, says_family, truth_of

from gcode2krl.arrays import Floats
from gcode2krl.gap.posterior.calibrated import (
    DEPENDENCE,
    FAMILY,
    FAMILY_NAMES,
    FAMILY_TERMS,
    MOST_UNNAMED,
    NAME,
    NAMES,
    UNKNOWN,
    Head,
    Probabilities,
    clipped,
    goodnesses,
    probability_of,
    terms_of,
)
from gcode2krl.gap.thresholds import TABLE, THRESHOLDS

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


ALL_BEST, ALL_BEST_CASES = 0.97, 10.0
"""Prior: how probable what is asked for is where every test is at its best, and what that counts as."""
ONE_WORST = {
    "surprise": 0.3,
    "size": 0.5,
    "family": 0.2,
    "form": 0.2,
    "constant": 0.3,
    "shape": 0.5,
    "folds": 0.2,
    "shrink": 0.05,
    "together": 0.3,
    "beside": 0.2,
    "left": 0.1,
    "few": 0.2,
    "gap": 0.3,
    "conditions": 0.1,
    "lead": 0.1,
    "share": 0.3,
    "chance": 0.3,
    "largest": 0.2,
    "first": 0.3,
}
"""Prior: the same where one test is at its worst and all others at their best."""
PRIOR_CASES = 1.0
"""What each of these counts as."""
_SPREAD = 10.0
"""Standard deviation of a weight in a flat prior, which keeps the search finite."""
_STRETCH = np.array([0.2, 0.5])
"""Standard deviations of slope and shift before any scores were seen: few rows hardly move them."""
_LEAST_SLOPE = 0.5
"""However wrong some unseen effects are, all tests keep half of their say."""
COVERAGE = 0.95
_BINS = 10


def weights_of(rows: Sequence[Row]) -> Floats:
    """Return the weight (n,) of each row; families of one case, which may be many, share one."""
    families = Counter(row.case for row in rows if DEPENDENCE in row.right)
    weights = np.array([1.0 / max(families[row.case], 1) for row in rows])
    foreign = np.array([row.kind in OUTSIDE or row.kind.startswith("null") for row in rows])
    if foreign.all() or not foreign.any():
        return weights
    half = 0.5 * weights.sum()
    return np.where(foreign, half / weights[foreign].sum(), half / weights[~foreign].sum()) * weights


def missing_of(rows: Sequence[Row], terms: int) -> tuple[float, ...]:
    """Return the mean of each term over the rows that have it; 1 where none has."""
    known = [[row.u[term] for row in rows if row.u[term] is not None] for term in range(terms)]
    return tuple(round(float(np.mean(each)), 3) if each else 1.0 for each in known)


def fitted(rows: Sequence[Row], head: str, without: int | None = None) -> Head:
    """Return the model of one probability; ``without`` is a term that is left out."""
    terms, falls = list(terms_of(head)), head == UNKNOWN
    missing = missing_of(rows, len(terms))
    prior_u, prior_y, prior_weight = _prior(terms)
    u = np.vstack([_filled(rows, missing), prior_u])
    best = _logistic(
        np.column_stack([np.ones(len(u)), u]),
        np.concatenate([_good(rows, head), prior_y]),
        np.concatenate([weights_of(rows), prior_weight]),
        centre=np.zeros(len(terms) + 1),
        spread=np.array([np.inf, *[_SPREAD] * len(terms)]),
        bounds=[(None, None), *((0.0, 0.0 if term == without else None) for term in range(len(terms)))],
    )
    return Head(round(float(best[0]), 4), tuple(np.round(best[1:], 4).tolist()), missing, falls)


def _good(rows: Sequence[Row], head: str) -> Floats:
    """Return of each row (n,) whether better tests speak for what it was."""
    return np.array([row.right[head] != (head == UNKNOWN) for row in rows], dtype=float)


def _logistic(
    x: Floats,
    y: Floats,
    weight: Floats,
    *,
    centre: Floats,
    spread: Floats,
    bounds: Sequence[tuple[float | None, float | None]],
) -> Floats:
    """Return the coefficients (p,) of a logistic model, normal about ``centre`` before the rows were seen."""
    from scipy import special
    from scipy.optimize import minimize

    def cost(b: Floats) -> tuple[float, Floats]:
        score, away = x @ b, (b - centre) / spread**2
        loss = float(weight @ (np.logaddexp(0.0, score) - y * score)) + 0.5 * float(away @ (b - centre))
        return loss, x.T @ (weight * (special.expit(score) - y)) + away

    best: Floats = minimize(cost, centre, jac=True, bounds=bounds, method="L-BFGS-B").x
    return best


def _prior(terms: Sequence[str]) -> tuple[Floats, Floats, Floats]:
    """Return the tests (t + 1, t) of the prior's cases, how probable it is (t + 1,) and their weights."""
    tests = np.vstack([1.0 - np.eye(len(terms)), np.ones(len(terms))])
    probable = np.array([*(ONE_WORST[term] for term in terms), ALL_BEST])
    return tests, probable, np.array([*[PRIOR_CASES] * len(terms), ALL_BEST_CASES])


def _filled(rows: Sequence[Row], missing: Sequence[float]) -> Floats:
    return np.array(
        [[m if u is None else u for u, m in zip(row.u, missing, strict=True)] for row in rows], dtype=float
    ).reshape(len(rows), len(missing))


def unseen_scores(rows: Sequence[Row], head: str, without: int | None = None) -> Floats:
    """Return the score (n,) of each row by a model of the rows that share no true effect with it."""
    scores = np.zeros(len(rows))
    for group in {row.group for row in rows}:
        model = fitted([row for row in rows if not row.group & group], head, without)
        for i, row in enumerate(rows):
            if row.group == group:
                scores[i] = model.score(row.u)
    return scores


@dataclass(frozen=True)
class Stretch:
    """slope·score + shift: what makes scores of unseen effects right (Platt 1999); monotone, two numbers."""

    slope: float
    shift: float

    @classmethod
    def of(cls, rows: Sequence[Row], scores: Floats, head: str) -> "Stretch":
        """Return the stretch of scores (n,) that were made without each row's effects; 1 and 0 for none."""
        found = _logistic(
            np.column_stack([scores, np.ones(len(rows))]),
            _good(rows, head),
            weights_of(rows),
            centre=np.array([1.0, 0.0]),
            spread=_STRETCH,
            bounds=[(_LEAST_SLOPE, None), (None, None)],
        )
        return cls(*found.tolist())

    def stretched(self, model: Head) -> Head:
        """Return a model whose scores are stretched."""
        weights = tuple(round(self.slope * weight, 4) for weight in model.weights)
        return replace(model, bias=round(self.slope * model.bias + self.shift, 4), weights=weights)


def calibrated(rows: Sequence[Row], head: str, scores: Floats) -> Head:
    """Return the model of all rows, stretched by their scores when their effects are left out."""
    return Stretch.of(rows, scores, head).stretched(fitted(rows, head))


def left_out(rows: Sequence[Row], head: str, scores: Floats) -> Floats:
    """Return the probability (n,) of each row from its unseen score, stretched by those of other effects."""
    p = np.zeros(len(rows))
    for group in {row.group for row in rows}:
        others = np.array([not row.group & group for row in rows])
        kept = [row for row, other in zip(rows, others, strict=True) if other]
        stretch = Stretch.of(kept, scores[others], head)
        for i, row in enumerate(rows):
            if row.group == group:
                good = probability_of(stretch.slope * float(scores[i]) + stretch.shift)
                p[i] = stated(1.0 - good if head == UNKNOWN else good, row, head)
    return p


def stated(p: float, row: Row, head: str) -> float:
    """Return the probability that an answer states: a cause that fails a condition is not named."""
    return min(p, MOST_UNNAMED) if head == NAME and row.conditions_failed else p


@dataclass(frozen=True)
class Scores:
    """Errors of probabilities; weighted as in the fit."""

    rows: int
    ece: float
    brier: float
    log: float
    sure: int
    """Rows with p >= 0.9."""
    sure_right: int
    named: int
    named_wrong: int

    def __str__(self) -> str:
        precision = f"{self.sure_right}/{self.sure}"
        wrong = f"{self.named_wrong}/{self.named}"
        return f"| {self.ece:.3f} | {self.brier:.3f} | {self.log:.3f} | {precision} | {wrong} |"


def scores_of(rows: Sequence[Row], p: Floats, head: str) -> Scores:
    """Return the scores of probabilities (n,); the expected calibration error in ten bins."""
    right, weight = np.array([row.right[head] for row in rows], dtype=bool), weights_of(rows)
    place = np.minimum((p * _BINS).astype(int), _BINS - 1)
    off = [abs(float(weight[place == b] @ (p - right)[place == b])) for b in np.unique(place)]
    sure, named = p >= 0.9, p >= THRESHOLDS.posterior.named
    return Scores(
        rows=len(p),
        ece=sum(off) / float(weight.sum()),
        brier=float(np.average((p - right) ** 2, weights=weight)),
        log=float(-np.average(np.log(np.where(right, p, 1.0 - p).clip(1e-3)), weights=weight)),
        sure=int(sure.sum()),
        sure_right=int((sure & right).sum()),
        named=int(named.sum()),
        named_wrong=int((named & ~right).sum()),
    )


def conformal_nats(behind: Iterable[Behind]) -> float:
    """Return the threshold that 95 % of the compared truths are within (Vovk et al. 2005); inf if few."""
    scores = sorted(each.nats for each in behind if each.nats is not None)
    rank = math.ceil(COVERAGE * (len(scores) + 1))
    return scores[rank - 1] if rank <= len(scores) else math.inf


def covered(behind: Sequence[Behind], least_nats: float = 0.0) -> tuple[int, int]:
    """Return how many compared truths are within the threshold of the other effects, and of how many."""
    count = of = 0
    for group in {each.group for each in behind}:
        threshold = max(conformal_nats(each for each in behind if not each.group & group), least_nats)
        own = [each.nats for each in behind if each.group == group and each.nats is not None]
        count, of = count + sum(nats <= threshold for nats in own), of + len(own)
    return count, of


HEADS = (NAME, FAMILY, UNKNOWN, DEPENDENCE)
CONVENTION_NATS = THRESHOLDS.posterior.alike_chi2 / 2.0
_HEAD = "| | rows | ECE | Brier | log score | right at p >= .9 | wrong at p >= .5 |\n| --- |" + " --- |" * 6


def main(given: Sequence[str] | None = None) -> int:
    """Fit, print and write; the exit code is 2 where the records cannot be used."""
    parser = argparse.ArgumentParser(prog="calibrate.py", description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path, help="as given to check.py --resume")
    parser.add_argument("-o", dest="table", type=Path, help="where to write; by default into the package")
    options = parser.parse_args(given)
    try:
        table = table_of(records_of(options.folder))
    except RecordsError as error:
        print(f"calibrate: {error}", file=sys.stderr)
        return 2
    target = options.table or TABLE
    target.write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8", newline="\n")
    print(f"\nwritten: {target.name}")
    return 0


def table_of(records: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the table of some records, and print what it is worth."""
    behind = list(behind_of(records))
    alike_nats = _conformal(behind)
    rows = list(cause_rows(records, alike_nats))
    of_head = {head: family_rows(records) if head == DEPENDENCE else rows for head in HEADS}
    of_head = {head: list(each) for head, each in of_head.items()}
    if not all(of_head.values()):
        raise RecordsError("no record has a cause, or none a family of a rest: make more cases")
    raw = {head: unseen_scores(of_head[head], head) for head in HEADS}
    heads = {head: calibrated(of_head[head], head, raw[head]) for head in HEADS}
    unseen = {head: left_out(of_head[head], head, raw[head]) for head in HEADS}
    scores = _print_scores(of_head, heads, unseen)
    _print_ablation(rows, scores[NAME])
    worst = _left_out_effects(rows, unseen[NAME])
    lacks = without_cause(records)
    table = {
        "features": NAMES,
        "family_features": FAMILY_NAMES,
        "heads": {head: _stated(head, model) for head, model in heads.items()},
        "alike_nats": round(alike_nats, 3),
        "unknown_without_cause": round(clipped((sum(lacks) + 1.0) / (len(lacks) + 2.0)), 3),
        "provenance": _provenance(records, scores, worst, behind, alike_nats),
    }
    Probabilities.of(table)  # raises where the diagnosis would not take it
    return table


def _conformal(behind: Sequence[Behind]) -> float:
    """Return the threshold of declared sets: never less than what the data cannot tell by convention."""
    quantile = conformal_nats(behind)
    missed = sum(each.nats is None for each in behind)
    print(
        f"declared sets: of {len(behind)} truths {missed} were compared with no cause; of the others 95 % "
        f"are within {quantile:.2f} nats of the best; convention {CONVENTION_NATS:g}"
    )
    for name, least in (("quantile", 0.0), ("with the convention", CONVENTION_NATS)):
        count, of = covered(behind, least)
        print(f"  whole effects left out, {name}: {count} of {of} within")
    return CONVENTION_NATS if math.isinf(quantile) else max(quantile, CONVENTION_NATS)


def _print_scores(
    of_head: dict[str, list[Row]], heads: dict[str, Head], unseen: dict[str, Floats]
) -> dict[str, Scores]:
    """Print the scores of each probability and return those with whole effects left out."""
    print(
        "\nwhole effects left out; in brackets: what the answers stated, the share of the right for all, and"
    )
    print(f"the model on the cases that it was fitted to\n\n{_HEAD}")
    scores = {}
    for head in HEADS:
        rows = of_head[head]
        scores[head] = scores_of(rows, unseen[head], head)
        print(f"| P({head}) | {scores[head].rows} {scores[head]}")
        if head in (NAME, DEPENDENCE):
            print(f"| (before) | {len(rows)} {scores_of(rows, np.array([row.before for row in rows]), head)}")
        even = np.full(len(rows), _mean_right(rows, head))
        print(f"| (mean) | {len(rows)} {scores_of(rows, even, head)}")
        own = np.array([stated(heads[head].probability(row.u), row, head) for row in rows])
        print(f"| (seen) | {len(rows)} {scores_of(rows, own, head)}")
    cases = {row.case for row in of_head[NAME]}
    pairs = zip(of_head[NAME], unseen[NAME], strict=True)
    wrong = {row.case for row, p in pairs if p >= THRESHOLDS.posterior.named and not row.right[NAME]}
    print(
        f"\ncases with a cause: {len(cases)}, with a wrong name: {len(wrong)} "
        f"(<= {rate([case in wrong for case in cases]).upper:.3f})"
    )
    return scores


def _mean_right(rows: Sequence[Row], head: str) -> float:
    return float(np.clip(np.mean([row.right[head] for row in rows]), 0.02, 0.98))


def _print_ablation(rows: Sequence[Row], whole: Scores) -> None:
    """Print P(name) without each term in turn, the one that matters most first."""
    print("\nP(name) without one test, whole effects left out\n")
    print(
        "| without | ECE | Brier | log score | right at p >= .9 | wrong at p >= .5 |\n| --- |" + " --- |" * 5
    )
    print(f"| none {whole}")
    lines = [
        (scores_of(rows, left_out(rows, NAME, unseen_scores(rows, NAME, number)), NAME), term)
        for number, term in enumerate(terms_of(NAME))
    ]
    for scores, term in sorted(lines, key=lambda line: -line[0].log):
        print(f"| {term} {scores}")


def _left_out_effects(rows: Sequence[Row], p: Floats) -> list[dict[str, Any]]:
    """Return of each true effect how its causes fared when it was left out; the worst first."""
    found = []
    for group in {row.group for row in rows}:
        own = [(each, row.right[NAME]) for row, each in zip(rows, p, strict=True) if row.group == group]
        mean, right = (float(np.mean(each)) for each in zip(*own, strict=True))
        loss = float(np.mean([(each - ok) ** 2 for each, ok in own]))
        effects = " + ".join(sorted(group))
        found.append((loss, effects, {"effects": effects, "rows": len(own), "p": mean, "right": right}))
    found.sort(key=lambda each: (-each[0], each[1]))
    return [
        {key: round(value, 3) if isinstance(value, float) else value for key, value in each.items()}
        for _, _, each in found
    ]


def _stated(head: str, model: Head) -> dict[str, Any]:
    terms = terms_of(head)
    return {
        "bias": model.bias,
        "weights": dict(zip(terms, model.weights, strict=True)),
        "missing": dict(zip(terms, model.missing, strict=True)),
    }


def _provenance(
    records: Sequence[dict[str, Any]],
    scores: dict[str, Scores],
    worst: list[dict[str, Any]],
    behind: Sequence[Behind],
    alike_nats: float,
) -> dict[str, Any]:
    seeds = sorted(record["case"]["seed"] for record in records)
    count, of = covered(behind, CONVENTION_NATS)
    return {
        "made_by": "benchmarks/blind/calibrate.py",
        "cases": len(records),
        "kinds": dict(sorted(Counter(record["case"]["kind"] for record in records).items())),
        "seeds": list(ranges(seeds)),
        "code": sorted({record["code"] for record in records}),
        "left_out_scores": {
            head: {
                "rows": each.rows,
                "ece": round(each.ece, 4),
                "brier": round(each.brier, 4),
                "log": round(each.log, 4),
                "sure": each.sure,
                "sure_right": each.sure_right,
            }
            for head, each in scores.items()
        },
        "declared_sets": {
            "truths": len(behind),
            "compared": of,
            "within_left_out": count,
            "alike_nats": round(alike_nats, 3),
        },
        "left_out_effects": worst,
    }


def ranges(seeds: Iterable[int]) -> Iterable[str]:
    """Yield sorted seeds as ranges, ``200-205``."""
    first = last = None
    for seed in seeds:
        if last is not None and seed > last + 1:
            yield f"{first}-{last}"
            first = None
        first, last = seed if first is None else first, seed
    if first is not None:
        yield f"{first}-{last}"


if __name__ == "__main__":
    raise SystemExit(main())
