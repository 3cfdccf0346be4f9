"""Give the first 2,000 points of a raster the fastest time law with toppra; print seconds and points.

python time_toppra.py part.nc
"""

import re
import sys
import time
from itertools import pairwise
from math import dist
from pathlib import Path

import numpy as np
import toppra

POINTS = 2_000
SPEED_MM_S, ACCELERATION_MM_S2 = 100.0, 2000.0


def points(path: Path) -> np.ndarray:
    """Return the ends of the first feed moves, (n, 3) in mm."""
    place, found = {"X": 0.0, "Y": 0.0, "Z": 0.0}, []
    for line in path.read_text(encoding="ascii").splitlines():
        words = re.findall(r"([XYZ])(-?[\d.]+)", line) if line[:1] in "XYG" else []
        place.update((letter, float(number)) for letter, number in words)
        if words and not line.startswith("G0"):
            found.append(tuple(place.values()))
        if len(found) == POINTS:
            break
    return np.array(found)


def main() -> None:
    path_mm = points(Path(sys.argv[1]))
    limits = np.tile([-1.0, 1.0], (3, 1))
    start = time.perf_counter()
    at = np.concatenate([[0.0], np.cumsum([dist(a, b) for a, b in pairwise(path_mm)])])
    path = toppra.SplineInterpolator(at, path_mm)
    constraints = [
        toppra.constraint.JointVelocityConstraint(SPEED_MM_S * limits),
        toppra.constraint.JointAccelerationConstraint(ACCELERATION_MM_S2 * limits),
    ]
    trajectory = toppra.algorithm.TOPPRA(constraints, path, gridpoints=at).compute_trajectory()
    seconds = time.perf_counter() - start
    if trajectory is None:
        sys.exit("no time law found")
    print(seconds, len(path_mm))


if __name__ == "__main__":
    main()
