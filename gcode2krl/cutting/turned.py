"""Engagement and mean force along a motion whose axis turns, by cutting it out of dexels."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints32
from gcode2krl.cell.sections import Tool
from gcode2krl.compiled.core import (
    FLOAT,
    FLOATS,
    INT,
    OUT_BOOLS,
    OUT_FLOATS,
    OUT_INTS,
    StructOf,
    core_function,
)
from gcode2krl.cutting.cutter import shape_of
from gcode2krl.cutting.dexels import DEXELS, Dexels, near_of
from gcode2krl.cutting.edge import BAND_COLUMNS, CUTTERS, WORK, Cutters, new_work
from gcode2krl.cutting.engagement import Engaged, air, bands_of
from gcode2krl.cutting.reading import ARCS, RESULT
from gcode2krl.cutting.records import copied, followed, taken
from gcode2krl.tables import lengths

CONTACT_NUMBERS = 18 + 2 * ARCS
"""What the core keeps of the sample that was read last."""
PROGRESS = 2
"""Numbers that say how far a motion has come: the last point that is cut, the last that is read."""
NODES_PER_DIAMETER = 10.0
_STEP_OF_DIAMETER = 0.4
"""Longest step of the removal."""
_BINS_PER_TURN = 96, 192
_BAND_OF_DIAMETER, _BAND_CELLS = 1.0 / 16.0, 4.0
_ABOVE_MM = 60.0
"""How far up a shank whose holder is not known, and a holder, are held against the stock: assumed."""


class TurnedPoints(NamedTuple):
    """The path (k) of a tool whose axis turns, in ``$BASE``: samples, and points that only shape it."""

    position_mm: Floats
    """(k, 3) tips."""
    axis: Floats
    """(k, 3) from tip to holder."""
    feed_mm: Floats
    """(k, 3) way of the tip while a tooth turns to the place of the next."""
    swing: Floats
    """(k, 3) how much the axis changes meanwhile."""
    tool: Ints32
    """(k,) row of the tools."""
    rapid: Bools
    """(k,) True where the sweep that leads to the point must not meet material."""
    wanted: Bools
    """(k,) True at samples."""


class Turned(NamedTuple):
    """What the core needs of such a path, and of the tools."""

    position_mm: Floats
    axis: Floats
    feed_mm: Floats
    swing: Floats
    tool: Ints32
    rapid: Bools
    wanted: Bools
    way_mm: Floats
    """(k,) along the path, turns included."""
    first: Bools
    """(k,) True where no sweep leads to the point."""
    node: Bools
    """(k,) True where the path is read in any case, and cut in between."""
    bodies: Floats
    """(t, 6) radius of the flat bottom, of the corner arc, sin and cos of the side's edge angle, radius,
    top."""
    longest_mm: Floats
    """(t,) longest step."""


TURNED = StructOf.record(Turned)
_mark = core_function("cutting_mark_turned", TURNED, FLOATS, OUT_BOOLS)
_cut = core_function(
    "cutting_turned",
    *(DEXELS, TURNED, CUTTERS, FLOATS, WORK, FLOAT, INT),
    *(OUT_INTS, OUT_FLOATS, OUT_FLOATS, OUT_FLOATS, RESULT),
    returns=INT,
)


class _Waiting(NamedTuple):
    points: TurnedPoints
    way_mm: Floats
    number: Floats
    """(k,) samples before the point."""
    first: Bools
    node: Bools


class TurnedEngagement:
    """A motion that is cut out of dexels, point after point, and what is read at its samples.

    A sample is read at its own position, before the material there is cut. Forces are means over a revolution
    of a right-hand tool turning clockwise (M3) by `slices.arc_force`, each band of the edge with the feed of
    its own height. How many points are given at a time changes nothing.
    """

    def __init__(
        self,
        dexels: Dexels,
        tools: Sequence[Tool],
        law: Floats,
        nodes_per_diameter: float = NODES_PER_DIAMETER,
    ) -> None:
        """Take the material, which is cut, and what to cut it with."""
        cell_mm = float(dexels.cell_mm.max())
        self.dexels, self._law = dexels, law
        self._bodies = np.array([body_of(tool) for tool in tools])
        radius = self._bodies[:, 4]
        self._apart_mm = 2.0 * radius / nodes_per_diameter
        self._longest_mm = longest_step(self._bodies)
        self._cutters = _cutters(tools, cell_mm, self._apart_mm)
        self._progress, self._contact = np.array([0, -1], dtype=np.int64), np.zeros(CONTACT_NUMBERS)
        none, empty, vectors = np.zeros(0, dtype=np.bool_), np.zeros(0), np.zeros((0, 3))
        points = TurnedPoints(*(vectors,) * 4, np.zeros(0, dtype=np.int32), none, none)
        self._waiting = _Waiting(points, empty, empty, none, none)
        self._samples = 0
        self._work = new_work()

    def take(self, points: TurnedPoints, ends: bool) -> Engaged:
        """Go on along the path; return what is read at the samples up to the last node.

        The motion ``ends`` with these points: then there is a row for every sample.
        """
        return self.contacts(points, ends)[0]

    def contacts(self, points: TurnedPoints, ends: bool) -> tuple[Engaged, Floats]:
        """Return the same, and the area of contact of each sample in mm²."""
        waiting = self._extended(points, ends)
        count, before = len(waiting.way_mm), int(self._progress[1]) + 1
        result, rapid_mm, area_mm2 = air(count), np.zeros(count), np.zeros(count)
        path = self._path(waiting)
        while count and not _cut(
            *(self.dexels, path, self._cutters, self._law, self._work, near_of(self.dexels), ends),
            *(self._progress, self._contact, rapid_mm, area_mm2, result),
        ):
            self.dexels = self.dexels.with_room()
        cut, read = self._progress.tolist()
        rows = before + np.flatnonzero(waiting.points.wanted[before : read + 1])
        met = np.flatnonzero(rapid_mm)
        settled = int(waiting.number[cut]) if count else 0
        engaged = Engaged(taken(result, rows), waiting.number[met].astype(np.int64), rapid_mm[met], settled)
        self._forget(waiting, min(cut, max(read, 0)))
        return engaged, area_mm2[rows]

    def bodies_in(self, ends_mm: Floats, radius_mm: Floats) -> tuple[Floats, Floats]:
        """Return how deep capsules (n) are in what stands now, and where (n, 3); see `Dexels.bodies_in`."""
        return self.dexels.bodies_in(ends_mm, radius_mm)

    def _extended(self, points: TurnedPoints, ends: bool) -> _Waiting:
        old = self._waiting
        joined = followed(old.points, points)
        known = len(old.way_mm)
        tip, axis, tool = joined.position_mm, joined.axis, joined.tool
        step = lengths(np.diff(tip, axis=0, prepend=tip[:1]))
        step += 2.0 * self._bodies[tool, 4] * lengths(np.diff(axis, axis=0, prepend=axis[:1]))
        way = np.cumsum(np.concatenate([old.way_mm[-1:] if known else [0.0], step[max(known, 0) :]]))[1:]
        first = np.concatenate([[True], tool[1:] != tool[:-1]])
        number = self._samples + np.cumsum(joined.wanted) - joined.wanted
        way = np.concatenate([old.way_mm, way])
        waiting = _Waiting(joined, way, number.astype(np.float64), first, first)
        node = np.zeros(len(tool), dtype=np.bool_)
        if len(tool):
            _mark(self._path(waiting), self._apart_mm, node)
            node[-1] = ends
        return waiting._replace(node=node)

    def _path(self, waiting: _Waiting) -> Turned:
        columns = (waiting.way_mm, waiting.first, waiting.node)
        return Turned(*waiting.points, *columns, self._bodies, self._longest_mm)

    def _forget(self, waiting: _Waiting, row: int) -> None:
        """Forget the points behind which both cutting and reading are."""
        self._samples += int(np.count_nonzero(waiting.points.wanted[:row]))
        way_mm, number = waiting.way_mm[row:].copy(), waiting.number[row:].copy()
        first, node = waiting.first[row:].copy(), waiting.node[row:].copy()
        points = copied(waiting.points, slice(row, None))
        self._waiting = _Waiting(points, way_mm, number, first, node)
        self._progress -= row


def body_of(tool: Tool) -> tuple[float, ...]:
    """Return a row of `Turned.bodies`."""
    shape = shape_of(tool)
    sine, cosine = math.sin(shape.kappa_rad), math.cos(shape.kappa_rad)
    cosine = 0.0 if abs(cosine) < 1e-9 else cosine
    return shape.bottom_mm, shape.corner_mm, sine, cosine, shape.radius_mm, shape.flute_mm


def longest_step(bodies: Floats) -> Floats:
    """Return the longest step (t,) of the removal in mm."""
    longest_mm: Floats = _STEP_OF_DIAMETER * 2.0 * bodies[:, 4]
    return longest_mm


def _cutters(tools: Sequence[Tool], cell_mm: float, apart_mm: Floats) -> Cutters:
    listed = [_short_bands(tool, cell_mm) for tool in tools]
    most = max(len(edge) for edge in listed)
    bands = np.zeros((len(tools), most, BAND_COLUMNS))
    for row, edge in zip(bands, listed, strict=True):
        row[: len(edge)] = edge
    radius = np.array([shape_of(tool).radius_mm for tool in tools])
    bins = 8 * np.ceil(np.clip(2.0 * math.pi * radius / cell_mm, *_BINS_PER_TURN) / 8.0).astype(np.int64)
    return Cutters(
        bands=bands.reshape(len(tools), -1),
        used=np.array([len(edge) for edge in listed], dtype=np.int64),
        wall_bins=bins,
        ring_bins=bins,
        teeth=np.array([float(tool.teeth) for tool in tools]),
        lag_mm=np.sqrt(radius * cell_mm) + apart_mm,
        above=np.array([_above(tool) for tool in tools]),
    )


def _short_bands(tool: Tool, cell_mm: float) -> Floats:
    """Return the edge in bands (s, 7) as for a height field, the tall ones in pieces."""
    tall_mm = max(_BAND_OF_DIAMETER * tool.diameter_mm, _BAND_CELLS * cell_mm)
    pieces = []
    for band in bands_of(tool, 0.5 * cell_mm):
        count = max(1, math.ceil((band[1] - band[0]) / tall_mm - 1e-9))
        share = np.linspace(0.0, 1.0, count + 1)
        z, r = (band[k] + share * (band[k + 1] - band[k]) for k in (0, 2))
        others = np.broadcast_to([band[4], band[5], band[6] / count], (count, 3))
        pieces.append(np.column_stack([z[:-1], z[1:], r[:-1], r[1:], others]))
    return np.concatenate(pieces)


def _above(tool: Tool) -> tuple[float, ...]:
    """Return radius, lower and upper end of shank and holder; radius 0 where it is not known."""
    flute = shape_of(tool).flute_mm
    stick_out = tool.stick_out_mm
    shank = (tool.shank_diameter_mm or 0.0) / 2.0
    known = tool.holder_diameter_mm is not None and stick_out is not None
    holder = (tool.holder_diameter_mm or 0.0) / 2.0 if known else 0.0
    above = stick_out if stick_out is not None else flute + _ABOVE_MM
    return shank, flute, above, holder, above, above + _ABOVE_MM
