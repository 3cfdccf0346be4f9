"""The column tables that pass between the stages, and their one shape check.

A table is a frozen dataclass of numpy columns, rows first, read-only once built. A stage makes a new
table; it never changes another's.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.exchange.table import Table as Table
from gcode2krl.exchange.table import column, columns_of, derived_column
from gcode2krl.units import DEG_PER_RAD


class Event(NamedTuple):
    """Something other than motion that happens while the tool stands at ``row``, after its move.

    ``kind`` is ``tool`` (values: ``tool``), ``spindle`` (``rpm``, signed, 0 = off), ``coolant`` (``mist``,
    ``flood``: what is on afterwards) or ``message`` (``text``, ``p`` where given). All but ``tool`` have
    ``m``, the M number (-1 for a mere text), and every event has ``line``; ``implied`` marks what a tool
    change or the program's end does without its own word, ``dwell_s`` is the part of the row's dwell
    that lies before the event.
    """

    row: int
    kind: str
    values: dict[str, Any]


@dataclass(frozen=True)
class Restart:
    """Where a program begins that does not run from its start (`restart.rows`)."""

    line: int
    """G-code line that was asked for."""
    begins_line: int
    """G-code line whose move is the first; the one before ``line`` where ``line`` begins in material."""
    way_rows: int = 0
    """Rows of the Toolpath, from row 1 on, that lead to the first position."""
    material: object = field(default=None, repr=False)
    """The material that the lines before have left, `cutting.height_field` or `cutting.dexels`; None: raw."""


@dataclass(frozen=True)
class Simplified:
    """What Targets leave out of the G-code's corners (`program.merging`)."""

    tolerance_mm: float
    """How far a corner that is left out may be from the new move."""
    moves: int = 0
    """Feed moves of the G-code."""
    left_out: int = 0
    """Corners between them."""
    largest_mm: float = 0.0
    """How far one is off at most."""
    worst_line: int = 0
    """G-code line of the move that is off most."""


AnyTable = TypeVar("AnyTable", bound=Table)


def rows_of(table: AnyTable, start: int, end: int) -> AnyTable:
    """Return rows of a table, which share its memory; findings and other fields stay."""
    columns = {spec.name: getattr(table, spec.name)[start:end] for spec in columns_of(table)}
    return replace(table, **columns)


def rows_at(table: AnyTable, rows: NDArray[np.int64]) -> AnyTable:
    """Return chosen rows of a table."""
    columns = {spec.name: getattr(table, spec.name)[rows] for spec in columns_of(table)}
    return replace(table, **columns)


BLOCK_ROWS = 32_768
"""Rows of a table that go through the stages together: two chunks, some 15 MB in all stages."""


def blocks_of(table: AnyTable, rows: int = BLOCK_ROWS) -> Iterator[tuple[AnyTable, bool]]:
    """Yield a table in blocks of rows, and whether it ends with each."""
    for start in range(0, max(len(table), 1), rows):
        yield rows_of(table, start, start + rows), start + rows >= len(table)


class Gathered(Generic[AnyTable]):
    """A table that comes in blocks, each written where it belongs: nothing is held twice."""

    def __init__(self, rows: int) -> None:
        """Take the number of rows of the whole."""
        self._rows, self._done = rows, 0
        self._first: AnyTable | None = None
        self._columns: dict[str, NDArray[Any]] = {}

    def take(self, block: AnyTable) -> None:
        """Take the rows that follow."""
        self._first = block if self._first is None else self._first
        for spec in columns_of(block):
            self._columns[spec.name] = self._with(getattr(block, spec.name), self._columns.get(spec.name))
        self._done += len(block)

    def _with(self, new: NDArray[Any], known: NDArray[Any] | None) -> NDArray[Any]:
        """Return a column (rows, …) with new rows; what is one row throughout stays one row in memory."""
        shape = (self._rows, *new.shape[1:])
        if len(new) and new.strides[0] == 0:
            if known is None:
                return np.broadcast_to(new[0], shape)
            if known.strides[0] == 0 and np.array_equal(known[0], new[0], equal_nan=True):
                return known
        if known is None:
            known = np.empty(shape, new.dtype)
        elif self._rows > 1 and known.strides[0] == 0:
            known = known.copy()
        known[self._done : self._done + len(new)] = new
        return known

    def table(self) -> AnyTable:
        """Return the whole; findings and other fields are those of the first block."""
        if self._first is None or self._done != self._rows:
            raise ValueError(f"{self._done} of {self._rows} rows have come")
        columns: dict[str, Any] = dict(self._columns)
        return replace(self._first, **columns)


