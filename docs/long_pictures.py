"""Draw the pictures of a program of 15,000 lines that `docs/prediction.md` shows.

    python docs/long_pictures.py    docs/images/long_*.png

The pictures are halved in size and brought to 256 colours, to some 100 kB each.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parent.parent
STOCK = 'based_on = "demonstration"\n[stock]\nbox_mm = [[0, -100, -30], [300, 100, 0]]\n'
PICTURES = ("path", "kinematics", "force", "deflection_path")
WIDTH_PX = 1000
COLOURS = 256


def predict(folder: Path) -> Path:
    """Return the folder of a prediction of the pocket."""
    make = [sys.executable, str(ROOT / "examples" / "make_examples.py"), "--out", str(folder), "--pocket"]
    subprocess.run(make, check=True)
    (folder / "cell.toml").write_text(STOCK, encoding="utf-8")
    words = ["predict", "adaptive_pocket.nc", "--cell", "cell.toml", "-o", "p", "--plot", "--quiet"]
    subprocess.run([sys.executable, "-m", "gcode2krl", *words], check=True, cwd=folder)
    return folder / "p"


def shrink(source: Path, target: Path) -> None:
    """Write a picture smaller and with fewer colours."""
    with Image.open(source) as whole:
        size = (WIDTH_PX, round(whole.height * WIDTH_PX / whole.width))
        small = whole.convert("RGB").resize(size, Image.Resampling.LANCZOS)
    few = small.quantize(COLOURS, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    few.save(target, optimize=True)


def main() -> None:
    """Draw."""
    with tempfile.TemporaryDirectory() as folder:
        drawn = predict(Path(folder))
        for picture in PICTURES:
            target = ROOT / "docs" / "images" / f"long_{picture}.png"
            shrink(drawn / f"{picture}.png", target)
            print(f"{target}: {target.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
