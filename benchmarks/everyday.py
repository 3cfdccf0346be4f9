"""What a user waits for: the first run after installing, a small part, ``--help``, a part of 30,000 lines.

The first run is that of a fresh virtual environment, installed from this source tree, with an empty home
folder, so that nothing is there from an earlier run. Then each command in turn, round after round; the
figures are the best. Whole processes, start-up included.

    python benchmarks/everyday.py                      all of it
    python benchmarks/everyday.py --lines 5000 --here  a smaller part, in the environment that runs this
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = ROOT / "examples"
SMALL = EXAMPLES / "test_piece.nc"


def make_part(folder: Path, lines: int) -> Path:
    script = EXAMPLES / "make_examples.py"
    subprocess.run(
        [sys.executable, script, "--out", folder, "--raster-lines", str(lines)],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    return next(folder.glob("raster_*.nc"))


def seconds(command: list[str], environment: dict[str, str], folder: Path) -> float:
    """Return the wall time of a process that has to end well."""
    start = time.perf_counter()
    subprocess.run(command, check=True, env=environment, cwd=folder, capture_output=True)
    return time.perf_counter() - start


def installed(folder: Path, environment: dict[str, str]) -> tuple[str, float]:
    """Return the Python of a fresh environment with the package in it, and how long installing took."""
    venv.create(folder / "venv", with_pip=True)
    python = str(folder / "venv" / ("Scripts" if os.name == "nt" else "bin") / "python")
    return python, seconds([python, "-m", "pip", "install", "--quiet", str(ROOT)], environment, folder)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--lines", type=int, default=30_000)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--here", action="store_true", help="no fresh environment")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        part, home = make_part(folder, arguments.lines), folder / "home"
        home.mkdir()
        lines = part.read_bytes().count(b"\n")
        environment = {**os.environ, "HOME": str(home), "USERPROFILE": str(home)}
        environment.pop("PYTHONDONTWRITEBYTECODE", None)  # a user's Python keeps its bytecode
        python = sys.executable
        if not arguments.here:
            environment.pop("PYTHONPATH", None)
            python, installing_s = installed(folder, {**os.environ, "PYTHONPATH": ""})
            print(f"  {'pip install from this source tree':<38}{installing_s:7.2f} s")
        commands = {
            "--help": ["--help"],
            "a small part": [str(SMALL), "-o", str(folder / "small.src"), "-q"],
            f"{lines:,} lines": [str(part), "-o", str(folder / "part.src"), "-q"],
        }
        first_s = seconds([python, "-m", "gcode2krl", *commands["a small part"]], environment, folder)
        print(f"  {'first run, a small part':<38}{first_s:7.2f} s")
        best = dict.fromkeys(commands, float("inf"))
        for _ in range(arguments.rounds):
            for what, words in commands.items():
                once = seconds([python, "-m", "gcode2krl", *words], environment, folder)
                best[what] = min(best[what], once)
        for what, best_s in best.items():
            print(f"  {what + ', best of ' + str(arguments.rounds):<38}{best_s:7.2f} s")


if __name__ == "__main__":
    main()
