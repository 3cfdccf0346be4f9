"""The pictures of the site, drawn by the tool while the site is built, so that none shows an earlier state.

What takes longer than a build may is kept in ``docs/images``: ``gap_backlash.png`` (a diagnosis,
``docs/diagnose_example.py``), ``report.png`` (needs a browser, ``docs/report_picture.py``) and
``before_*.png`` (an earlier version, for comparison).

python docs/site/pictures.py     puts the others there, too, for reading the documents in the repository
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "docs"))

import laws_picture  # noqa: E402
import long_pictures  # noqa: E402

PIECE = ROOT / "examples" / "test_piece.nc"
OF_THE_PIECE = (
    "path",
    "kinematics",
    "joints",
    "force",
    "deflection_path",
    "deflection_joints",
)
MAPS = ("workspace", "spin")
REPORT = "report_of_the_test_piece.html"
LIVE_REPORT = ("(images/report.png)\n", f"(images/report.png)\n\n[Open this page]({REPORT})\n")


def draw(folder: Path) -> dict[str, Path]:
    """Draw everything in a folder; return the files by their paths on the site."""
    cell = folder / "cell.toml"
    cell.write_text(long_pictures.STOCK, encoding="utf-8")
    piece, maps = folder / "piece", folder / "maps"
    _tool("predict", str(PIECE), "--cell", str(cell), "-o", str(piece), "--plot", "--quiet")
    _tool("report", str(piece), "-o", str(folder / REPORT))
    _tool("stiffness-map", "--cell", str(cell), "--at", "100", "50", "-5", "-o", str(maps))
    laws_picture.draw(folder / "motion_laws.png")
    made = {f"images/{name}.png": piece / f"{name}.png" for name in OF_THE_PIECE}
    made |= {f"images/map_{name}.png": _png(maps, name) for name in MAPS}
    made |= {f"images/{path.name}": path for path in _long(folder)}
    return made | {"images/motion_laws.png": folder / "motion_laws.png", REPORT: folder / REPORT}


def _long(folder: Path) -> list[Path]:
    """Draw the pictures of the long program."""
    drawn = long_pictures.predict(folder)
    targets = [folder / f"long_{name}.png" for name in long_pictures.PICTURES]
    for name, target in zip(long_pictures.PICTURES, targets, strict=True):
        long_pictures.shrink(drawn / f"{name}.png", target)
    return targets


def _png(folder: Path, name: str) -> Path:
    return folder / f"{name}.png"


def _tool(*words: str) -> None:
    """Run the tool of this tree; what it says is shown only where it fails."""
    done = subprocess.run(
        [sys.executable, "-m", "gcode2krl", *words], cwd=ROOT, capture_output=True, text=True
    )
    if done.returncode != 0:
        raise RuntimeError(f"gcode2krl {' '.join(words)}\n{done.stderr}")


def main() -> None:
    """Draw the pictures into ``docs/images``."""
    with tempfile.TemporaryDirectory() as scratch:
        for name, path in draw(Path(scratch)).items():
            if name.startswith("images/"):
                shutil.copy(path, ROOT / "docs" / name)


if __name__ == "__main__":
    main()
