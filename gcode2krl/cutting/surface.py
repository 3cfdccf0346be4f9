"""How a part comes about under a tool whose axis turns, coarse enough to be shown; `history` of any axis."""

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.cell import Cell
from gcode2krl.compiled.core import INT, INTS32, OUT_INTS, OUT_INTS32, StructOf, core_function
from gcode2krl.cutting.dexels import DEXELS, SHORTENED, Dexels
from gcode2krl.cutting.height_field import MESH_CELLS
from gcode2krl.cutting.milling import axes_between, shaped, tool_axes
from gcode2krl.cutting.outlook import Outlook
from gcode2krl.cutting.raw_part import dexels_of, side_of_squares
from gcode2krl.cutting.records import taken
from gcode2krl.cutting.solids import mesh_of, solid_of
from gcode2krl.cutting.turned import TURNED, Turned, body_of, longest_step
from gcode2krl.tables import Motion, SurfaceHistory, Toolpath

if TYPE_CHECKING:
    import trimesh


class Surface(NamedTuple):
    """What the core keeps of the surface between cells; it changes while the stock is cut."""

    solid: Bools
    """Middles of cells, and one layer around them, with material."""
    shape: Ints32
    """Cubes between eight middles: three bytes of the point of the surface, above its state; 0 = none."""
    facing: Ints32
    """Packed normal of what was cut in a cube."""
    point: Ints32
    """The point of the path that cut it, -1 where none did,"""
    shape_left: Ints32
    """and the shape that it left."""


SURFACE = StructOf.record(Surface, written=Surface._fields)
_EVENTS = (OUT_INTS32,) * 4
_raw = core_function("cutting_raw_surface", DEXELS, SURFACE, *_EVENTS, returns=INT)
_cut = core_function("cutting_surface", DEXELS, TURNED, INTS32, INT, SURFACE, *_EVENTS, OUT_INTS, returns=INT)


class _Events(NamedTuple):
    """Cubes (e) that became otherwise, in the order of time."""

    cube: Ints32
    slot: Ints32
    shape: Ints32
    point: Ints32


def surface_history(
    toolpath: Toolpath,
    motion: Motion,
    cell: Cell,
    outlook: Outlook,
    slots: tuple[float, float],
    most: tuple[int, int],
) -> SurfaceHistory:
    """Return how the part comes about along a motion; errors as `history.history_of`.

    Parameters
    ----------
    slots : the shortest time in s, and the share of the whole, within which a cube changes once.
    most : squares of the surface of the raw part, and events.
    """
    tools = [cell.tool[number] for number in outlook.numbers]
    raw, _ = dexels_of(toolpath, cell, tools, most_squares=most[0])
    points, sample = path_points(motion, outlook, np.array([body_of(tool) for tool in tools]))
    time_s = motion.time_s[sample] - motion.time_s[0]
    slot = (time_s / max(slots[0], slots[1] * float(time_s[-1]))).astype(np.int32)
    events, surface = _cut_out(raw, points, slot)
    events, length = _fewer(events, most[1])
    slot //= length
    ends = np.append(
        np.flatnonzero(np.diff(slot)), len(slot) - 1
    )  # the last point of each slot that there is
    shape = _shape_of(raw, events)
    site = shape["site"]
    left_by, packed = surface.point[site], surface.facing[site]
    is_left = (surface.shape[site] != 0) & (left_by >= 0)
    normal = np.stack([packed, packed >> 8, packed >> 16], axis=1).astype(np.int8) / SHORTENED
    return SurfaceHistory(
        **shape,
        shown=np.where(events.slot < 0, -1, sample[ends[np.searchsorted(slot[ends], events.slot)]]),
        sample=np.where(events.point < 0, -1, sample[events.point]),
        left_by=np.where(is_left, sample[left_by], -1),
        normal=np.where(is_left[:, None], normal, np.nan),
    )


def dexels_to_mesh(dexels: Dexels, most_squares: int = MESH_CELLS) -> "trimesh.Trimesh":
    """Return material as a closed mesh in ``$BASE``, as fine as so many squares of cells around it allow.

    Edges are sharp; a wall that is thinner than a cell may have holes.
    """
    import trimesh

    cell_mm = side_of_squares(dexels.size_mm, most_squares)
    drawn = dexels.coarser(cell_mm) if cell_mm > float(dexels.cell_mm.max()) else dexels
    _, _, events = _begun(drawn)
    never, nowhere = np.full(len(events.cube), -1), np.zeros((0, 3))
    shape = SurfaceHistory(
        **_shape_of(drawn, events), shown=never, sample=never, left_by=never, normal=nowhere
    )
    points, squares = shape.surface()
    mesh = trimesh.Trimesh(
        points, np.concatenate([squares[:, [0, 1, 2]], squares[:, [0, 2, 3]]]), process=False
    )
    return mesh_of(solid_of(mesh))  # where bodies touch in an edge its points become several


