"""Build the site into ``site/`` and check it; needs ``python -m pip install -e ".[docs]"`` and no network.

python docs/site/build.py [--into FOLDER]

Warnings are errors. Then open ``site/index.html`` in a browser: no server is needed.
"""

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path

from links import broken

ROOT = Path(__file__).resolve().parents[2]
QUIET = {"NO_MKDOCS_2_WARNING": "1", "MPLBACKEND": "Agg"}
"""An announcement of the theme is no finding; nothing opens a window."""


def main() -> int:
    """Build, check, and say what was made."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--into", type=Path, default=ROOT / "site", metavar="FOLDER")
    folder = parser.parse_args().into.resolve()
    started = time.perf_counter()
    words = [
        "build",
        "--strict",
        "--quiet",
        "--config-file",
        str(ROOT / "mkdocs.yml"),
        "--site-dir",
        str(folder),
    ]
    done = subprocess.run([sys.executable, "-m", "mkdocs", *words], env={**os.environ, **QUIET})
    if done.returncode != 0:
        return 1
    wrong = broken(folder)
    for line in wrong:
        print(line, file=sys.stderr)
    pages = len(list(folder.rglob("*.html")))
    size_MB = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) / 1e6
    seconds = time.perf_counter() - started
    print(f"{folder}: {pages} pages, {size_MB:.1f} MB, {len(wrong)} broken links, {seconds:.0f} s")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
