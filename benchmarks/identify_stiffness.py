"""Does `gcode2krl identify stiffness` recover table 1, and how often do its intervals contain the truth?

The robot of Hähn & Weigold 2020 with the stiffness of table 1 is simulated by the script of
``examples/identify``, which shares no code with the package: eight pairs of cubes, four poses, six loads, and
each reading repeated with new laser noise. Every draw goes through the files and the reader.

    python benchmarks/identify_stiffness.py [--draws 200] [--noise 0.005] [--repeats 16] [--seed 2020]
"""

import argparse
import sys
import tempfile
import time
from importlib import import_module
from pathlib import Path

import numpy as np

from gcode2krl import load_cell
from gcode2krl.identify.measurements import read_measurements
from gcode2krl.identify.stiffness import KEYS, identify_stiffness

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples" / "identify"))
make = import_module("make_measurements")

LEVELS = (0.90, 0.95)
SENSOR = {"sensor": make.TABLE_1["sensor"]}
JOINTS = [name for name in make.TABLE_1 if name not in ("sensor", "spindle")]
TRUTH = [k for name in JOINTS for k in make.TABLE_1[name]]


def write(folder: Path, rows: list[list], *, cubes=None, stated_mm: float = 0.0) -> Path:
    head = make.cube_head(make.PAIRS, cubes or make.CUBES, known=SENSOR, noise_mm=stated_mm)
    (folder / "draw.toml").write_text(head, encoding="utf-8")
    (folder / "draw.csv").write_text(make.cube_csv(rows), encoding="utf-8")
    return folder / "draw.toml"


def noisy(rows: list[list], noise_mm: float, repeats: int, rng: np.random.Generator) -> list[list]:
    drawn = []
    for row in rows:
        readings = np.array(row[13:]) + rng.normal(0.0, noise_mm, (repeats, 24))
        drawn += [[*row[:13], *values] for values in readings]
    return drawn


def draw(file: Path, cell) -> tuple[np.ndarray, np.ndarray, float]:
    """Return inside (levels, 24), value and half-width over truth (2, 24), NaN where refused; and seconds."""
    measurements = read_measurements(file)
    inside, shares = np.full((len(LEVELS), 24), np.nan), np.full((2, 24), np.nan)
    for number, level in enumerate(LEVELS):
        start = time.perf_counter()
        result = identify_stiffness(measurements, cell, level)
        seconds = time.perf_counter() - start
        found = [k for fit in result.joints for k in fit.k_Nmm_rad]
        for at, (k, true) in enumerate(zip(found, TRUTH, strict=True)):
            if k is None:
                continue
            inside[number, at] = k.contains(true)
            if level == LEVELS[0]:
                shares[:, at] = k.value / true, 0.5 * true * (1 / k.low - 1 / k.high)
    return inside, shares, seconds


def coverage(rows: list[list], cell, arguments: argparse.Namespace, folder: Path) -> None:
    rng = np.random.default_rng(arguments.seed)
    draws = []
    for _ in range(arguments.draws):
        drawn = noisy(rows, arguments.noise, arguments.repeats, rng)
        draws.append(draw(write(folder, drawn, stated_mm=arguments.stated), cell))
    inside, shares, seconds = (np.array(part) for part in zip(*draws, strict=True))
    stated = f"{arguments.stated * 1e3:g} um stated" if arguments.stated else "not stated"
    print(
        f"{arguments.draws} draws of {len(drawn)} readings, {arguments.repeats} of each pair, pose and load"
    )
    print(f"  laser noise {arguments.noise * 1e3:g} um a distance, {stated}")
    for number, level in enumerate(LEVELS):
        counted = inside[:, number][~np.isnan(inside[:, number])]
        by_stiffness = np.nanmean(inside[:, number], axis=0)
        spread = 2 * np.sqrt(level * (1 - level) / len(counted))
        print(
            f"  {level:.0%} intervals cover {counted.mean():6.2%} of {len(counted)} true values "
            f"(right: {level:.0%} +- {spread:.2%})"
        )
        print(f"      by stiffness {by_stiffness.min():.1%} .. {by_stiffness.max():.1%}")
    refused = np.count_nonzero(np.isnan(inside[:, 0]))
    print(f"  not determined {refused} of {inside[:, 0].size}; {np.median(seconds) * 1e3:.0f} ms a fit")
    print("  identified / table 1: mean, and half-width of the 90 % interval (median)")
    mean, half = np.nanmean(shares[:, 0], axis=0), np.nanmedian(shares[:, 1], axis=0)
    for number, joint in enumerate(JOINTS):
        words = [f"{KEYS[i]} {mean[3 * number + i]:.3f} +- {half[3 * number + i]:.3f}" for i in range(3)]
        print(f"    {joint:<11} {'   '.join(words)}")


def worst(rows: list[list], cell, folder: Path, cubes=None) -> str:
    """Largest errors without laser noise, of the axes and of the links' joints."""
    result = identify_stiffness(read_measurements(write(folder, rows, cubes=cubes)), cell)
    off = {True: 0.0, False: 0.0}
    for fit in result.joints:
        for k, true in zip(fit.k_Nmm_rad, make.TABLE_1[fit.joint], strict=True):
            link = fit.joint in ("linked_arm", "arm")
            off[link] = max(off[link], np.inf if k is None else abs(k.value / true - 1))
    return f"axes {off[False]:8.3%}, links {off[True]:8.3%}"


def not_covered(rows: list[list], cell, folder: Path) -> None:
    """Errors that the intervals do not cover: those equal in every reading."""
    print("  largest error without laser noise (distances written to 0.1 um)")
    print(f"    nothing else wrong                {worst(rows, cell, folder)}")
    low = [[*row[:7], *(0.99 * x for x in row[7:13]), *row[13:]] for row in rows]
    print(f"    force stated 1 % too small        {worst(low, cell, folder)}")
    rng = np.random.default_rng(1)
    moved = {
        name: (
            body,
            tuple(np.round(np.array(pose) + np.r_[rng.normal(0, 0.1, 3), rng.normal(0, 0.05, 3)], 6)),
        )
        for name, (body, pose) in make.CUBES.items()
    }
    print(f"    cubes' poses 0.1 mm, 0.05 deg off {worst(rows, cell, folder, moved)}")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--draws", type=int, default=200)
    parser.add_argument("--noise", type=float, default=make.LASER_NOISE_MM, help="mm, 1 sigma of a distance")
    parser.add_argument("--stated", type=float, default=0.0, help="mm, as stated in the head; 0: not stated")
    parser.add_argument("--repeats", type=int, default=make.SAMPLES, help="readings of a pair, pose and load")
    parser.add_argument("--seed", type=int, default=2020)
    arguments = parser.parse_args()
    cell = load_cell()
    rows = make.cube_rows(make.PAIRS, make.CUBES, make.POSES_DEG, make.LOADS)
    with tempfile.TemporaryDirectory() as folder:
        coverage(rows, cell, arguments, Path(folder))
        not_covered(rows, cell, Path(folder))


if __name__ == "__main__":
    main()
