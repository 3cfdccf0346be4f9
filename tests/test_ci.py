"""What CI runs: all tests, the slow ones too, and every benchmark."""

import re
from pathlib import Path

from tests.conftest import ROOT

SCRIPT = ROOT / ".ci" / "run"


def steps():
    """Return the lines of the script that are no comments."""
    lines = SCRIPT.read_text(encoding="utf-8").splitlines()
    return [line.strip() for line in lines if not line.lstrip().startswith("#")]


def test_the_slow_tests_run():
    assert any(re.match(r"python -m pytest .*-m slow\b", line) for line in steps())
    assert "set -euo pipefail" in steps()  # else their failure would be overlooked


def test_every_benchmark_runs():
    benchmarks = [path for path in (ROOT / "benchmarks").glob("*.py") if is_program(path)]
    assert len(benchmarks) > 10
    missing = [
        path.name for path in benchmarks if not any(f"benchmarks/{path.name} " in f"{s} " for s in steps())
    ]
    assert missing == []


def is_program(path: Path) -> bool:
    return "\ndef main(" in path.read_text(encoding="utf-8") and not path.stem.startswith("fuzz_")
