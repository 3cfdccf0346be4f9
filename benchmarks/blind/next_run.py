"""Does the run that the answer asks for settle what it left open?

Of cases whose answer lists the true cause but leaves it open, the plant drives `next_run.program` with the
same machine on the same day, and the diagnosis answers again with this run added. Beside it stand a canned
program of `gcode2krl make-test` drawn at random and the first program once more.
"""

import contextlib
import functools
import json
import math
import shutil
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from blind.cases import Case, answer, in_processes, made, predictions
from blind.figures import rate
from blind.score import Truth, effects_alike, judge, named_of, truth_of
from blind.score import names as says

from gcode2krl import Prediction, load_cell
from tests.plant.confounded import SAME
from tests.plant.next_run import PLANNED, drive_next
from tests.plant.programs import Program
from tests.plant.waypoints import PROGRAMS

STEP_s = 0.012
AT_REST_mm_s = 1e-6
AGAIN = "repeat"
"""Runs a program that is given: the plant does that without a canned one."""


class NotCannedError(Exception):
    """A canned program cannot be made; the message says why."""


@functools.cache
def names() -> tuple[str, ...]:
    """Return the names of the canned programs that need no part."""
    try:
        from gcode2krl.canned import NAMES
    except ImportError:
        return ()
    return tuple(name for name in NAMES if name != AGAIN)


def predicted(name: str, cell_file: Path, folder: Path) -> tuple[Path, dict[str, Any]]:
    """Return the folder of a canned program's prediction, made where it is not there yet, and plain data.

    The data are what the plant drives: the commanded joints over time, and the spindle and the hung weights
    that the program's lines ask for. Raises NotCannedError where there is no such program.
    """
    if name not in names():
        raise NotCannedError(f"make-test knows no {name!r}; it knows {', '.join(names()) or 'none'}")
    from gcode2krl import canned

    cell = load_cell(cell_file)
    draft = canned.draft_of(name, canned.place_of(cell))
    place = folder / f"canned-{name}"
    if not (place / "prediction.toml").exists():
        canned.predicted(draft, cell, STEP_s).save(place)
    prediction = Prediction.load(place)
    if prediction.motion is None or prediction.joints is None:
        raise NotCannedError(f"the prediction of {name} has no joints")
    motion = prediction.motion
    begun = moments(draft.states, motion, prediction.toolpath.source_line)
    track = {"t_s": motion.time_s.tolist(), "q_deg": np.degrees(prediction.joints.q_rad).tolist()}
    hung = weights(begun, float(motion.time_s[-1]))
    return place, {"name": name, "track": track, "spindle": spindle(begun), "weights": hung}


@dataclass(frozen=True)
class Moment:
    """From a time on: the pull on the tool along ``$BASE`` and the spindle's speed."""

    time_s: float
    pull_N: tuple[float, float, float]
    rpm: float


def moments(states: Iterable[Any], motion: Any, source_line: np.ndarray) -> list[Moment]:
    """Return when each state of a program begins: a dwell after the last move up to its line.

    ``source_line``: of each row of the Toolpath that the motion's samples name.
    """
    moving = motion.speed_mm_s > AT_REST_mm_s
    lines, times_s = source_line[motion.move][moving], motion.time_s[moving]
    found = []
    for state in states:
        before = np.flatnonzero(lines <= state.line)
        arrived_s = float(times_s[before[-1]]) if len(before) else 0.0
        time_s = min(arrived_s + state.stood_s, float(motion.time_s[-1]))
        found.append(Moment(time_s, tuple(map(float, state.pull_N)), float(state.rpm)))
    return found


def spindle(found: Sequence[Moment]) -> list[list[float]]:
    """Return time and speed of the spindle for the plant; it stands at first."""
    return [[0.0, 0.0], *([each.time_s, each.rpm] for each in found)]


def weights(found: Sequence[Moment], end_s: float) -> list[dict[str, Any]]:
    """Return the pulls on the tool for the plant, each until the next change."""
    ends_s = [*(each.time_s for each in found[1:]), end_s]
    return [
        {"from_s": each.time_s, "to_s": to_s, "pull_N": list(each.pull_N)}
        for each, to_s in zip(found, ends_s[: len(found)], strict=True)
        if any(each.pull_N)
    ]


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
    cpu_s: float = 0.0


@dataclass(frozen=True)
class Asked:
    """How many cases get a further run, and how."""

    most: int
    beside: int = 3
    """The other programs are driven on every so many of them; 0: never."""
    jobs: int = 1
    until_s: float = math.inf
    """Of `time.monotonic`: no case begins later."""
    only_stored: bool = False


def is_left_open(record: dict[str, Any]) -> bool:
    """Tell whether an answer lists the true cause, of a size that shows, and leaves it open."""
    if record["case"]["kind"] not in KINDS or record.get("result") is None:
        return False
    judged = judge(record)
    one = len(judged.truths) == 1 and judged.observable and judged.in_a_set
    return one and not is_settled(record["result"], judged.truths[0])


def is_settled(result: dict[str, Any], truth: Truth) -> bool:
    """Tell whether an answer names the true cause alone, told from all that any motion can part."""
    named = named_of(result)
    if len(named) != 1:
        return False
    said = [named[0], *effects_alike(named[0])]
    allowed = (truth, *SAME.get(truth, ()))
    return any(says(each, truth) for each in said) and all(
        any(says(each, one) for one in allowed) for each in said
    )


