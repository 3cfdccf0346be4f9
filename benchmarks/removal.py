"""Forces by the height field beside exact geometry (`tests/cutting/scenes.py`), a flat mill of 16 mm.

python benchmarks/removal.py            cells of 0.1 and 0.25 mm
python benchmarks/removal.py --small    for CI: below 20 s
"""

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from gcode2krl.cell.sections import Tool
from gcode2krl.cutting.engagement import engage
from tests.cutting import scenes

FLAT = Tool(diameter_mm=16, teeth=3, flute_length_mm=30)


def print_scenes(cell_mm, most):
    """Errors against exact geometry (`tests/cutting/scenes.py`)."""
    print(f"\nErrors against exact geometry, flat 16, {cell_mm:g} mm cells; every sample: share of the peak")
    print("| scene | every sample, worst | steady, mean | steady, worst |")
    print("| --- | --- | --- | --- |")
    for scene in scenes.transitions() + scenes.steady_scenes():
        position, way = scene.samples()
        count = len(way)
        found = engage(
            scene.field(cell_mm),
            position,
            np.zeros(count, np.int32),
            np.zeros(count, bool),
            np.full(count, scenes.F_Z_MM),
            [FLAT],
            scenes.LAW,
        ).force_N
        rows = np.arange(1, count, max(1, count // most))
        wanted = np.array([scene.exact(way[row]) for row in rows])
        step = position[rows] - position[rows - 1]
        step = step[:, :2] / np.linalg.norm(step[:, :2], axis=1)[:, None]
        force = found[rows]
        own = np.stack(
            [
                force[:, 0] * step[:, 0] + force[:, 1] * step[:, 1],
                force[:, 1] * step[:, 0] - force[:, 0] * step[:, 1],
                -force[:, 2],
            ],
            axis=1,
        )
        error, size = np.linalg.norm(own - wanted, axis=1), np.linalg.norm(wanted, axis=1)
        steady = (way[rows] >= scene.steady[0]) & (way[rows] <= scene.steady[1])
        mean = np.linalg.norm(own[steady], axis=1).mean() / size[steady].mean() - 1
        print(
            f"| {scene.name} | {100 * error.max() / size.max():.2f} % | {100 * mean:+.2f} % "
            f"| {100 * (error[steady] / size[steady]).max():.2f} % |"
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--small", action="store_true", help="below 20 s")
    is_small = parser.parse_args().small
    for cell_mm in (0.1,) if is_small else (0.1, 0.25):
        print_scenes(cell_mm, 30 if is_small else 100)


if __name__ == "__main__":
    main()
