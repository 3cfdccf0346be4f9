"""What the collision check costs, and how it agrees with an independent library.

``python benchmarks/collision.py``: 10^6 samples of a raster with 8 capsules against a mesh of 50,688
triangles, with the fixture near the way and far from it; then 10,000 random capsules against a mesh of 3,168
triangles by python-fcl and by us, and 1,000 plates of 2 mm that a body passes between two rows; then the
default command on a raster of a million lines, without and with such a fixture 8 mm beside the cutter.
``--small`` takes a hundredth of all of it.
"""

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import trimesh
from throughput import make_raster

from gcode2krl import frames as fr
from gcode2krl import load_cell
from gcode2krl.collision import scene
from gcode2krl.collision.along import Way
from gcode2krl.collision.gaps import obstacle_gaps, placed
from gcode2krl.robot.inverse_kinematics import one_branch
from gcode2krl.robot.poses import flange_frames

GEOMETRY = np.array([350.0, 41.0, 675.0, 1150.0, 1000.0, 240.0])
CAPSULES = (  # link, ends, radius: an arm with a spindle across its flange
    (0, [0, 0, 0, 0, 0, 300], 300),
    (1, [0, 0, 400, 350, 0, 675], 250),
    (2, [0, 0, 0, 1150, 0, 0], 180),
    (3, [-150, 0, 0, 150, 0, 0], 200),
    (4, [-600, 0, 0, 0, 0, 0], 150),
    (5, [-50, 0, 0, 100, 0, 0], 120),
    (6, [0, 0, 0, 0, 0, 150], 90),
    (6, [175, 0, 250, -150, 0, 250], 60),
)
FIXTURE = """based_on = "demonstration"
[[obstacle]]
name = "ring"
mesh = "ring.stl"
[spindle.body]
source = "made up"
capsules = [
  { from_mm = [0.0, 0.0, 40.0], to_mm = [50.0, 0.0, 250.0], radius_mm = 70.0 },
  { from_mm = [75.0, 0.0, 250.0], to_mm = [-150.0, 0.0, 250.0], radius_mm = 75.0 },
]
"""
BODIES = scene.bodies_of(
    [link for link, _, _ in CAPSULES],
    np.array([ends for _, ends, _ in CAPSULES], dtype=float),
    [radius for _, _, radius in CAPSULES],
    GEOMETRY,
)


def torus(rings: int, sides: int) -> np.ndarray:
    """Return the triangles of a closed ring of 300 mm with a section of 80 mm."""
    u, v = np.meshgrid(np.arange(rings), np.arange(sides), indexing="ij")

    def point(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        around, across = 2 * np.pi * u / rings, 2 * np.pi * v / sides
        far = 300 + 80 * np.cos(across)
        return np.stack([far * np.cos(around), far * np.sin(around), 80 * np.sin(across)], axis=-1)

    a, b, c, d = (point(u + i, v + j) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)))
    return np.concatenate([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)]).reshape(-1, 3, 3)


def raster(samples: int) -> np.ndarray:
    """Return the joints (n, 6) along rows of 400 mm over a wavy surface, 0.6 mm apart."""
    cell = load_cell()
    way = 0.6 * np.arange(samples)
    row, x = np.divmod(way, 400.0)
    x = np.where(row % 2 == 0, x, 400.0 - x)
    tip = np.stack([x, 0.25 * row, -3.0 * np.sin(x / 30.0)], axis=1)
    rotation = np.tile([0.0, 0.0, 0.0, 1.0], (samples, 1))
    position, turned = flange_frames(tip, rotation, np.ones(samples, dtype=np.int32), cell)
    turned = np.broadcast_to(turned, (samples, 3, 3))
    return one_branch(position, turned, GEOMETRY, 0, cell.home_q_rad())


def cost(q_rad: np.ndarray, beside_mm: float) -> str:
    """Return a line on a ring of 50,688 triangles that stands beside the work."""
    ring = 0.4 * torus(198, 128) + [1700.0, -152.0 - 8.0 - beside_mm, 815.0]
    begin_s = time.process_time()
    shape = scene.mesh(ring)
    tree_s = time.process_time() - begin_s
    pairs = [(body, 0, 0) for body in range(len(CAPSULES))]
    way = Way(BODIES, shape, pairs, GEOMETRY, near_mm=5.0, horizon_mm=0.0, is_sampled=True)
    begin_s = time.process_time()
    found = way.take(q_rad)
    taken_s = time.process_time() - begin_s
    return (
        f"{len(q_rad):,} samples x {len(CAPSULES)} capsules, {len(ring):,} triangles "
        f"{beside_mm:g} mm beside: {taken_s:.2f} s of one thread, {len(found.row):,} near; "
        f"tree {tree_s:.2f} s"
    )


