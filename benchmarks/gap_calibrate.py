"""Fit the probabilities of the diagnosis to stored cases of the check, and write their table.

``python benchmarks/gap_calibrate.py FOLDER`` reads the records that ``benchmarks/blind/check.py`` has left in
the folder of its ``--resume``, fits what ``gcode2krl/gap/posterior/calibrated.py`` uses, prints its errors
with whole effects left out and what each test is worth, and writes ``gcode2krl/gap/probabilities.json`` (or
``-o TABLE``).
``--made-up`` takes records that are made up, to try it.
"""

import argparse
import json
import math
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))

import numpy as np
from blind.figures import rate
from gap_calibrate_fit import (
    Scores,
    calibrated,
    conformal_nats,
    covered,
    left_out,
    scores_of,
    stated,
    unseen_scores,
)
from gap_calibrate_made_up import write_made_up
from gap_calibrate_rows import (
    Behind,
    RecordsError,
    Row,
    behind_of,
    cause_rows,
    family_rows,
    records_of,
    without_cause,
)

from gcode2krl.arrays import Floats
from gcode2krl.gap.posterior.calibrated import (
    DEPENDENCE,
    FAMILY,
    FAMILY_NAMES,
    NAME,
    NAMES,
    UNKNOWN,
    Head,
    Probabilities,
    clipped,
    terms_of,
)
from gcode2krl.gap.thresholds import TABLE, THRESHOLDS

HEADS = (NAME, FAMILY, UNKNOWN, DEPENDENCE)
CONVENTION_NATS = THRESHOLDS.posterior.alike_chi2 / 2.0
_HEAD = "| | rows | ECE | Brier | log score | right at p >= .9 | wrong at p >= .5 |\n| --- |" + " --- |" * 6


def main(given: Sequence[str] | None = None) -> int:
    """Fit, print and write; the exit code is 2 where the records cannot be used."""
    parser = argparse.ArgumentParser(prog="gap_calibrate.py", description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path, nargs="?", help="as given to blind/check.py --resume")
    parser.add_argument("-o", dest="table", type=Path, help="where to write; by default into the package")
    parser.add_argument(
        "--made-up", action="store_true", help="made-up records instead of a folder; needs -o"
    )
    options = parser.parse_args(given)
    if options.made_up == bool(options.folder) or (options.made_up and not options.table):
        parser.error("give a folder, or --made-up with -o")
    try:
        with tempfile.TemporaryDirectory() as scratch:
            records = records_of(write_made_up(Path(scratch)) if options.made_up else options.folder)
        table = table_of(records)
    except RecordsError as error:
        print(f"gap_calibrate: {error}", file=sys.stderr)
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
        "made_by": "benchmarks/gap_calibrate.py",
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
