"""The diagnosis that the README shows: three runs of the independent plant with backlash in axis 2.

python docs/diagnose_example.py
"""

import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))


def main() -> None:
    """Simulate, predict, diagnose."""
    from gcode2krl import load_cell, predict
    from tests.plant.cases import make_case

    with tempfile.TemporaryDirectory() as folder:
        case = Path(folder) / "case"
        make_case(12, case, effect="backlash@A2", form="same")
        (case / "predictions").mkdir()
        for part in sorted((case / "programs").glob("*.nc")):
            predict(part, load_cell(case / "cell.toml")).save(case / "predictions" / part.stem)
        first = min((case / "predictions").iterdir())
        command = [sys.executable, "-m", "gcode2krl", "diagnose", str(first), "run-1", "run-2", "run-3"]
        done = subprocess.run(command, cwd=case, capture_output=True, text=True, check=False)
        print("gcode2krl diagnose prediction run-1 run-2 run-3")
        print(done.stdout + done.stderr)


if __name__ == "__main__":
    main()
