"""Processor time and memory of two trees side by side: each case by both, one after the other, in turn first.

Each tree has a process of its own that lives through all cases, so that imports and compiled kernels are no
part of what is measured. What else runs on the machine disturbs both alike, as they are measured within
seconds of each other; a tree against itself shows how far two equal ones differ by chance.
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gap_identity_run import measured, stored_jobs, where_from

Took = dict[str, float]
REPEATABLE = {"MALLOC_MMAP_THRESHOLD_": "131072", "PYTHONHASHSEED": "0"}
"""With a fixed threshold glibc gives freed arrays back at once. Otherwise it keeps some of them, a tenth of
the peak more or less by chance. The price is some percent of processor time, for both trees alike."""


class Worker:
    """A process that diagnoses stored cases by the code of one tree."""

    def __init__(self, tree: Path, folder: Path, scratch: Path) -> None:
        words = [sys.executable, str(Path(__file__).resolve()), str(folder.resolve()), str(scratch)]
        environment = os.environ | REPEATABLE | {"PYTHONPATH": str(tree.resolve())}
        self.process = subprocess.Popen(
            words, env=environment, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        self.name = self._line()["name"]

    def _line(self) -> dict[str, Any]:
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if not line:
            raise ValueError("a process that diagnoses has ended; what it said stands above")
        answer: dict[str, Any] = json.loads(line)
        return answer

    def diagnose(self, job: dict[str, Any]) -> tuple[str, Took]:
        """Return what the diagnosis prints, and what it took."""
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps(job) + "\n")
        self.process.stdin.flush()
        answer = self._line()
        return answer["text"], answer["took"]

    def end(self) -> None:
        """Let the process end."""
        assert self.process.stdin is not None
        self.process.stdin.close()
        self.process.wait()


def serve(folder: Path, scratch: Path) -> None:
    """Diagnose each case that standard input names, and answer with a line of JSON."""
    answers = sys.stdout
    sys.stdout = sys.stderr  # nothing else may stand among the answers
    os.chdir(folder)
    print(json.dumps({"name": where_from()}), file=answers, flush=True)
    for line in sys.stdin:
        job = json.loads(line)
        text, took = measured(job, str(scratch / "out"))
        (scratch / "out.toml").unlink(missing_ok=True)
        print(json.dumps({"text": text, "took": took}), file=answers, flush=True)


@dataclass(frozen=True)
class Pair:
    """What one case took by both trees."""

    name: str
    a: Took
    b: Took
    same: bool

    def ratio(self, key: str) -> float:
        """Return B over A."""
        return self.b[key] / self.a[key]


def time_trees(tree_a: Path, tree_b: Path, folder: Path, count: int, rounds: int) -> int:
    """Print how the trees compare; returns the exit code. Raises ValueError where there are no cases.

    Each round has processes of its own, so that their peaks are independent.
    """
    jobs = stored_jobs(folder)
    jobs = [jobs[i * len(jobs) // count] for i in range(min(count, len(jobs)))]
    found = [_round((tree_a, tree_b), folder, jobs, number) for number in range(rounds)]
    print(summary(found))
    return 0


def _round(trees: Sequence[Path], folder: Path, jobs: Sequence[dict[str, Any]], number: int) -> list[Pair]:
    with tempfile.TemporaryDirectory() as scratch:
        places = [Path(scratch) / side for side in "ab"]
        for place in places:
            place.mkdir()
        workers = [Worker(tree, folder, place) for tree, place in zip(trees, places, strict=True)]
        for side, worker in zip("AB", workers, strict=True):
            print(f"round {number + 1} {side}: {worker.name}")
            worker.diagnose(jobs[0])  # not measured: it loads modules and kernels
        pairs = [_pair(workers, job, number + i) for i, job in enumerate(jobs)]
        for worker in workers:
            worker.end()
    return pairs


def _pair(workers: Sequence[Worker], job: dict[str, Any], number: int) -> Pair:
    """Measure a case by both trees; A is first in every second one."""
    order = (0, 1) if number % 2 == 0 else (1, 0)
    found = {side: workers[side].diagnose(job) for side in order}
    pair = Pair(job["name"], found[0][1], found[1][1], found[0][0] == found[1][0])
    print(_row(pair), flush=True)
    return pair


def _row(pair: Pair) -> str:
    told = "" if pair.same else "  not identical"
    return (
        f"{pair.name:34} cpu {pair.a['cpu_s']:6.2f} {pair.b['cpu_s']:6.2f} s ({pair.ratio('cpu_s'):.3f})  "
        f"peak {pair.a['peak_MB']:5.0f} {pair.b['peak_MB']:5.0f} MB ({pair.ratio('peak_MB'):.3f}){told}"
    )


def summary(rounds: Sequence[Sequence[Pair]]) -> str:
    """Return the figures of all cases: B over A of the whole, and how far single cases scatter about it."""
    lines = []
    pairs = [pair for each in rounds for pair in each]
    for key, name in (("cpu_s", "processor time"), ("wall_s", "wall time")):
        a, b = sum(pair.a[key] for pair in pairs), sum(pair.b[key] for pair in pairs)
        ratios = [pair.ratio(key) for pair in pairs]
        error = statistics.stdev(ratios) / len(ratios) ** 0.5 if len(ratios) > 1 else float("nan")
        lines.append(
            f"{name}: A {a:.1f} s, B {b:.1f} s, B/A {b / a:.3f}; of single cases the median is "
            f"{statistics.median(ratios):.3f}, the range {min(ratios):.3f}..{max(ratios):.3f}, the standard "
            f"error of their mean {error:.3f}"
        )
    for key, name in (("peak_MB", "peak memory"), ("after_MB", "most memory after a case")):
        a_MB = [max(pair.a[key] for pair in each) for each in rounds]
        b_MB = [max(pair.b[key] for pair in each) for each in rounds]
        lines.append(
            f"{name}, mean of {len(rounds)} rounds: A {_spread(a_MB)} MB, B {_spread(b_MB)} MB, "
            f"B/A {sum(b_MB) / sum(a_MB):.3f}"
        )
    lines.append(f"{sum(pair.same for pair in pairs)} of {len(pairs)} outputs identical")
    return "\n".join(lines)


def _spread(values: Sequence[float]) -> str:
    return f"{statistics.fmean(values):.0f} ({min(values):.0f}..{max(values):.0f})"


if __name__ == "__main__":
    serve(Path(sys.argv[1]), Path(sys.argv[2]))
