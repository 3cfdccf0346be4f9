"""Which thresholds decide a name, and what the check says when each is halved and doubled.

``list`` prints all thresholds of the diagnosis with kind, seeds and reason; ``make FOLDER`` stores
calibration cases, ``take FOLDER --check OTHER`` those that a check has kept, with their answers;
``screen FOLDER`` halves and doubles every calibrated threshold on a few of them and ranks the thresholds by
how many answers change; ``table FOLDER`` prints the figures of all stored cases for the ten that matter most.
Each setting is a process of its own, in which the thresholds are replaced before the diagnosis is loaded.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))

import numpy as np
from gap_blind_cases import NULLS, ROOT, SCORED_FROM, plan, predictions, shelves
from gap_blind_figures import rate
from gap_blind_print import table
from gap_blind_run import fingerprint, made
from gap_blind_score import Judged, judge
from gap_blind_workers import say
from gap_thresholds_changed import BASE, FACTORS, Setting, thresholds

KINDS = {"null": 0.15, "null_foreign_noise": 0.15, "single": 0.35, "open": 0.2, "deleted": 0.1, "pair": 0.05}
"""Shares of the stored cases."""
MOST = 10
ENVIRONMENT = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "GCODE2KRL_THREADS"), "1"
)


def arguments(given: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="gap_thresholds.py", description=__doc__.split("\n")[0])
    parser.add_argument("what", choices=("list", "make", "take", "screen", "table"))
    parser.add_argument("folder", type=Path, nargs="?", help="stored cases and answers")
    parser.add_argument("--cases", type=int, default=0, help="make: how many; else: only the first ones")
    parser.add_argument("--seed", type=int, default=1, help="make: first seed, of calibration cases")
    parser.add_argument("--check", type=Path, help="take: folder of gap_blind.py --keep --resume")
    parser.add_argument("--kind", default="calibrated", help="screen: of this kind alone; empty: all")
    parser.add_argument("--names", default="", help="room.name, joined by commas: these thresholds alone")
    parser.add_argument("--jobs", type=int, default=2, help="processes, one thread each")
    return parser.parse_args(given)


def print_list() -> None:
    """Print all thresholds, a line each, and how many are of which kind."""
    found = thresholds()
    rows = []
    for each in found:
        seeds = "" if each.seeds is None else f"{each.seeds.start}-{each.seeds.stop - 1}"
        rows.append((f"{each.room}.{each.name}", str(each.value), each.kind.value, seeds, each.reason))
    print(table(("threshold", "value", "kind", "seeds", "reason"), rows))
    kinds = [each.kind.value for each in found]
    print("\n" + ", ".join(f"{kinds.count(kind)} {kind}" for kind in sorted(set(kinds))))


# stored cases -----------------------------------------------------------------------------------------------


def make(folder: Path, count: int, seed: int) -> None:
    """Store calibration cases of several kinds: runs, predictions, and the labels apart from them.

    Raises ValueError for seeds that are scored.
    """
    if seed >= SCORED_FROM:
        raise ValueError(
            f"seed {seed}: from {SCORED_FROM} on cases are scored; thresholds are never set on them"
        )
    counts = {kind: max(1, round(share * count)) for kind, share in KINDS.items()}
    names = sorted({name for shelf in shelves().values() for name in shelf})
    cases = plan(seed, counts, np.random.default_rng(seed).permutation(names).tolist())
    places = predictions(folder / "predictions")
    for case in cases:
        if _label_file(folder, case.name).exists():
            continue
        label = made(case, folder / "cases" / case.name, places)
        kept = {"case": {"seed": case.seed, "kind": case.kind, "without": case.without}, "label": label}
        _label_file(folder, case.name).parent.mkdir(exist_ok=True)
        _label_file(folder, case.name).write_text(json.dumps(kept), encoding="utf-8")
    say(f"{len(cases)} cases in {folder}")


def take(folder: Path, check: Path, count: int) -> None:
    """Store cases of a check that kept their runs, and its answers where this code gave them.

    Raises ValueError where it kept none, or where they are scored ones.
    """
    answers: dict[str, Any] = {}
    code = fingerprint()
    records = [
        json.loads(file.read_text(encoding="utf-8")) for file in sorted((check / "results").glob("*.json"))
    ]
    kept = [each for each in records if (check / "cases" / _name(each) / "case").exists()]
    if not kept:
        raise ValueError(f"{check}: no kept runs; make them with gap_blind.py --keep --resume {check}")
    if scored := [_name(each) for each in kept if each["case"]["seed"] >= SCORED_FROM]:
        raise ValueError(f"{scored[0]}: scored cases set no thresholds")
    for record in _mixed(kept)[: count or None]:
        name, case = _name(record), record["case"]
        shutil.copytree(check / "cases" / name / "case", folder / "cases" / name, dirs_exist_ok=True)
        label = {"case": {key: case[key] for key in ("seed", "kind", "without")}, "label": record["label"]}
        _label_file(folder, name).parent.mkdir(exist_ok=True)
        _label_file(folder, name).write_text(json.dumps(label), encoding="utf-8")
        if record["code"] == code:
            answers[name] = {key: record[key] for key in ("result", "error")} | {
                "cpu_s": record.get("diagnosis_cpu_s", 0.0)
            }
    if answers:
        _keep(folder, BASE, code, answers)
    say(f"{len(list((folder / 'labels').glob('*.json')))} cases in {folder}, {len(answers)} with answers")


def _name(record: dict[str, Any]) -> str:
    return f"{record['case']['kind']}-{record['case']['seed']:05d}"


def _mixed(records: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the records with their kinds in turn."""
    turn: dict[str, int] = {}
    order = []
    for record in records:
        kind = record["case"]["kind"]
        turn[kind] = turn.get(kind, 0) + 1
        order.append(turn[kind])
    return [record for _, record in sorted(zip(order, records, strict=True), key=lambda pair: pair[0])]


