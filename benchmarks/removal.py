"""Material removal with engagement and forces: speed, memory and accuracy.

Rates are samples a second with kernels compiled before; each line of the growth table is a process of its
own, so that its peak memory is its own. Nothing is judged here: the figures are printed.

    python benchmarks/removal.py                 all tables, moves from 10^3 to 10^6
    python benchmarks/removal.py --small         for CI: below 20 s
    python benchmarks/removal.py --scenes        only the errors against exact geometry
"""

import argparse
import itertools
import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from gcode2krl.cell.sections import Tool  # noqa: E402
from gcode2krl.cutting.engagement import engage  # noqa: E402
from gcode2krl.cutting.height_field import HeightField  # noqa: E402
from tests.cutting import scenes  # noqa: E402

FLAT = Tool(diameter_mm=16, teeth=3, flute_length_mm=30)
BALL_8 = Tool(kind="ball", diameter_mm=8, corner_radius_mm=4, teeth=2, flute_length_mm=20)
BALL_16 = Tool(kind="ball", diameter_mm=16, corner_radius_mm=8, teeth=2, flute_length_mm=30)
BULL = Tool(kind="bull-nose", diameter_mm=16, corner_radius_mm=2, teeth=3, flute_length_mm=30)


def block(low, high, cell_mm):
    low, high = np.array(low, float), np.array(high, float)
    count = np.ceil((high - low)[:2] / cell_mm - 1e-9).astype(int)
    return HeightField(np.full(count[::-1], high[2], np.float32), low[:2], (high - low)[:2] / count, low[2])


def zigzag(samples, step_mm, stepover_mm, row_mm=390.0, wavy=False):
    """Rows along x over a block of 400 mm, each a little farther along y; wavy: on a curved surface."""
    per_row = int(row_mm / step_mm)
    number = np.arange(samples)
    row, at = number // per_row, number % per_row
    x = np.where(row % 2 == 0, at, per_row - 1 - at) * step_mm + 5.0
    y = 5.0 + (row * stepover_mm) % 380.0
    layer = (row * stepover_mm) // 380.0
    z = -4.0 - 2.0 * layer
    if wavy:
        tau = 2 * np.pi
        z = z + 2 * np.sin(tau * x / 80) + np.sin(tau * y / 60) + 0.5 * np.sin(tau * x / 25 + y / 20)
    return np.stack([x, y, z], axis=1)


def rate(tool, cell_mm, samples, threads, step_mm=1.0, stepover_mm=8.0, wavy=False, rounds=1):
    """Return samples a second, the best of some rounds."""
    position = zigzag(samples, step_mm, stepover_mm, wavy=wavy)
    depth = float(position[:, 1].max()) + 15.0
    best = 0.0
    for _ in range(rounds):
        field = block((0, 0, -40), (400, depth, 0), cell_mm)
        start = time.perf_counter()
        cut(field, position, tool, threads)
        best = max(best, samples / (time.perf_counter() - start))
    return best


def cut(field, position, tool, threads):
    count = len(position)
    engage(
        field,
        position,
        np.zeros(count, np.int32),
        np.zeros(count, bool),
        np.full(count, 0.1),
        [tool],
        scenes.LAW,
        threads,
    )


def print_rates(samples, rounds):
    print(f"Samples a second, {samples} samples, best of {rounds}")
    print("| cut | cells mm | 1 thread | 2 threads |")
    print("| --- | --- | --- | --- |")
    cases = [
        ("flat 16, rows 8 mm apart, moves of 1 mm", FLAT, 0.25, 1.0, 8.0, False),
        ("flat 16, rows 8 mm apart, moves of 1 mm", FLAT, 0.2, 1.0, 8.0, False),
        ("flat 16, rows 8 mm apart, moves of 1 mm", FLAT, 0.1, 1.0, 8.0, False),
        ("flat 16, wavy raster, 0.6 mm, rows 0.25 mm apart", FLAT, 0.25, 0.6, 0.25, True),
        ("ball 8, wavy raster, 0.6 mm, rows 0.25 mm apart", BALL_8, 0.25, 0.6, 0.25, True),
        ("ball 16, wavy raster, 0.6 mm, rows 0.25 mm apart", BALL_16, 0.25, 0.6, 0.25, True),
        ("bull-nose 16, wavy raster, 0.6 mm, rows 0.25 mm apart", BULL, 0.25, 0.6, 0.25, True),
    ]
    for name, tool, cell_mm, step_mm, stepover_mm, wavy in cases:
        rates = [rate(tool, cell_mm, samples, n, step_mm, stepover_mm, wavy, rounds) for n in (1, 2)]
        print(f"| {name} | {cell_mm:g} | {rates[0]:,.0f} | {rates[1]:,.0f} |", flush=True)