def joined(first: AnyTable, *others: AnyTable) -> AnyTable:
    """Return the rows of tables one after the other; findings and other fields are those of the first."""
    tables = [table for table in (first, *others) if len(table)]
    if len(tables) < 2:
        return tables[0] if tables else first
    columns: dict[str, Any] = {}
    for spec in columns_of(first):
        columns[spec.name] = joined_columns([getattr(table, spec.name) for table in tables])
    return replace(first, **columns)


def joined_columns(parts: list[NDArray[Any]]) -> NDArray[Any]:
    """Return columns joined; what is one row throughout stays one row in memory."""
    if len(parts) == 1:
        return parts[0]
    row = parts[0][:1]
    if all(part.strides[0] == 0 and np.array_equal(part[:1], row) for part in parts):
        return np.broadcast_to(row[0], (sum(map(len, parts)), *row.shape[1:]))
    return np.concatenate(parts)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Toolpath(Table):
    """What the G-code says: a row per straight move, row 0 the start point."""

    position_mm: Floats = column(np.float64, 3)
    """(n, 3) tool tip in the frame in which work offsets are stated (``$BASE``)."""
    axis: Floats = column(np.float64, 3)
    """(n, 3) unit vector from tip to holder."""
    rapid: Bools = column(np.bool_)
    feed_mm_s: Floats = column(np.float64)
    """(n,) programmed speed, inf on rapids."""
    spindle_rad_s: Floats = column(np.float64)
    """(n,) positive for M3."""
    tool: Ints32 = column(np.int32)
    """(n,) tool in the spindle during the row; 0 = nobody says which."""
    exact_stop: Bools = column(np.bool_)
    tolerance_mm: Floats = column(np.float64)
    """(n,) blend tolerance of ``G64 P``, NaN = none."""
    dwell_s: Floats = column(np.float64)
    source_line: Ints32 = column(np.int32)
    """(n,) 1-based line of the file."""
    arc: Ints32 = column(np.int32)
    """(n,) number of the arc this row is a chord of, or -1."""
    machine: Bools = column(np.bool_)
    """(n,) rows from G28, G30 and G53."""
    known: Bools = column(np.bool_, 3)
    """(n, 3) True where the axis has been programmed in the part frame since the start, the last machine
    move of that axis or (Z) the last change of tool length offset. Only rows that are all True are
    positions a robot may be sent to."""
    length_offset_mm: Floats = column(np.float64)
    """(n,) tool length offset in force (G43), NaN = none (G49)."""
    length_offset_tool: Ints32 = column(np.int32)
    """(n,) the tool whose length that is (H), -1 = none."""
    events: tuple[Event, ...] = ()
    source: str = ""
    restart: Restart | None = None
    """None: the program runs from its start."""

    def facts(self) -> str:
        """Return how many moves there are, and the program's name."""
        return f"{max(len(self) - 1, 0)} moves{_of(self.source)}"

    def is_position(self) -> Bools:
        """Return (n,) True where X, Y and Z are all known: a point a robot may be sent to."""
        x, y, z = self.known.T
        result: Bools = x & y & z
        return result


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Targets(Table):
    """What the KRL program says: a row per motion; planned, written and read back as this one table."""

    position_mm: Floats = column(np.float64, 3)
    """(p, 3) tool tip in ``$BASE``."""
    rotation: Floats = column(np.float64, 4)
    """(p, 4) quaternion x, y, z, w of the tool frame in ``$BASE``; z points from tip to holder."""
    ptp: Bools = column(np.bool_)
    home: Bools = column(np.bool_)
    """(p,) True for PTP HOME, which is written as joint angles."""
    speed_mm_s: Floats = column(np.float64)
    """(p,) path speed, NaN on PTP."""
    cdis_mm: Floats = column(np.float64)
    """(p,) approximation distance at the end of this motion, 0 = exact stop."""
    wait_s: Floats = column(np.float64)
    """(p,) dwell at the target."""
    move: Ints32 = column(np.int32)
    """(p,) row of Toolpath, -1 = added (HOME, approach, final retract)."""
    source_line: Ints32 = column(np.int32)
    """(p,) line of the G-code, 0 = added."""
    tool: Ints32 = column(np.int32)
    """(p,) tool number whose frame moves."""
    external: Floats = derived_column(np.float64, 6, on_disk="e")
    """(p, 6) E1 to E6 in mm and degrees, 0 without the axis."""
    events: tuple[Event, ...] = ()
    source: str = ""
    restart: Restart | None = None
    """That of the Toolpath."""
    simplified: Simplified | None = None
    """None: every corner of the G-code is a target."""
    correction_mm: float = 0.0
    """How far targets are moved at most, by offline compensation."""

    def __post_init__(self) -> None:
        _without_external(self, len(self.tool))
        super().__post_init__()

    def facts(self) -> str:
        """Return how many motions there are, and the program's name."""
        return f"{len(self)} motions{_of(self.source)}"


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Motion(Table):
    """What the controller will command: a row per time sample, from the first programmed position at rest
    to the end of the last programmed move."""

    time_s: Floats = column(np.float64)
    position_mm: Floats = column(np.float64, 3)
    """(m, 3) tool tip in ``$BASE``."""
    rotation: Floats = column(np.float64, 4)
    """(m, 4) quaternion x, y, z, w of the tool frame in ``$BASE``."""
    speed_mm_s: Floats = column(np.float64)
    acceleration_mm_s2: Floats = column(np.float64)
    """(m,) magnitude of the acceleration vector of the tip."""
    jerk_mm_s3: Floats = column(np.float64)
    """(m,) magnitude of the jerk vector of the tip."""
    path_mm: Floats = column(np.float64)
    """(m,) arc length along the blended path."""
    move: Ints32 = column(np.int32)
    """(m,) row of Toolpath."""
    corner: Bools = column(np.bool_)
    """(m,) True inside an approximated corner."""
    tool: Ints32 = column(np.int32)
    """(m,) tool number whose frame moves."""
    direction: Floats = derived_column(np.float64, 3)
    """(m, 3) unit tangent of the path at the sample, zero in a turn on the spot; where it is not given, that
    of the chords beside the sample."""
    external: Floats = derived_column(np.float64, 6, on_disk="e")
    """(m, 6) E1 to E6 in mm and degrees, 0 without the axis."""

    def __post_init__(self) -> None:
        _without_external(self, len(self.tool))
        if self.direction is None:
            object.__setattr__(self, "direction", chord_directions(np.asarray(self.position_mm, np.float64)))
        super().__post_init__()

    def facts(self) -> str:
        """Return how many samples there are, and the time they take."""
        return f"{len(self)} samples" + (f", {self.time_s[-1]:.1f} s" if len(self) else "")


