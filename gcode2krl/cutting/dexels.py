"""Material as three fields of dexels: what a tool may cut from any side.

A dexel is a ray along an axis of ``$BASE`` through the middle of a cell, with the stretches of it that are
material. Each end has the normal of the surface there, so that a surface is known between rays to the second
order in a cell: cells may be three times as wide as those of a height field for the same force.
"""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Floats, Ints, Ints32
from gcode2krl.compiled.core import (
    FLOAT,
    FLOATS,
    INTS,
    OUT_FLOATS,
    OUT_FLOATS32,
    OUT_INTS,
    ArrayOf,
    StructOf,
    core_function,
)
from gcode2krl.errors import input_error

if TYPE_CHECKING:
    import trimesh

SIDE = 4
"""Rays along one side of a block with a common bound of its ends."""
MOST = 32
"""Stretches of material that a ray may have."""
CELLS_PER_DIAMETER = 32.0
"""Default resolution: 0.5 mm for a cutter of 16 mm. docs/cutting.md says what it costs."""
MAX_RAYS = 8_000_000
SHORTENED = 127
"""Length of a packed normal."""
RAY = np.dtype([("first", "i4"), ("filled", "u1"), ("room", "u1")], align=True)
"""A ray: place of its first end, stretches that it has, and for which there is room there."""
END = np.dtype([("at", "f4"), ("facing", "i4")])
"""Where material begins or ends; the normal of the surface out of it, three signed bytes, above a stamp."""


