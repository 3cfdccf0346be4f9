"""The everyday figure: a part of 30,000 lines from file to verified .src, cold and warm.

Cold means a machine that has never compiled the kernels (an empty cache); warm is the median of three runs
after it. Whole processes, start-up included.

    python benchmarks/everyday.py [--lines 30000]
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"


def make_part(folder: Path, lines: int) -> Path:
    script = EXAMPLES / "make_examples.py"
    subprocess.run(
        [sys.executable, script, "--out", folder, "--raster-lines", str(lines)],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    return next(folder.glob("raster_*.nc"))


def translate(part: Path, environment: dict[str, str]) -> float:
    command = [sys.executable, "-m", "gcode2krl", str(part), "-o", str(part.with_suffix(".src")), "-q"]
    start = time.perf_counter()
    subprocess.run(command, check=True, env=environment, stderr=subprocess.DEVNULL)
    return time.perf_counter() - start


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--lines", type=int, default=30_000)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        part = make_part(folder, arguments.lines)
        lines = part.read_bytes().count(b"\n")
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(folder / "kernels")}
        cold_s = translate(part, environment)
        warm_s = statistics.median(translate(part, environment) for _ in range(3))
    print(f"{lines} lines, file to verified .src, whole process:")
    print(f"  first run on a machine (compiles)  {cold_s:6.2f} s")
    print(f"  every run after it                 {warm_s:6.2f} s")


if __name__ == "__main__":
    main()
