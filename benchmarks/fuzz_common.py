"""Common part of the fuzz benchmarks: cases in a child process that may hang or abort, and a report.

A case is made from a seed and its number alone, so that each can be made again. It is *accepted*, *refused*
(one of our errors, of one line, exit code 2) or it is a *failure*: another exception, several lines, a word
on standard error, a process that ends, hangs or takes more than 1 GB.
"""

import argparse
import multiprocessing
import os
import resource
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

LONGEST_S = 60.0
MOST_MB = 1000.0
ADDRESS_SPACE = 16 * 2**30
"""A child that asks for more fails instead of taking the machine with it."""
Try = Callable[[np.random.Generator, Path], str]
"""Makes a case in a folder, tries it, and returns its description; raises what the package raises."""


@dataclass
class Tally:
    """Results of the cases."""

    count: int = 0
    accepted: int = 0
    refused: int = 0
    failures: list[str] = field(default_factory=list)
    slowest_s: float = 0.0
    slowest: str = ""
    peak_mb: float = 0.0
    start_mb: float = 0.0
    """Memory before the first case, used by the imports."""
    codes: dict[str, int] = field(default_factory=dict)


def run(prepare: Callable[[Path], Try], count: int, seed: int) -> Tally:
    """Run cases 0 to ``count`` - 1 in child processes; one that dies is a failure, and the next goes on."""
    tally, at = Tally(), 0
    context = multiprocessing.get_context("spawn")
    with tempfile.TemporaryDirectory(prefix="fuzz_") as folder:
        while at < count:
            here, there = context.Pipe(duplex=False)
            shared = context.Array("d", 2, lock=False)  # number of the case, when it began
            shared[0], shared[1] = at, time.monotonic() + 60.0  # imports take their time
            child = context.Process(target=_work, args=(prepare, at, count, seed, folder, shared, there))
            child.start()
            there.close()
            at = _watch(child, here, shared, tally, count)
    return tally


def _watch(child: Any, here: Connection, shared: Any, tally: Tally, count: int) -> int:
    """Wait for a child; returns the case to go on with."""
    result = None
    while result is None:
        if here.poll(0.5):
            try:
                result = here.recv()
            except EOFError:
                break
        elif time.monotonic() - shared[1] > LONGEST_S:
            child.kill()
            child.join()
            tally.failures.append(f"case {int(shared[0])}: hangs")
            tally.count += 1
            return int(shared[0]) + 1
    child.join()
    if result is None:
        tally.failures.append(f"case {int(shared[0])}: the process ended with {child.exitcode}")
        tally.count += 1
        return int(shared[0]) + 1
    _add(tally, result)
    return count


def _add(tally: Tally, other: Tally) -> None:
    tally.count += other.count
    tally.accepted += other.accepted
    tally.refused += other.refused
    tally.failures += other.failures
    tally.peak_mb, tally.start_mb = max(tally.peak_mb, other.peak_mb), other.start_mb
    if other.slowest_s > tally.slowest_s:
        tally.slowest_s, tally.slowest = other.slowest_s, other.slowest
    for code, number in other.codes.items():
        tally.codes[code] = tally.codes.get(code, 0) + number


def _work(
    prepare: Callable[[Path], Try],
    start: int,
    count: int,
    seed: int,
    folder: str,
    shared: Any,
    out: Connection,
) -> None:
    """Run cases in this process, and send their results."""
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE, ADDRESS_SPACE))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    place = Path(tempfile.mkdtemp(dir=folder))
    errors = os.open(place / "stderr", os.O_RDWR | os.O_CREAT)
    os.dup2(errors, 2)
    os.dup2(errors, 1)
    attempt = prepare(place)
    tally, said = Tally(start_mb=peak_mb()), os.fstat(errors).st_size
    for number in range(start, count):
        shared[0], shared[1] = number, time.monotonic()
        _one(attempt, seed, number, place, tally)
        now = os.fstat(errors).st_size
        if now > said:
            words = os.pread(errors, 300, said).decode("utf-8", "replace").replace("\n", " | ")
            tally.failures.append(f"case {number}: on standard error: {words}")
            said = now
        peak = peak_mb()
        if peak > max(MOST_MB, tally.peak_mb):
            tally.failures.append(f"case {number}: {peak:.0f} MB")
        tally.peak_mb = max(tally.peak_mb, peak)
    out.send(tally)