def whole_chain(lines: int, rounds: int) -> str:
    """Return a line on the default command, without and with the fixture, in turn."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        part = make_raster(folder, lines)
        ring = 0.4 * torus(198, 128) + [150.0, _lowest_y_mm(part) - 4.0 - 8.0 - 152.0, -10.0]
        trimesh.Trimesh(**trimesh.triangles.to_kwargs(ring)).export(folder / "ring.stl")
        (folder / "fixture.toml").write_text(FIXTURE, encoding="ascii")
        seconds: dict[str, list[tuple[float, float]]] = {"demonstration": [], "fixture.toml": []}
        for _ in range(rounds):
            for cell, taken in seconds.items():
                taken.append(_run(folder, part, cell))
    (wall_s, used_s), (wall_with_s, used_with_s) = (np.median(each, axis=0) for each in seconds.values())
    return (
        f"the default command on {lines:,} lines: {wall_s:.1f} s, with the fixture {wall_with_s:.1f} s "
        f"({wall_with_s / wall_s - 1.0:+.0%}); of processors {used_s:.1f} and {used_with_s:.1f} s "
        f"({used_with_s / used_s - 1.0:+.0%})"
    )


def _run(folder: Path, part: Path, cell: str) -> tuple[float, float]:
    """Return wall and processor seconds of a translation."""
    command = [sys.executable, "-m", "gcode2krl", part.name, "-o", "OUT.src", "--quiet"]
    options = [] if cell == "demonstration" else ["--cell", cell]
    before, began_s = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([*command, *options], cwd=folder, check=True, stderr=subprocess.DEVNULL)
    wall_s, after = time.perf_counter() - began_s, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall_s, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def _lowest_y_mm(part: Path) -> float:
    with part.open(encoding="ascii") as text:
        return min(float(line[1 : line.index(" ")]) for line in text if line.startswith("Y"))


def against_oracle(poses: int) -> str:
    """Return a line on random capsules, by python-fcl and by us."""
    try:
        import fcl
    except ImportError:
        return "python-fcl is not installed: no comparison"
    rng = np.random.default_rng(0)
    triangles, radius_mm = torus(66, 24), 30.0
    middle, way = rng.uniform(-700, 700, (poses, 3)), rng.normal(size=(poses, 3))
    way *= rng.uniform(1, 400, (poses, 1)) / np.linalg.norm(way, axis=1, keepdims=True)
    ends = np.concatenate([middle - way / 2, middle + way / 2], axis=1)
    begin_s = time.process_time()
    gap, _ = obstacle_gaps(ends, radius_mm, scene.mesh(triangles))
    own_s = time.process_time() - begin_s
    model = fcl.BVHModel()
    model.beginModel(3 * len(triangles), len(triangles))
    model.addSubModel(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))
    model.endModel()
    ring, missed, apart_mm, begin_s = fcl.CollisionObject(model), 0, 0.0, time.process_time()
    for ours, pair in zip(gap, ends, strict=True):
        place = fcl.Transform(
            frame_along(pair[3:] - pair[:3], (pair[:3] + pair[3:]) / 2)[:3, :3], pair[:3] / 2 + pair[3:] / 2
        )
        capsule = fcl.CollisionObject(
            fcl.Capsule(radius_mm, float(np.linalg.norm(pair[3:] - pair[:3]))), place
        )
        if fcl.collide(capsule, ring, fcl.CollisionRequest(), fcl.CollisionResult()):
            missed += ours > 1e-3
        elif ours > -radius_mm:  # inside the ring without touching it, the oracle sees nothing
            far = fcl.distance(capsule, ring, fcl.DistanceRequest(), fcl.DistanceResult())
            apart_mm = max(apart_mm, abs(far - ours))
    fcl_s = time.process_time() - begin_s
    return (
        f"{poses:,} capsules against python-fcl: {missed} contacts missed, distances apart by "
        f"{apart_mm:.1e} mm at most; {own_s:.2f} s and {fcl_s:.2f} s"
    )


def thin_plates(count: int) -> str:
    """Return a line on plates of 2 mm somewhere between two rows of a fast way of the joints."""
    rng = np.random.default_rng(1)
    low, high = np.radians([-120, -120, 0, -180, -110, -180]), np.radians([120, -20, 140, 180, 110, 180])
    missed, steps_mm = 0, []
    for _ in range(count):
        way = rng.normal(size=6)
        q = rng.uniform(low, high) + np.arange(8)[:, None] * np.radians(5.0) * way / np.abs(way).max()
        body, row, u = int(rng.integers(3, 8)), int(rng.integers(1, 7)), rng.uniform(0.2, 0.8)
        pose = q[row] + u * (q[row + 1] - q[row])
        ends = placed(np.stack([pose - 1e-4 * (q[1] - q[0]), pose, *q[row : row + 2]]), GEOMETRY, BODIES)[
            :, body
        ]
        middle = (ends[:, :3] + ends[:, 3:]) / 2
        size = np.array([30.0, 30.0, 1.0])
        plate = scene.box(-size, size, frame_along(middle[1] - middle[0], middle[1]))
        found = Way(
            BODIES, plate, [(body, 0, 0)], GEOMETRY, near_mm=5.0, horizon_mm=0.0, is_sampled=False
        ).take(q)
        missed += not (found.gap_mm[: row + 2] <= 0).any()
        steps_mm.append(float(np.linalg.norm(middle[3] - middle[2])))
    return f"{count:,} plates of 2 mm, rows up to {max(steps_mm):.0f} mm apart: {missed} missed"


def frame_along(way: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """Return a frame (4, 4) whose z goes along a vector."""
    z = way / np.linalg.norm(way)
    x = np.cross(z, [1.0, 0, 0] if abs(z[0]) < 0.9 else [0, 1.0, 0])
    x /= np.linalg.norm(x)
    return fr.transform(origin, np.stack([x, np.cross(z, x), z], axis=1))


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the figures."""
    parser = argparse.ArgumentParser(description="cost and agreement of the collision check")
    parser.add_argument("--small", action="store_true", help="a hundredth of it")
    options = parser.parse_args(arguments)
    share = 100 if options.small else 1
    q_rad = raster(1_000_000 // share)
    for beside_mm in (8.0, 40.0, 200.0):
        print(cost(q_rad, beside_mm), flush=True)
    print(against_oracle(10_000 // share), flush=True)
    print(thin_plates(1000 // share), flush=True)
    print(whole_chain(1_000_000 // share, 1 if options.small else 3), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