def peak_mb():
    """Largest memory of this process so far; Linux's resource usage would count its parent's too."""
    status = Path("/proc/self/status")
    if status.exists():
        return int(status.read_text(encoding="ascii").split("VmHWM:")[1].split()[0]) / 1024
    import resource

    return (
        resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024 / (1024 if sys.platform == "darwin" else 1)
    )


def growth_child(samples):
    """Print time and peak memory of one size, of this process."""
    cut(block((0, 0, -40), (50, 50, 0), 0.25), zigzag(100, 1.0, 8.0, 40.0), FLAT, 2)
    field = block((0, 0, -40), (400, 400, 0), 0.25)
    position = zigzag(samples, 1.0, 8.0)
    before = peak_mb()
    start = time.perf_counter()
    cut(field, position, FLAT, 2)
    print(json.dumps({"seconds": time.perf_counter() - start, "before_mb": before, "peak_mb": peak_mb()}))


def print_growth(sizes):
    print("\nGrowth: flat 16, 0.25 mm cells on 400 x 400 mm, moves of 1 mm, two threads")
    print("| moves | s | moves/s | memory before, MB | peak, MB |")
    print("| --- | --- | --- | --- | --- |")
    for size in sizes:
        command = [sys.executable, __file__, "--growth-child", str(size)]
        found = subprocess.run(command, capture_output=True, text=True, check=True)
        row = json.loads(found.stdout.strip().splitlines()[-1])
        print(
            f"| {size:,} | {row['seconds']:.3f} | {size / row['seconds']:,.0f} | {row['before_mb']:.0f} "
            f"| {row['peak_mb']:.0f} |",
            flush=True,
        )


def print_booleans(moves):
    """The same short program as exact booleans: each move a hull of two cylinders."""
    import manifold3d

    position = zigzag(moves, 10.0, 8.0, 390.0)
    cylinder = manifold3d.Manifold.cylinder(60.0, 8.0, 8.0, 64)
    start = time.perf_counter()
    part = manifold3d.Manifold.cube([400, 60, 40]).translate([0, 0, -40])
    for a, b in itertools.pairwise(position):
        part -= manifold3d.Manifold.batch_hull([cylinder.translate(list(a)), cylinder.translate(list(b))])
    left = part.volume()
    exact_s = time.perf_counter() - start
    field = block((0, 0, -40), (400, 60, 0), 0.1)
    start = time.perf_counter()
    cut(field, position, FLAT, 2)
    own_s = time.perf_counter() - start
    print(f"\nExact booleans (manifold3d), {moves} moves of 10 mm: {exact_s:.2f} s; here, 0.1 mm cells with")
    print(f"engagement and forces: {own_s:.3f} s, {exact_s / own_s:.0f} times as fast;", end=" ")
    removed = 400 * 60 * 40 - field.volume_mm3
    print(f"removed volume {100 * (removed / (400 * 60 * 40 - left) - 1):+.3f} %")


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
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--small", action="store_true", help="below 20 s")
    parser.add_argument("--scenes", action="store_true", help="only the errors against exact geometry")
    parser.add_argument("--growth-child", type=int, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.growth_child:
        growth_child(chosen.growth_child)
        return
    if not chosen.scenes:
        cut(block((0, 0, -40), (50, 50, 0), 0.25), zigzag(100, 1.0, 8.0, 40.0), FLAT, 2)  # compiles
        print_rates(8_000 if chosen.small else 100_000, 1 if chosen.small else 3)
        print_growth([1000, 10_000] if chosen.small else [1000, 10_000, 100_000, 1_000_000])
        print_booleans(40 if chosen.small else 200)
    for cell_mm in (0.1,) if chosen.small else (0.1, 0.25):
        print_scenes(cell_mm, 30 if chosen.small else 100)


if __name__ == "__main__":
    main()
