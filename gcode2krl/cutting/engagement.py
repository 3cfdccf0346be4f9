"""Engagement and mean force along a motion, by cutting it out of a height field.

The field is divided into strips, one for each thread. Each strip removes every sweep that comes near it, in
the order of time, and reads the samples in it. The reading of a sample does not depend on the division, so
any number of threads gives the same result to the last bit.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.cell.sections import Tool
from gcode2krl.compiled.core import FLOATS, INTS, OUT_FLOATS, core_function
from gcode2krl.compiled.threads import cores, in_threads
from gcode2krl.cutting.cutter import Shape, bottom_of, shape_of, slices_of
from gcode2krl.cutting.edge import BAND_COLUMNS, Cutters, new_work
from gcode2krl.cutting.height_field import HeightField
from gcode2krl.cutting.reading import (
    ARCS,
    NODE_NUMBERS,
    PROGRESS,
    Result,
    cut_strip,
    mark_walls,
    number_walls,
)
from gcode2krl.cutting.records import taken
from gcode2krl.cutting.sweep import BALL, FLAT, GRID, LANES, OTHER, Path, Samples
from gcode2krl.cutting.way import Points, Way
from gcode2krl.tables import chord_directions

NODES_PER_DIAMETER = 20.0
_STRETCH = {BALL: 5.0, FLAT: 1.0, OTHER: 0.5}
"""How much farther apart the nodes of a kind of cutter lie: the force of a ball hardly depends on how far
the field lags, that of a bull-nose does."""
_NEW_PER_DIAMETER = 0.1
"""Way behind a turn or a change for which every sample is read, in diameters."""
_LONGEST_OF_LAG = 0.5
"""Longest sweep, as a share of the distance by which the field lags: longer ones would lag farther."""
_BINS = 16
_FEWEST_BINS = 96
_MOST_WALL_BINS = 960
_MOST_RING_BINS = 128
_CELLS_PER_BAND = 4.0
_FEWEST_BANDS, _MOST_BANDS = 6, 12
_BOTTOM_BANDS = 10
"""Of a flat bottom: with four, the force of thin slivers below it is 6.5 % too large, with twelve 1.1 %."""
_MARGIN_CELLS = 4
_BEFORE = 2
"""Corners before the last sweep that was removed on which the next one depends."""
_FEW_SAMPLES = 2000
"""Samples below which a second thread does not pay."""

_bodies = core_function("cutting_bodies", GRID, FLOATS, FLOATS, INTS, OUT_FLOATS, OUT_FLOATS)


class Engaged(NamedTuple):
    """What `Engagement.take` finds."""

    result: Result
    """A row for each of the samples that follow those of the call before."""
    rapid_row: Ints
    """(r,) samples, counted from the first of the motion, before which a rapid has cut material off."""
    rapid_mm: Floats
    """(r,) how deep."""
    settled: int
    """Nothing more will be said of rapids on the way to the samples before this one."""


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

    Parameters
    ----------
    position_mm, tool, rapid, f_z_mm, direction, wanted : columns (k,) of `Points`; ``direction`` is by
        default that of the chords, ``wanted`` True everywhere.
    law : (8,) force law of `law.law_array`.
    threads, nodes_per_diameter : as in `Engagement`.
    """
    position = np.ascontiguousarray(position_mm, dtype=np.float64)
    tool = np.ascontiguousarray(tool, dtype=np.int32)
    wanted = np.ones(len(position), dtype=np.bool_) if wanted is None else wanted
    if not wanted.any():
        return air(0)
    first = np.concatenate([[True], tool[1:] != tool[:-1]])
    tangents = _tangents(position, first) if direction is None else direction
    engagement = Engagement(field, tools, law, position, threads, nodes_per_diameter)
    engaged = engagement.take(Points(position, tangents, tool, rapid, f_z_mm, wanted), ends=True)
    engagement.write_back(field)
    owner = np.minimum(engaged.rapid_row, len(engaged.result.a_p_mm) - 1)
    np.maximum.at(engaged.result.overlap_mm[:, 0], owner, engaged.rapid_mm)
    return engaged.result


