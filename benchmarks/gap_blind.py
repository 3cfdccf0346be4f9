"""How often `diagnose` is right on runs of a robot that it has never seen, and its false alarms.

``python benchmarks/gap_blind.py --cases 200 --seed N`` makes cases with the independent plant of
``tests/plant``, diagnoses each without its label, and prints the table of metrics, the confusions, simple
methods beside it and the smallest size of each effect that shows. Seeds below 10000 are for development and
calibration, those from 10000 on are scored; the two never mix. ``--full`` is the whole check of 300
effect-free and 400 single-effect cases.
"""

import argparse
import json
import multiprocessing
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

if __name__ == "__main__":  # a case runs on one core; must be set before numpy is loaded
    for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ.setdefault(_name, "1")
sys.path.insert(0, str(Path(__file__).resolve().parent))

from gap_blind_cases import (
    FULL,
    KINDS,
    SCORED_FROM,
    Case,
    How,
    fingerprint,
    mixed,
    plan,
    predictions,
    run_case,
)


def arguments(given: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="gap_blind.py", description=__doc__.split("\n")[0])
    parser.add_argument("--cases", type=int, default=0, help="mixed cases of all kinds")
    parser.add_argument("--full", action="store_true", help="300 effect-free and 400 single-effect cases")
    parser.add_argument(
        "--small", action="store_true", help="a null, a single-effect and an open case, to try it"
    )
    for kind in KINDS:
        word = "--delete-label" if kind == "deleted" else f"--{kind}"
        parser.add_argument(word, dest=kind, type=int, metavar="M", nargs="?", const=10, help=f"{kind} cases")
    parser.add_argument("--effects", default="", help="names, joined by commas: these in turn")
    parser.add_argument(
        "--seed", type=int, default=1, help=f"first seed; below {SCORED_FROM} nothing is scored"
    )
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--resume", type=Path, help="folder that keeps predictions and records, and goes on")
    parser.add_argument("--keep", action="store_true", help="keep the runs of the cases in that folder")
    parser.add_argument("--no-oracle", action="store_true")
    parser.add_argument("--no-baselines", action="store_true")
    parser.add_argument(
        "--only-report", action="store_true", help="tables of what is there, whatever code made it"
    )
    parser.add_argument("--json", action="store_true", help="the judgements, a line each")
    parser.add_argument("--timing", action="store_true", help="how long three runs of 60 s take")
    return parser.parse_args(given)


def counts_of(options: argparse.Namespace) -> dict[str, int]:
    """Return the requested number of cases of each kind."""
    counts = dict.fromkeys(KINDS, 0)
    if options.small:
        counts |= {"null": 1, "single": 1, "open": 1}
    if options.full:
        counts |= FULL
    if options.cases:
        counts |= mixed(options.cases)
    return counts | {kind: getattr(options, kind) for kind in KINDS if getattr(options, kind) is not None}


def done(case: Case, folder: Path, code: str | None) -> dict[str, Any] | None:
    """Return the record of a case that this code has made already; of any code where None is given."""
    file = folder / "results" / f"{case.name}.json"
    if not file.exists():
        return None
    record = json.loads(file.read_text(encoding="utf-8"))
    same = record["case"]["effect"] == case.effect and code in (None, record["code"])
    return record if same else None


def _one(case: Case, folder: Path, how: How) -> dict[str, Any]:
    record = run_case(case, folder, how)
    file = folder / "results" / f"{case.name}.json"
    file.parent.mkdir(exist_ok=True)
    file.write_text(json.dumps(record), encoding="utf-8")
    return record


def run(cases: Sequence[Case], folder: Path, how: How, jobs: int) -> list[dict[str, Any]]:
    """Return the records of all cases, those already there included."""
    there = {case: done(case, folder, how.code) for case in cases}
    left = [case for case in cases if there[case] is None]
    print(f"{len(cases)} cases, {len(cases) - len(left)} already there", file=sys.stderr)
    if jobs <= 1 or len(left) <= 1:
        records = [_shown(_one(case, folder, how), i, len(left)) for i, case in enumerate(left)]
    else:
        fresh = multiprocessing.get_context("spawn")  # so that the threads of numpy stay at one
        with ProcessPoolExecutor(jobs, mp_context=fresh) as pool:
            waiting = [pool.submit(_one, case, folder, how) for case in left]
            records = [_shown(each.result(), i, len(left)) for i, each in enumerate(as_completed(waiting))]
    return [record for record in there.values() if record is not None] + records


def _shown(record: dict[str, Any], i: int, of: int) -> dict[str, Any]:
    from gap_blind_score import judge

    each = judge(record)
    mark = "failed" if each.failed else "right" if each.declared else "wrong"
    truth = f"{i + 1}/{of} {each.kind}-{each.seed:05d} {mark}: {each.name} ({each.form}, {each.ratio:.2f})"
    print(f"{truth} -> {each.answer} [{each.verdict}] {each.seconds:.1f} s", file=sys.stderr, flush=True)
    return record


def main(given: Sequence[str] | None = None) -> int:
    """Run the check; the exit code is 0 whatever it found, 2 where the options make no sense."""
    options = arguments(given)
    if options.timing:
        from gap_blind_timing import timing

        print(timing())
        return 0
    try:
        cases = plan(options.seed, counts_of(options), [name for name in options.effects.split(",") if name])
    except ValueError as error:
        print(f"gap_blind: {error}", file=sys.stderr)
        return 2
    if not cases:
        print(
            "gap_blind: nothing to do: give --cases, --full, --small or numbers of each kind", file=sys.stderr
        )
        return 2
    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.resume or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        if options.only_report:
            records = [record for case in cases if (record := done(case, folder, None)) is not None]
        else:
            how = How(
                not options.no_oracle,
                not options.no_baselines,
                options.keep,
                fingerprint(),
                predictions(folder / "predictions"),
            )
            records = run(cases, folder, how, options.jobs)
    return _print(records, options, time.perf_counter() - start)


def _print(records: list[dict[str, Any]], options: argparse.Namespace, took_s: float) -> int:
    from dataclasses import asdict

    from gap_blind_print import report
    from gap_blind_score import judge

    judged = sorted((judge(record) for record in records), key=lambda each: (each.kind, each.seed))
    if options.json:
        print("\n".join(json.dumps(asdict(each)) for each in judged))
        return 0
    scored = options.seed >= SCORED_FROM
    codes = ", ".join(sorted({record["code"] for record in records}))
    what = "scored" if scored else "calibration, not to be quoted"
    print(
        report(
            judged,
            f"{len(judged)} cases from seed {options.seed} ({what}), code {codes}, {took_s / 60.0:.1f} min",
        )
    )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
