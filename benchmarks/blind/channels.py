"""Does a channel more or less make a right answer worse?

``python benchmarks/blind/channels.py --cases 30 --seed 1`` makes cases of one effect with every channel that
a run can have, diagnoses each as it is and without each channel in turn, and compares. Taking a channel away
may cost the name only where the effect is smaller than the noise in all that is left; it may never lead to a
wrong name. Adding the channel again may do neither. Exit code 1 where an answer became worse.
"""

import argparse
import multiprocessing
import os
import shutil
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

if __name__ == "__main__":  # a case runs on one core; must be set before numpy is loaded
    for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "GCODE2KRL_THREADS"):
        os.environ.setdefault(_name, "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import polars as pl
from blind.cases import Case, answer, done, drawn, driven, fingerprint, predictions, say, store
from blind.cases import plan as planned
from blind.figures import grouped, rate
from blind.score import Judged, judge
from blind.tables import table

JOINTS = ("A1", "A2", "A3", "A4", "A5", "A6")


def _columns(pattern: str, joints: Iterable[int] = range(1, 7)) -> tuple[str, ...]:
    return tuple(pattern.format(joint) for joint in joints)


@dataclass(frozen=True)
class Channel:
    """A table of a run, or columns of it."""

    table: str
    columns: tuple[str, ...] = ()
    """The whole table where empty."""
    signals: tuple[str, ...] = ()
    """Signals of the label that go with it."""
    joints: tuple[str, ...] = JOINTS
    """Joints whose signals go with it."""


LOAD = "q{}_load_deg"
CHANNELS = {
    "tracker": Channel("tracker", signals=("tcp",)),
    "orientation": Channel("tracker", ("a_deg", "b_deg", "c_deg")),
    "force": Channel("force", signals=("force",)),
    "moments": Channel("force", ("mx_Nm", "my_Nm", "mz_Nm")),
    "controller": Channel("controller", signals=("joint_commanded", "joint_actual", "joint_load")),
    "load encoders": Channel("controller", _columns(LOAD), ("joint_load",)),
    "load encoders of A1-A3": Channel("controller", _columns(LOAD, (1, 2, 3)), ("joint_load",), JOINTS[:3]),
    "load encoders of A4-A6": Channel("controller", _columns(LOAD, (4, 5, 6)), ("joint_load",), JOINTS[3:]),
    "motor torques": Channel("controller", _columns("tau{}_Nm")),
    "scan": Channel("scan", signals=("scan",)),
}
"""Name -> what is taken away."""
MEASURES = ("tracker", "force", "controller")
"""At least one of these tables must be left."""


def without(channel: Channel, case: Path, to: Path) -> bool:
    """Copy a case without a channel; False, and no copy, where it has none or nothing else."""
    shutil.copytree(case, to)
    changed = [_taken(channel, run) for run in sorted(to.glob("run-*"))]
    left = all(any(_file(run, table) for table in MEASURES) for run in to.glob("run-*"))
    if any(changed) and left:
        return True
    shutil.rmtree(to)
    return False


def _taken(channel: Channel, run: Path) -> bool:
    file = _file(run, channel.table)
    if file is None:
        return False
    if not channel.columns:
        file.unlink()
        return True
    binary = file.suffix == ".parquet"
    table = pl.read_parquet(file) if binary else pl.read_csv(file, infer_schema_length=None)
    present = [name for name in channel.columns if name in table.columns]
    smaller = table.drop(present)
    if binary:
        smaller.write_parquet(file)
    else:
        smaller.write_csv(file)
    return bool(present)


def _file(run: Path, table: str) -> Path | None:
    return next((file for ending in ("csv", "parquet") if (file := run / f"{table}.{ending}").exists()), None)


def shows_without(channel: Channel, entry: dict[str, Any]) -> bool:
    """Tell whether an effect is at least as large as the noise in a signal that is left without a channel."""
    joints = set((entry.get("depends") or {}).get("joints") or JOINTS)
    gone = set(channel.signals) if joints <= set(channel.joints) else set()
    ratios = {name: signal["ratio"] for name, signal in entry["signals"].items()}
    ratios[entry["main_signal"]] = entry["ratio"]
    return any(ratio >= 1.0 for name, ratio in ratios.items() if name not in gone)


WHOLE = "(all)"
SAME, LOST, HIDDEN, WRONG = "same", "lost", "lost, does not show", "wrong name"
WORSE = (LOST, WRONG)


@dataclass(frozen=True)
class Change:
    """A right answer, and what became of it when a channel went or came."""

    case: str
    truth: str
    channel: str
    added: bool
    fate: str
    answer: str

    @property
    def is_worse(self) -> bool:
        """Tell whether the answer must not have become this."""
        return self.fate in WORSE


def arguments(given: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="channels.py", description=__doc__.split("\n")[0])
    parser.add_argument("--cases", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1, help="first seed, as in check.py")
    parser.add_argument("--effects", default="", help="names, joined by commas: these in turn")
    parser.add_argument("--channels", default="", help="names, joined by commas; default: all")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--resume", type=Path, help="folder that keeps predictions and records, and goes on")
    return parser.parse_args(given)


def whole_case(case: Case, folder: Path, places: dict[str, str]) -> dict[str, Any]:
    """Let the plant write a case with every channel; returns its label, which is taken away."""
    plan, more = drawn(case)
    every = ("controller", "tracker", "force")
    how = replace(plan.how, tables=every, q_load=True, tracker_turns=True, torques=True)
    how = replace(how, force_moments=True, scan=True)
    return driven(replace(plan, how=how), more, folder, places)


def run_case(case: Case, channels: Sequence[str], code: str, places: dict[str, str]) -> dict[str, Any]:
    """Return the record of a case: its label, and the answers with all channels and without each."""
    with tempfile.TemporaryDirectory() as scratch:
        whole = Path(scratch) / "case"
        label = whole_case(case, whole, places)
        answers = {WHOLE: _answer(whole)}
        for name in channels:
            smaller = Path(scratch) / name.replace(" ", "-")
            if without(CHANNELS[name], whole, smaller):
                answers[name] = _answer(smaller)
    asked = {"seed": case.seed, "kind": case.kind, "effect": case.effect, "form": case.form}
    return {"case": asked, "code": code, "label": label, "answers": answers}


def _answer(folder: Path) -> dict[str, Any]:
    """Return the answer, or the exception in its place."""
    try:
        return {"result": answer(folder), "error": None}
    except Exception as error:  # no answer is worse than a right one, and is shown
        return {"result": None, "error": repr(error)}


def changes(record: dict[str, Any]) -> Iterator[Change]:
    """Yield what each channel did to the right answers of a case, taken away and added."""
    judged = {
        name: judge({"case": record["case"], "label": record["label"], **said})
        for name, said in record["answers"].items()
    }
    whole = judged.pop(WHOLE)
    for name, smaller in judged.items():
        shows = shows_without(CHANNELS[name], record["label"]["effects"][0])
        if whole.declared:
            yield _change(whole, name, False, smaller, shows)
        if smaller.declared:
            yield _change(whole, name, True, whole, True)


def _change(case: Judged, channel: str, added: bool, after: Judged, shows: bool) -> Change:
    if after.declared:
        fate = SAME
    elif after.is_wrongly_named or after.failed:
        fate = WRONG
    else:
        fate = LOST if shows else HIDDEN
    name = f"{case.kind}-{case.seed:05d}"
    return Change(name, f"{case.name} ({case.ratio:.2f})", channel, added, fate, after.answer)


def report(found: Sequence[Change], cases: int) -> str:
    """Return the counts of each channel and the answers that became worse."""
    fates = (SAME, HIDDEN, LOST, WRONG)
    rows = [
        (
            str(channel),
            "added" if added else "taken away",
            str(len(mine)),
            *(str(sum(each.fate == fate for each in mine)) for fate in fates),
        )
        for (channel, added), mine in grouped(found, lambda each: (each.channel, each.added)).items()
    ]
    parts = [f"{cases} cases", table(("channel", "", "right before", *fates), rows)]
    worse = [each for each in found if each.is_worse]
    if worse:
        lines = [
            (each.case, each.truth, each.channel, "added" if each.added else "taken away", each.answer)
            for each in worse
        ]
        parts += [table(("case", "truth (x noise)", "channel", "", "answer then"), lines)]
    for added, what in ((False, "taken away"), (True, "added")):
        mine = [each for each in found if each.added == added]
        lost, wrong = (rate(each.fate in fates for each in mine) for fates in (WORSE, (WRONG,)))
        if mine:
            parts += [
                f"A channel {what}, {lost.of} right answers: worse {lost.value:.3f} (<= {lost.upper:.3f}), "
                f"a wrong name {wrong.value:.3f} (<= {wrong.upper:.3f})"
            ]
    parts += [f"{len(worse)} of {len(found)} right answers became worse"]
    return "\n\n".join(parts)


def records_of(
    cases: Sequence[Case], folder: Path, channels: Sequence[str], jobs: int
) -> list[dict[str, Any]]:
    """Return the records of all cases, those already there included."""
    code = fingerprint()
    there = [done(case, folder, code) for case in cases]
    left = [case for case, record in zip(cases, there, strict=True) if record is None]
    places = predictions(folder / "predictions" / code)
    fresh = []
    for record in _run(left, channels, code, places, jobs):
        store(record, folder)
        fresh.append(record)
        worse = [f"{each.channel}: {each.answer}" for each in changes(record) if each.is_worse]
        say(f"{len(fresh)}/{len(left)} {record['case']['effect']} {'; '.join(worse) or 'not worse'}")
    return [record for record in there if record is not None] + fresh


def _run(
    cases: Sequence[Case], channels: Sequence[str], code: str, places: dict[str, str], jobs: int
) -> Iterable[dict[str, Any]]:
    if jobs <= 1 or len(cases) <= 1:
        yield from (run_case(case, channels, code, places) for case in cases)
        return
    with ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn")) as pool:
        waiting = [pool.submit(run_case, case, channels, code, places) for case in cases]
        yield from (each.result() for each in as_completed(waiting))


def main(given: Sequence[str] | None = None) -> int:
    """Run it; the exit code is 1 where an answer became worse, 2 where the options make no sense."""
    options = arguments(given)
    channels = [name.strip() for name in options.channels.split(",") if name.strip()] or list(CHANNELS)
    if unknown := set(channels) - set(CHANNELS):
        say(f"channels: no channel {', '.join(sorted(unknown))}; there are {', '.join(CHANNELS)}")
        return 2
    try:
        effects = [name for name in options.effects.split(",") if name]
        cases = planned(options.seed, {"single": options.cases}, effects)
    except ValueError as error:
        say(f"channels: {error}")
        return 2
    with tempfile.TemporaryDirectory() as scratch:
        records = records_of(cases, options.resume or Path(scratch), channels, options.jobs)
    found = [change for record in records for change in changes(record)]
    print(report(found, len(records)))
    return int(any(each.is_worse for each in found))


if __name__ == "__main__":
    raise SystemExit(main())
