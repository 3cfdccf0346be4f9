"""A batch of parts: processes beside each other, the cache, a killed worker, an interruption, a Dask cluster.

The parts are the programs of a folder, and variants of them until there are enough: the same program under
another name with a comment of its own, so that none is another's entry in the cache. Each row is a whole
process of ``gcode2krl batch``, start-up included, with its wall time and the processor time of itself and its
workers; the outputs of all rows are compared with those of the first, byte for byte.

    python benchmarks/batch.py                               a hundred parts of examples/
    python benchmarks/batch.py --parts 200 --folder PUBLIC   of a folder of programs
    python benchmarks/batch.py --parts 6 --no-dask           a small run
"""

import argparse
import hashlib
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ENDINGS = (".nc", ".ngc", ".gcode", ".tap", ".cnc", ".mpf")
ABOUT = {"results.jsonl", "junit.xml", "findings.sarif", "summary.md", "index.html"}
CLUSTER = """
import os, sys
from distributed import Client, LocalCluster
if __name__ == "__main__":
    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        with Client(cluster) as client:
            print(cluster.scheduler_address, *client.run(os.getpid).values(), flush=True)
            sys.stdin.read()
"""


@dataclass(frozen=True)
class Row:
    """A run: its time, and what it left."""

    name: str
    seconds: float
    processor_s: float
    code: int
    cached: int
    parts: int
    programs: dict[str, str]

    def line(self, first: "Row | None") -> str:
        if first is None or self.programs == first.programs:
            same = "" if first is None else "same bytes"
        else:
            same = "other bytes" if self.parts == first.parts else f"{self.parts} parts"
        figures = f"{self.seconds:8.1f}{self.processor_s:12.1f}{self.cached:8}{self.code:6}"
        return f"  {self.name:<46}{figures}  {same}"


def make_parts(source: Path, folder: Path, count: int) -> int:
    """Write so many parts and return their bytes."""
    programs = sorted(file for file in source.rglob("*") if file.suffix.lower() in ENDINGS)
    if not programs:
        sys.exit(f"no G-code in {source}")
    for number in range(count):
        program, variant = programs[number % len(programs)], number // len(programs)
        place = folder / f"set {variant}" / f"{number:03d}_{program.name}"
        place.parent.mkdir(parents=True, exist_ok=True)
        comment = f"(variant {variant} of {number})\n".encode() if variant else b""
        content = program.read_bytes()
        head, _, rest = content.partition(b"\n") if content.startswith(b"%") else (b"", b"", content)
        place.write_bytes((head + b"\n" if head else b"") + comment + rest)
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())


class Bench:
    """Runs batches over one folder of parts."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.parts = folder, folder / "parts"
        self.first: Row | None = None

    def batch(
        self, name: str, out: str, *options: str, disturb: Callable[[subprocess.Popen], None] | None = None
    ) -> Row:
        """Run a batch, do something to it after its first part, and print its row."""
        command = [sys.executable, "-m", "gcode2krl", "batch", str(self.parts), "-o", out, *options]
        before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        with (self.folder / "words.txt").open("w+") as words:
            process = subprocess.Popen(
                command,
                cwd=self.folder,
                env=environment(self.folder),
                stdout=subprocess.DEVNULL,
                stderr=words,
                preexec_fn=heed_ctrl_c if os.name == "posix" else None,
            )
            if disturb is not None:
                while process.poll() is None and not words.seek(0, 2):
                    time.sleep(0.02)
                disturb(process)
            code = process.wait()
        seconds = time.perf_counter() - began
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        used_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        records = [json.loads(line) for line in (self.folder / out / "results.jsonl").open(encoding="utf-8")]
        cached = sum(record["cached"] for record in records)
        row = Row(name, seconds, used_s, code, cached, len(records), hashes(self.folder / out))
        print(row.line(self.first), flush=True)
        self.first = self.first or row
        return row

    def median_ms(self, out: str) -> float:
        """Return the median time of a part that came from the cache."""
        lines = (self.folder / out / "results.jsonl").read_text(encoding="utf-8").splitlines()
        times = sorted(record["seconds"] for record in map(json.loads, lines) if record["cached"])
        return 1e3 * times[len(times) // 2] if times else float("nan")


def hashes(out: Path) -> dict[str, str]:
    files = [file for file in out.rglob("*") if file.is_file()]
    return {
        file.relative_to(out).as_posix(): hashlib.sha256(file.read_bytes()).hexdigest()
        for file in files
        if file.relative_to(out).as_posix() not in ABOUT
    }


def environment(folder: Path) -> dict[str, str]:
    return {
        **os.environ,
        "GCODE2KRL_CACHE": str(folder / "cache"),
        "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]),
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }


def heed_ctrl_c() -> None:
    """A shell in the background lets its programs ignore Ctrl+C."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def kill_a_worker(process: subprocess.Popen) -> None:
    """Kill a child of a batch as the system does where memory is short."""
    tasks = Path(f"/proc/{process.pid}/task").glob("*/children")
    children = [int(number) for task in tasks for number in task.read_text().split()]
    if children:
        os.kill(children[0], signal.SIGKILL)