class Engagement:
    """A motion that is cut out of a field, point after point, and what is read at its samples.

    A sample that is read is read at its own position, before the sweep that leads to it is removed; a sample
    between two nodes has what lies between theirs, with its own heading and feed. Forces are means over a
    revolution of a right-hand tool turning clockwise (M3), `slices.arc_force` summed over the edge; the
    moment is that of heights above the tip times lateral forces, and the torque. How many points are given
    at a time changes nothing.

    Material is a height field: exact heights over the middle of cells, walls left by a cutter's rim to a
    twentieth of a cell, edges of a mesh to half a cell. The tool axis does not tilt. The path between
    points is straight.
    """

    def __init__(
        self,
        field: HeightField,
        tools: Sequence[Tool],
        law: Floats,
        outlook_mm: Floats,
        threads: int | None = None,
        nodes_per_diameter: float = NODES_PER_DIAMETER,
    ) -> None:
        """Take the field, which is left as it is, and what to cut it with.

        Parameters
        ----------
        outlook_mm : (o, 3) points all over the path, by which the field is divided into strips.
        threads : how many; default: all cores.
        nodes_per_diameter : how many nodes there are while a flat tool goes its diameter; between two of them
            only what is not smooth is read. inf: every sample is read.
        """
        cell_mm = float(field.cell_mm.max())
        self._law, self._outlines = law, outlines_of(tools)
        self._cutters = _cutters(tools, cell_mm)
        widest_mm = float(max(self._outlines[:, 0].max(), self._cutters.above[:, ::2].max()))
        diameter_mm = 2.0 * self._outlines[:, 0]
        stretch = np.array([_STRETCH[int(kind)] for kind in self._outlines[:, -1]])
        self._apart_mm, self._new_mm = (
            diameter_mm / nodes_per_diameter * stretch,
            _NEW_PER_DIAMETER * diameter_mm,
        )
        # nodes are the samples that are nearest to the places meant
        self._farthest_mm = 2.0 * float(self._apart_mm.max())
        # how far around itself a strip reads: around a sample, and around the nodes beside it
        halo_mm = widest_mm + self._farthest_mm + _MARGIN_CELLS * cell_mm
        # one cell more: the grid begins with a whole one, and a sweep takes the disc at its start as cut
        self._reach_mm = halo_mm + float(self._outlines[:, 0].max()) + cell_mm
        self._axis = int(np.ptp(outlook_mm[:, 1]) > np.ptp(outlook_mm[:, 0]))
        bounds = _bounds(outlook_mm[:, self._axis], halo_mm, threads)
        self._strips = [_Strip(field, self._axis, *ends, halo_mm) for ends in pairwise(bounds)]
        self._way = Way(_LONGEST_OF_LAG * self._cutters.lag_mm, self._outlines[:, -1] == OTHER)

    def take(self, points: Points, ends: bool) -> Engaged:
        """Go on along the path; return what is read at the samples up to the last node that is certain.

        The motion ``ends`` with these points: then there is a row for every sample.
        """
        way = self._way
        way.extend(points, ends)
        samples, begins = way.samples(self._apart_mm, self._new_mm, ends)
        count = len(samples.way_mm)
        result = air(count)
        if count == 0:
            return Engaged(result, np.zeros(0, dtype=np.int64), np.zeros(0), 0)
        path, shown = way.path(self._outlines), self._strips[0].shown
        noted = in_threads(
            lambda strip: self._cut(strip, path, samples, ends, result), self._strips, len(self._strips)
        )
        rapid_mm = np.maximum.reduce(noted)
        cut = np.flatnonzero(rapid_mm)
        owner, shown = way.owner(shown + 1 + cut), self._strips[0].shown
        settled = int(way.owner(np.array([shown]))[0])
        way.forget()
        if way.is_long:
            self._drop_corners(len(path.way_mm), shown)
        return Engaged(taken(result, slice(begins, None)), owner, rapid_mm[cut], settled)

    def _cut(self, strip: "_Strip", path: Path, samples: Samples, ends: bool, result: Result) -> Floats:
        rapid_mm = np.zeros(len(path.way_mm) - 1 - strip.shown)
        cut_strip(
            *(strip.grid, path, samples, self._cutters, self._law, strip.low, strip.high, self._axis),
            *(self._reach_mm, self._farthest_mm, ends, new_work()),
            *(strip.progress, strip.node, rapid_mm, result),
        )
        return rapid_mm

    def _drop_corners(self, count: int, shown: int) -> None:
        """Drop the corners of sweeps that are removed and whose walls no strip shows."""
        kept = np.zeros(count, dtype=np.bool_)
        kept[max(shown - _BEFORE, 0) :] = True
        for strip in self._strips:
            mark_walls(strip.grid, kept)
        number = self._way.renumber(kept)
        for strip in self._strips:
            number_walls(strip.grid, number)
            strip.progress[:2] = number[strip.progress[:2]]

    def bodies_in(self, ends_mm: Floats, radius_mm: Floats) -> tuple[Floats, Floats]:
        """Return how deep capsules (n) are in what stands now, 0 where they are not, and where (n, 3).

        ``ends_mm`` (n, 6), in the frame of the field. The field lags a little behind the cutter.
        """
        ends, radius = np.ascontiguousarray(ends_mm), np.ascontiguousarray(radius_mm)
        bodies = [strip.bodies_in(ends, radius, self._axis) for strip in self._strips]
        deepest = np.argmax([depth for depth, _ in bodies], axis=0)
        rows = np.arange(len(ends))
        depth, place = (np.stack(columns) for columns in zip(*bodies, strict=True))
        return depth[deepest, rows], place[deepest, rows]

    def write_back(self, field: HeightField) -> None:
        """Write what is left into the field that was cut."""
        for strip in self._strips:
            strip.write_back(field, self._axis)


