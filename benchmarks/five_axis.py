"""Forces while the tool's axis turns: dexels against exact solids, against the height field, and their cost.

Cases are drawn: lead, tilt, both, swarf cuts, walls of pockets, undercuts, blends from one axis to another,
plunges along a tilted axis. The volume that a case removes is compared with booleans of manifold3d (hulls of
the cutter at fine steps), the area of contact with points all over the edge that no earlier pose has
contained. Nothing is judged here.

    python benchmarks/five_axis.py            32 cases
    python benchmarks/five_axis.py --small    for CI: below 30 s
"""

import argparse
import itertools
import math
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple
from unittest import mock

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from gcode2krl.cell.sections import Tool  # noqa: E402
from gcode2krl.cutting.cutter import shape_of  # noqa: E402
from gcode2krl.cutting.dexels import CELLS_PER_DIAMETER, dexel_block  # noqa: E402
from gcode2krl.cutting.engagement import engage  # noqa: E402
from gcode2krl.cutting.height_field import HeightField  # noqa: E402
from gcode2krl.cutting.turned import TurnedEngagement, TurnedPoints  # noqa: E402
from tests.cutting import scenes  # noqa: E402

TOOLS = (
    Tool(diameter_mm=16, teeth=3, flute_length_mm=30),
    Tool(kind="ball", diameter_mm=12, corner_radius_mm=6, teeth=2, flute_length_mm=24),
    Tool(kind="bull-nose", diameter_mm=16, corner_radius_mm=3, teeth=3, flute_length_mm=30),
    Tool(kind="tapered", diameter_mm=8, corner_radius_mm=2, taper_deg=6, teeth=2, flute_length_mm=24),
)
STOCK = np.array([[0.0, 0.0, -30.0], [60.0, 50.0, 0.0]])
F_Z_MM = 0.1
STEP_MM = 0.3
"""Between two samples: 25 mm/s at 12 ms."""
HOLLOW = math.sin(math.radians(2.0))
"""A flat bottom is hollow: what it descends to more gently it does not touch."""


class Case(NamedTuple):
    """A motion: tips and axes (n, 3), the tool."""

    name: str
    tool: Tool
    tip: np.ndarray
    axis: np.ndarray


def tilted(lead_deg, tilt_deg):
    """Return an axis leaning forward (x) and to the side (y)."""
    axis = np.array([math.tan(math.radians(lead_deg)), math.tan(math.radians(tilt_deg)), 1.0])
    return axis / np.linalg.norm(axis)


def along(corners, axes):
    """Return tips and axes between corners, the axis turning evenly in a plane."""
    tips, turned = [np.array(corners[:1], float)], [np.array(axes[:1], float)]
    for (a, b), (u, v) in zip(
        itertools.pairwise(np.array(corners, float)), itertools.pairwise(axes), strict=True
    ):
        count = max(2, math.ceil(np.linalg.norm(b - a) / STEP_MM))
        share = np.linspace(0.0, 1.0, count + 1)[1:, None]
        angle = math.acos(float(np.clip(np.dot(u, v), -1.0, 1.0)))
        if angle < 1e-9:
            axis = np.repeat([v], count, axis=0)
        else:
            axis = (np.sin((1 - share) * angle) * u + np.sin(share * angle) * v) / math.sin(angle)
        tips.append(a + share * (b - a))
        turned.append(axis)
    return np.concatenate(tips), np.concatenate(turned)


def drawn(count, seed=46):
    """Yield cases of all kinds in turn."""
    rng = np.random.default_rng(seed)
    for number in range(count):
        kind = ("lead", "tilt", "both", "swarf", "wall", "undercut", "blend", "plunge")[number % 8]
        tool = TOOLS[int(rng.integers(len(TOOLS)))]
        depth, y = rng.uniform(1.0, 4.0), rng.uniform(15.0, 35.0)
        lead, tilt = rng.uniform(3.0, 25.0, 2) * rng.choice([-1.0, 1.0], 2)
        start, end = [-16.0, y, -depth], [50.0, y + rng.uniform(-6.0, 6.0), -depth]
        first = last = tilted(lead, tilt)
        if kind in ("lead", "tilt"):
            first = last = tilted(*((lead, 0.0) if kind == "lead" else (0.0, tilt)))
        corners, axes = [start, end], [first, last]
        if kind == "swarf":
            edge = STOCK[1, 1] + tool.diameter_mm / 2.0 - rng.uniform(1.0, 3.0)
            corners = [[-16.0, edge, -12.0], [70.0, edge, -12.0]]
            axes = [tilted(0.0, rng.uniform(-15.0, 15.0)), tilted(0.0, rng.uniform(-15.0, 15.0))]
        if kind == "wall":
            aside = rng.uniform(1.0, 4.0)
            corners = [start, end, [end[0], end[1] + aside, -depth], [start[0], start[1] + aside, -depth]]
            axes = [first] * 4
        if kind == "undercut":
            first = last = np.array([0.0, math.sin(1.75), math.cos(1.75)])
            reach = STOCK[1, 1] - rng.uniform(4.0, 8.0)
            corners, axes = [[-16.0, reach, -15.0], [50.0, reach, -15.0]], [first, last]
        if kind == "blend":
            axes = [tilted(lead, tilt), tilted(-0.5 * lead, rng.uniform(-20.0, 20.0))]
        if kind == "plunge":
            below = np.array([30.0, y, -6.0])
            corners, axes = [below + 10.0 * first, below, below + 10.0 * first], [first] * 3
        yield Case(kind, tool, *along(corners, axes))


