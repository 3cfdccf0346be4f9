"""What CI runs: all tests, the slow ones too, and every benchmark that no test runs."""

import re
from pathlib import Path

from tests.conftest import ROOT

SCRIPT = ROOT / ".ci" / "run"
IN_TESTS = {
    "benchmarks/five_axis.py": "tests/cutting/test_turned.py",
    "benchmarks/mistakes.py": "tests/test_mistakes.py",
    "benchmarks/blind/calibrate.py": "tests/benchmarks/test_gap_blind_calibrate.py",
    "benchmarks/blind/channels.py": "tests/benchmarks/test_gap_metamorphic.py",
    "benchmarks/online_faults.py": "tests/online/test_plant.py",
}
"""Benchmarks of which a test does a small part, and that test."""


def steps():
    """Return the lines of the script that are no comments."""
    lines = SCRIPT.read_text(encoding="utf-8").splitlines()
    return [line.strip() for line in lines if not line.lstrip().startswith("#")]


def test_the_slow_tests_run():
    assert any(re.match(r"python -m pytest .*-m slow\b", line) for line in steps())
    assert "set -euo pipefail" in steps()  # else their failure would be overlooked


def test_every_benchmark_runs():
    files = [*(ROOT / "benchmarks").glob("*.py"), *(ROOT / "benchmarks" / "blind").glob("*.py")]
    benchmarks = {path.relative_to(ROOT).as_posix() for path in files if is_program(path)}
    assert len(benchmarks) > 10
    in_steps = {name for name in benchmarks if any(f"{name} " in f"{step} " for step in steps())}
    assert benchmarks - in_steps == set(IN_TESTS)


def test_the_tests_named_for_it_import_their_benchmark():
    for name, test in IN_TESTS.items():
        words = re.findall(r"\w+", (ROOT / test).read_text(encoding="utf-8"))
        assert Path(name).stem in words, f"{test} does not import {name}"


def is_program(path: Path) -> bool:
    return "\ndef main(" in path.read_text(encoding="utf-8") and not path.stem.startswith("fuzz_")
