"""The diagnosis of examples/runs: three dry runs of the test piece, by a robot with play in axis 3.

python docs/diagnose_example.py              prints the report that the README shows; less than a minute
python docs/diagnose_example.py --keep DIR   leaves prediction, page and pictures in a folder
python docs/diagnose_example.py --pictures   draws gap_backlash.png and, with Chromium, gap_page.png
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
IMAGES = ROOT / "docs" / "images"


def report(folder: Path) -> str:
    """Return the text of the diagnosis; ``gap.html`` and ``pictures/`` are left in the folder."""
    _done("predict", "examples/test_piece.nc", "-o", str(folder / "p"))
    runs = sorted(str(each) for each in (ROOT / "examples" / "runs").glob("run-*"))
    outputs = ["--html", str(folder / "gap.html"), "--plot", str(folder / "pictures")]
    return _done("diagnose", str(folder / "p"), *runs, *outputs)


def _done(*words: str) -> str:
    command = [sys.executable, "-m", "gcode2krl", *words]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout


def main() -> None:
    """Print the report, keep the files or draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--keep", type=Path, metavar="DIR", help="folder that is made and kept")
    parser.add_argument("--pictures", action="store_true", help="draw the picture of the documents")
    parser.add_argument("--browser", default="/usr/bin/chromium", help="for the picture of the page")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = (given.keep or Path(scratch)).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        print(report(folder))
        if given.pictures:
            shutil.copy(folder / "pictures" / "gap_run-1.png", IMAGES / "gap_backlash.png")
            _photograph(folder / "gap.html", given.browser)


def _photograph(page: Path, browser: str) -> None:
    """Draw the top of a page as a browser shows it."""
    window = ["--headless", "--no-sandbox", "--hide-scrollbars", "--window-size=1280,1000"]
    seen = f"--screenshot={IMAGES / 'gap_page.png'}"
    subprocess.run([browser, *window, "--virtual-time-budget=10000", seen, page.as_uri()], check=True)


if __name__ == "__main__":
    main()
