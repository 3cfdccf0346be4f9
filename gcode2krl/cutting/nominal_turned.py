"""The finished part against the nominal one where the tool axis turned: stretch by stretch of the rays.

A stretch of a ray that only one of both has is gouge or rest. Its depth is the largest distance, in space,
of its ends and its middle from the nominal surface. Ends of stretches are on the finished surface, exact to
2 % of a cell, so that walls and undercuts are judged like floors.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.cell import Cell
from gcode2krl.compiled.core import FLOATS, OUT_INTS, core_function
from gcode2krl.cutting.dexels import Dexels, crossings
from gcode2krl.cutting.nominal import (
    FEWEST_CELLS,
    MOST_SOLIDS,
    NEARLY,
    TOLERANCE_MM,
    Comparison,
    Difference,
    Kind,
    shell,
    solid_in_base,
)
from gcode2krl.cutting.outlook import outlook_of
from gcode2krl.cutting.records import taken
from gcode2krl.cutting.solids import mesh_of, solid_of
from gcode2krl.cutting.surface import path_points
from gcode2krl.cutting.turned import TURNED, body_of
from gcode2krl.tables import Motion, lengths

if TYPE_CHECKING:
    import manifold3d
    import trimesh

_nearest_poses = core_function("cutting_nearest_poses", TURNED, FLOATS, OUT_INTS)
_TOGETHER_CELLS = 2.0
"""Side of the cubes of cells whose stretches are one place where they touch."""
_ALONG = 1.0 / 3.0
"""Least squared cosine between a ray and the way to the nominal surface at which a solid is drawn of it: for
every way one of the three axes has that."""


class _Stretches(NamedTuple):
    """What only one of both parts has (n)."""

    axis: Ints
    """(n,) of the ray, and its cell along the next two axes."""
    column: Ints
    row: Ints
    span_mm: Floats
    """(n, 2) where it begins and ends on the ray."""
    is_gouge: Bools
    place_mm: Floats
    """(n, 3, 3) both ends and the middle."""
    is_cut: Bools
    """(n, 2) which ends are on the finished surface."""
    depth_mm: Floats
    """(n, 3) distance from the nominal surface of the ends that are cut and of the middle, else 0."""
    toward: Floats
    """(n, 3) unit vector from the nominal surface to the deepest of them."""


def compare_turned(
    dexels: Dexels,
    motion: Motion,
    cell: Cell,
    nominal: "trimesh.Trimesh",
    nearest_on: "Callable[[trimesh.Trimesh, Floats], Floats]",
) -> Comparison:
    """Return how what a motion left of the stock differs from a closed mesh of the nominal part in ``$BASE``.

    ``nearest_on`` gives the places (n, 3) on a mesh that are nearest to places (n, 3). Raises `MeshError`
    where the mesh encloses no solid.
    """
    wanted = mesh_of(solid_of(nominal))
    stretches = _deep(_stretches(dexels, wanted), lambda places_mm: nearest_on(wanted, places_mm))
    differences: list[Difference] = []
    left_out: dict[Kind, int] = {}
    volume_mm3: dict[Kind, float] = {}
    kinds: tuple[Kind, ...] = ("gouge", "rest")
    for kind in kinds:
        of_kind = taken(stretches, np.flatnonzero(stretches.is_gouge == (kind == "gouge")))
        groups = _groups(of_kind, dexels)
        volumes = [_volume_mm3(group, dexels.cell_mm) for group in groups]
        volume_mm3[kind], left_out[kind] = float(sum(volumes)), max(len(groups) - MOST_SOLIDS, 0)
        for number in np.argsort(-np.array(volumes), kind="stable")[:MOST_SOLIDS]:
            group, deepest = groups[number], _deepest(groups[number])
            solid = solid_in_base(list(_shells(group, dexels)))
            depth_mm = float(group.depth_mm.max())
            differences.append(Difference(kind, volumes[number], depth_mm, deepest, -1, solid))
    rows = _nearest_samples(np.array([one.place_mm for one in differences]).reshape(-1, 3), motion, cell)
    stretch, end = np.nonzero(stretches.is_cut & (stretches.depth_mm[:, :2] > TOLERANCE_MM))
    sign = np.where(stretches.is_gouge[stretch], -1.0, 1.0)
    return Comparison(
        tuple(replace(one, row=row) for one, row in zip(differences, rows, strict=True)),
        left_out,
        volume_mm3,
        sign * stretches.depth_mm[stretch, end],
        stretches.place_mm[stretch, end],
    )


def _stretches(dexels: Dexels, wanted: "trimesh.Trimesh") -> _Stretches:
    """Return the stretches longer than `TOLERANCE_MM`; depths are not known yet."""
    ray_have, ends_mm = dexels.stretches()
    ray_want, at_want, _ = crossings(wanted, dexels.low_mm, dexels.cell_mm, dexels.cells)
    step_want = 1 - 2 * _parity(ray_want)
    ray = np.concatenate([np.repeat(ray_have, 2), ray_want])
    at = np.concatenate([ends_mm.ravel(), at_want])
    none_have, none_want = np.zeros(len(ray_want), np.int64), np.zeros(2 * len(ray_have), np.int64)
    steps = (
        np.concatenate([np.tile([1, -1], len(ray_have)), none_have]),
        np.concatenate([none_want, step_want]),
    )
    order = np.lexsort((at, ray))
    ray, at = ray[order], at[order]
    has, wants = (np.cumsum(step[order]) > 0 for step in steps)
    is_cut = steps[0][order] != 0
    k = np.flatnonzero((ray[1:] == ray[:-1]) & (has != wants)[:-1] & (np.diff(at) > TOLERANCE_MM))
    axis, row, column = dexels.places(ray[k])
    span_mm = np.stack([at[k], at[k + 1]], axis=1)
    place_mm, every = np.empty((len(k), 3, 3)), np.arange(len(k))
    place_mm[every, :, axis] = np.column_stack([span_mm, span_mm.mean(axis=1)])
    for cell, side in ((column, (axis + 1) % 3), (row, (axis + 2) % 3)):
        middle_mm = dexels.low_mm[side] + (cell + 0.5) * dexels.cell_mm[side]
        place_mm[every, :, side] = middle_mm[:, None]
    cut = np.stack([is_cut[k], is_cut[k + 1]], axis=1)
    unknown = np.zeros((len(k), 3))
    return _Stretches(axis, column, row, span_mm, wants[k], place_mm, cut, unknown, unknown)


def _parity(ray: Ints) -> Ints:
    """Return which of the places on each ray (c,), rising, is the second, fourth, …: 1, else 0."""
    begins = np.append(True, ray[1:] != ray[:-1])[: len(ray)]
    place = np.arange(len(ray))
    return (place - np.maximum.accumulate(np.where(begins, place, 0))) % 2


def _deep(stretches: _Stretches, nearest: Callable[[Floats], Floats]) -> _Stretches:
    """Return the stretches that are deeper than `TOLERANCE_MM`, with their depths."""
    is_asked = np.column_stack([stretches.is_cut, np.ones(len(stretches.axis), np.bool_)])
    away_mm = np.zeros_like(stretches.place_mm)
    asked_mm = stretches.place_mm[is_asked]
    away_mm[is_asked] = asked_mm - nearest(asked_mm)
    depth_mm = np.sqrt((away_mm**2).sum(axis=2))
    every, deepest = np.arange(len(depth_mm)), depth_mm.argmax(axis=1)
    most_mm = depth_mm[every, deepest]
    toward = away_mm[every, deepest] / np.maximum(most_mm, 1e-12)[:, None]
    deep = np.flatnonzero(most_mm > TOLERANCE_MM)
    return taken(stretches._replace(depth_mm=depth_mm, toward=toward), deep)


def _groups(stretches: _Stretches, dexels: Dexels) -> list[_Stretches]:
    """Return the stretches of each place: those whose deep ends and middles touch, or are of one stretch."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    size_mm = _TOGETHER_CELLS * float(dexels.cell_mm.max())
    stretch, which = np.nonzero(stretches.depth_mm > TOLERANCE_MM)
    cube = np.floor((stretches.place_mm[stretch, which] - dexels.low_mm) / size_mm).astype(np.int64)
    cube -= cube.min(axis=0, initial=0) - 1
    sides = cube.max(axis=0, initial=1) + 2
    strides = np.array([1, sides[0], sides[0] * sides[1]])
    key, node = np.unique(cube @ strides, return_inverse=True)
    first = np.append(True, np.diff(stretch) != 0)[: len(stretch)]
    links = [np.stack([node[first][np.cumsum(first) - 1], node])] if len(node) else []
    for offset in np.ndindex(3, 3, 3):
        other = key + (np.array(offset) - 1) @ strides
        at = np.minimum(np.searchsorted(key, other), max(len(key) - 1, 0))
        links.append(np.stack([np.arange(len(key)), at])[:, key[at] == other])
    pairs = np.concatenate(links, axis=1)
    graph = coo_array((np.ones(pairs.shape[1]), tuple(pairs)), shape=(len(key), len(key)))
    count, of_node = connected_components(graph, directed=False) if len(key) else (0, node)
    of_stretch = of_node[node[first]]
    order = np.argsort(of_stretch, kind="stable")
    rows = np.split(order, np.searchsorted(of_stretch[order], np.arange(1, count))) if count else []
    return [taken(stretches, each) for each in rows if len(each) >= FEWEST_CELLS]