def _without_external(table: Table, rows: int) -> None:
    """Let the external axes of a table that does not state them stand at 0, one row for all."""
    if getattr(table, "external", 0) is None:
        object.__setattr__(table, "external", np.broadcast_to(0.0, (rows, 6)))


def lengths(vectors: Floats) -> Floats:
    """Return the lengths (m,) of vectors (m, 3), to the bit as `numpy.linalg.norm` in a third of its time."""
    x, y, z = vectors.T
    sums, square = x * x, y * y
    sums += square
    sums += np.multiply(z, z, out=square)
    return np.asarray(np.sqrt(sums, out=sums))


STRAIGHT_ON = 0.985
"""Cosine of the turn at a sample, 10 degrees, above which its tangent is the mean of both chords."""
_NO_CHORD_MM = 1e-9


def chord_directions(position_mm: Floats) -> Floats:
    """Return unit tangents (m, 3) from the chords of positions: of both beside a sample, at a corner of the
    one before it; zero where nothing moves."""
    position = position_mm.reshape(-1, 3)
    before = np.diff(position, axis=0, prepend=position[:1])
    after = np.roll(before, -1, axis=0)
    after[-1:] = 0.0
    from_mm, to_mm = np.linalg.norm(before, axis=1), np.linalg.norm(after, axis=1)
    begins = from_mm < _NO_CHORD_MM
    straight = (before * after).sum(axis=1) > STRAIGHT_ON * from_mm * to_mm
    straight &= ~begins & (to_mm > _NO_CHORD_MM)
    tangent = np.where(begins[:, None], after, np.where(straight[:, None], before + after, before))
    length_mm = np.linalg.norm(tangent, axis=1, keepdims=True)
    return np.where(length_mm > _NO_CHORD_MM, tangent / np.maximum(length_mm, _NO_CHORD_MM), 0.0)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Joints(Table):
    """Joint angles along a Motion or at Targets."""

    q_rad: Floats = column(np.float64, 6)
    """(m, 6) KUKA signs and zero; NaN where out of reach."""
    qd_rad_s: Floats = column(np.float64, 6)
    """(m, 6) joint speeds; NaN for Targets."""
    limit_margin_rad: Floats = column(np.float64)
    """(m,) distance to the nearest joint limit, negative beyond it."""
    sigma_min: Floats = column(np.float64)
    """(m,) smallest singular value of the Jacobian, its translations over the length of the stretched arm."""
    status: Ints32 = column(np.int32)
    """(m,) KUKA's S bits."""
    turn: Ints32 = column(np.int32)
    """(m,) KUKA's T bits."""
    external: Floats = derived_column(np.float64, 6, on_disk="e")
    """(m, 6) E1 to E6 in mm and degrees, 0 without the axis."""

    def __post_init__(self) -> None:
        _without_external(self, len(self.status))
        super().__post_init__()

    def facts(self) -> str:
        """Return how many rows there are, and how near a limit comes."""
        return f"{len(self)} rows, nearest limit {_most(-self.limit_margin_rad, -DEG_PER_RAD, '.1f')} deg"


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Clearance(Table):
    """How near arm, spindle and tool come to anything along a Motion."""

    clearance_mm: Floats = column(np.float64)
    """(m,) the least distance since the sample before, less than 0 where they overlap; `HORIZON_MM` of
    `collision` where nothing is as near; NaN where the robot goes another way than the Motion (PTP)."""
    clearance_link: Ints32 = column(np.int32)
    """(m,) what of the robot that is, a place in ``links``; -1: nothing is as near."""
    clearance_obstacle: Ints32 = column(np.int32)
    """(m,) what it is near, a place in ``obstacles``."""
    links: tuple[str, ...] = ()
    obstacles: tuple[str, ...] = ()

    def facts(self) -> str:
        """Return how many samples there are, and the least distance."""
        return f"{len(self)} samples, nearest {_most(-self.clearance_mm, -1.0, '.1f')} mm"

    def names(self) -> tuple[NDArray[np.str_], NDArray[np.str_]]:
        """Return link and obstacle (m,) by name, "" where nothing is near."""
        both = ((self.clearance_link, self.links), (self.clearance_obstacle, self.obstacles))
        link, obstacle = (np.array([*names, ""], dtype=np.str_)[number] for number, names in both)
        return link, obstacle


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Forces(Table):
    """Cutting forces along a Motion: means over one spindle revolution, on the tool."""

    force_base_N: Floats = column(np.float64, 3)
    """(m, 3) along the axes of ``$BASE``; exactly zero in air."""
    moment_base_Nmm: Floats = column(np.float64, 3)
    """(m, 3) about the tool tip, along the axes of ``$BASE``."""
    peak_N: Floats = column(np.float64)
    """(m,) largest force of a revolution; for warnings."""
    torque_Nmm: Floats = column(np.float64)
    """(m,) about the tool axis; the spindle must supply it."""
    a_p_mm: Floats = column(np.float64)
    """(m,) axial depth of cut."""
    a_e_mm: Floats = column(np.float64)
    """(m,) width of cut normal to the feed."""
    phi_rad: Floats = column(np.float64, None)
    """(m, 2k) entry and exit angles of the engagement arcs from the feed normal, NaN padded."""
    tool: Ints32 = column(np.int32)
    """(m,) tool number that cuts."""
    relative_band: float = 0.0
    """Half-width of the 90 % band of the forces, relative."""

    def facts(self) -> str:
        """Return how many samples there are, and the largest force."""
        return f"{len(self)} samples, up to {_most(lengths(self.force_base_N), 1.0, '.0f')} N"


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class PilotForce(Table):
    """What the pilot force of a program is made from: of a Motion and its forces a row per time sample."""

    time_s: Floats = column(np.float64)
    path_mm: Floats = column(np.float64)
    speed_mm_s: Floats = column(np.float64)
    acceleration_mm_s2: Floats = column(np.float64)
    line: Ints32 = column(np.int32)
    """(m,) line of the G-code."""
    force_N: Floats = column(np.float64, 3)
    """(m, 3) in the pilot frame."""
    deflection_mm: Floats = column(np.float64, 3)
    """(m, 3) in the pilot frame; NaN where it is not predicted."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Deflection(Table):
    """How far the tool tip bends away under the forces along a Motion."""

    deflection_base_mm: Floats = column(np.float64, 3)
    """(m, 3) along the axes of ``$BASE``."""
    correction_base_mm: Floats = column(np.float64, 3)
    """(m, 3) minus the deflection, projected normal to the feed (eq. 10 of Haehn & Weigold 2020)."""
    relative_band: float = 0.0
    """Half-width of the 90 % band of the deflection, relative: forces and stiffness."""

    def facts(self) -> str:
        """Return how many samples there are, and the largest deflection."""
        return f"{len(self)} samples, up to {_most(lengths(self.deflection_base_mm), 1.0, '.3g')} mm"


class PartHistory(NamedTuple):
    """How a part comes about, in cells (r, c) of a field normal to the tool axis; row = y, column = x."""

    to_field: Floats
    """(3, 3) rotation from ``$BASE`` to the frame of the field, whose z is the tool axis."""
    origin_mm: Floats
    """(2,) low corner."""
    cell_mm: Floats
    """(2,) size of a cell along x and y."""
    bottom_mm: float
    raw_mm: Floats
    """(r, c) mean height of the material over each cell before the first cut."""
    cell: Ints32
    """(e,) events in the order of time: a cell, row by row, got lower,"""
    sample: NDArray[np.int64]
    """(e,) by this row of the Motion, which lowered it,"""
    height_mm: Floats
    """(e,) to this mean height."""
    left_by: NDArray[np.int64]
    """(r, c) the row of the Motion that left the finished surface, -1 where nothing was cut."""
    normal: Floats
    """(r, c, 3) unit normal out of the finished surface along ``$BASE``, NaN where nothing was cut."""

    def heights_mm(self, sample: int | None = None) -> Floats:
        """Return the heights (r, c) at a row of the Motion; default: of the finished part."""
        heights = self.raw_mm.copy()
        done = len(self.cell) if sample is None else int(np.searchsorted(self.sample, sample, side="right"))
        heights.ravel()[self.cell[:done]] = self.height_mm[:done]  # of several the last one counts
        return heights

    def volume_mm3(self, sample: int | None = None) -> float:
        """Return the volume that stands at a row of the Motion; default: of the finished part."""
        return float((self.heights_mm(sample) - self.bottom_mm).sum() * self.cell_mm.prod())

    def error_mm(self, deviation_mm: Floats) -> Floats:
        """Return how far the finished surface (r, c) is off along its normal; above 0 material is left.

        ``deviation_mm`` (m, 3) of the tip along ``$BASE``. NaN where nothing was cut.
        """
        off: Floats = np.einsum("ijk,ijk->ij", self.normal, deviation_mm[self.left_by])
        return off


class SurfaceHistory(NamedTuple):
    """How a part comes about under a tool whose axis turns: a surface through cubes in ``$BASE``.

    A cube has one point of the surface or none. The four cubes round an edge that leads out of the material
    make a square.
    """

    low_mm: Floats
    """(3,) low corner."""
    cell_mm: Floats
    """(3,) size of a cube."""
    cubes: Ints
    """(3,) how many there are along each axis."""
    site: Ints32
    """(s,) cubes, x first, that ever have a point, rising."""
    cell: Ints32
    """(e,) events in the order of time: a site became otherwise; first those of the raw part,"""
    shown: NDArray[np.int64]
    """(e,) as it is from this row of the Motion on, -1 in the raw part; no square is torn at any row,"""
    sample: NDArray[np.int64]
    """(e,) by this row of the Motion, -1 for none,"""
    share: NDArray[np.uint8]
    """(e, 3) to a point at these 255ths of the cube,"""
    state: NDArray[np.uint8]
    """(e,) with material at its low corner (1) and beyond it along x, y, z (2, 4, 8); 0 = without a point."""
    left_by: NDArray[np.int64]
    """(s,) the row of the Motion that left the finished surface, -1 where nothing was cut or none is."""
    normal: Floats
    """(s, 3) unit normal out of the finished surface, NaN there."""

    def surface(self, sample: int | None = None) -> tuple[Floats, Ints]:
        """Return points (s, 3) in mm, of each site, and squares (q, 4) of them, at a row of the Motion.

        Default: of the finished part. Seen from outside the corners of a square turn left.
        """
        done = len(self.cell) if sample is None else int(np.searchsorted(self.shown, sample, side="right"))
        last = np.full(len(self.site), -1)
        last[self.cell[:done]] = np.arange(done)  # of several the last one counts
        state = np.where(last >= 0, self.state[last], 0)
        corner = np.stack(np.unravel_index(self.site, self.cubes[::-1])[::-1], axis=1)
        points: Floats = self.low_mm + (corner + self.share[last] / 255.0) * self.cell_mm
        strides = np.array([1, self.cubes[0], self.cubes[0] * self.cubes[1]])
        squares = []
        for axis in range(3):
            low, high = state & 1, state >> (axis + 1) & 1
            u, v = strides[(axis + 1) % 3], strides[(axis + 2) % 3]
            for ends, way in (((low > high), (0, u, u + v, v)), ((low < high), (0, v, u + v, u))):
                squares.append(np.searchsorted(self.site, self.site[ends, None] - np.array(way)))
        return points, np.concatenate(squares)

    def volume_mm3(self, sample: int | None = None) -> float:
        """Return the volume that stands at a row of the Motion; default: of the finished part."""
        points, squares = self.surface(sample)
        a, b, c, d = (points[squares[:, k]] - self.low_mm for k in range(4))
        return float((a * (np.cross(b, c) + np.cross(c, d))).sum()) / 6.0

    def error_mm(self, deviation_mm: Floats) -> Floats:
        """Return how far the finished surface (s,) is off along its normal; as `PartHistory.error_mm`."""
        off: Floats = np.einsum("ij,ij->i", self.normal, deviation_mm[self.left_by])
        return off


_MOST_LETTERS = 60
"""Of the name of a program where a table is shown on one line."""


def _of(source: str) -> str:
    """Return the name of a program behind a comma; of a long one its end."""
    name = re.split(r"[\\/]", source)[-1]
    return f", {name[-_MOST_LETTERS:]}" if name else ""


def _most(values: Floats, factor: float, form: str) -> str:
    """Return the largest of values that may be missing, in another unit."""
    largest = np.fmax.reduce(values, initial=-np.inf)
    return format(largest * factor, form) if np.isfinite(largest) else "-"
