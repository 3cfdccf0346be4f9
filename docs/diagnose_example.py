"""Three measured runs of a robot with play in axis 3, made by the independent plant, and the diagnosis.

`python docs/diagnose_example.py` prints the report that the README shows.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

from gap_blind_cases import predictions  # noqa: E402

from tests.plant.cases import make_case  # noqa: E402

SEED, EFFECT = 1032, "backlash@A3"


def report() -> str:
    """Return the text of the diagnosis."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        places = predictions(folder / "predictions")
        make_case(SEED, folder / "case", EFFECT, "same", predictions=(folder / "predictions").as_posix())
        runs = sorted(str(each) for each in (folder / "case").glob("run-*"))
        command = [sys.executable, "-m", "gcode2krl", "diagnose", next(iter(places.values())), *runs]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout


if __name__ == "__main__":
    print(report())