def _label_file(folder: Path, name: str) -> Path:
    return folder / "labels" / f"{name}.json"


def stored(folder: Path, most: int) -> dict[str, dict[str, Any]]:
    """Return seed, kind and label of the stored cases by name, kinds mixed; at most so many where not 0."""
    files = sorted((folder / "labels").glob("*.json"))
    by_kind: dict[str, list[Path]] = {}
    for file in files:
        by_kind.setdefault(file.stem.rpartition("-")[0], []).append(file)
    mixed = sorted(files, key=lambda file: by_kind[file.stem.rpartition("-")[0]].index(file))
    chosen = mixed[:most] if most else mixed
    return {file.stem: json.loads(file.read_text(encoding="utf-8")) for file in chosen}


# answers under a setting ------------------------------------------------------------------------------------


def judgements(folder: Path, cases: dict[str, dict[str, Any]], setting: Setting) -> dict[str, Judged]:
    """Return the judgement of each case under a setting; answers that this code gave already are kept."""
    file = _answers_file(folder, setting)
    kept = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    code = fingerprint()
    answers = kept.get("answers", {}) if kept.get("code") == code else {}
    wanted = {name: case for name, case in cases.items() if name not in answers}
    if wanted:
        answers |= _asked(folder, wanted, setting)
        _keep(folder, setting, code, answers)
    return {name: judge({**case, **answers[name]}) for name, case in cases.items()}


def _answers_file(folder: Path, setting: Setting) -> Path:
    return folder / "answers" / f"{setting}.json"


def _keep(folder: Path, setting: Setting, code: str, answers: dict[str, Any]) -> None:
    file = _answers_file(folder, setting)
    file.parent.mkdir(exist_ok=True)
    file.write_text(json.dumps({"code": code, "answers": answers}), encoding="utf-8")


def told_cost(folder: Path, cases: Sequence[str], count: int) -> str:
    """Return what so many settings will take, by the stored answers of the thresholds as they are."""
    answers = json.loads(_answers_file(folder, BASE).read_text(encoding="utf-8"))["answers"]
    own_s = sum(answers[name].get("cpu_s", 0.0) for name in cases)
    whole_min = count * own_s / 60.0
    return f"{count} settings of {len(cases)} cases, {own_s:.0f} s each: {whole_min:.0f} min of a core"


def _asked(folder: Path, cases: dict[str, dict[str, Any]], setting: Setting) -> dict[str, Any]:
    """Let a process of its own answer the cases under a setting."""
    task = {
        "setting": [setting.room, setting.name, setting.factor],
        "cases": {
            name: [str(folder / "cases" / name), case["case"]["without"]] for name, case in cases.items()
        },
    }
    command = [sys.executable, str(ROOT / "benchmarks" / "gap_thresholds_changed.py")]
    environment = {**os.environ, **ENVIRONMENT}
    done = subprocess.run(command, input=json.dumps(task), capture_output=True, text=True, env=environment)
    if done.returncode != 0:
        raise RuntimeError(f"{setting}: {done.stderr[-2000:]}")
    say(f"{setting}: {len(cases)} cases")
    answers: dict[str, Any] = json.loads(done.stdout)
    return answers


