"""The stored cases through the code on PYTHONPATH: one file a case, and beside it what the case took."""

import contextlib
import hashlib
import io
import json
import multiprocessing
import os
import runpy
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

RECORDS = "records"
"""Folder of what the cases took; it is no output, and two trees may differ in it."""


def code() -> str:
    """Return a digest of the package that is imported."""
    import gcode2krl

    package = Path(gcode2krl.__file__ or "").parent
    digest = hashlib.sha256()
    for file in sorted([*package.rglob("*.py"), *package.rglob("*.toml")]):
        digest.update(file.relative_to(package).as_posix().encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def where_from() -> str:
    """Return what code this is, for a person."""
    import gcode2krl

    return f"code {code()} of {Path(gcode2krl.__file__ or '').parent}"


def called(arguments: list[str]) -> str:
    """Return what a command prints on standard output; below it a failure's exit code and errors."""
    out, err = io.StringIO(), io.StringIO()
    before, exit_code = sys.argv, 0
    sys.argv = ["gcode2krl", *arguments]
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            runpy.run_module("gcode2krl", run_name="__main__")
    except SystemExit as end:
        exit_code = end.code if isinstance(end.code, int) else 1
    finally:
        sys.argv = before
    return out.getvalue() + (f"exit code {exit_code}\n{err.getvalue()}" if exit_code else "")


def diagnosed(job: dict[str, Any], out: str) -> str:
    """Return what the diagnosis of a case prints; the current folder is that of the cases."""
    if not job["exclude"]:
        return called([word.replace("{out}", out) for word in job["arguments"]])
    from gcode2krl import Prediction, diagnose, load_run

    folders = [word for word in job["arguments"][1:] if word != "--json"]
    at = folders.index("--holdout") if "--holdout" in folders else len(folders)
    runs = [load_run(each) for each in folders[1:at]]
    held = [load_run(each) for each in folders[at:] if each != "--holdout"]
    gap = diagnose(Prediction.load(folders[0]), runs, held, exclude=tuple(job["exclude"]))
    return json.dumps(gap.as_dict(), indent=2, allow_nan=False) + "\n"


def measured(job: dict[str, Any], out: str) -> tuple[str, dict[str, float]]:
    """Return what a case prints, and the time and memory that it took."""
    forget_peak()
    start, own = time.perf_counter(), time.process_time()
    text = diagnosed(job, out)
    took = {
        "wall_s": time.perf_counter() - start,
        "cpu_s": time.process_time() - own,
        "peak_MB": memory_MB("VmHWM"),
        "after_MB": memory_MB("VmRSS"),
    }
    return text, took


def forget_peak() -> None:
    """Let the process's peak memory begin anew; where the system cannot, the peak is that of all cases."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")


def memory_MB(key: str) -> float:
    """Return a line of the process's status: VmHWM the peak, VmRSS what it has now."""
    for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
        if line.startswith(f"{key}:"):
            return int(line.split()[1]) / 1024.0
    return float("nan")


def stored_jobs(folder: Path, every: int = 1, only: str = "") -> list[dict[str, Any]]:
    """Return the stored cases, or a part of them. Raises ValueError where there are none."""
    file = folder / "jobs.json"
    if not file.exists():
        raise ValueError(f"{folder} holds no cases; `gap_identity.py make {folder}` stores some")
    jobs = json.loads(file.read_text(encoding="utf-8"))
    return [job for job in jobs[::every] if only in job["name"]]


def run(folder: Path, out: Path, workers: int, every: int, only: str) -> int:
    """Diagnose the cases that this code has not yet diagnosed into ``out``; returns the exit code."""
    jobs = stored_jobs(folder, every, only)
    out = out.resolve()
    (out / RECORDS).mkdir(parents=True, exist_ok=True)
    own = code()
    left = [job for job in jobs if not _is_done(out, job["name"], own)]
    _say(f"{len(jobs)} cases, {len(jobs) - len(left)} already there; {where_from()}")
    start = time.perf_counter()
    for i, (name, took) in enumerate(_all(left, folder, out, own, workers)):
        _say(f"{i + 1}/{len(left)} {name} {took['cpu_s']:.1f} s, {took['peak_MB']:.0f} MB")
    _say(f"{(time.perf_counter() - start) / 60.0:.1f} min")
    return 0


def _all(
    left: list[dict[str, Any]], folder: Path, out: Path, own: str, workers: int
) -> Iterator[tuple[str, dict[str, float]]]:
    if not left:
        return
    fresh = multiprocessing.get_context("spawn")  # so that the threads of numpy stay at one
    first = (str(folder.resolve()), left[0], str(out))
    with ProcessPoolExecutor(max(workers, 1), mp_context=fresh, initializer=_warm, initargs=first) as pool:
        waiting = [pool.submit(_one, job, str(out), own) for job in left]
        for each in as_completed(waiting):
            yield each.result()


def _warm(folder: str, job: dict[str, Any], out: str) -> None:
    """Enter the folder, and diagnose a case unmeasured, so that imports and kernels are loaded."""
    os.chdir(folder)
    name = Path(out) / RECORDS / f"warm-{os.getpid()}"
    diagnosed(job, str(name))
    name.with_suffix(".toml").unlink(missing_ok=True)


def _one(job: dict[str, Any], out: str, own: str) -> tuple[str, dict[str, float]]:
    name = job["name"]
    place = Path(out) / name
    place.with_suffix(".toml").unlink(missing_ok=True)
    text, took = measured(job, str(place))
    kind = ".json" if "--json" in job["arguments"] else ".txt"
    place.with_suffix(kind).write_text(text, encoding="utf-8", newline="\n")
    record = json.dumps({"code": own, "pid": os.getpid(), **took})
    (Path(out) / RECORDS / f"{name}.json").write_text(record + "\n", encoding="utf-8")
    return name, took


def _is_done(out: Path, name: str, own: str) -> bool:
    record = out / RECORDS / f"{name}.json"
    return record.exists() and json.loads(record.read_text(encoding="utf-8"))["code"] == own


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