def _volume_mm3(group: _Stretches, cell_mm: Floats) -> float:
    """Return the volume of a place: by the rays along each axis, weighted by how far it faces that axis.

    Rays along a thin layer meet it by chance; those across it say how thick it is.
    """
    of_axis, weight = np.zeros(3), np.zeros(3)
    for axis in range(3):
        area_mm2, on_axis = float(np.delete(cell_mm, axis).prod()), group.axis == axis
        of_axis[axis] = area_mm2 * np.diff(group.span_mm[on_axis], axis=1).sum()
        weight[axis] = area_mm2 * (group.toward[on_axis, axis] ** 2).sum()
    return float(of_axis @ weight / weight.sum()) if weight.any() else float(of_axis.mean())


def _deepest(group: _Stretches) -> Floats:
    """Return the place (3,) of the deepest: of those that are nearly as deep the middle one."""
    places_mm = group.place_mm[group.depth_mm >= NEARLY * group.depth_mm.max()]
    away_mm = lengths(places_mm - places_mm.mean(axis=0))
    place_mm: Floats = places_mm[int(away_mm.argmin())]
    return place_mm


def _shells(group: _Stretches, dexels: Dexels) -> "list[manifold3d.Manifold]":
    """Return the solids between the ends of stretches that lie along the way to the nominal surface."""
    along = group.toward[np.arange(len(group.axis)), group.axis]
    is_across = along**2 >= _ALONG
    shells = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for sign in (-1.0, 1.0):
            rows = np.flatnonzero(
                (group.axis == axis) & (is_across | ~is_across.any()) & (sign * along >= 0.0)
            )
            if not len(rows):
                continue
            rows = rows[
                np.argsort(np.diff(group.span_mm[rows], axis=1)[:, 0], kind="stable")
            ]  # the longest stays
            column, row = (each[rows] - each[rows].min() for each in (group.column, group.row))
            above = np.full((int(row.max()) + 1, int(column.max()) + 1), -np.inf)
            under = above.copy()
            under[row, column], above[row, column] = group.span_mm[rows].T
            low = np.array([group.column[rows].min(), group.row[rows].min()])
            origin_mm, size_mm = dexels.low_mm[[u, v]] + low * dexels.cell_mm[[u, v]], dexels.cell_mm[[u, v]]
            shells.append(shell(origin_mm, size_mm, above, under, np.eye(3)[[u, v, axis]]))
    return shells


def _nearest_samples(places_mm: Floats, motion: Motion, cell: Cell) -> list[int]:
    """Return the samples whose cutter comes nearest to places (n, 3)."""
    outlook = outlook_of([motion])
    points, sample = path_points(motion, outlook, np.array([body_of(cell.tool[n]) for n in outlook.numbers]))
    nearest = np.zeros(len(places_mm), dtype=np.int64)
    _nearest_poses(points, np.ascontiguousarray(places_mm), nearest)
    rows: list[int] = sample[nearest].tolist()
    return rows
