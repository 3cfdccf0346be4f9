"""The raw part as a height field: a block by numbers, a mesh, or a guess from the program (see `guess`)."""

import io
import math
import warnings
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.cell import Cell
from gcode2krl.cell.sections import Tool
from gcode2krl.cutting.cutter import shape_of
from gcode2krl.cutting.dexels import CELLS_PER_DIAMETER as DEXELS_PER_DIAMETER
from gcode2krl.cutting.dexels import Dexels, dexel_block, dexel_mesh
from gcode2krl.cutting.guess import guessed_box
from gcode2krl.cutting.height_field import CELLS_PER_DIAMETER, MAX_CELLS, HeightField
from gcode2krl.cutting.mesh_file import REMEDY, MeshError, read_mesh_file
from gcode2krl.cutting.solids import mesh_of, solid_of
from gcode2krl.errors import extra_missing, input_error
from gcode2krl.files.there import is_there
from gcode2krl.tables import Toolpath

if TYPE_CHECKING:
    import trimesh

_NEEDED_FOR_3MF = ("lxml", "networkx")
"""What trimesh reads its XML with, and puts its objects in their places."""
_METRES_MM = 1.0
"""A mesh smaller than this in every direction is taken to be in metres."""
_LARGEST_MM = 20_000.0
_COARSEST_OF_DIAMETER = 20.0
"""Cells across the smallest tool below which a field is too coarse to be useful."""


def height_field_of(toolpath: Toolpath, cell: Cell, to_field: Floats, tools: list[Tool]) -> HeightField:
    """Return the raw part before the first cut, in the frame of the field; of a restart what is left of it.

    Parameters
    ----------
    to_field : (3, 3) rotation from ``$BASE`` to the field, whose z is the tool axis.
    tools : those that the program uses; the smallest gives the resolution where the cell does not, by
        `CELLS_PER_DIAMETER`: the same for parts of any length, as it shows in the force.

    Raises
    ------
    NotUnderstoodError
        Where a mesh cannot be read or the field would be too large.
    """
    left_over = toolpath.restart.material if toolpath.restart is not None else None
    if isinstance(left_over, HeightField):
        return left_over.copy()
    stock = cell.stock
    own_mm = stock.resolution_mm if stock is not None else None
    if stock is not None and stock.mesh is not None:
        mesh = load_mesh(Path(stock.mesh))
        mesh.apply_transform(np.block([[to_field, np.zeros((3, 1))], [np.zeros((1, 3)), np.ones((1, 1))]]))
        return _from_mesh(mesh, _resolution(mesh.bounds, tools, own_mm))
    if stock is not None and stock.box_mm is not None:
        box = np.array(stock.box_mm)
        if np.allclose(to_field, np.eye(3)):
            return block(box, _resolution(box, tools, own_mm))
        corners = np.array(np.meshgrid(*box.T)).reshape(3, -1).T @ to_field.T
        bounds = np.array([corners.min(axis=0), corners.max(axis=0)])
        return _from_mesh(_turned_box(box, to_field), _resolution(bounds, tools, own_mm))
    radius_mm, edges_mm = max(tool.diameter_mm for tool in tools) / 2.0, max(map(_edges_mm, tools))
    box = guessed_box(toolpath, to_field, radius_mm, edges_mm)
    return block(box, _resolution(box, tools, own_mm), guessed=True)


