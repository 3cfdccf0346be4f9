"""Three measured runs of a robot with play in axis 3, made by the independent plant, and the diagnosis.

python docs/diagnose_example.py              prints the report that the README shows; about a minute
python docs/diagnose_example.py --keep DIR   leaves prediction, runs, page and pictures in a folder
python docs/diagnose_example.py --pictures   draws docs/images/gap_backlash.png
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

from gap_blind_cases import predictions  # noqa: E402

from tests.plant.cases import make_case  # noqa: E402

SEED, EFFECT = 1032, "backlash@A3"
IMAGE = ROOT / "docs" / "images" / "gap_backlash.png"


def report(folder: Path) -> str:
    """Return the text of the diagnosis; ``gap.html`` and ``pictures/`` are left in the folder."""
    _say("predicting the six programs of the plant …")
    places = predictions(folder / "predictions")
    _say("making three measured runs …")
    make_case(SEED, folder / "case", EFFECT, "same", predictions=(folder / "predictions").as_posix())
    _say("diagnosing them …")
    runs = sorted(str(each) for each in (folder / "case").glob("run-*"))
    command = [sys.executable, "-m", "gcode2krl", "diagnose", next(iter(places.values())), *runs]
    outputs = ["--html", str(folder / "gap.html"), "--plot", str(folder / "pictures")]
    return subprocess.run([*command, *outputs], capture_output=True, text=True, check=True).stdout


def _say(words: str) -> None:
    """Print what is done on a terminal."""
    if sys.stderr.isatty():
        print(words, file=sys.stderr, flush=True)


def main() -> None:
    """Print the report, keep the files or draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--keep", type=Path, metavar="DIR", help="folder that is made and kept")
    parser.add_argument("--pictures", action="store_true", help="draw the picture of the documents")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = given.keep or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        print(report(folder))
        if given.pictures:
            shutil.copy(folder / "pictures" / "gap_run-1.png", IMAGE)


if __name__ == "__main__":
    main()