def points_of(case):
    """Return the case as the core takes it: a tooth in F_Z_MM of the way, turns in proportion."""
    step = np.gradient(case.tip, axis=0)
    size = np.linalg.norm(step, axis=1, keepdims=True)
    swing = np.gradient(case.axis, axis=0) / np.maximum(size, 1e-9) * F_Z_MM
    count = len(case.tip)
    none = np.zeros(count, bool)
    columns = (case.tip, case.axis, F_Z_MM * step / np.maximum(size, 1e-9), swing)
    return TurnedPoints(*columns, np.zeros(count, np.int32), none, ~none)


def profile(shape):
    """Return radii and heights (k,) of the outline of a cutter up to its top, from the axis to the axis."""
    kappa = np.linspace(0.0, shape.kappa_rad, 24 if shape.corner_mm > 0 else 1)
    r = [0.0, *(shape.bottom_mm + shape.corner_mm * np.sin(kappa)), shape.radius_mm, 0.0]
    z = [0.0, *(shape.corner_mm * (1.0 - np.cos(kappa))), shape.flute_mm, shape.flute_mm]
    return np.array(r), np.array(z)


def exact_volume(case, every=1):
    """Return the volume (mm³) that hulls of the cutter at two samples each take from the block.

    ``every``: so many samples of one straight way on which the axis turns evenly are one step.
    """
    import manifold3d

    r, z = profile(shape_of(case.tool))
    cutter = manifold3d.Manifold.revolve(manifold3d.CrossSection([np.stack([r, z], axis=1)]), 96)
    part = manifold3d.Manifold.cube(list(STOCK[1] - STOCK[0])).translate(list(STOCK[0]))
    whole = part.volume()
    way = np.diff(np.hstack([case.tip, case.axis]), axis=0)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    # one hull covers a straight way of a constant axis
    bends = np.abs(np.diff(way, axis=0)).max(axis=1) > 1e-9
    bends |= np.abs(way[1:, 3:]).max(axis=1) > 0.0
    rows = [0, *(np.flatnonzero(bends)[every - 1 :: every] + 1), len(case.tip) - 1]
    bodies = [cutter.transform(np.column_stack([frame(case.axis[row]), case.tip[row]])) for row in rows]
    sweeps = [manifold3d.Manifold.batch_hull([a, b]) for a, b in itertools.pairwise(bodies)]
    for first in range(0, len(sweeps), 16):
        part -= manifold3d.Manifold.batch_boolean(sweeps[first : first + 16], manifold3d.OpType.Add)
    return whole - part.volume()