def settings(names: Sequence[str], kind: str = "") -> list[Setting]:
    """Return half and twice of each threshold that is a number; of these names or this kind if given."""
    found = [
        Setting(each.room, each.name, factor)
        for each in thresholds()
        for factor in FACTORS
        if (not names or f"{each.room}.{each.name}" in names)
        and kind in ("", each.kind.value)
        and Setting.applies(each.value, factor)
    ]
    if names and (unknown := set(names) - {f"{each.room}.{each.name}" for each in found}):
        raise ValueError(f"no threshold that is a number: {', '.join(sorted(unknown))}")
    return found


def compared(
    folder: Path, cases: dict[str, dict[str, Any]], asked: Sequence[Setting], jobs: int
) -> Iterator[tuple[Setting, dict[str, Judged]]]:
    """Yield each setting with its judgements; each is a process, so that threads suffice to wait for them."""
    with ThreadPoolExecutor(jobs) as pool:
        yield from zip(asked, pool.map(lambda one: judgements(folder, cases, one), asked), strict=True)


def changed(before: dict[str, Judged], after: dict[str, Judged]) -> int:
    """Return how many answers differ: in their verdict or in what they name."""
    return sum(
        (before[name].verdict, before[name].named) != (after[name].verdict, after[name].named)
        for name in before
    )


# figures ----------------------------------------------------------------------------------------------------


def screen(folder: Path, most: int, names: Sequence[str], jobs: int, kind: str = "") -> list[str]:
    """Rank the thresholds by how many answers change, keep and return the order."""
    cases = stored(folder, most)
    base = judgements(folder, cases, BASE)
    counts: dict[str, int] = {}
    asked = settings(names, kind)
    say(told_cost(folder, list(cases), len(asked)))
    for setting, judged in compared(folder, cases, asked, jobs):
        key = f"{setting.room}.{setting.name}"
        counts[key] = counts.get(key, 0) + changed(base, judged)
    order = sorted(counts, key=lambda key: -counts[key])
    (folder / "order.json").write_text(json.dumps(order), encoding="utf-8")
    print(table(("threshold", "answers changed"), [(key, str(counts[key])) for key in order]))
    return order


def print_table(folder: Path, most: int, names: Sequence[str], jobs: int) -> None:
    """Print the figures of the check for each threshold halved and doubled."""
    cases = stored(folder, most)
    base = judgements(folder, cases, BASE)
    head = ("threshold", "value", "", "false alarms", "declared", "wrong name", "flagged", "pairs", "changed")
    rows = [("as it is", "", "", *_figures(base), "")]
    say(told_cost(folder, list(cases), len(settings(names))))
    values = {f"{each.room}.{each.name}": each.value for each in thresholds()}
    for setting, judged in compared(folder, cases, settings(names), jobs):
        key, count = f"{setting.room}.{setting.name}", changed(base, judged)
        rows.append(
            (key, str(values[key]), f"x {setting.factor:g}", *_figures(judged), f"{count}/{len(cases)}")
        )
    print(table(head, rows))


def _figures(judged: dict[str, Judged]) -> tuple[str, ...]:
    """Return false alarms, declared sets, wrong names, unknowns flagged, pairs exactly right."""
    cases = list(judged.values())
    seen = [each for each in cases if each.observable]
    unknown = [each for each in seen if each.kind in ("open", "deleted")]
    rates = (
        rate(each.alarms for each in cases if each.kind in NULLS),
        rate(each.declared for each in seen if each.kind == "single"),
        rate(each.is_wrongly_named for each in cases),
        rate(each.flagged for each in unknown),
        rate(each.exact for each in seen if each.kind == "pair"),
    )
    return tuple(f"{each.count}/{each.of}" for each in rates)


def main(given: Sequence[str] | None = None) -> int:
    """Run a part of it; the exit code is 2 where the options make no sense."""
    options = arguments(given)
    names = [name for name in options.names.split(",") if name]
    if options.what == "list":
        print_list()
        return 0
    if options.folder is None:
        say(f"gap_thresholds: {options.what} needs a folder")
        return 2
    options.folder.mkdir(parents=True, exist_ok=True)
    try:
        if options.what == "make":
            make(options.folder, options.cases or 40, options.seed)
        elif options.what == "take":
            if options.check is None:
                raise ValueError("take needs --check FOLDER")
            take(options.folder, options.check, options.cases)
        elif options.what == "screen":
            screen(options.folder, options.cases, names, options.jobs, "" if names else options.kind)
        else:
            order = options.folder / "order.json"
            if not names and not order.exists():
                raise ValueError("run screen first, or give --names")
            ranked = names or json.loads(order.read_text(encoding="utf-8"))[:MOST]
            print_table(options.folder, options.cases, ranked, options.jobs)
    except ValueError as error:
        say(f"gap_thresholds: {error}")
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
