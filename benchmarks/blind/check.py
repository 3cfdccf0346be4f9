"""How often `diagnose` is right on runs of a robot that it has never seen, and its false alarms.

``python benchmarks/blind/check.py --cases 200 --seed N`` makes cases with the independent plant of
``tests/plant``, diagnoses each without its label, and prints the table of metrics and the confusions.
``--full`` is the whole check, ``--full --scale 0.1`` its first tenth. Seeds below 30000 are for development
and calibration, those from 30000 on are scored; the two never mix.
"""

import argparse
import json
import math
import multiprocessing
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

if __name__ == "__main__":  # a case runs on one core; must be set before numpy is loaded
    for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "GCODE2KRL_THREADS"):
        os.environ.setdefault(_name, "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from blind.cases import (
    CELL_TOML,
    KINDS,
    SCORED_FROM,
    Case,
    How,
    done,
    fingerprint,
    fresh_records,
    full_counts,
    in_turn,
    mixed,
    plan,
    say,
    scaled,
    store,
)
from blind.next_run import Asked, next_records
from blind.score import judge
from blind.tables import failures, report

from gcode2krl import Prediction, load_cell, load_run, predict
from tests.plant import faults, instruments, mismatch, writing
from tests.plant.robot import simulate
from tests.plant.scene import World
from tests.plant.waypoints import Writer

ROWS, FEED_mm_s = 17, 60.0
ROW_S = 3.3
"""That a row along y takes."""
EFFECT, SIZE = "backlash@A2", 0.02


def long_program(rows: int = ROWS) -> Writer:
    """Rows along y, to and fro over the whole block until there are so many; back between those of before."""
    w = Writer("LONG", -4, -92, 30)
    w.rapid(z=2).feed(FEED_mm_s, z=-3)
    for i in range(rows):
        column = i % (2 * ROWS)
        x = -4 + 9 * (column if column < ROWS else 2 * ROWS - 1.5 - column)
        w.feed(FEED_mm_s, x=x).feed(FEED_mm_s, y=92 if i % 2 == 0 else -92)
    return w.rapid(z=30)


def timing(seconds: float = ROWS * ROW_S, effect: str = EFFECT, size: float = SIZE, times: int = 2) -> str:
    """Return how long predictions, plant and diagnosis took, and the diagnosis's peak memory.

    It has a process of its own; the first one loads compiled code. One of long runs takes minutes.
    """
    program = long_program(max(1, round(seconds / ROW_S)))
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        writing.write_text(folder / "cell.toml", CELL_TOML)
        writing.write_text(folder / "long.nc", program.text())
        marks = [time.perf_counter()]
        predict(folder / "long.nc", load_cell(folder / "cell.toml")).save(folder / "prediction")
        marks.append(time.perf_counter())
        length_s = _runs(folder, program, effect, size)
        marks.append(time.perf_counter())
        with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
            for _ in range(times):
                verdict, causes, peak_MB = pool.submit(_diagnosis, folder).result()
                marks.append(time.perf_counter())
    parts = np.diff(marks)
    diagnoses = ", ".join(f"{part:.1f} s" for part in parts[2:])
    return (
        f"three runs of {length_s:.0f} s with {effect}: prediction {parts[0]:.1f} s, plant {parts[1]:.1f} s, "
        f"diagnosis {diagnoses}, peak {peak_MB:.0f} MB ({verdict}: {causes or 'no cause'})"
    )


def _diagnosis(folder: Path) -> tuple[str, str, float]:
    """Return the verdict, the causes, and the peak memory of this process in MB."""
    import resource  # where there is one: not on Windows

    from gcode2krl.gap import diagnose

    runs = [load_run(folder / f"run-{i + 1}") for i in range(3)]
    gap = diagnose(Prediction.load(folder / "prediction"), runs).as_dict()
    causes = ", ".join(f"{c['effect']} {c['target']} {c['probability']:.2f}" for c in gap["causes"])
    return gap["verdict"], causes, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _runs(folder: Path, program: Writer, effect: str, size: float) -> float:
    rng = np.random.default_rng(1)
    how = replace(
        instruments.drawn(rng, frozenset({"controller", "tracker", "force", "q_load"})),
        tracker_hz=100.0,
        controller_s=0.012,
        scan=False,
    )
    fault = faults.build(effect, "same", 1)
    robot = mismatch.of_robot(rng)
    for number in range(3):
        run = simulate(
            program.waypoints(), World(), [fault.hooks(size)], mismatch.of_day(robot, rng), 0.0, number
        )
        place = folder / f"run-{number + 1}"
        place.mkdir()
        for name, table in instruments.noisy(instruments.clean(run, how), how, run.units, rng).items():
            writing.write_table(place / name, table, parquet=False)
        keys = {"program": "../long.nc", "prediction": "../prediction", "angles": "absolute"}
        writing.write_text(
            place / "run.toml",
            writing.run_toml(keys, {"frames": {"tracker": "base", "force": how.force_frame}}),
        )
    return float(run.t_s[-1])


