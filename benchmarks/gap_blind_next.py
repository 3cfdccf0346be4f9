"""Does the run that the answer asks for settle what it left open?

Of cases whose answer lists the true cause but leaves it open, the plant drives `next_run.program` with the
same machine on the same day, and the diagnosis answers again with this run added. Beside it stand a canned
program drawn at random and the first program once more.
"""

import contextlib
import json
import multiprocessing
import shutil
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from gap_blind_canned import AGAIN, NotCannedError, names, predicted
from gap_blind_cases import Case, predictions
from gap_blind_figures import rate
from gap_blind_names import Truth, named_of
from gap_blind_names import names as says
from gap_blind_run import answer, made
from gap_blind_score import judge
from gap_blind_words import truth_of

from tests.plant.next_run import PLANNED, drive_next
from tests.plant.programs import Program
from tests.plant.waypoints import PROGRAMS

ASKED, RANDOM, REPEAT = "the next run asked for", "a random canned program", "the first program again"
WAYS = (ASKED, RANDOM, REPEAT)
KINDS = ("confounded", "single", "missing")
"""Kinds whose true cause is in the library; in this order."""
NONE_ASKED = "no next run is given"
NO_CANNED = "make-test has no canned programs yet"
OWN_LAW = "an error of the motion's law, which commanded joints leave no room for"


@dataclass(frozen=True)
class Drive:
    """One more run of a case, and whether the answer is settled after it."""

    way: str
    program: str | None
    skipped: str | None
    settled: bool


def is_left_open(record: dict[str, Any]) -> bool:
    """Tell whether an answer lists the true cause, of a size that shows, and leaves it open."""
    if record["case"]["kind"] not in KINDS or record.get("result") is None:
        return False
    judged = judge(record)
    one = len(judged.truths) == 1 and judged.observable and judged.in_a_set
    return one and not is_settled(record["result"], judged.truths[0])


def is_settled(result: dict[str, Any], truth: Truth) -> bool:
    """Tell whether an answer names the true cause alone, told from all others."""
    named = named_of(result)
    return len(named) == 1 and says(named[0], truth) and not named[0].get("indistinguishable_from")


def next_records(
    records: Iterable[dict[str, Any]], folder: Path, code: str, most: int, only_stored: bool, jobs: int = 1
) -> list[dict[str, Any]]:
    """Return a record of the further runs of each case that is left open, at most so many of them."""
    open_ones = [record for record in records if is_left_open(record)]
    chosen = sorted(open_ones, key=lambda record: KINDS.index(record["case"]["kind"]))[:most]
    there = {name_of(record): _stored(record, folder, None if only_stored else code) for record in chosen}
    left = [] if only_stored else [record for record in chosen if there[name_of(record)] is None]
    for made_now in _driven(left, folder, code, jobs):
        file = _file(made_now, folder)
        file.parent.mkdir(exist_ok=True)
        file.write_text(json.dumps(made_now), encoding="utf-8")
        there[name_of(made_now)] = made_now
    return [record for record in there.values() if record is not None]


def name_of(record: dict[str, Any]) -> str:
    """Return the name of a record's case."""
    return f"{record['case']['kind']}-{record['case']['seed']:05d}"


def _file(record: dict[str, Any], folder: Path) -> Path:
    return folder / "next" / f"{name_of(record)}.json"


def _stored(record: dict[str, Any], folder: Path, code: str | None) -> dict[str, Any] | None:
    file = _file(record, folder)
    if not file.exists():
        return None
    stored: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return stored if code in (None, stored["code"]) else None


def _driven(
    records: Sequence[dict[str, Any]], folder: Path, code: str, jobs: int
) -> Iterator[dict[str, Any]]:
    if not records:
        return
    places = predictions(folder / "predictions" / code)
    for name in names():  # once, before the processes start
        try_predicted(name, places)
    if jobs <= 1 or len(records) <= 1:
        yield from (drive(record, folder, places) for record in records)
        return
    with ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn")) as pool:
        count = len(records)
        yield from pool.map(drive, records, [folder] * count, [places] * count)


