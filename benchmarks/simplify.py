"""What merging feed moves gains and costs: time, deviation, processor time, by several laws of a controller.

``python benchmarks/simplify.py PART.nc [PART.nc …] [--simplify MM …]`` prints, for each program and
tolerance, how many feed moves are left, how far a corner of the G-code is off the new lines, how far the
commanded path with its rounded corners is off the G-code's lines, and the time of the motion. Moves are
merged without looking at any law; the times by other laws, look-aheads and filter lengths than the cell's say
whether the gain depends on them. ``--raster N`` makes a ball-nose raster of so many moves and prints the
processor time of each step.
"""

import argparse
import io
import math
import time
from collections.abc import Iterator, Sequence

import numpy as np

from gcode2krl import krc4, program
from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell, load_cell
from gcode2krl.gcode import read_gcode, read_stream
from gcode2krl.krl.composition import TextLayout, compose
from gcode2krl.krl.original_path import compare_with_original
from gcode2krl.krl.read import read_texts
from gcode2krl.pipeline import set_targets
from gcode2krl.robot import ptp_joints
from gcode2krl.tables import Targets, Toolpath

LAWS = {
    "the cell's": {},
    "trapezoid": {"law": "trapezoid"},
    "advance 1": {"advance": 1},
    "advance 5": {"advance": 5},
    "k 0.084 s": {"k_s": 0.084},
    "k 0.300 s": {"k_s": 0.300},
    "a 4 m/s2": {"acc_cp_m_s2": 4.0},
    "no look-ahead model": {"advance": "unlimited"},
}
"""Controllers that the time is told by."""
HEAD = ("tolerance", "feed moves", "corner off", "path off")
POINTS_OF_A_CORNER = 9
RASTER_LINE_MM, RASTER_STEP_MM, RASTER_PITCH_MM = 500.0, 0.1, 0.5


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("parts", nargs="*", metavar="PART.nc")
    parser.add_argument("--simplify", nargs="+", type=float, default=[0.005, 0.01, 0.02], metavar="MM")
    parser.add_argument("--cell", help="cell file; default: the demonstration cell")
    parser.add_argument("--raster", type=int, metavar="MOVES")
    options = parser.parse_args(arguments)
    cell = load_cell(options.cell)
    for part in options.parts:
        toolpath = read_gcode(part, cell)
        print(f"\n{part}: {len(toolpath) - 1} moves")
        print(
            " | ".join(
                ["tolerance", "feed moves", "corner off", "path off", *(f"s, {name}" for name in LAWS)]
            )
        )
        for simplify_mm in (None, *options.simplify):
            print(" | ".join(_row(toolpath, cell, simplify_mm)))
    if options.raster:
        _cost(options.raster, cell)
    return 0


def _row(toolpath: Toolpath, cell: Cell, simplify_mm: float | None) -> Iterator[str]:
    targets = set_targets(toolpath, cell, None, simplify_mm)
    kept = targets.simplified
    yield "-" if simplify_mm is None else f"{simplify_mm:g}"
    feed = ~targets.ptp & (targets.move >= 0) & ~toolpath.rapid[np.maximum(targets.move, 0)]
    yield str(int(np.count_nonzero(feed)))
    yield f"{kept.largest_mm:.4f}" if kept is not None else "0"
    yield f"{path_off_mm(toolpath, targets, cell):.4f}"
    for changes in LAWS.values():
        controller = cell.controller.model_copy(update=changes)
        other = cell.model_copy(update={"controller": controller})
        yield f"{krc4.plan(krc4.build_chain(targets, other), other).total_s:.1f}"