def arguments(given: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="check.py", description=__doc__.split("\n")[0])
    parser.add_argument("--cases", type=int, default=0, help="mixed cases of all kinds")
    parser.add_argument("--full", action="store_true", help="the whole check")
    parser.add_argument("--small", action="store_true", help="a null, a single and an open case, to try it")
    parser.add_argument("--scale", type=float, default=1.0, help="the first part of each kind: 0.1 a tenth")
    for kind in KINDS:
        words = [f"--{kind.replace('_', '-')}", *(["--delete-label"] if kind == "deleted" else [])]
        parser.add_argument(*words, dest=kind, type=int, metavar="M", nargs="?", const=10)
    parser.add_argument("--effects", default="", help="names, joined by commas: these in turn")
    parser.add_argument(
        "--seed", type=int, default=1, help=f"first seed; below {SCORED_FROM} nothing is scored"
    )
    parser.add_argument("--jobs", type=int, default=2, help="processes, one thread each")
    parser.add_argument(
        "--minutes", type=float, default=math.inf, help="begin no case after so long; a later call goes on"
    )
    parser.add_argument("--next", type=int, default=0, metavar="M", help="drive the next run of M cases")
    parser.add_argument(
        "--next-beside", type=int, default=3, metavar="N", help="other programs too on every N-th of these"
    )
    parser.add_argument("--resume", type=Path, help="folder that keeps predictions and records, and goes on")
    parser.add_argument("--keep", action="store_true", help="keep the runs of the cases in that folder")
    parser.add_argument("--no-oracle", action="store_true")
    parser.add_argument("--no-baselines", action="store_true", help=argparse.SUPPRESS)  # stood in old calls
    parser.add_argument(
        "--decide", action="store_true", help="how far each truth is from its imitators, stored records too"
    )
    parser.add_argument("--only-report", action="store_true", help="tables of what is there, of any code")
    parser.add_argument("--json", action="store_true", help="the judgements, a line each")
    parser.add_argument("--timing", action="store_true", help="time and memory of three runs of 56 s")
    parser.add_argument(
        "--timing-runs",
        nargs=3,
        metavar=("SECONDS", "EFFECT", "SIZE"),
        help="the same of others, once: 600 backlash@A2 0.02, or 56 servo_lag@all 0.02",
    )
    return parser.parse_args(given)


def counts_of(options: argparse.Namespace) -> dict[str, int]:
    """Return the requested number of cases of each kind."""
    counts = dict.fromkeys(KINDS, 0)
    if options.small:
        counts |= {"null": 1, "single": 1, "open": 1}
    if options.full:
        counts |= full_counts()
    if options.cases:
        counts |= mixed(options.cases)
    counts |= {kind: getattr(options, kind) for kind in KINDS if getattr(options, kind) is not None}
    return scaled(counts, options.scale)


def main(given: Sequence[str] | None = None) -> int:
    """Run the check; the exit code is 0 whatever it found, 2 where the options make no sense."""
    options = arguments(given)
    if options.timing:
        print(timing())
        return 0
    if options.timing_runs:
        seconds, effect, size = options.timing_runs
        print(timing(float(seconds), effect, float(size), times=1))
        return 0
    try:
        cases = plan(options.seed, counts_of(options), [name for name in options.effects.split(",") if name])
    except ValueError as error:
        say(f"check: {error}")
        return 2
    if not cases:
        say("check: nothing to do: give --cases, --full, --small or numbers of each kind")
        return 2
    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.resume or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        records, driven = _records(cases, folder, options)
        _show(records, driven, options, len(cases), time.perf_counter() - start)
        failures(records, folder)
    return 0


def _records(
    cases: Sequence[Case], folder: Path, options: argparse.Namespace
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return the records of all cases, those already there included, and those of the next runs."""
    until_s = time.monotonic() + 60.0 * options.minutes
    how = How(not options.no_oracle, options.keep, fingerprint())
    there = [done(case, folder, None if options.only_report else how.code) for case in cases]
    records = [record for record in there if record is not None]
    if not options.only_report:
        left = in_turn([case for case, record in zip(cases, there, strict=True) if record is None])
        say(f"{len(cases)} cases, {len(records)} already there")
        fresh = fresh_records(left, folder, how, options.jobs, until_s)
        for i, record in enumerate(fresh):
            store(record, folder)
            records.append(record)
            _tell(record, f"{i + 1}/{len(left)}")
    if options.decide:
        records = _decided(records, folder, options.jobs, until_s)
    asked = Asked(options.next, options.next_beside, options.jobs, until_s, options.only_report)
    driven = next_records(records, folder, how.code, asked)
    return records, driven


def _decided(records: list[dict[str, Any]], folder: Path, jobs: int, until_s: float) -> list[dict[str, Any]]:
    """Return the records, all with distances, and store those that are new."""
    from blind.figures import decide

    fresh = {}
    for record in decide(records, folder / "signatures", jobs, until_s):
        store(record, folder)
        fresh[record["case"]["kind"], record["case"]["seed"]] = record
    say(f"{len(fresh)} cases decided")
    return [fresh.get((each["case"]["kind"], each["case"]["seed"]), each) for each in records]


def _tell(record: dict[str, Any], count: str) -> None:
    each = judge(record)
    mark = "failed" if each.failed else "right" if each.declared else "wrong"
    truth = f"{count} {each.kind}-{each.seed:05d} {mark}: {each.name} ({each.form}, {each.ratio:.2f})"
    say(f"{truth} -> {each.answer} [{each.verdict}] {each.seconds:.1f} s")


def _show(
    records: list[dict[str, Any]],
    driven: list[dict[str, Any]],
    options: argparse.Namespace,
    planned: int,
    took_s: float,
) -> None:
    judged = sorted((judge(record) for record in records), key=lambda each: (each.kind, each.seed))
    if options.json:
        print("\n".join(json.dumps(asdict(each), default=sorted) for each in judged))
        return
    codes = ", ".join(sorted({record["code"] for record in records}))
    what = "scored" if options.seed >= SCORED_FROM else "calibration, not to be quoted"
    part = "" if options.scale == 1.0 else f", the first {options.scale:g} of each kind"
    title = (
        f"{len(judged)} of {planned} cases from seed {options.seed} ({what}{part}), code {codes}, "
        f"{took_s / 60.0:.1f} min in this call"
    )
    print(report(judged, driven, title))


if __name__ == "__main__":
    raise SystemExit(main())
