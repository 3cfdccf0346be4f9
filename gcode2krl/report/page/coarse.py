"""A mesh with few triangles, to be looked at: what lies in one cell of a grid becomes one corner.

Not for distances: a corner moves by up to the diagonal of a cell.
"""

import numpy as np

from gcode2krl.arrays import Floats

MOST_TRIANGLES = 4000
"""Triangles that a page draws of one mesh, some 30 kB."""
_FINEST = 256
"""Cells along the longest side of the finest grid."""
_COARSER = 0.8


def drawn_mesh(triangles_mm: Floats, most: int = MOST_TRIANGLES) -> Floats:
    """Return triangles (t, 3, 3) of a mesh (n, 3, 3), at most so many; all of them where they are few."""
    cells = float(_FINEST)
    drawn = triangles_mm
    while len(drawn) > most and cells >= 2.0:
        drawn = _clustered(triangles_mm, cells)
        cells *= _COARSER
    return drawn


def _clustered(triangles_mm: Floats, cells: float) -> Floats:
    """Return the triangles whose corners are in three cells of a grid with so many along its longest side."""
    corners = triangles_mm.reshape(-1, 3)
    low = corners.min(axis=0)
    side_mm = max(float(np.ptp(corners, axis=0).max()), 1e-9) / cells
    place = np.floor((corners - low) / side_mm).astype(np.int64)
    number = (place[:, 0] * (_FINEST + 1) + place[:, 1]) * (_FINEST + 1) + place[:, 2]
    _, own, count = np.unique(number, return_inverse=True, return_counts=True)
    middle = np.stack([np.bincount(own, corners[:, k]) / count for k in range(3)], axis=1)
    faces = own.reshape(-1, 3)
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    drawn: Floats = middle[faces[np.sort(first)]]
    return drawn