class Dexels(NamedTuple):
    """Three fields of rays, along x, y and z; a ray's row and column count cells of the next two axes.

    They change while they are cut; lengths in mm, in ``$BASE``.
    """

    ends: NDArray[np.void]
    """(e,) records `END`, in pairs; those of a ray are together."""
    rays: NDArray[np.void]
    """(rays,) records `RAY`, those of a block together, also where it reaches beyond the field."""
    used: Ints
    """(1,) ends that belong to rays; a ray that needs more room gets it behind them."""
    bound: NDArray[np.float32]
    """(blocks, 2) lowest and highest end in a block."""
    low_mm: Floats
    """(3,) low corner of the box around the material."""
    cell_mm: Floats
    """(3,)"""
    cells: Ints
    """(3,) how many there are along each axis."""

    @property
    def volume_mm3(self) -> float:
        """Volume of the material."""
        return float(_volume(self))

    @property
    def size_mm(self) -> Floats:
        """Size (3,) of the box around the raw part."""
        size: Floats = self.cells * self.cell_mm
        return size

    @property
    def top_mm(self) -> float:
        """The highest place of the material, -inf where there is none."""
        blocks = -(-int(self.cells[0]) // SIDE) * -(-int(self.cells[1]) // SIDE)
        return float(self.bound[-blocks:, 1].max())

    def copy(self) -> "Dexels":
        """Return dexels that can be cut without changing these."""
        return self._replace(**{name: getattr(self, name).copy() for name in _CUT})

    def with_room(self) -> "Dexels":
        """Return the same with room for twice as many ends; raises where a ray has all that it may have."""
        _refuse_more_than(MOST - 1, self.rays["filled"])
        more = np.zeros(2 * len(self.ends), END)
        more[: len(self.ends)] = self.ends
        return self._replace(ends=more)

    def stretches(self) -> tuple[Ints, Floats]:
        """Return the ray (s,) of each stretch of material, rising, and both its ends (s, 2) in mm."""
        axis, row, column = self.places(np.arange(len(self.rays)))
        is_inside = (row < self.cells[(axis + 2) % 3]) & (column < self.cells[(axis + 1) % 3])
        filled = np.where(is_inside, self.rays["filled"], 0).astype(np.int64)  # blocks reach beyond the field
        ray = np.repeat(np.arange(len(filled)), filled)
        number = np.arange(len(ray)) - np.repeat(np.cumsum(filled) - filled, filled)
        begin = self.rays["first"][ray] + 2 * number
        return ray, self.ends["at"][begin[:, None] + [0, 1]].astype(np.float64)

    def places(self, ray: Ints) -> tuple[Ints, Ints, Ints]:
        """Return axis, row and column (r,) of rays, as `_ray` numbers them."""
        firsts = _firsts(self.cells)
        axis = np.searchsorted(firsts, ray, side="right") - 1
        block, inside = np.divmod(ray - firsts[axis], SIDE**2)
        blocks_in_a_row = -(-self.cells[(axis + 1) % 3] // SIDE)
        row = SIDE * (block // blocks_in_a_row) + inside // SIDE
        return axis, row, SIDE * (block % blocks_in_a_row) + inside % SIDE

    def coarser(self, cell_mm: float) -> "Dexels":
        """Return the same material on fewer rays, each as the nearest of these."""
        low_mm, size_mm, cells = _grid(
            np.array([self.low_mm, self.low_mm + self.cells * self.cell_mm]), cell_mm
        )
        firsts, own_firsts = _firsts(cells), _firsts(self.cells)
        near = np.full(firsts[3], -1)  # rays of a block beyond the field are none
        for axis in range(3):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            row, column = np.divmod(np.arange(cells[u] * cells[v]), cells[u])
            own_row, own_column = (
                ((at + 0.5) * size_mm[k] / self.cell_mm[k]).astype(np.int64)
                for at, k in ((row, v), (column, u))
            )
            nearest = own_firsts[axis] + _ray(own_row, own_column, self.cells[u])
            near[firsts[axis] + _ray(row, column, cells[u])] = nearest
        filled = np.where(near >= 0, self.rays["filled"][near], 0).astype(np.int64)
        made = _with_ends(low_mm, size_mm, cells, filled)
        ends = 2 * filled
        number = np.arange(ends.sum()) - np.repeat(np.cumsum(ends) - ends, ends)
        to, of = (
            np.repeat(first.astype(np.int64), ends) + number
            for first in (made.rays["first"], self.rays["first"][near])
        )
        made.ends[to] = self.ends[of]
        made.ends["facing"][to] &= 0xFFFFFF  # without a stamp
        _bound(made)
        return made

    def depths(self, places_mm: Floats) -> Floats:
        """Return how deep in mm places (n, 3) are in material, negative outside, to two cells."""
        depth = np.empty(len(places_mm))
        _depths(self, np.ascontiguousarray(places_mm), near_of(self), depth)
        return depth

    def bodies_in(self, ends_mm: Floats, radius_mm: Floats) -> tuple[Floats, Floats]:
        """Return how deep capsules (n), ends (n, 6), are in the material, 0 where not, and where (n, 3)."""
        depth, place = np.empty(len(ends_mm)), np.empty((len(ends_mm), 3))
        _bodies(self, np.ascontiguousarray(ends_mm), np.ascontiguousarray(radius_mm), depth, place)
        return depth, place


_CUT = ("ends", "rays", "used", "bound")
DEXELS = StructOf(
    ends=ArrayOf(END, written=True),
    rays=ArrayOf(RAY, written=True),
    used=OUT_INTS,
    bound=OUT_FLOATS32,
    low_mm=FLOATS,
    cell_mm=FLOATS,
    cells=INTS,
)
_bound = core_function("cutting_bound_dexels", DEXELS)
_depths = core_function("cutting_depths", DEXELS, FLOATS, FLOAT, OUT_FLOATS)
_volume = core_function("cutting_dexel_volume", DEXELS, returns=FLOAT)
_bodies = core_function("cutting_bodies_dexels", DEXELS, FLOATS, FLOATS, OUT_FLOATS, OUT_FLOATS)


def near_of(dexels: Dexels) -> float:
    """Return how far from a surface the depth in material is known."""
    return 2.0 * float(dexels.cell_mm.max())


def dexel_block(box_mm: Floats, cell_mm: float) -> Dexels:
    """Return a block (2, 3) as dexels whose cells of about ``cell_mm`` fill it exactly."""
    low_mm, size_mm, cells = _grid(np.asarray(box_mm, dtype=np.float64), cell_mm)
    firsts = _firsts(cells)
    block = _with_ends(low_mm, size_mm, cells, np.ones(firsts[3], dtype=np.int64))
    for axis in range(3):
        ends = slice(2 * firsts[axis], 2 * firsts[axis + 1])
        block.ends["at"][ends].reshape(-1, 2)[:] = box_mm[0][axis], box_mm[1][axis]
        normals = np.zeros((2, 3))
        normals[:, axis] = -1.0, 1.0
        block.ends["facing"][ends].reshape(-1, 2)[:] = _packed(normals)
    _bound(block)
    return block


def dexel_mesh(mesh: "trimesh.Trimesh", cell_mm: float) -> Dexels:
    """Return a closed mesh as dexels: each ray begins and ends where it passes a triangle."""
    low_mm, size_mm, cells = _grid(np.array(mesh.bounds, dtype=np.float64), cell_mm)
    ray, at, normal = crossings(mesh, low_mm, size_mm, cells)
    count = np.bincount(ray, minlength=_firsts(cells)[3])
    _refuse_more_than(MOST, count // 2)
    dexels = _with_ends(low_mm, size_mm, cells, -(-count // 2))
    dexels.rays["filled"] = count // 2
    place = dexels.rays["first"][ray] + np.arange(len(ray)) - np.repeat(np.cumsum(count) - count, count)
    dexels.ends["at"][place], dexels.ends["facing"][place] = at, _packed(normal)
    _bound(dexels)
    return dexels


def crossings(
    mesh: "trimesh.Trimesh", low_mm: Floats, cell_mm: Floats, cells: Ints
) -> tuple[Ints, Floats, Floats]:
    """Return where rays of dexels pass a mesh: rays (c,) and places, both rising, and normals (c, 3)."""
    triangles = np.ascontiguousarray(mesh.triangles, dtype=np.float64)
    firsts, of_fields = _firsts(cells), []
    for axis in range(3):
        ray, at, normal = _crossed(triangles, axis, low_mm, cell_mm, cells)
        of_fields.append((ray + firsts[axis], at, normal))
    ray, at, normal = (np.concatenate(column) for column in zip(*of_fields, strict=True))
    order = np.lexsort((at, ray))
    return ray[order], at[order], normal[order]


def _crossed(
    triangles: Floats, axis: int, low: Floats, size: Floats, cells: Ints
) -> tuple[Ints, Floats, Floats]:
    """Return rays (c,) of a field, where they pass triangles (t, 3, 3), and the normals (c, 3) there.

    A ray on the edge of two triangles passes one of them: points are never on the line of an edge, as rays
    are a little beside the middles of cells, by shares of a cell that no mesh has.
    """
    u, v = (axis + 1) % 3, (axis + 2) % 3
    off_middle = {u: 0.5 + 1.234567e-5, v: 0.5 + 2.345678e-5}
    rays, places, normals = [np.zeros(0, dtype=np.int64)], [np.zeros(0)], [np.zeros((0, 3))]
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    for corners, normal in zip(triangles, across, strict=True):
        if abs(normal[axis]) < 1e-12:
            continue
        spans = {}
        for k in (u, v):
            at = (corners[:, k] - low[k]) / size[k] - off_middle[k]
            spans[k] = np.arange(max(int(np.ceil(at.min())), 0), min(int(at.max()) + 1, cells[k]))
        x = low[u] + (spans[u] + off_middle[u]) * size[u]
        y = (low[v] + (spans[v] + off_middle[v]) * size[v])[:, None]
        inside = np.ones((len(spans[v]), len(spans[u])), dtype=np.bool_)
        for a, b in ((0, 1), (1, 2), (2, 0)):
            p, q = corners[a], corners[b]
            side = (q[u] - p[u]) * (y - p[v]) - (q[v] - p[v]) * (x - p[u])
            inside &= (side > 0.0) == (normal[axis] > 0.0)
        row, column = np.nonzero(inside)
        at_x, at_y = x[column], y[row, 0]
        depth = normal[u] * (at_x - corners[0, u]) + normal[v] * (at_y - corners[0, v])
        rays.append(_ray(spans[v][row], spans[u][column], cells[u]))
        places.append(corners[0, axis] - depth / normal[axis])
        normals.append(np.broadcast_to(normal / np.linalg.norm(normal), (len(row), 3)))
    return np.concatenate(rays), np.concatenate(places), np.concatenate(normals)


def _grid(box_mm: Floats, cell_mm: float) -> tuple[Floats, Floats, Ints]:
    """Return low corner, size (3,) and number (3,) of cells that fill a box (2, 3); raises for too many."""
    low, high = box_mm
    cells = np.maximum(1, np.ceil((high - low) / cell_mm - 1e-9)).astype(np.int64)
    rays = int(_firsts(cells)[3])
    if rays > MAX_RAYS:
        raise input_error(
            "stock-large",
            f"the stock of {' x '.join(f'{size:.0f}' for size in high - low)} mm would be "
            f"{rays / 1e6:.0f} million rays at {cell_mm:.3g} mm",
            "state a smaller [stock], or a coarser resolution_mm",
        )
    return low.copy(), (high - low) / cells, cells


def _with_ends(low_mm: Floats, cell_mm: Floats, cells: Ints, stretches: Ints) -> Dexels:
    """Return dexels whose rays have so many stretches (rays,); ends and bounds are still to be written."""
    room = np.maximum(stretches, 1)
    after = 2 * np.cumsum(room)
    used = int(after[-1])
    rays = np.zeros(len(stretches), RAY)
    rays["first"], rays["filled"], rays["room"] = after - 2 * room, stretches, room
    return Dexels(
        ends=np.zeros(2 * used, END),  # what no ray uses yet takes no memory
        rays=rays,
        used=np.array([used]),
        bound=np.empty((len(rays) // SIDE**2, 2), np.float32),
        low_mm=low_mm,
        cell_mm=cell_mm,
        cells=cells,
    )


def _refuse_more_than(most: int, stretches: NDArray[np.integer[Any]]) -> None:
    """Raise where a ray has more stretches."""
    if stretches.max(initial=0) > most:
        raise input_error(
            "stock-large",
            f"a line through the stock meets material more than {most} times",
            "state a coarser [stock] resolution_mm",
        )


def _firsts(cells: Ints) -> Ints:
    """Return the first ray of each field, and the number of all."""
    blocks = -(-cells // SIDE)
    return SIDE**2 * np.append(0, np.cumsum([blocks[(k + 1) % 3] * blocks[(k + 2) % 3] for k in range(3)]))


def _ray(row: Ints, column: Ints, columns: int) -> Ints:
    """Return the place of rays (n,) in a field of so many columns."""
    block = row // SIDE * -(-columns // SIDE) + column // SIDE
    return SIDE * (SIDE * block + row % SIDE) + column % SIDE


def _packed(normals: Floats) -> Ints32:
    """Return unit vectors (n, 3) as three signed bytes each."""
    parts = np.rint(normals * SHORTENED).astype(np.int64) & 0xFF
    packed: Ints32 = (parts @ np.array([1, 1 << 8, 1 << 16])).astype(np.int32)
    return packed