def _one(attempt: Try, seed: int, number: int, place: Path, tally: Tally) -> None:
    from gcode2krl.errors import Gcode2KrlError

    rng = np.random.default_rng([seed, number])
    began_s = time.perf_counter()
    what = ""
    try:
        what = attempt(rng, place)
        tally.accepted += 1
    except Gcode2KrlError as error:
        tally.refused += 1
        what = error.issues[0].code
        tally.codes[what] = tally.codes.get(what, 0) + 1
        lines = str(error).splitlines()
        if len(lines) != 1 or error.exit_code != 2:
            tally.failures.append(
                f"case {number}: {len(lines)} lines, exit code {error.exit_code}: {lines[0]}"
            )
    except BaseException as error:
        tally.failures.append(f"case {number}: {type(error).__name__}: {str(error)[:200]}")
    took_s = time.perf_counter() - began_s
    tally.count += 1
    if took_s > tally.slowest_s:
        tally.slowest_s, tally.slowest = took_s, f"case {number} ({what})"


def peak_mb() -> float:
    """Return the largest memory of this program; `getrusage` keeps that of the parent, over fork and exec."""
    try:
        lines = Path("/proc/self/status").read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:  # not Linux: the parent's counts
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM:")) / 1024.0


def mutated(rng: np.random.Generator, data: bytes, other: bytes = b"") -> bytes:
    """Return bytes with bits flipped, blocks cut, doubled, spliced from another file, or numbers changed."""
    text = bytearray(data)
    for _ in range(int(rng.integers(1, 4))):
        size = len(text)
        if size == 0:
            return rng.bytes(int(rng.integers(0, 40)))
        at, length = int(rng.integers(size)), int(rng.integers(1, max(2, min(size, 400))))
        kind = int(rng.integers(9))
        if kind == 0:
            text[at] ^= 1 << int(rng.integers(8))
        elif kind == 1:
            del text[at:]
        elif kind == 2:
            del text[at : at + length]
        elif kind == 3:
            text[at:at] = text[at : at + length]
        elif kind == 4 and other:
            start = int(rng.integers(len(other)))
            text[at : at + length] = other[start : start + length]
        elif kind == 5:
            text[at : at + 8] = ABSURD[int(rng.integers(len(ABSURD)))]
        elif kind == 6:
            text[at : at + length] = rng.bytes(length)
        elif kind == 7:
            text[at : at + length] = bytes(length)
        else:
            near = max(size - 1 - int(rng.integers(min(size, 3000))), 0)  # footers stand at the end
            text[near] = int(rng.integers(256))
    return bytes(text)


ABSURD = tuple(
    number.to_bytes(8, "little", signed=True)
    for number in (-1, 0, 1, 2**31 - 1, 2**31, 2**32 - 1, 2**53, 2**60, 2**63 - 1, -(2**63), -(2**31))
) + tuple(np.array(value).tobytes() for value in (np.nan, np.inf, -np.inf, 1e308, -1e308, 1e-320))


def options(about: str | None, argv: list[str] | None, count: int) -> argparse.Namespace:
    """Read ``--count`` and ``--seed``."""
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=count)
    parser.add_argument("--seed", type=int, default=1)
    return parser.parse_args(argv)


def printed(kind: str, tally: Tally, took_s: float) -> int:
    """Print a tally; returns the exit code."""
    print(f"{tally.count} {kind}: {tally.accepted} accepted, {tally.refused} refused, {took_s:.0f} s")
    codes = ", ".join(f"{code} {number}" for code, number in sorted(tally.codes.items(), key=lambda c: -c[1]))
    print(f"  refused as: {codes}")
    print(f"  slowest {tally.slowest_s * 1e3:.0f} ms: {tally.slowest}")
    print(f"  peak memory {tally.peak_mb:.0f} MB, of which {tally.start_mb:.0f} MB before the first case")
    print(f"  failures (tracebacks, hangs, aborts, over 1 GB, several lines): {len(tally.failures)}")
    for words in tally.failures[:20]:
        print(f"    {words}")
    return 1 if tally.failures or tally.count == 0 else 0


def main_of(kind: str, prepare: Callable[[Path], Try], about: str | None, count: int) -> Callable[..., int]:
    """Return the ``main(argv)`` of a kind."""

    def main(argv: list[str] | None = None) -> int:
        chosen = options(about, argv, count)
        began_s = time.perf_counter()
        tally = run(prepare, chosen.count, chosen.seed)
        return printed(kind, tally, time.perf_counter() - began_s)

    return main
