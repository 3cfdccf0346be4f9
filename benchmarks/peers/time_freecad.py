"""Remove the material of a raster with FreeCAD's path simulator; print processor seconds and moves.

/usr/bin/python3 time_freecad.py part.nc 16 flat 0.1    (diameter in mm, flat or ball, cells in mm)

The Python is that of the system, whose packages FreeCAD's are. It cuts a block that is as large as the moves
and the cutter; only the moves are timed, not the block or the shape of the cutter.
"""

import pathlib  # a Path of its own would give way to the module Path of FreeCAD
import re
import sys
import time

sys.path[:0] = ["/usr/lib/freecad-python3/lib", "/usr/lib/freecad/lib"]

import FreeCAD  # noqa: E402
import Part  # noqa: E402
import PathSimulator  # noqa: E402
from Path import Command  # noqa: E402


def moves(path: pathlib.Path) -> list[tuple[float, float, float]]:
    """Return the ends of the feed moves, in mm."""
    place, found = {"X": 0.0, "Y": 0.0, "Z": 0.0}, []
    for line in path.read_text(encoding="ascii").splitlines():
        words = re.findall(r"([XYZ])(-?[\d.]+)", line) if line[:1] in "XYG" else []
        place.update((letter, float(number)) for letter, number in words)
        if words and not line.startswith("G0"):
            found.append((place["X"], place["Y"], place["Z"]))
    return found


def cutter(diameter_mm: float, kind: str, length_mm: float) -> "Part.Shape":
    """Return the cutter with its tip at the origin."""
    radius = diameter_mm / 2.0
    if kind == "flat":
        return Part.makeCylinder(radius, length_mm)
    middle = FreeCAD.Vector(0, 0, radius)
    return Part.makeSphere(radius, middle).fuse(Part.makeCylinder(radius, length_mm, middle))


def main() -> None:
    ends = moves(pathlib.Path(sys.argv[1]))
    diameter_mm, kind, cell_mm = float(sys.argv[2]), sys.argv[3], float(sys.argv[4])
    low, high = ([choose(axis) for axis in zip(*ends, strict=True)] for choose in (min, max))
    block = Part.makeBox(
        *(high[axis] - low[axis] + diameter_mm for axis in (0, 1)),
        high[2] - low[2] + 1.0,
        FreeCAD.Vector(low[0] - diameter_mm / 2.0, low[1] - diameter_mm / 2.0, low[2] - 1.0),
    )
    simulator = PathSimulator.PathSim()
    simulator.BeginSimulation(block, cell_mm)
    simulator.SetToolShape(cutter(diameter_mm, kind, high[2] - low[2] + diameter_mm), cell_mm)
    place = FreeCAD.Placement(FreeCAD.Vector(*ends[0]), FreeCAD.Rotation())
    commands = [Command("G1", {"X": x, "Y": y, "Z": z}) for x, y, z in ends[1:]]
    start = time.process_time()
    for command in commands:
        place = simulator.ApplyCommand(place, command)
    print(time.process_time() - start, len(commands))


if __name__ == "__main__":
    main()
