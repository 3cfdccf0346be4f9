"""The finished part against the nominal one: gouges and rest as solids with volume, depth and place.

Both are compared as seen from the tool, as heights over the cells in which material was removed; an undercut
of the nominal part counts as solid. A wall lies within a cell of where it is: a cell is a gouge for sure only
if it is lower than all nominal cells beside it, and rest only if it is higher than all of them, by
`TOLERANCE_MM`; then its neighbours are judged by themselves.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.cutting.height_field import HeightField
from gcode2krl.cutting.milling import Removal
from gcode2krl.cutting.raw_part import raise_to, to_mesh
from gcode2krl.cutting.solids import mesh_of, solid_of
from gcode2krl.tables import Motion

if TYPE_CHECKING:
    import manifold3d
    import trimesh

TOLERANCE_MM = 0.1
"""Assumed: what a finishing cut leaves. The height field itself is exact to its cells and some 0.01 mm."""
MOST_SOLIDS = 20
"""Largest differences of each kind that are made into solids."""
FEWEST_CELLS = 4
"""Of a difference; fewer are none."""
_SOLID_CELLS = 40_000
_BELOW_MM = 1.0
_FLAT_MM = 0.01
NEARLY = 0.98
"""Of the cells that are as deep as this share of the deepest, the middle one is the place."""

Kind = Literal["gouge", "rest"]


@dataclass(frozen=True, eq=False)
class Difference:
    """Material that is missing (gouge) or too much (rest)."""

    kind: Kind
    volume_mm3: float
    depth_mm: float
    """Largest, along the tool."""
    place_mm: Floats
    """(3,) where it is deepest, on the finished part, in ``$BASE``."""
    row: int
    """Sample of the motion whose tool tip is nearest to the place."""
    solid: "trimesh.Trimesh"
    """In ``$BASE``."""


@dataclass(frozen=True)
class Comparison:
    """All differences of a finished part, gouges first, the largest first."""

    differences: tuple[Difference, ...]
    left_out: dict[Kind, int]
    """Number of smaller ones that are not made into solids."""
    volume_mm3: dict[Kind, float]
    """Of all, also of those left out."""
    above_mm: Floats
    """(r, c) by how much the cells of the finished part are above the nominal one, below 0 in gouges; 0 where
    they do not differ for sure. Where the tool axis turns (n,), of the places ``at_mm``."""
    at_mm: Floats | None = None
    """(n, 3) places on the finished surface that differ, in ``$BASE``; None: all cells."""


def compare(removal: Removal, motion: Motion, nominal: "trimesh.Trimesh") -> Comparison:
    """Return how the part that is left differs from a closed mesh of the nominal part in ``$BASE``.

    Raises `MeshError` where the mesh encloses no solid.
    """
    turn = np.eye(4)
    turn[:3, :3] = removal.to_field
    wanted = mesh_of(solid_of(nominal)).apply_transform(turn)
    part = removal.material
    assert isinstance(part, HeightField), "of dexels see nominal_turned"
    have, want = _heights(part, wanted)
    differences: list[Difference] = []
    left_out: dict[Kind, int] = {}
    volume_mm3: dict[Kind, float] = {}
    kinds: tuple[tuple[Kind, Floats], ...] = (
        ("gouge", _sure(_highest(want, -1) - have, want - have)),
        ("rest", _sure(have - _highest(want), have - want)),
    )
    for kind, depth_mm in kinds:
        judged = want + (depth_mm if kind == "rest" else -depth_mm)
        places, volumes = _places(depth_mm > 0.0, depth_mm * part.cell_mm.prod())
        volume_mm3[kind], left_out[kind] = float(sum(volumes)), max(len(places) - MOST_SOLIDS, 0)
        for number in np.argsort(-np.array(volumes), kind="stable")[:MOST_SOLIDS]:
            rows, columns, mask = places[number]
            cut = _part_of(part, rows, columns)
            pair = judged[rows, columns], want[rows, columns]
            differences.append(_difference(kind, volumes[number], cut, mask, *pair, removal, motion))
    above_mm = kinds[1][1] - kinds[0][1]
    return Comparison(tuple(differences), left_out, volume_mm3, above_mm)


def _heights(part: HeightField, nominal: "trimesh.Trimesh") -> tuple[Floats, Floats]:
    """Return the heights (r, c) of the finished and of the nominal part, from the field's bottom upwards."""
    want = np.full(part.height_mm.shape, -np.inf)
    triangles = np.ascontiguousarray(nominal.triangles, dtype=np.float64)
    raise_to(triangles, part.origin_mm, part.cell_mm, want)
    have = part.height_mm.astype(np.float64)
    return np.maximum(have, part.bottom_mm), np.maximum(want, part.bottom_mm)