def try_predicted(name: str, places: dict[str, str]) -> None:
    """Predict a canned program; one that cannot be predicted is told of where it is asked for."""
    home = Path(next(iter(places.values()))).parent
    with contextlib.suppress(NotCannedError):
        predicted(name, home / "cell.toml", home)


def drive(record: dict[str, Any], folder: Path, places: dict[str, str]) -> dict[str, Any]:
    """Make a case again and return what the answer is after one more run, in each way."""
    asked = record["case"]
    case = Case(asked["seed"], asked["kind"], asked["effect"], asked["form"], tuple(asked["without"]))
    place = folder / "cases" / f"{case.name}-next"
    shutil.rmtree(place, ignore_errors=True)
    label = made(case, place / "case", places)
    truth = truth_of(label["effects"][0])
    drives = [_one_way(way, record, label, truth, place / "case", places) for way in WAYS]
    shutil.rmtree(place, ignore_errors=True)
    return {"case": asked, "code": record["code"], "drives": drives}


def _one_way(
    way: str,
    record: dict[str, Any],
    label: dict[str, Any],
    truth: Truth,
    case: Path,
    places: dict[str, str],
) -> dict[str, Any]:
    name, skipped = chosen_program(way, record, truth)
    found: dict[str, Any] = {"way": way, "program": name, "skipped": skipped, "settled": False}
    if name is None:
        return found
    number = len(label["runs"]) + 1
    run = case / f"run-{number}"
    try:
        _drive(name, way, label, run, places)
        found["settled"] = is_settled(answer(case), truth)
    except NotCannedError as error:
        found["skipped"] = str(error)
    except Exception as error:  # counts as not settled, and is shown
        found["error"] = repr(error)
    finally:
        shutil.rmtree(run, ignore_errors=True)
    return found


def chosen_program(way: str, record: dict[str, Any], truth: Truth) -> tuple[str | None, str | None]:
    """Return the program of a way, or None and why it is skipped."""
    if way == REPEAT:
        return record["label"]["runs"][0]["program"], None
    if truth[0] in PLANNED:
        return None, OWN_LAW
    if way == RANDOM:
        if not names():
            return None, NO_CANNED
        return str(np.random.default_rng(record["case"]["seed"]).choice(names())), None
    asked = record["result"].get("next_run")
    return (asked["program"], None) if asked else (None, NONE_ASKED)


def is_again(way: str, name: str) -> bool:
    """Tell whether a way is the case's first program once more."""
    return way == REPEAT or name == AGAIN


def _drive(name: str, way: str, label: dict[str, Any], run: Path, places: dict[str, str]) -> None:
    """Let the plant drive a program with the machine of a case."""
    if is_again(way, name):
        first = label["runs"][0]["program"]
        program: Program | dict[str, Any] = Program(first, PROGRAMS[first]().waypoints())
        prediction = Path(places[first])
    else:
        home = Path(next(iter(places.values()))).parent
        prediction, program = predicted(name, home / "cell.toml", home)
    drive_next(label, program, run, prediction.as_posix())


def drives_of(records: Iterable[dict[str, Any]]) -> list[Drive]:
    """Return all further runs of these records."""
    keys = ("way", "program", "skipped", "settled")
    return [Drive(*(drive[key] for key in keys)) for record in records for drive in record["drives"]]


def rows(records: Sequence[dict[str, Any]]) -> list[tuple[str, str, str, str]]:
    """Return a row for each way: metric, figure, what was skipped and why, aim."""
    drives = drives_of(records)
    found = []
    for way in WAYS:
        mine = [each for each in drives if each.way == way]
        tried = rate(each.settled for each in mine if each.skipped is None)
        reasons = [each.skipped for each in mine if each.skipped is not None]
        skipped = "; ".join(f"{reason}: {reasons.count(reason)}" for reason in sorted(set(reasons)))
        figure = f"{tried.value:.3f} (>= {tried.lower:.3f}, n {tried.of})" if tried.of else "-"
        found.append((way, figure, skipped, ">= .85" if way == ASKED else ""))
    return found