def path_off_mm(toolpath: Toolpath, targets: Targets, cell: Cell) -> float:
    """Return how far the commanded path, along its rounded corners, is off the G-code's lines at most."""
    chain = krc4.build_chain(targets, cell)
    corners = np.flatnonzero(chain.blend_mm > 0.0)
    corners = corners[~toolpath.rapid[chain.move[corners]] & ~toolpath.rapid[chain.move[corners + 1]]]
    way = chain.end_mm - chain.start_mm
    unit = way / np.maximum(np.linalg.norm(way, axis=1), 1e-12)[:, None]
    before, after = (chain.blend_mm[corners] * chain.scale[corners + k] for k in (0, 1))
    largest = 0.0
    for share in np.linspace(0.0, 1.0, POINTS_OF_A_CORNER):
        point = chain.end_mm[corners] - ((1.0 - share) ** 2 * before)[:, None] * unit[corners]
        point += (share**2 * after)[:, None] * unit[corners + 1]
        first = np.append(chain.move[:1] - 1, chain.move)[corners]
        largest = max(
            largest, float(_off_lines(toolpath, point, first, chain.move[corners + 1]).max(initial=0.0))
        )
    return max(largest, targets.simplified.largest_mm if targets.simplified is not None else 0.0)


def _off_lines(toolpath: Toolpath, point: Floats, first: Floats, last: Floats) -> Floats:
    """Return the distance (n,) of points to the nearest move behind row ``first`` and up to row ``last``."""
    count = last - first
    of = np.repeat(np.arange(len(point)), count)
    row = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + first[of] + 1
    start, way = toolpath.position_mm[row - 1], toolpath.position_mm[row] - toolpath.position_mm[row - 1]
    size2 = np.maximum(np.einsum("ij,ij->i", way, way), 1e-24)
    share = np.clip(np.einsum("ij,ij->i", point[of] - start, way) / size2, 0.0, 1.0)
    off = np.linalg.norm(point[of] - start - share[:, None] * way, axis=1)
    return np.minimum.reduceat(off, np.cumsum(count) - count)


def _cost(moves: int, cell: Cell) -> None:
    """Print the processor time of the steps that merging adds, on a raster."""
    toolpath = read_stream(io.BytesIO(raster(moves)), "raster.nc", cell)
    seconds: dict[str, float] = {}

    def timed(name: str, work):
        begin = time.process_time()
        result = work()
        seconds[name] = time.process_time() - begin
        return result

    whole = timed("targets", lambda: set_targets(toolpath, cell))
    fewer = timed("merging", lambda: program.merged(whole, toolpath, cell, 0.01))
    for name, targets in (("time before", whole), ("time after", fewer)):
        timed(name, lambda t=targets: krc4.plan(krc4.build_chain(t, cell), cell))
    files = compose(fewer, ptp_joints(fewer, cell), cell, "RASTER", TextLayout())
    texts = {name: b"".join(pieces) for name, pieces in files.items()}
    read = read_texts(texts, "RASTER.src")
    timed("against the G-code", lambda: compare_with_original(read, fewer, toolpath, cell))
    timed("targets, simplified", lambda: set_targets(toolpath, cell, None, 0.01))
    left_out = fewer.simplified.left_out
    print(f"\nraster of {len(toolpath) - 1} moves, {left_out} left out at 0.01 mm; processor time")
    for name, value in seconds.items():
        print(f"  {name:20} {value:.2f} s")


def raster(moves: int) -> bytes:
    """Return a raster over a wavy surface, 3 decimals, points 0.1 mm apart."""
    each = int(RASTER_LINE_MM / RASTER_STEP_MM)
    x = np.arange(1, each + 1) * RASTER_STEP_MM
    lines = ["G21 G90 G17 G94", "T1 M6", "S12000 M3", "G0 G43 H1 Z50", "X0 Y0", "Z5", "G1 Z0 F600", "F3000"]
    for k in range(math.ceil(moves / each)):
        along = x if k % 2 == 0 else RASTER_LINE_MM - x
        z = 3.0 * np.sin(along / 20.0) * np.cos(k * RASTER_PITCH_MM / 30.0) - 3.0
        lines += [f"X{a:.3f} Z{b:.3f}" for a, b in zip(along.tolist(), z.tolist(), strict=True)]
        lines.append(f"Y{(k + 1) * RASTER_PITCH_MM:.3f}")
    return "\n".join([*lines, "G0 Z50", "M5", "M30", ""]).encode("ascii")


if __name__ == "__main__":
    raise SystemExit(main())