def dexels_of(
    toolpath: Toolpath, cell: Cell, tools: list[Tool], most_squares: int | None = None
) -> tuple[Dexels, bool]:
    """Return the raw part as dexels, and whether it is guessed; arguments and errors as above.

    Cells are so large that at most so many squares of theirs cover the box around it.
    """
    stock, smallest_mm = cell.stock, min(tool.diameter_mm for tool in tools)
    left_over = toolpath.restart.material if toolpath.restart is not None else None
    if isinstance(left_over, Dexels):
        is_stated = stock is not None and (stock.mesh is not None or stock.box_mm is not None)
        cell_mm = float(left_over.cell_mm.max())
        least_mm = cell_mm if most_squares is None else side_of_squares(left_over.size_mm, most_squares)
        return (left_over.coarser(least_mm) if least_mm > cell_mm else left_over.copy()), not is_stated
    own_mm = stock.resolution_mm if stock is not None else None
    mesh = load_mesh(Path(stock.mesh)) if stock is not None and stock.mesh is not None else None
    stated_mm = stock.box_mm if stock is not None and mesh is None else None
    if mesh is not None or stated_mm is not None:
        box_mm = np.array(stated_mm if mesh is None else mesh.bounds)
    else:
        radius_mm, edges_mm = max(tool.diameter_mm for tool in tools) / 2.0, max(map(_edges_mm, tools))
        box_mm = guessed_box(toolpath, np.eye(3), radius_mm, edges_mm)
    cell_mm = own_mm if own_mm is not None else smallest_mm / DEXELS_PER_DIAMETER
    if most_squares is not None:
        cell_mm = max(cell_mm, side_of_squares(box_mm[1] - box_mm[0], most_squares))
    is_guessed = mesh is None and stated_mm is None
    return (dexel_block(box_mm, cell_mm) if mesh is None else dexel_mesh(mesh, cell_mm)), is_guessed


def side_of_squares(size_mm: Floats, most_squares: int) -> float:
    """Return the side of so many squares that cover a box of a size (3,)."""
    x, y, z = size_mm.tolist()
    return math.sqrt(2.0 * (x * y + y * z + z * x) / most_squares)


def _edges_mm(tool: Tool) -> float:
    """Return how far up a tool's edges reach."""
    return shape_of(tool).flute_mm


def block(box_mm: Floats, cell_mm: float, guessed: bool = False) -> HeightField:
    """Return a block (2, 3) as a field whose cells of about ``cell_mm`` fill it exactly."""
    low, high = box_mm
    count = np.maximum(1, np.ceil((high[:2] - low[:2]) / cell_mm - 1e-9)).astype(np.int64)
    size = (high[:2] - low[:2]) / count
    height = np.full((count[1], count[0]), high[2], dtype=np.float32)
    return HeightField(height, low[:2].copy(), size, float(low[2]), guessed)


def load_mesh(file: Path, what: str = "stock") -> "trimesh.Trimesh":
    """Return the mesh of a raw part, or of ``what`` else, in mm.

    Cracks are closed (`solids.solid_of`). Raises `NotUnderstoodError` where the file is missing, not a mesh,
    has holes or is not in mm, or where it is a 3MF file and the extra for them is not installed.
    """
    if not is_there(file):
        words = f"cannot read the {what}: no such file"
        raise input_error("file-unreadable", words, REMEDY, source=str(file))
    try:
        data, kind = read_mesh_file(file)
        if kind == "3mf" and not all(map(find_spec, _NEEDED_FOR_3MF)):
            raise extra_missing("3mf", "a 3MF file", str(file))
        mesh = _solid_of(data, kind)
    except OSError as error:
        words = f"cannot read the {what}: {error.strerror}"
        raise input_error("file-unreadable", words, REMEDY, source=str(file)) from None
    except MeshError as error:
        raise input_error("stock-mesh", str(error), REMEDY, source=str(file)) from None
    span = float(np.ptp(mesh.bounds, axis=0).max())
    if span < _METRES_MM:
        sentence = f"the mesh is {span:.4g} mm large, so probably in metres"
        raise input_error("stock-unit", sentence, "export it in mm", source=str(file))
    if span > _LARGEST_MM:
        sentence = f"the mesh is {span:.4g} mm large, so probably not in mm"
        raise input_error("stock-unit", sentence, "export it in mm", source=str(file))
    if mesh.is_watertight:
        return mesh
    try:
        return mesh_of(solid_of(mesh))
    except MeshError as error:
        raise input_error("stock-mesh", str(error), REMEDY, source=str(file)) from None


