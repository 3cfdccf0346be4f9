"""Zigzag finishing rasters over a wavy surface; `make_examples.py` writes them.

The blocks are made one by one, so a program of ten million lines needs no memory.
"""

import math
import random
from collections.abc import Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class Raster:
    """Zigzag along x; rows beyond `rows_per_layer` go back over the area, a layer deeper."""

    rows: int
    row_mm: float
    stepover_mm: float
    x_mm: float
    y_mm: float
    rows_per_layer: int = 3000
    layer_mm: float = 0.3
    shortest_mm: float = 0.25
    mean_mm: float = 0.6


def wave_z_mm(x: float, y: float) -> float:
    """Height of the tool tip: -7.5..-0.5 mm, slope along x below 0.29."""
    long_wave = 2 * math.sin(math.tau * x / 80) + math.sin(math.tau * y / 60)
    return -4 + long_wave + 0.5 * math.sin(math.tau * x / 25 + y / 20)


def row_steps_mm(raster: Raster, chance: random.Random) -> list[float]:
    """Steps along x, 0.25..0.95 mm, which add up to the row: pairs with a fixed sum, then the rest."""
    pair_mm = 2 * raster.mean_mm
    pairs = int(raster.row_mm / pair_mm + 1e-9)
    width_mm = pair_mm - 2 * raster.shortest_mm
    steps = [raster.shortest_mm + width_mm * chance.random() for _ in range(pairs)]
    rest = raster.row_mm - pairs * pair_mm
    return steps + [pair_mm - step for step in steps] + ([rest] if rest > 1e-6 else [])


def raster_feed(slope: float) -> int:
    """Full feed where it is flat, slower uphill, slowest downhill."""
    return 6000 if abs(slope) < 0.1 else 4500 if slope > 0 else 3000


def raster_rows(raster: Raster) -> Iterator[str]:
    """The blocks of the rows, G1 throughout."""
    chance = random.Random(2020)
    last_feed = 0
    for row in range(raster.rows):
        layer, at = divmod(row, raster.rows_per_layer)
        y = raster.y_mm + raster.stepover_mm * (raster.rows_per_layer - 1 - at if layer % 2 else at)
        x, direction = (raster.x_mm + raster.row_mm, -1) if row % 2 else (raster.x_mm, 1)
        z = wave_z_mm(x, y) - layer * raster.layer_mm
        yield f"Y{y:z.3f} Z{z:.3f}" if row else f"G1 Z{z:.3f} F3000"
        for step in row_steps_mm(raster, chance):
            x += direction * step
            z, below = wave_z_mm(x, y) - layer * raster.layer_mm, z
            feed = raster_feed((z - below) / step)
            yield f"X{x:z.3f} Z{z:.3f}" + (f" F{feed}" if feed != last_feed else "")
            last_feed = feed


def raster_program(raster: Raster) -> Iterator[str]:
    """The whole program; it begins and ends in air, 5 mm beside the blank."""
    x_from, x_to = raster.x_mm + 5, raster.x_mm + raster.row_mm - 5
    y_to = raster.y_mm + raster.stepover_mm * (min(raster.rows, raster.rows_per_layer) - 1)
    yield from (
        "%",
        "(RASTER FINISH OF A WAVY SURFACE, ZIGZAG ALONG X)",
        f"(STOCK: BLOCK X{x_from:.0f}..{x_to:.0f} Y{raster.y_mm:.2f}..{y_to:.2f} Z-30..0, ALUMINIUM)",
        "(ROUGHED TO 0.3 MM OVER THE SURFACE)",
        f"(T13 BALL NOSE D8, STEPOVER {raster.stepover_mm:.2f} MM, {raster.rows} ROWS)",
        *("G21 G90 G17 G40 G49 G80 G94", "G54", "G64 P0.02"),
        *("T13 M6", "S13000 M3", "M8", "G0 G43 H13 Z20.000"),
        *(f"G0 X{raster.x_mm:.3f} Y{raster.y_mm:.3f}", "G0 Z2.000"),
    )
    yield from raster_rows(raster)
    yield from ("G0 Z20.000", "M9", "M5", "M30", "%")


def raster_finish() -> Iterator[str]:
    """The raster of the repository: 150 mm x 23 mm."""
    return raster_program(Raster(rows=47, row_mm=150.0, stepover_mm=0.5, x_mm=0.0, y_mm=0.0))


def long_raster(lines: int) -> Iterator[str]:
    """Rows of 400 mm, 0.25 mm apart, in all about `lines` lines."""
    rows = max(1, round(lines / 668))  # 667 steps and the link to the next row
    return raster_program(Raster(rows=rows, row_mm=400.0, stepover_mm=0.25, x_mm=-50.0, y_mm=-375.0))
