"""Engagement and mean force along a motion, by cutting it out of a height field.

The field is divided into strips, one for each thread. Each strip removes every sweep that comes near it, in
the order of time, and reads the samples in it. The reading of a sample does not depend on the division, so
any number of threads gives the same result to the last bit.
"""

import math
from collections.abc import Sequence

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.cell.sections import Tool
from gcode2krl.compiled.threads import cores, in_threads
from gcode2krl.cutting.cutter import Shape, bottom_of, shape_of, slices_of
from gcode2krl.cutting.edge import BAND_COLUMNS, Cutters, new_work
from gcode2krl.cutting.height_field import HeightField
from gcode2krl.cutting.reading import ARCS, Result, cut_strip, mark_corners, mark_nodes
from gcode2krl.cutting.sweep import BALL, FLAT, OTHER, Grid, Path, Samples
from gcode2krl.tables import chord_directions

NODES_PER_DIAMETER = 20.0
_BALL_STRETCH = 5.0
"""How much farther apart the nodes of a ball lie: its force hardly depends on how far the field lags."""
_SETTLED_PER_DIAMETER = 0.1
_LONGEST_OF_LAG = 0.5
"""Longest sweep, as a share of the distance by which the field lags: longer ones would lag farther."""
_BINS = 16
_FEWEST_BINS = 96
_MOST_WALL_BINS = 960
_MOST_RING_BINS = 128
_CELLS_PER_BAND = 4.0
_FEWEST_BANDS, _MOST_BANDS = 6, 12
_BOTTOM_BANDS = 4
_MARGIN_CELLS = 4
_FEW_SAMPLES = 2000
"""Samples below which a second thread does not pay."""