def _solid_of(data: bytes, kind: str) -> "trimesh.Trimesh":
    """Return the mesh of a checked file; raises `MeshError` where it holds none.

    It is read from bytes, so that it cannot refer to other files, and the reader's own warnings are
    suppressed.
    """
    import logging

    import trimesh

    logging.getLogger("trimesh").addHandler(logging.NullHandler())
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            warnings.simplefilter("error", DeprecationWarning)  # text that is not a number ends its reading
            mesh: Any = trimesh.load(io.BytesIO(data), file_type=kind, force="mesh")
    except Exception as error:  # a foreign reader may raise anything
        why = str(error).splitlines()[0][:120] if str(error) else type(error).__name__
        raise MeshError(f"not a mesh: {why}") from None
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
        raise MeshError("the mesh has no faces")
    if mesh.faces.min() < 0 or mesh.faces.max() >= len(mesh.vertices):
        raise MeshError("a triangle with a corner that is not there")
    if not np.isfinite(mesh.vertices).all():
        raise MeshError("the mesh has points that are not numbers")
    solid: trimesh.Trimesh = mesh
    return solid


def to_mesh(field: HeightField, most_cells: int = 250_000) -> "trimesh.Trimesh":
    """Return the remaining material as a closed mesh, in the frame of the field.

    Its surface runs from cell middle to cell middle, so a wall leans by one cell. A field of more than
    ``most_cells`` cells is made coarser first (the highest of joined cells counts). Undercuts are filled.
    """
    import trimesh

    tops, x, y = _coarser(field, most_cells)
    rows, columns = tops.shape
    solid = tops > field.bottom_mm
    filled = solid[:-1, :-1] | solid[1:, :-1] | solid[:-1, 1:] | solid[1:, 1:]
    grid_x, grid_y = np.meshgrid(x, y)
    points = np.concatenate(
        [
            np.stack([grid_x, grid_y, tops], axis=-1).reshape(-1, 3),
            np.stack([grid_x, grid_y, np.full_like(tops, field.bottom_mm)], axis=-1).reshape(-1, 3),
        ]
    )
    number = np.arange(rows * columns).reshape(rows, columns)
    number_below = np.where(solid, number + rows * columns, number)  # where nothing is left, both are one
    top = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1)[filled]
    below = np.stack(
        [number_below[1:, :-1], number_below[1:, 1:], number_below[:-1, 1:], number_below[:-1, :-1]], axis=-1
    )[filled]
    squares = np.concatenate([top, below, *_sides(number, number_below, filled)])
    faces = np.concatenate([squares[:, [0, 1, 2]], squares[:, [0, 2, 3]]])
    distinct = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 0] != faces[:, 2])
    mesh = trimesh.Trimesh(points, faces[distinct], process=False)
    mesh.remove_unreferenced_vertices()
    return mesh