def interrupt_after(out: Path, programs: int) -> Callable[[subprocess.Popen], None]:
    """Return what interrupts a batch as soon as so many programs stand in its folder."""

    def interrupt(process: subprocess.Popen) -> None:
        while process.poll() is None and len(list(out.rglob("*.src"))) < programs:
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)

    return interrupt


@contextmanager
def cluster(folder: Path):
    """Yield the address of a cluster of two worker processes, and their numbers."""
    script = folder / "local_cluster.py"
    script.write_text(CLUSTER, encoding="utf-8")
    process = subprocess.Popen(
        [sys.executable, script],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=environment(folder),
        text=True,
    )
    try:
        address, *workers = process.stdout.readline().split()
        yield address, [int(worker) for worker in workers]
    finally:
        process.stdin.close()
        process.wait(60)


def loop(bench: Bench, names: Sequence[Path]) -> None:
    """Translate part after part, a process each, as a loop of the shell does."""
    out = bench.folder / "loop"
    out.mkdir()
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    for part in names:
        subprocess.run(
            [sys.executable, "-m", "gcode2krl", str(part), "-o", str(out), "-q"],
            env=environment(bench.folder),
            capture_output=True,
        )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    print(
        f"  {'a loop of `gcode2krl part.nc`':<46}{time.perf_counter() - began:8.1f}{used_s:12.1f}", flush=True
    )


def run(bench: Bench, dask: bool, with_loop: bool) -> None:
    print(f"  {'':<46}{'s':>8}{'processor s':>12}{'cached':>8}{'code':>6}")
    one = bench.batch("one process", "out-one", "--processes", "1", "--no-cache")
    two = bench.batch("two processes", "out", "--processes", "2")
    bench.batch("unchanged", "out")
    bench.batch("unchanged, into an empty folder", "out-fresh")
    changed = max(bench.parts.rglob("*.*"), key=lambda file: file.stat().st_size)
    content = changed.read_bytes()
    changed.write_bytes(content + b"(changed)\n")
    bench.batch("one part changed, the longest", "out-changed")
    changed.write_bytes(content)
    (bench.folder / "cell.toml").write_text(
        'based_on = "demonstration"\n[home]\nq_deg = [0, -90, 90, 0, 10, 0]\n'
    )
    bench.batch("the cell changed", "out-cell", "--cell", "cell.toml", "--processes", "2")
    if Path("/proc/self/task").exists():
        bench.batch("a worker killed", "out-killed", "--no-cache", "--processes", "2", disturb=kill_a_worker)
    if os.name == "posix":
        shutil.rmtree(bench.folder / "cache")
        stop = interrupt_after(bench.folder / "out-resumed", max(1, two.parts // 3))
        bench.batch("interrupted after about a third", "out-resumed", "--processes", "2", disturb=stop)
        bench.batch("the same command again", "out-resumed", "--processes", "2")
    if dask:
        with cluster(bench.folder) as (address, workers):
            bench.batch("Dask, two worker processes", "out-dask", "--no-cache", "--scheduler", address)
            bench.batch(
                "the same, one of them killed",
                "out-dask-killed",
                "--no-cache",
                "--scheduler",
                address,
                disturb=lambda _: os.kill(workers[0], getattr(signal, "SIGKILL", signal.SIGTERM)),
            )
    if with_loop:
        loop(bench, sorted(file for file in bench.parts.rglob("*") if file.is_file()))
    print(f"two processes are {one.seconds / two.seconds:.2f} times as fast as one")
    print(
        f"a part from the cache takes {bench.median_ms('out'):.1f} ms, "
        f"{bench.median_ms('out-fresh'):.1f} ms where its files are written anew"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--parts", type=int, default=100)
    parser.add_argument("--folder", type=Path, default=ROOT / "examples")
    parser.add_argument("--no-dask", action="store_true", help="leave the cluster out")
    parser.add_argument("--loop", action="store_true", help="also a process a part")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="batch-") as name:
        bench = Bench(Path(name))
        size_mb = make_parts(arguments.folder, bench.parts, arguments.parts) / 1e6
        print(f"{arguments.parts} parts of {size_mb:.1f} MB, {os.cpu_count()} cores")
        run(bench, not arguments.no_dask, arguments.loop)


if __name__ == "__main__":
    main()
