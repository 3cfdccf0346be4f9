"""Cases stored for a comparison of two trees: which ones, and their inputs as folders.

Every effect of the plant's library and every slip is there once; beside them runs without an effect, effects
of no library, pairs, effects taken out of the library, logs without a prediction, and runs without a tracker
or force sensor. A case has one to three runs and, in turn, one held out.
"""

import json
import shutil
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(Path(__file__).parent)]

from gap_blind_cases import SCORED_FROM, predictions  # noqa: E402

from tests.plant.cases import make_case  # noqa: E402
from tests.plant.effects import LIBRARY, SLIPS  # noqa: E402
from tests.plant.waypoints import PROGRAMS  # noqa: E402

SCENE = "predictions/cell.toml"


@dataclass(frozen=True)
class Wanted:
    """What a case is to have."""

    kind: str
    effect: str = "none"
    runs: int = 2
    """Runs that explain."""
    holdout: int = 0
    dropped: str = ""
    """A table taken out of its runs."""
    from_log: bool = False
    with_cell: bool = True
    exclude: tuple[str, ...] = ()
    apply: bool = False
    """The named causes are written into a copy of the cell."""


@dataclass(frozen=True)
class Job:
    """One call: the words of the command line, with ``{out}`` for the output folder and the case's name."""

    name: str
    arguments: list[str]
    exclude: list[str]
    """Effects left out of the candidates, for which the command line has no option."""


IN_TURN = ({"runs": 2}, {"runs": 2, "holdout": 1}, {"runs": 1}, {"runs": 3}, {"runs": 1, "holdout": 1})
HOURS = ("thermal", "force_drift", "tool_wear")
"""Effects that change over hours; they need runs that lie apart."""
OTHERS = (
    Wanted("null", runs=3),
    Wanted("null", runs=1),
    Wanted("null", holdout=1),
    Wanted("null", apply=True),
    Wanted("null", dropped="controller"),
    Wanted("open", "open:cable_snag"),
    Wanted("open", "open:floor_sways", holdout=1),
    Wanted("open", "open:tool_creeps", runs=1),
    Wanted("pair", "backlash+force_scale", runs=3),
    Wanted("pair", "thermal+friction", runs=3),
    Wanted("pair", "servo_lag+stiffness"),
    Wanted("deleted", "backlash", exclude=("backlash",)),
    Wanted("deleted", "stiffness", exclude=("stiffness",), holdout=1),
    Wanted("deleted", "servo_lag", exclude=("servo_lag",), runs=1),
    Wanted("log", "backlash", from_log=True),
    Wanted("log", "friction", from_log=True, with_cell=False),
    Wanted("log", "none", from_log=True, with_cell=False, runs=1),
    Wanted("log", "transmission", from_log=True, holdout=1),
    Wanted("blind", "backlash", dropped="tracker"),
    Wanted("blind", "edge_force", dropped="tracker", holdout=1),
    Wanted("blind", "mastering", dropped="force"),
)
"""Everything besides one effect or one slip."""


def wanted(count: int) -> list[Wanted]:
    """Return so many cases: each kind in turn, spread evenly where they are fewer than the whole list."""
    single = [
        Wanted("single", name, **(IN_TURN[3] if name in HOURS else IN_TURN[i % len(IN_TURN)]))
        for i, name in enumerate(sorted(LIBRARY))
    ]
    single = [replace(each, apply=i % 7 == 3) for i, each in enumerate(single)]
    slip = [Wanted("slip", name, runs=1 + i % 2) for i, name in enumerate(sorted(SLIPS))]
    whole = _interleaved([single, slip, list(OTHERS)])
    if count <= len(whole):
        return [whole[i * len(whole) // count] for i in range(count)]
    return [whole[i % len(whole)] for i in range(count)]


def _interleaved(lists: Sequence[list[Wanted]]) -> list[Wanted]:
    """Return the lists as one, each spread evenly over all of it, so that a part of it has some of each."""
    places = [((i + 0.5) / len(each), n, i) for n, each in enumerate(lists) for i in range(len(each))]
    return [lists[n][i] for _, n, i in sorted(places)]


def store(folder: Path, count: int, seed: int) -> int:
    """Write predictions and cases into a folder; what is there already stays. Returns the exit code.

    Raises ValueError where a seed belongs to the cases that the blind check scores.
    """
    if not 0 < seed <= SCORED_FROM - count:
        raise ValueError(f"seeds from {seed}: {count} cases must stay between 1 and {SCORED_FROM - 1}")
    predictions(folder / "predictions")
    jobs = [_stored(folder, i, seed + i, each) for i, each in enumerate(wanted(count))]
    jobs += _example(folder)
    text = json.dumps([asdict(job) for job in jobs], indent=1)
    (folder / "jobs.json").write_text(text + "\n", encoding="utf-8")
    print(f"{len(jobs)} cases in {folder}")
    return 0


def _stored(folder: Path, number: int, seed: int, case: Wanted) -> Job:
    effect = case.effect.replace("open:", "").replace("+", "-")
    name = f"{number + 1:03d}-{case.kind}-{effect}"
    place = folder / "cases" / name
    if not place.exists():
        _written(place, seed, case)
        print(name, file=sys.stderr, flush=True)
    runs = [f"cases/{name}/run-{i + 1}" for i in range(case.runs + case.holdout)]
    words = ["diagnose", "--json"]
    if case.from_log:
        words += ["--from-log", *(["--cell", SCENE] if case.with_cell else [])]
    else:
        words.append(_prediction(folder / runs[0]))
    words += runs[: case.runs]
    for run in runs[case.runs :]:
        words += ["--holdout", run]
    if case.apply:
        words += ["--cell", SCENE, "--apply", "{out}.toml"]
    return Job(name, words, list(case.exclude))


def _written(place: Path, seed: int, case: Wanted) -> None:
    """Make the runs beside and rename them, so that a folder that is there is whole."""
    beside = place.with_name("unfinished")
    shutil.rmtree(beside, ignore_errors=True)
    make_case(seed, beside, case.effect, runs=case.runs + case.holdout, predictions="../../../predictions")
    beside.with_name("unfinished.label.json").unlink()
    for table in beside.glob(f"run-*/{case.dropped}.*") if case.dropped else ():
        table.unlink()
    beside.rename(place)


def _prediction(run: Path) -> str:
    """Return the prediction that a run names, from the folder of the cases."""
    import tomllib

    keys = tomllib.loads((run / "run.toml").read_text(encoding="utf-8"))
    return f"predictions/{Path(keys['prediction']).name}"


def _example(folder: Path) -> list[Job]:
    """Return a case with play in axis 3, as JSON and as text."""
    place = folder / "cases" / "example"
    if not place.exists():
        make_case(1032, place, "backlash@A3", "same", predictions="../../../predictions")
        place.with_name("example.label.json").unlink()
    runs = sorted(f"cases/example/{run.name}" for run in place.glob("run-*"))
    named = f"predictions/{next(iter(PROGRAMS))}"
    return [
        Job("example", ["diagnose", "--json", named, *runs], []),
        Job("example-text", ["diagnose", named, *runs], []),
    ]