def next_records(
    records: Iterable[dict[str, Any]], folder: Path, code: str, asked: Asked
) -> list[dict[str, Any]]:
    """Return a record of the further runs of each case that is left open, at most so many of them."""
    most, only_stored = asked.most, asked.only_stored
    open_ones = [record for record in records if is_left_open(record)]
    order = {kind: number for number, kind in enumerate(KINDS)}
    chosen = sorted(open_ones, key=lambda each: (order[each["case"]["kind"]], each["case"]["seed"]))[:most]
    there = {name_of(record): _stored(record, folder, None if only_stored else code) for record in chosen}
    left = [] if only_stored else [record for record in chosen if there[name_of(record)] is None]
    ways = {name_of(record): ways_of(i, asked.beside) for i, record in enumerate(chosen)}
    for made_now in _driven(left, folder, code, ways, asked):
        file = _file(made_now, folder)
        file.parent.mkdir(exist_ok=True)
        file.write_text(json.dumps(made_now), encoding="utf-8")
        there[name_of(made_now)] = made_now
    return [record for record in there.values() if record is not None]


def ways_of(number: int, beside: int) -> tuple[str, ...]:
    """Return the ways of the n-th case: all of them on every so many."""
    return WAYS if beside and number % beside == 0 else (ASKED,)


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
    records: Sequence[dict[str, Any]], folder: Path, code: str, ways: dict[str, tuple[str, ...]], asked: Asked
) -> Iterator[dict[str, Any]]:
    if not records:
        return
    places = predictions(folder / "predictions" / code)
    for name in _wanted(records, ways):  # once, before the processes start
        try_predicted(name, places)
    each = ((record, folder, places, ways[name_of(record)]) for record in records)
    yield from in_processes(drive, each, asked.jobs, asked.until_s)


def _wanted(records: Sequence[dict[str, Any]], ways: dict[str, tuple[str, ...]]) -> list[str]:
    """Return the canned programs that some case is to drive."""
    programs = {
        chosen_program(way, record, truth_of(record["label"]["effects"][0]))[0]
        for record in records
        for way in ways[name_of(record)]
        if way != REPEAT
    }
    return sorted(name for name in programs if name is not None and name in names())


def try_predicted(name: str, places: dict[str, str]) -> None:
    """Predict a canned program; one that cannot be predicted is told of where it is asked for."""
    home = Path(next(iter(places.values()))).parent
    with contextlib.suppress(NotCannedError):
        predicted(name, home / "cell.toml", home)


def drive(
    record: dict[str, Any], folder: Path, places: dict[str, str], ways: Sequence[str] = WAYS
) -> dict[str, Any]:
    """Make a case again and return what the answer is after one more run, in each way."""
    asked = record["case"]
    case = Case(asked["seed"], asked["kind"], asked["effect"], asked["form"], tuple(asked["without"]))
    place = folder / "cases" / f"{case.name}-next"
    shutil.rmtree(place, ignore_errors=True)
    label = made(case, place / "case", places)
    truth = truth_of(label["effects"][0])
    drives = [_one_way(way, record, label, truth, place / "case", places) for way in ways]
    shutil.rmtree(place, ignore_errors=True)
    return {"case": asked, "code": record["code"], "drives": drives}


def _one_way(
    way: str, record: dict[str, Any], label: dict[str, Any], truth: Truth, case: Path, places: dict[str, str]
) -> dict[str, Any]:
    name, skipped = chosen_program(way, record, truth)
    found: dict[str, Any] = {"way": way, "program": name, "skipped": skipped, "settled": False}
    if name is None:
        return found
    own, number = time.process_time(), len(label["runs"]) + 1
    run = case / f"run-{number}"
    try:
        _drive(name, way, label, run, places)
        after = answer(case, record["case"]["without"])
        found["settled"] = is_settled(after, truth)
        found["named"] = [f"{each['effect']} {each['target']}" for each in named_of(after)]
        found["left"] = [
            f"{one['effect']} {one['target']}" for each in named_of(after) for one in effects_alike(each)
        ]
    except NotCannedError as error:
        found["skipped"] = str(error)
    except Exception as error:  # counts as not settled, and is shown
        found["error"] = repr(error)
    finally:
        shutil.rmtree(run, ignore_errors=True)
    found["cpu_s"] = time.process_time() - own
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
    return [
        Drive(*(drive[key] for key in keys), cpu_s=drive.get("cpu_s", 0.0))
        for record in records
        for drive in record["drives"]
    ]


def cost(records: Sequence[dict[str, Any]]) -> str:
    """Return what a further run costs, and how often each program asked for settled it."""
    drives = [each for each in drives_of(records) if each.skipped is None]
    programs = sorted({str(each.program) for each in drives if each.way == ASKED})
    told = []
    for name in programs:
        mine = [each for each in drives if each.way == ASKED and each.program == name]
        own_s = sum(each.cpu_s for each in mine) / len(mine)
        told.append(f"{name} {sum(each.settled for each in mine)}/{len(mine)} ({own_s:.0f} s)")
    whole_s = sum(each.cpu_s for each in drives)
    return (
        f"Processor seconds: {whole_s:.0f} for {len(drives)} runs of {len(records)} cases. Of each program "
        f"asked for how many settled it, and seconds: {', '.join(told) or 'none'}."
    )


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
