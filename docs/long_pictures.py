"""Draw the pictures of a program of 15,000 lines that `docs/prediction.md` shows.

    python docs/long_pictures.py                             docs/images/long_*.png
    python docs/long_pictures.py --tree PATH --name before   the same by the code of another checkout

The pictures are halved in size and brought to 256 colours, to some 100 kB each.
"""

import argparse
import os
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


def predict(tree: Path, folder: Path) -> Path:
    """Return the folder of a prediction of the pocket, made by the code of a checkout."""
    make = [sys.executable, str(ROOT / "examples" / "make_examples.py"), "--out", str(folder), "--pocket"]
    subprocess.run(make, check=True)
    cell = folder / "cell.toml"
    cell.write_text(STOCK, encoding="utf-8")
    words = [
        "predict",
        str(folder / "adaptive_pocket.nc"),
        "--cell",
        str(cell),
        "-o",
        str(folder / "p"),
        "--plot",
    ]
    environment = {**os.environ, "PYTHONPATH": str(tree)}
    command = [sys.executable, "-m", "gcode2krl", *words, "--quiet"]
    subprocess.run(command, check=True, cwd=tree, env=environment)
    return folder / "p"


def shrink(source: Path, target: Path) -> None:
    """Write a picture smaller and with fewer colours."""
    with Image.open(source) as whole:
        size = (WIDTH_PX, round(whole.height * WIDTH_PX / whole.width))
        small = whole.convert("RGB").resize(size, Image.Resampling.LANCZOS)
    few = small.quantize(COLOURS, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    few.save(target, optimize=True)


def main() -> None:
    """Read the options and draw."""
    parser = argparse.ArgumentParser(description="Draw the pictures of a program of 15,000 lines.")
    parser.add_argument("--tree", type=Path, default=ROOT, help="checkout whose code draws, its core built")
    parser.add_argument("--name", default="long", help="what the files' names begin with")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "images")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        drawn = predict(options.tree.resolve(), Path(folder))
        for picture in PICTURES:
            target = options.out / f"{options.name}_{picture}.png"
            shrink(drawn / f"{picture}.png", target)
            print(f"{target}: {target.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
