"""The triangles of the meshes that a cell names: for distances, and to be drawn."""

from functools import lru_cache
from pathlib import Path

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.compiled.inputs import locked
from gcode2krl.cutting.raw_part import load_mesh
from gcode2krl.errors import Gcode2KrlError


def triangles_of(file: str) -> Floats:
    """Return the triangles (t, 3, 3) of a mesh file; as it is asked for several times, the last are kept."""
    try:
        state = Path(file).stat()
    except OSError:
        return _read(file, 0, 0)  # which says what is wrong
    return _read(file, state.st_mtime_ns, state.st_size)


def obstacle_meshes(cell: Cell) -> dict[str, Floats]:
    """Return the triangles (t, 3, 3) of obstacles by name, in their frames, of files that can be read."""
    meshes = {}
    for obstacle in cell.obstacle:
        if obstacle.mesh is not None:
            try:
                meshes[obstacle.name] = triangles_of(obstacle.mesh)
            except Gcode2KrlError:
                continue
    return meshes


@lru_cache(maxsize=8)
def _read(file: str, changed_ns: int, size: int) -> Floats:
    return locked(np.asarray(load_mesh(Path(file), "obstacle").triangles, dtype=np.float64))