def _highest(height: Floats, sign: int = 1) -> Floats:
    """Return the highest (sign 1) or the lowest (-1) of each cell and its eight neighbours."""
    from scipy.ndimage import maximum_filter

    dilated: Floats = sign * maximum_filter(sign * height, size=3, mode="nearest")
    return dilated


def _sure(least_mm: Floats, difference_mm: Floats) -> Floats:
    """Return the depth of cells that differ for sure and of those beside them that differ too; 0 elsewhere.

    ``least_mm`` is the difference to the nearest of the nominal heights in and beside a cell, which is sure.
    A cell at the edge may be half a wall; it is no deeper than the deepest sure cell in and beside it.
    """
    sure_mm = np.where(least_mm > TOLERANCE_MM, least_mm, 0.0)
    depth_mm = np.minimum(difference_mm, _highest(sure_mm))
    return np.where(depth_mm > TOLERANCE_MM, depth_mm, 0.0)


def _places(cells: Bools, volume_mm3: Floats) -> tuple[list[tuple[slice, slice, Bools]], list[float]]:
    """Return rows, columns and mask of each group of cells that touch, and their volumes."""
    from scipy.ndimage import find_objects, label

    number, count = label(cells, structure=np.ones((3, 3)))
    sizes = np.bincount(number.ravel(), minlength=count + 1)
    sums = np.bincount(number.ravel(), weights=volume_mm3.ravel(), minlength=count + 1)
    places, volumes = [], []
    for piece, box in enumerate(find_objects(number), start=1):
        if sizes[piece] >= FEWEST_CELLS:
            places.append((box[0], box[1], number[box] == piece))
            volumes.append(float(sums[piece]))
    return places, volumes


def _part_of(part: HeightField, rows: slice, columns: slice) -> HeightField:
    """Return the rectangle of a field."""
    origin = part.origin_mm + part.cell_mm * [columns.start, rows.start]
    return HeightField(part.height_mm[rows, columns], origin, part.cell_mm, part.bottom_mm)


def _difference(
    kind: Kind,
    volume_mm3: float,
    part: HeightField,
    mask: Bools,
    have: Floats,
    want: Floats,
    removal: Removal,
    motion: Motion,
) -> Difference:
    """Return one difference; heights and mask (r, c) are those of the cells of ``part``."""
    depth = np.where(mask, np.abs(have - want), -1.0)
    deepest = np.argwhere(depth >= NEARLY * depth.max())
    row, column = deepest[np.argmin(np.abs(deepest - deepest.mean(axis=0)).sum(axis=1))]
    middle = part.origin_mm + part.cell_mm * [column + 0.5, row + 0.5]
    place = np.array([*middle, part.height_mm[row, column]]) @ removal.to_field
    nearest = int(np.argmin(np.linalg.norm(motion.position_mm - place, axis=1)))
    above, under = (
        np.where(mask, heights, -np.inf) for heights in (np.maximum(have, want), np.minimum(have, want))
    )
    solid = solid_in_base([shell(part.origin_mm, part.cell_mm, above, under, removal.to_field)])
    return Difference(kind, volume_mm3, float(depth.max()), place, nearest, solid)


def shell(
    origin_mm: Floats, cell_mm: Floats, above_mm: Floats, under_mm: Floats, to_field: Floats
) -> "manifold3d.Manifold":
    """Return what lies between heights (r, c), -inf where nothing does, turned back into ``$BASE``."""
    bottom_mm = float(under_mm[np.isfinite(under_mm)].min()) - _BELOW_MM
    above, under = (np.pad(heights, 1, constant_values=-np.inf) for heights in (above_mm, under_mm))
    around = np.where(np.isinf(under), _highest(under), under)
    upper = solid_of(_columns(origin_mm, cell_mm, above, bottom_mm))
    lower = solid_of(_columns(origin_mm, cell_mm, around, bottom_mm - _BELOW_MM))  # no faces in one plane
    back = np.column_stack([to_field.T, np.zeros(3)])
    return (upper - lower).simplify(_FLAT_MM).transform(back)


def solid_in_base(shells: "list[manifold3d.Manifold]") -> "trimesh.Trimesh":
    """Return shells as one solid."""
    import manifold3d

    return mesh_of(manifold3d.Manifold.batch_boolean(shells, manifold3d.OpType.Add))


def _columns(origin_mm: Floats, cell_mm: Floats, height_mm: Floats, bottom_mm: float) -> "trimesh.Trimesh":
    """Return heights over some cells and a cell around them as a closed mesh, with an empty cell around both.

    A wall runs from the middle of the last cell to that of the next; below it, the lower of two meshes must
    reach a cell further.
    """
    heights = np.pad(height_mm, 1, constant_values=-np.inf).astype(np.float32)
    around = HeightField(heights, origin_mm - 2.0 * cell_mm, cell_mm, bottom_mm)
    return to_mesh(around, _SOLID_CELLS)