def _coarser(field: HeightField, most_cells: int) -> tuple[Floats, Floats, Floats]:
    """Return heights at cell middles with a border on the edges of the field (r, c), and their x and y."""
    rows, columns = field.height_mm.shape
    step = max(1, math.ceil(math.sqrt(rows * columns / most_cells)))
    padded = np.full((-(-rows // step) * step, -(-columns // step) * step), -np.inf)
    padded[:rows, :columns] = field.height_mm
    tops = padded.reshape(padded.shape[0] // step, step, padded.shape[1] // step, step).max(axis=(1, 3))
    tops = np.pad(np.maximum(tops, field.bottom_mm), 1, mode="edge")
    places = []
    for count, size, origin in zip((columns, rows), field.cell_mm, field.origin_mm, strict=True):
        edges = np.minimum(np.arange(0, count + step, step), count) * size + origin
        middles = 0.5 * (edges[:-1] + edges[1:])
        places.append(np.concatenate([edges[:1], middles, edges[-1:]]))
    return tops, places[0], places[1]


def _sides(top: Ints, below: Ints, filled: Bools) -> Iterator[Ints]:
    """Yield the walls (f, 4) along the border of the field; elsewhere top and bottom meet."""
    for first, second, border in (
        ((0, slice(None, -1)), (0, slice(1, None)), filled[0]),
        ((-1, slice(1, None)), (-1, slice(None, -1)), filled[-1]),
        ((slice(1, None), 0), (slice(None, -1), 0), filled[:, 0]),
        ((slice(None, -1), -1), (slice(1, None), -1), filled[:, -1]),
    ):
        yield np.stack([below[first], below[second], top[second], top[first]], axis=-1)[border]


def _turned_box(box: Floats, to_field: Floats) -> "trimesh.Trimesh":
    import trimesh

    mesh: trimesh.Trimesh = trimesh.creation.box(bounds=box)
    mesh.apply_transform(np.block([[to_field, np.zeros((3, 1))], [np.zeros((1, 3)), np.ones((1, 1))]]))
    return mesh


def _from_mesh(mesh: "trimesh.Trimesh", cell_mm: float) -> HeightField:
    """Return the field of the surface from above: each triangle raises the cells whose middle it covers."""
    field = block(np.array(mesh.bounds), cell_mm)
    height = np.full(field.height_mm.shape, -np.inf)
    raise_to(np.ascontiguousarray(mesh.triangles, dtype=np.float64), field.origin_mm, field.cell_mm, height)
    return HeightField(
        height.astype(np.float32), field.origin_mm, field.cell_mm, float(mesh.bounds[0, 2]), False
    )


def raise_to(triangles: Floats, origin_mm: Floats, cell_mm: Floats, height: Floats) -> None:
    """Raise cells (in place) to the triangles (t, 3, 3) over their middles."""
    for a, b, c in triangles:
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if abs(area) < 1e-12:
            continue  # seen from above a wall is a line
        low = np.floor((np.min([a, b, c], axis=0)[:2] - origin_mm) / cell_mm - 0.5).astype(int)
        high = np.ceil((np.max([a, b, c], axis=0)[:2] - origin_mm) / cell_mm + 0.5).astype(int)
        j0, i0 = np.maximum(low, 0)
        j1, i1 = np.minimum(high, height.shape[::-1])
        if j1 <= j0 or i1 <= i0:
            continue
        x = origin_mm[0] + (np.arange(j0, j1) + 0.5) * cell_mm[0]
        y = origin_mm[1] + (np.arange(i0, i1) + 0.5)[:, None] * cell_mm[1]
        u = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / area
        v = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / area
        inside = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1.0 + 1e-9)
        z = a[2] + u * (b[2] - a[2]) + v * (c[2] - a[2])
        part = height[i0:i1, j0:j1]
        np.maximum(part, np.where(inside, z, -np.inf), out=part)


def _resolution(bounds: Floats, tools: list[Tool], own_mm: float | None) -> float:
    """Return the cell size: the user's, else a fraction of the smallest tool, larger if necessary."""
    width, depth = (float(size) for size in bounds[1, :2] - bounds[0, :2])
    smallest = min(tool.diameter_mm for tool in tools)
    least = math.sqrt(max(width * depth, 1e-12) / MAX_CELLS)
    if own_mm is not None:
        if own_mm < least:
            raise input_error(
                "stock-resolution",
                f"resolution_mm {own_mm:g}: {width:.0f} x {depth:.0f} mm would be more than "
                f"{MAX_CELLS / 1e6:.0f} million cells",
                f"at least {least:.3f}, or a smaller stock",
            )
        return own_mm
    if least > smallest / _COARSEST_OF_DIAMETER:
        raise input_error(
            "stock-large",
            f"the stock of {width:.0f} x {depth:.0f} mm is too large for a tool of {smallest:g} mm",
            "state a smaller [stock], or resolution_mm",
        )
    return max(least, smallest / CELLS_PER_DIAMETER)