class _Strip:
    """A strip of the field, and how far it has been cut."""

    def __init__(self, field: HeightField, axis: int, low: float, high: float, halo_mm: float) -> None:
        self.low, self.high = low, high
        begin, end = field.cells(axis, low - halo_mm, high + halo_mm)
        self._own = field.cells(axis, low, high)
        self._skip = self._own[0] - begin
        self.grid = field.grid(axis, begin, end)
        self.progress, self.node = np.zeros(PROGRESS, dtype=np.int64), np.zeros(NODE_NUMBERS)

    @property
    def shown(self) -> int:
        """The last point of the path whose sweep has been removed."""
        return int(self.progress[1])

    def bodies_in(self, ends_mm: Floats, radius_mm: Floats, axis: int) -> tuple[Floats, Floats]:
        rows, columns = self.grid.height.shape
        across = (self._skip + 1, self._skip + 1 + self._own[1] - self._own[0])
        inner = (1, rows - 1, *across) if axis == 0 else (*across, 1, columns - LANES)
        depth, place = np.empty(len(ends_mm)), np.empty((len(ends_mm), 3))
        _bodies(self.grid, ends_mm, radius_mm, np.array(inner, dtype=np.int64), depth, place)
        return depth, place

    def write_back(self, field: HeightField, axis: int) -> None:
        field.take_back(self.grid, axis, *self._own, self._skip)


def _tangents(position_mm: Floats, first: Bools) -> Floats:
    """Return the tangents (n, 3) of chords, none of which joins two tools."""
    parts = np.split(position_mm, np.flatnonzero(first)[1:])
    return np.concatenate([chord_directions(part) for part in parts])


def _bounds(along_mm: Floats, halo_mm: float, threads: int | None) -> list[float]:
    """Return the borders of strips with equally many samples each, none narrower than useful."""
    strips = min(threads or cores(), max(1, int(np.ptp(along_mm) / halo_mm)))
    if threads is None and len(along_mm) < _FEW_SAMPLES:
        strips = 1
    shares = np.linspace(0.0, 1.0, strips + 1)[1:-1]
    inner = np.quantile(along_mm, shares).tolist() if len(shares) else []
    return [-math.inf, *inner, math.inf]


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
    listed = [bands_of(tool, cell_mm) for tool in tools]
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


def bands_of(tool: Tool, cell_mm: float) -> Floats:
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


def air(count: int) -> Result:
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
