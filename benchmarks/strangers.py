"""Programs from elsewhere: translated at once, refused and why, and which findings stand in good ones.

``python benchmarks/strangers.py FOLDER [FOLDER …] [--most N] [--tools LIBRARY]`` runs the command line on
every G-code file below the folders, each in a process of its own with a time limit, as a user would type it:
the built-in cell, no options but --tools. Last comes in how many programs each code was found: one that many
translated programs have is noise. The exit code is always 0: figures are printed, not judged.
"""

import argparse
import json
import random
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

ENDINGS = (".nc", ".ngc", ".gcode", ".tap", ".cnc", ".mpf")
MOST_LINES_OF_ONE_CAUSE = 10


def translated(part: Path, options: list[str], limit_s: float) -> tuple[str, float, Counter[tuple[str, str]]]:
    """Return the verdict on a program, the seconds, and how often each severity and code was found."""
    started = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        command = [
            sys.executable,
            "-m",
            "gcode2krl",
            "translate",
            str(part),
            "-o",
            f"{folder}/PART.src",
            "--json",
        ]
        try:
            done = subprocess.run([*command, *options], capture_output=True, timeout=limit_s, check=False)
        except subprocess.TimeoutExpired:
            return "time", time.perf_counter() - started, Counter()
    findings = json.loads(done.stdout)["issues"]
    codes = Counter((finding["severity"], finding["code"]) for finding in findings)
    verdict = {0: "translated", 1: "refused"}.get(done.returncode, "not understood")
    return verdict, time.perf_counter() - started, codes


def programs(folders: list[Path], most: int | None, seed: int) -> list[Path]:
    """Return the G-code files below the folders, at most ``most`` of each, drawn by the seed."""
    chosen: list[Path] = []
    for folder in folders:
        found = (
            [folder]
            if folder.is_file()
            else sorted(p for p in folder.rglob("*") if p.suffix.lower() in ENDINGS)
        )
        if most is not None and len(found) > most:
            found = sorted(random.Random(seed).sample(found, most))
        chosen += found
    return chosen


def main(argv: list[str] | None = None) -> None:
    """Run the programs and print the result of each, then the counts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--most", type=int, help="At most so many programs of each folder, drawn by --seed.")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=300.0, help="Time limit for each run.")
    parser.add_argument("--tools", type=Path, help="A library of tools for every run.")
    given = parser.parse_args(argv)
    options = ["--tools", str(given.tools)] if given.tools is not None else []
    verdicts: Counter[str] = Counter()
    found: dict[str, Counter[str]] = {}
    crowded = 0
    for part in programs(given.folders, given.most, given.seed):
        verdict, seconds, codes = translated(part, options, given.seconds)
        verdicts[verdict] += 1
        crowded += any(count > MOST_LINES_OF_ONE_CAUSE for count in codes.values())
        for severity, code in codes:
            found.setdefault(f"{code} ({severity})", Counter())[verdict] += 1
        told = ", ".join(f"{code} {count}" for (severity, code), count in codes.items() if severity != "note")
        print(f"{verdict:<15} {seconds:6.1f} s  {part.name:<44} {told}", flush=True)
    print("\n" + ", ".join(f"{verdict}: {count}" for verdict, count in verdicts.most_common()))
    print(f"more than {MOST_LINES_OF_ONE_CAUSE} findings of one code: {crowded}")
    print("in so many programs, by verdict:")
    for code, counts in sorted(found.items(), key=lambda entry: -entry[1].total()):
        print(f"  {code:<44} " + ", ".join(f"{verdict} {count}" for verdict, count in counts.items()))


if __name__ == "__main__":
    main()
