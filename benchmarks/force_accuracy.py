"""What the default resolution costs in force, against the finest: D/160, every sample, 32 bands of a bottom.

Seven programs, each with the tool it is meant for, in a stated block. Printed for each: by how much the force
differs at the same times, RMS over the samples that cut as a share of their RMS force; the bias of the mean
size; the largest force against the finest's; the share of samples where only one of both cuts.

    python benchmarks/force_accuracy.py
    python benchmarks/force_accuracy.py --programs ball,drill
"""

import argparse
import io
import math
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple
from unittest import mock

import numpy as np

from gcode2krl.cell import Cell, resolve_cell
from gcode2krl.cutting import engagement
from gcode2krl.cutting.milling import remove
from gcode2krl.gcode import read_stream
from gcode2krl.pipeline import plan_motion, set_targets
from gcode2krl.tables import Forces, Motion, Toolpath

HEAD = "G21 G90 G17 G40 G49 G80 G94\nT1 M6\nS13000 M3\nG0 Z20\n"
FINEST, FINEST_BANDS = 160.0, 32
"""Cells in a diameter, bands of a flat bottom."""


class Program(NamedTuple):
    """A program, its tool and the block that it cuts."""

    text: str
    tool: dict[str, Any]
    box_mm: list[list[float]]


def flat(diameter_mm: float = 16.0) -> dict[str, Any]:
    return {"kind": "flat", "diameter_mm": diameter_mm, "teeth": 3, "centre_cutting": True}


def rows(
    stepover_mm: float, step_mm: float, surface: Callable[[float, float], float], size_mm: float = 60.0
) -> Iterator[str]:
    """Yield the lines of a raster over a square, back and forth, with a height at each point."""
    x_mm = np.arange(0.0, size_mm + step_mm / 2, step_mm)
    for number, y in enumerate(np.arange(0.0, size_mm / 2, stepover_mm)):
        for x in x_mm if number % 2 == 0 else x_mm[::-1]:
            yield f"X{x:.3f} Y{y:.3f} Z{surface(x, y):.3f}"


def raster() -> Program:
    lines = "\n".join(rows(4.0, 0.6, lambda _x, _y: -2.0))
    return Program(f"G0 X-12 Y0\nG1 Z-2 F400\nF1500\n{lines}", flat(), [[0, -8, -20], [60, 40, 0]])


def pocket() -> Program:
    """Squares with rounded corners from the inside out, after a ramp."""
    lines = ["G0 X30 Y30", "G1 Z0.5 F900", "G1 X40 Z-1.5 F600", "X30 Z-3", "F1500"]
    for half in (6.0, 11.0, 16.0, 21.0):
        low, high, r = 30 - half, 30 + half, 4.0
        lines += [f"G1 X{30:g} Y{low:g}", f"G1 X{high - r:g}", f"G3 X{high:g} Y{low + r:g} J{r:g}"]
        lines += [f"G1 Y{high - r:g}", f"G3 X{high - r:g} Y{high:g} I-{r:g}", f"G1 X{low + r:g}"]
        lines += [
            f"G3 X{low:g} Y{high - r:g} J-{r:g}",
            f"G1 Y{low + r:g}",
            f"G3 X{low + r:g} Y{low:g} I{r:g}",
        ]
        lines += ["G1 X30"]
    return Program("\n".join(lines), flat(10.0), [[-5, -5, -20], [65, 65, 0]])


def ramp() -> Program:
    lines = (
        "G0 X5 Y10\nG1 Z0.5 F900\nG1 X50 Z-3 F1500\nX5 Z-4\nX50\nX58 Z2\nG0 Y22\nX5\nG1 Z0.5\nX50 Z-4\nX5 Z-1"
    )
    return Program(lines, flat(), [[0, -8, -20], [60, 40, 0]])


def drill() -> Program:
    holes = ((10, 10), (30, 10), (30.37, 25.21))
    lines = "\n".join(f"G0 X{x} Y{y}\nZ2\nG1 Z-6 F300\nG0 Z2\nG1 Z-14\nG0 Z20" for x, y in holes)
    tool = {"kind": "drill", "diameter_mm": 8, "teeth": 2, "point_deg": 118}
    return Program(lines, tool, [[0, 0, -20], [40, 40, 0]])