def frame(axis):
    """Return a rotation (3, 3) whose third column is the axis."""
    helper = np.array([1.0, 0.0, 0.0]) if abs(axis[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    across = np.cross(axis, helper)
    across /= np.linalg.norm(across)
    return np.column_stack([np.cross(across, axis), across, axis])


def is_inside(shape, tip, axis, places):
    """Return (n,) True where places are inside a cutter, by its radius at their height."""
    off = places - tip
    z = off @ axis
    r2 = (off * off).sum(axis=1) - z * z
    height, radii = np.array(profile(shape)[::-1])[:, :-1]
    if shape.corner_mm > 0.0:
        low = np.clip(shape.corner_mm - z, 0.0, shape.corner_mm)
        arc = shape.bottom_mm + np.sqrt(shape.corner_mm**2 - low**2)
        side = shape.arc_radius_mm + (z - shape.arc_top_mm) / math.tan(shape.kappa_rad)
        radius = np.where(z < shape.arc_top_mm, arc, side)
    else:
        radius = np.interp(z, height[1:], radii[1:])
    return (z > 0.0) & (z < shape.flute_mm) & (r2 < np.maximum(radius - 1e-3, 0.0) ** 2)


def exact_contact(case, row, fine=4):
    """Return the area (mm²) of the edge that moves into material which no earlier pose has contained."""
    shape = shape_of(case.tool)
    r, z = profile(shape)
    r, z = r[:-1], z[:-1]  # the top is no edge
    parts = [16, *[2] * (len(r) - 3), 60]
    at = np.concatenate([np.linspace(0.0, 1.0, count, endpoint=False) + k for k, count in enumerate(parts)])
    radius, height = np.interp(at, np.arange(len(r)), r), np.interp(at, np.arange(len(z)), z)
    middle_r, middle_z = 0.5 * (radius[1:] + radius[:-1]), 0.5 * (height[1:] + height[:-1])
    dr, dz = np.diff(radius), np.diff(height)
    slant = np.maximum(np.hypot(dr, dz), 1e-12)
    phi = (np.arange(120) + 0.5) * math.tau / 120
    turn = frame(case.axis[row])
    around = np.stack([np.cos(phi), np.sin(phi), np.zeros_like(phi)], axis=1) @ turn.T
    places = case.tip[row] + middle_z[:, None, None] * case.axis[row] + middle_r[:, None, None] * around
    normal = (dz / slant)[:, None, None] * around - (dr / slant)[:, None, None] * case.axis[row]
    before, behind = max(row - 1, 0), min(row + 1, len(case.tip) - 1)
    turn = np.cross(case.axis[row], case.axis[behind] - case.axis[before])
    moved = case.tip[behind] - case.tip[before] + np.cross(turn, places - case.tip[row])
    into = (normal * moved).sum(axis=2) / np.linalg.norm(moved, axis=2)
    is_bottom = (dz == 0.0)[:, None]
    into = into > np.where(is_bottom, HOLLOW, 1e-6)
    area = np.broadcast_to((slant * middle_r)[:, None] * math.tau / 120, into.shape)[into]
    places = places[into]
    stands = ((places > STOCK[0]) & (places < STOCK[1])).all(axis=1)
    for k in range(row - 1, -1, -1):  # the last ones contain most of what is no contact
        for part in range(fine):
            share = part / fine
            tip = case.tip[k] + share * (case.tip[k + 1] - case.tip[k])
            axis = case.axis[k] + share * (case.axis[k + 1] - case.axis[k])
            left = np.flatnonzero(stands)
            if not len(left):
                return 0.0
            stands[left[is_inside(shape, tip, axis / np.linalg.norm(axis), places[left])]] = False
    return float(area[stands].sum())


def cut(case, cell_mm):
    """Return what is read, the areas of contact, the dexels that are left, and the processor time."""
    dexels = dexel_block(STOCK, cell_mm)
    start = time.process_time()
    engagement = TurnedEngagement(dexels, [case.tool], scenes.LAW)
    engaged, area = engagement.contacts(points_of(case), ends=True)
    return engaged.result, area, engagement.dexels, time.process_time() - start


def print_cases(count, most):
    """Print the errors of each case."""
    print("| case | cutter | removed mm³ | volume | contact | missed | µs/sample |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    block, worst = float(np.prod(STOCK[1] - STOCK[0])), []
    for case in drawn(count):
        _, area, left, seconds = cut(case, case.tool.diameter_mm / CELLS_PER_DIAMETER)
        exact = exact_volume(case)
        error = (block - left.volume_mm3) / exact - 1.0
        rows = np.linspace(1, len(case.tip) - 1, most + 2).astype(int)[1:-1]
        wanted = np.array([exact_contact(case, row) for row in rows])
        sizes = wanted > 0.02 * wanted.max()
        contact = area[rows][sizes].sum() / wanted[sizes].sum() - 1.0
        missed = int(np.count_nonzero((area[rows] == 0.0) & sizes))
        worst.append((abs(error), abs(contact), missed))
        each = 1e6 * seconds / len(case.tip)
        print(
            f"| {case.name} | {case.tool.kind} {case.tool.diameter_mm:g} | {exact:.0f} "
            f"| {100 * error:+.2f} % | {100 * contact:+.1f} % "
            f"| {missed} of {int(sizes.sum())} | {each:.0f} |",
            flush=True,
        )
    volume, contact, missed = (100 * np.array(column) for column in zip(*worst, strict=True))
    print(f"\nVolume: {np.count_nonzero(volume <= 0.5)} of {count} within 0.5 %, worst {volume.max():.2f} %;")
    print(f"contact: {np.count_nonzero(contact <= 5)} within 5 %, worst {contact.max():.1f} %;", end=" ")
    print(f"missed: {missed.sum() / 100:.0f}")


def upright_ways():
    """Yield ways of an upright tool."""
    up = np.array([0.0, 0.0, 1.0])
    for name, corners in (
        ("slot", [[-10, 20, -4], [70, 20.3, -4]]),
        ("second pass", [[-10, 20, -4], [70, 20, -4], [70, 29, -4], [-10, 29, -4]]),
        ("corner", [[-10, 20, -4], [40, 25, -4], [40, 60, -4]]),
        ("ramp", [[10, 20, 1], [50, 22, -4]]),
    ):
        yield name, *along(corners, [up] * len(corners))


def print_upright():
    """Print forces where the axis is constant against those of the height field, and the times of both."""
    print("\nUpright tool: dexels beside the height field (D/100)")
    print("| way | cutter | mean force | RMS | µs/sample, height field | µs/sample, dexels |")
    print("| --- | --- | --- | --- | --- | --- |")
    total_s, samples = np.zeros(2), 0
    for tool, (name, tip, axis) in itertools.product(TOOLS, upright_ways()):
        case = Case(name, tool, tip, axis)
        cut(case, tool.diameter_mm / CELLS_PER_DIAMETER)  # the first call of each kind is slow
        found, _, _, own_s = cut(case, tool.diameter_mm / CELLS_PER_DIAMETER)
        wanted, field_s = cut_upright(case)
        size, own = np.linalg.norm(wanted, axis=1), np.linalg.norm(found.force_N, axis=1)
        off = np.linalg.norm(found.force_N - wanted, axis=1)
        total_s, samples = total_s + np.array([field_s, own_s]), samples + len(tip)
        print(
            f"| {name} | {tool.kind} | {100 * (own.sum() / size.sum() - 1):+.2f} % "
            f"| {100 * math.sqrt((off**2).sum() / (size**2).sum()):.2f} % "
            f"| {1e6 * field_s / len(tip):.0f} | {1e6 * own_s / len(tip):.0f} |",
            flush=True,
        )
    mean = 1e6 * total_s / samples
    print(f"all: {mean[0]:.0f} and {mean[1]:.0f} µs a sample, {mean[1] / mean[0]:.1f} times")


def cut_upright(case):
    """Return the forces (n, 3) along a way of an upright tool by the height field, and the processor time."""
    size_mm = case.tool.diameter_mm / 100.0
    count = np.ceil((STOCK[1] - STOCK[0])[:2] / size_mm).astype(int)
    height = np.full(count[::-1], STOCK[1, 2], np.float32)
    field = HeightField(height, STOCK[0, :2].copy(), (STOCK[1] - STOCK[0])[:2] / count, STOCK[0, 2])
    rows = len(case.tip)
    none, direction = np.zeros(rows, np.int32), points_of(case).feed_mm / F_Z_MM
    f_z_mm = np.full(rows, F_Z_MM)
    start = time.process_time()
    found = engage(field, case.tip, none, none.astype(bool), f_z_mm, [case.tool], scenes.LAW, 1, direction)
    return found.force_N, time.process_time() - start


def print_chain():
    """Print what a whole prediction costs by the height field and by dexels, and the memory of these."""
    from gcode2krl import load_cell, predict
    from gcode2krl.cutting.outlook import Watch

    print("\nThe whole chain (predict), processor time a sample")
    folder, outlook = ROOT / "examples", Watch.outlook

    def seconds(part, cell):
        spent = []
        for _ in range(3):
            start = time.process_time()
            prediction = predict(folder / part, cell)
            spent.append(time.process_time() - start)
        return 1e6 * min(spent) / len(prediction.motion)

    known = load_cell()
    for part in ("test_piece.nc", "cam_style.nc"):
        field_us = seconds(part, known)
        with mock.patch.object(Watch, "outlook", lambda watch: replace(outlook(watch), turns=True)):
            dexels_us = seconds(part, known)
        print(f"{part}: {field_us:.0f} µs, by dexels {dexels_us:.0f} µs", flush=True)
    turning_us = seconds("five_axis/five_axis.nc", load_cell(folder / "five_axis" / "cell.toml"))
    print(f"five_axis/five_axis.nc: {turning_us:.0f} µs", flush=True)
    block = dexel_block(np.array([[0.0, 0.0, 0.0], [300.0, 200.0, 50.0]]), 0.5)
    size = sum(column.nbytes for column in block)
    print(f"memory: {len(block.rays):,} rays of 300 x 200 x 50 mm at 0.5 mm cells, {size / 1e6:.0f} MB")


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--small", action="store_true", help="below 30 s")
    chosen = parser.parse_args()
    print_cases(*((8, 2) if chosen.small else (32, 4)))
    print_upright()
    if not chosen.small:
        print_chain()


if __name__ == "__main__":
    main()
