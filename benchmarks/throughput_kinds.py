"""Programs of other kinds than a raster, for benchmarks/throughput.py: arcs, parameters, five axes."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

BLOCKS_OF_A_TURN = 5
"""Blocks that the loop of `macro_lines` runs in a turn, its while and endwhile not counted."""


class Kind(NamedTuple):
    """A program of a kind."""

    name: str
    part: Path
    cell: str
    """Cell that reading it takes, '' = none."""
    is_plain: bool
    """It has no parameters, so that parsers of words can be compared."""


def write_kinds(folder: Path, lines: int, five_axes: Path) -> tuple[Kind, ...]:
    """Write the programs; ``five_axes`` is a raster with rotary words of so many lines."""
    arcs, macro = folder / f"arcs_{lines}.nc", folder / f"macro_{lines}.ngc"
    for part, made in ((arcs, arc_lines(lines)), (macro, macro_lines(lines))):
        with part.open("w", encoding="ascii", newline="\n") as file:
            file.writelines(f"{line}\n" for line in made)
    return (
        Kind(f"{lines:,} lines with arcs and modal words", arcs, "", is_plain=True),
        Kind(f"{lines:,} executed blocks of a loop with expressions", macro, "", is_plain=False),
        Kind(f"{lines:,} lines with A and C in every block", five_axes, "five_axes.toml", is_plain=True),
    )


def arc_lines(lines: int) -> Iterator[str]:
    """Yield straight moves, arcs by centre and by radius, helices, modes, numbers and comments."""
    yield from ("G21 G90 G17 G94 F900", "G0 X0 Y0 Z5", "G1 Z-1")
    x, number = 0.0, 3
    while number < lines - 1:
        at = number % 12
        if at in (0, 4):
            yield (
                f"N{number} G3 X{x + 2:.3f} Y1. I1. J0. F{900 + at}"
                if at
                else f"N{number} G1 X{x:.3f} Y1. F1200."
            )
            x += 2.0 if at else 0.0
        elif at in (1, 2):
            x += 1.0
            yield f"X{x:.3f} Y{1 if at == 2 else 2}."
        elif at == 3:
            yield f"G0 X{x:.3f} Y1."
        elif at == 5:
            x += 3.0
            yield f"G2 X{x:.3f} Y1. R1.6"
        elif at == 6:
            yield "G91 G1 Z-0.01"
        elif at == 7:
            yield "G90"
        elif at == 8:
            yield f"G3 X{x:.3f} Y1. Z{-1 - 0.001 * (number % 900):.3f} I-2. J0."
        elif at == 9:
            yield f"(PASS {number})"
        elif at == 10:
            yield f"G18 G1 X{x:.3f} Z-1. F{800 + number % 7}"
        else:
            yield "G17 M8"
        x = math.fmod(x, 500.0) if at == 11 else x
        number += 1
    yield "M2"


def macro_lines(blocks: int) -> Iterator[str]:
    """Yield a program whose loop runs so many blocks."""
    turns = blocks // BLOCKS_OF_A_TURN
    yield from ("G21 G90 G17 G94 F900", "G0 X0 Y0 Z5", "#1 = 0 #<radius> = 40", f"O100 while [#1 LT {turns}]")
    yield from (
        "#2 = [#1 * 0.37]",
        "G1 X[#<radius> * COS[#2]] Y[#<radius> * SIN[#2]] F[800 + #1 MOD 7]",
        "#3 = [ROUND[#2] / 1000 + 0.5]",
        "Z-#3",
        "#1 = [#1 + 1]",
        "O100 endwhile",
        "M2",
    )