def _shape_of(raw: Dexels, events: _Events) -> dict[str, Any]:
    """Return the fields of a `SurfaceHistory` that say where the surface is."""
    state = events.shape >> 24
    site = np.unique(events.cube[state > 0])
    return {
        "low_mm": raw.low_mm - 0.5 * raw.cell_mm,
        "cell_mm": raw.cell_mm,
        "cubes": raw.cells + 1,
        "site": site,
        "cell": np.searchsorted(site, events.cube).astype(np.int32),
        "share": np.stack([events.shape >> shift & 0xFF for shift in (0, 8, 16)], axis=1).astype(np.uint8),
        "state": state.astype(np.uint8),
    }


def path_points(motion: Motion, outlook: Outlook, bodies: Floats) -> tuple[Turned, Ints]:
    """Return the way of the tool, and the sample (k,) to which the sweep to each point belongs."""
    tool = np.searchsorted(outlook.numbers, motion.tool).astype(np.int32)
    joined = np.append(False, tool[1:] == tool[:-1])
    way = shaped(motion.position_mm, motion.direction, motion.path_mm, joined)
    of_point = tool[way.sample]
    none, empty = np.zeros(len(of_point), np.bool_), np.zeros(len(of_point))
    points = Turned(
        position_mm=np.ascontiguousarray(way.position_mm),
        axis=axes_between(tool_axes(motion), way),
        feed_mm=np.zeros((len(of_point), 3)),
        swing=np.zeros((len(of_point), 3)),
        tool=of_point,
        rapid=none,
        wanted=none,
        way_mm=empty,
        first=np.append(True, of_point[1:] != of_point[:-1]),
        node=none,
        bodies=bodies,
        longest_mm=longest_step(bodies),
    )
    return points, way.sample


def _cut_out(raw: Dexels, points: Turned, slot: Ints32) -> tuple[_Events, Surface]:
    """Cut the path out of the stock; return what changed, the raw surface first, and what stands."""
    surface, events, first = _begun(raw)
    done = np.zeros(2, np.int64)
    parts = [first]
    at = 0
    while at < len(slot):
        at = _cut(raw, points, slot, at, surface, *events, done)
        parts.append(_written(events, done[0]))
        if done[1]:
            raw = raw.with_room()
    return _Events(*(np.concatenate(columns) for columns in zip(*parts, strict=True))), surface


def _begun(raw: Dexels) -> tuple[Surface, _Events, _Events]:
    """Return the surface of uncut material, room for events, and those that make it."""
    cubes = int(np.prod(raw.cells + 1))
    surface = Surface(
        solid=np.zeros(int(np.prod(raw.cells + 2)), np.bool_),
        shape=np.zeros(cubes, np.int32),
        facing=np.zeros(cubes, np.int32),
        point=np.full(cubes, -1, np.int32),
        shape_left=np.zeros(cubes, np.int32),
    )
    room = max(cubes, 100_000)
    events = _Events(*(np.empty(room, np.int32) for _ in _Events._fields))
    return surface, events, _written(events, _raw(raw, surface, *events))


def _written(events: _Events, count: int) -> _Events:
    return _Events(*(column[:count].copy() for column in events))


def _fewer(events: _Events, most: int) -> tuple[_Events, int]:
    """Return at most so many events, and how many slots are one for that."""
    length = 1
    while True:
        slot = events.slot // length
        order = np.lexsort((events.slot, slot, events.cube))
        cube, of_slot = events.cube[order], slot[order]
        order = order[np.append((cube[1:] != cube[:-1]) | (of_slot[1:] != of_slot[:-1]), True)]
        cube, is_gone = events.cube[order], events.shape[order] == 0
        was_there = np.append(False, (cube[1:] == cube[:-1]) & ~is_gone[:-1])
        order = order[~is_gone | was_there]
        if len(order) <= most or slot.max(initial=0) == 0:
            fewer = taken(events._replace(slot=slot.astype(np.int32)), order)
            return taken(fewer, np.lexsort((fewer.cube, fewer.slot))), length
        length = math.ceil(1.2 * length + 0.2)