def engage(
    field: HeightField,
    position_mm: Floats,
    tool: Ints32,
    rapid: Bools,
    f_z_mm: Floats,
    tools: Sequence[Tool],
    law: Floats,
    threads: int | None = None,
    direction: Floats | None = None,
    wanted: Bools | None = None,
    nodes_per_diameter: float = NODES_PER_DIAMETER,
) -> Result:
    """Cut a motion out of a field (in place); return engagement and mean force of every sample.

    A sample that is read is read at its own position, before the sweep that leads to it is removed; a sample
    between two nodes has what lies between theirs, with its own heading and feed. Forces are means over a
    revolution of a right-hand tool turning clockwise (M3), `slices.arc_force` summed over the edge; the
    moment is that of heights above the tip times lateral forces, and the torque.

    Parameters
    ----------
    position_mm : (k, 3) tips in the frame of the field, whose z is the tool axis.
    tool : (k,) row of ``tools``; no sweep joins two points of different tools.
    rapid : (k,) True where the sweep that leads to the point must not meet material.
    f_z_mm : (k,) feed per tooth along the path.
    law : (8,) force law of `law.law_array`.
    threads : how many; default: all cores.
    direction : (k, 3) unit tangents; by default those of the chords.
    wanted : (k,) True at the n samples; False at points that only shape the path. Default: all are samples.
    nodes_per_diameter : how many nodes there are at least while the tool goes its diameter, of a ball a part
        of that; between two of them only what is not smooth is read. inf: every sample is read.

    Notes
    -----
    Material is a height field: exact heights over the middle of cells, walls left by a cutter's rim to a
    twentieth of a cell, edges of a mesh to half a cell. The tool axis does not tilt. The path between
    points is straight.
    """
    position = np.ascontiguousarray(position_mm, dtype=np.float64)
    tool = np.ascontiguousarray(tool, dtype=np.int32)
    rows = np.arange(len(position)) if wanted is None else np.flatnonzero(wanted)
    result = _air(len(rows))
    if len(rows) == 0:
        return result
    first = np.concatenate([[True], tool[1:] != tool[:-1]])
    tangents = _tangents(position, first) if direction is None else direction
    way_mm = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(position, axis=0), axis=1))])
    outlines, rapid = outlines_of(tools), np.ascontiguousarray(rapid, dtype=np.bool_)
    cell_mm = float(field.cell_mm.max())
    cutters = _cutters(tools, cell_mm)
    corner = np.empty(len(position), dtype=np.bool_)
    is_short = outlines[:, -1] == OTHER
    columns = (position, way_mm, first, rapid, tool)
    mark_corners(*columns, _LONGEST_OF_LAG * cutters.lag_mm, is_short, corner)
    path = Path(position[corner], way_mm[corner], tool[corner], rapid[corner], first[corner], outlines)
    stretch = np.where(outlines[:, -1] == BALL, _BALL_STRETCH, 1.0)
    apart_mm = 2.0 * outlines[:, 0] / nodes_per_diameter * stretch
    samples = Samples(
        position[rows],
        np.ascontiguousarray(tangents[rows], dtype=np.float64),
        way_mm[rows],
        np.ascontiguousarray(f_z_mm[rows], dtype=np.float64),
        tool[rows],
        np.cumsum(corner)[rows] - 1,
        np.empty(len(rows), dtype=np.bool_),
    )
    mark_nodes(samples, rapid[rows], apart_mm, _SETTLED_PER_DIAMETER * 2.0 * outlines[:, 0], samples.node)
    widest_mm = float(max(outlines[:, 0].max(), cutters.above[:, ::2].max()))
    farthest_mm = 2.0 * float(apart_mm.max())  # nodes are the samples that are nearest to the places meant
    # how far around itself a strip reads: around a sample, and around the nodes beside it
    halo_mm = widest_mm + farthest_mm + _MARGIN_CELLS * cell_mm
    axis = int(np.ptp(position[:, 1]) > np.ptp(position[:, 0]))
    bounds = _bounds(samples.position_mm[:, axis], halo_mm, threads)

    def cut(strip: int) -> _Piece:
        low, high = bounds[strip], bounds[strip + 1]
        begin, end = field.cells(axis, low - halo_mm, high + halo_mm)
        own_begin, own_end = field.cells(axis, low, high)
        grid, rapid_mm = field.grid(axis, begin, end), np.zeros(len(path.way_mm))
        # one cell more: the grid begins with a whole one, and a sweep takes the disc at its start as cut
        reach_mm = halo_mm + float(outlines[:, 0].max()) + cell_mm
        lengths = (reach_mm, farthest_mm)
        cut_strip(grid, path, samples, cutters, law, low, high, axis, *lengths, new_work(), rapid_mm, result)
        return grid, own_begin, own_end, own_begin - begin, rapid_mm

    strips = range(len(bounds) - 1)
    rapid_mm = np.zeros(len(path.way_mm))
    for grid, begin, end, skip, of_strip_mm in in_threads(cut, strips, len(strips)):
        field.take_back(grid, axis, begin, end, skip)
        np.maximum(rapid_mm, of_strip_mm, out=rapid_mm)
    # what a rapid cuts off on the way to a sample is that sample's
    owner = np.searchsorted(rows, np.flatnonzero(corner)).clip(max=len(rows) - 1)
    np.maximum.at(result.overlap_mm[:, 0], owner, rapid_mm)
    return result


_Piece = tuple[Grid, int, int, int, Floats]


def _tangents(position_mm: Floats, first: Bools) -> Floats:
    """Return the tangents (n, 3) of chords, none of which joins two tools."""
    parts = np.split(position_mm, np.flatnonzero(first)[1:])
    return np.concatenate([chord_directions(part) for part in parts])


def _bounds(along_mm: Floats, halo_mm: float, threads: int | None) -> list[float]:
    """Return the borders of strips with equally many samples each, none narrower than useful."""
    strips = min(threads or cores(), max(1, int(np.ptp(along_mm) / (2.0 * halo_mm))))
    if threads is None and len(along_mm) < _FEW_SAMPLES:
        strips = 1
    inner = np.quantile(along_mm, np.linspace(0.0, 1.0, strips + 1)[1:-1])
    return [-math.inf, *(float(border) for border in inner), math.inf]


def outlines_of(tools: Sequence[Tool]) -> Floats:
    """Return `sweep.Path.outlines` (t, 7) of tools."""
    return np.array([_outline(shape_of(tool)) for tool in tools])