def bull_nose() -> Program:
    lines = "\n".join(rows(5.0, 0.6, lambda x, y: -2.0 - 0.03 * x + 0.02 * y))
    tool = {"kind": "bull-nose", "diameter_mm": 16, "corner_radius_mm": 2, "teeth": 3}
    return Program(f"G0 X-12 Y0\nG1 Z-2 F400\nF1500\n{lines}", tool, [[0, -8, -20], [60, 40, 0]])


def wave(x: float, y: float) -> float:
    return -3.0 + 2.0 * math.sin(math.tau * x / 40) + math.sin(math.tau * y / 30)


def thin() -> Program:
    """Rows so close that a flat cutter meets thin slivers beside it and below its bottom."""
    lines = "\n".join(rows(0.8, 0.6, wave))
    return Program(f"G0 X-12 Y0\nG1 Z-3 F400\nF3000\n{lines}", flat(), [[0, -8, -20], [60, 40, 0]])


def ball() -> Program:
    lines = "\n".join(rows(0.8, 0.6, wave))
    tool = {"kind": "ball", "diameter_mm": 16, "teeth": 2}
    return Program(f"G0 X-12 Y0\nG1 Z-3 F400\nF3000\n{lines}", tool, [[0, -8, -20], [60, 40, 0]])


PROGRAMS = {each.__name__: each for each in (raster, pocket, ramp, drill, bull_nose, ball, thin)}


def cell_of(program: Program, cell_mm: float | None) -> Cell:
    """Return the demonstration cell with the program's tool and block; None: default cells."""
    tool = {"length_mm": 100.0, "flute_length_mm": 40.0, **program.tool}
    stock: dict[str, Any] = {"box_mm": program.box_mm}
    if cell_mm is not None:
        stock["resolution_mm"] = cell_mm
    return resolve_cell({"based_on": "demonstration", "tool": {"1": tool}, "stock": stock})


def planned(program: Program) -> tuple[Toolpath, Motion]:
    cell = cell_of(program, None)
    text = HEAD + program.text + "\nG0 Z20\nM30\n"
    toolpath = read_stream(io.BytesIO(text.encode()), "program", cell)
    return toolpath, plan_motion(set_targets(toolpath, cell), cell)


def timed(toolpath: Toolpath, motion: Motion, cell: Cell, **options: Any) -> tuple[Forces, float]:
    start = time.process_time()
    return remove(toolpath, motion, cell, **options).forces, time.process_time() - start


def compared(name: str) -> str:
    """Return a line of the table."""
    program = PROGRAMS[name]()
    toolpath, motion = planned(program)
    with mock.patch.object(engagement, "_BOTTOM_BANDS", FINEST_BANDS):
        finest, finest_s = timed(
            toolpath, motion, cell_of(program, program.tool["diameter_mm"] / FINEST), **EVERY
        )
    usual, usual_s = timed(toolpath, motion, cell_of(program, None))
    a, b = (np.linalg.norm(each.force_base_N, axis=1) for each in (finest, usual))
    cuts = (a > 0.0) | (b > 0.0)
    apart = np.linalg.norm(finest.force_base_N - usual.force_base_N, axis=1)[cuts]
    rms = math.sqrt(np.mean(apart**2) / np.mean(a[cuts] ** 2))
    bias = b[cuts].mean() / a[cuts].mean() - 1.0
    largest, peak = b.max() / a.max() - 1.0, usual.peak_N.max() / finest.peak_N.max() - 1.0
    alone = np.mean((a > 0.0) != (b > 0.0))
    return (
        f"  {name:<10}{len(motion):>8}{rms:9.2%}{bias:+9.2%}{largest:+9.2%}{peak:+9.2%}{alone:9.2%}"
        f"{usual_s / finest_s:8.2f}"
    )


EVERY = {"nodes_per_diameter": math.inf}
"""Options of `remove` with which every sample is read."""


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--programs", default=",".join(PROGRAMS), help="default: all")
    names = parser.parse_args().programs.split(",")
    print(
        f"  {'program':<10}{'samples':>8}{'RMS':>9}{'bias':>9}{'largest':>9}{'peak':>9}{'one':>9}{'time':>8}"
    )
    for name in names:
        print(compared(name), flush=True)


if __name__ == "__main__":
    main()