def _outline(shape: Shape) -> tuple[float, ...]:
    """Return radius, bottom, corner, end of the corner arc (r, z), steepness of the side above it, kind."""
    widens = shape.radius_mm > shape.arc_radius_mm + 1e-9
    steep = math.tan(shape.kappa_rad) if widens else 0.0
    ball = shape.bottom_mm == 0.0 and shape.corner_mm > 0.0 and not widens
    kind = BALL if ball else FLAT if shape.corner_mm == 0.0 and not widens else OTHER
    return (
        shape.radius_mm,
        shape.bottom_mm,
        shape.corner_mm,
        shape.arc_radius_mm,
        shape.arc_top_mm,
        steep,
        kind,
    )


def _cutters(tools: Sequence[Tool], cell_mm: float) -> Cutters:
    """Return what the core needs of tools on a field of a cell size."""
    listed = [_bands(tool, cell_mm) for tool in tools]
    bands = np.zeros((len(tools), max(len(edge) for edge in listed), BAND_COLUMNS))
    for row, edge in zip(bands, listed, strict=True):
        row[: len(edge)] = edge
    radius = outlines_of(tools)[:, 0]
    around = 2.0 * math.pi * radius / cell_mm
    return Cutters(
        bands=bands,
        used=np.array([len(edge) for edge in listed], dtype=np.int64),
        wall_bins=_round_up(np.clip(around, _FEWEST_BINS, _MOST_WALL_BINS)),
        ring_bins=_round_up(np.clip(around, _FEWEST_BINS, _MOST_RING_BINS)),
        teeth=np.array([float(tool.teeth) for tool in tools]),
        lag_mm=1.25 * np.sqrt(radius * cell_mm) + cell_mm,  # see `reading`
        above=np.array([_above(tool) for tool in tools]),
    )


def _round_up(bins: Floats) -> Ints:
    return (_BINS * np.ceil(bins / _BINS)).astype(np.int64)


def _bands(tool: Tool, cell_mm: float) -> Floats:
    """Return the edge in bands (s, 7) from the axis outwards, as fine as the cells resolve."""
    shape = shape_of(tool)
    long_mm = shape.corner_mm * shape.kappa_rad
    if shape.radius_mm > shape.arc_radius_mm + 1e-9:
        long_mm = math.inf
    count = int(np.clip(long_mm / (_CELLS_PER_BAND * cell_mm), _FEWEST_BANDS, _MOST_BANDS))
    parts = []
    for edge in (bottom_of(tool, _BOTTOM_BANDS), slices_of(tool, count)):
        cos = np.where(np.abs(edge.cos_kappa) < 1e-9, 0.0, edge.cos_kappa)
        half = 0.5 * edge.db_mm * cos
        low, high = edge.radius_mm - half, edge.radius_mm + half
        parts.append(
            np.stack([edge.z_low_mm, edge.z_high_mm, low, high, edge.sin_kappa, cos, edge.db_mm], axis=1)
        )
    bands = np.concatenate(parts)
    bands[1:, 2] = bands[:-1, 3]  # a ring between two bands is read once
    return bands


def _above(tool: Tool) -> tuple[float, float, float, float]:
    """Return radius and lower end of shank and holder; radius 0 where it is not known."""
    shank = tool.shank_diameter_mm / 2.0 if tool.shank_diameter_mm is not None else 0.0
    known = tool.holder_diameter_mm is not None and tool.stick_out_mm is not None
    holder = (tool.holder_diameter_mm or 0.0) / 2.0 if known else 0.0
    return shank, shape_of(tool).flute_mm, holder, tool.stick_out_mm or 0.0


def _air(count: int) -> Result:
    """Return the result of samples that cut nothing."""
    return Result(
        force_N=np.zeros((count, 3)),
        moment_Nmm=np.zeros((count, 3)),
        torque_Nmm=np.zeros(count),
        a_p_mm=np.zeros(count),
        a_e_mm=np.zeros(count),
        phi_rad=np.full((count, 2 * ARCS), np.nan),
        ramp_rad=np.zeros(count),
        centre_mm=np.zeros(count),
        overlap_mm=np.zeros((count, 3)),
        is_read=np.zeros(count, dtype=np.bool_),
    )
