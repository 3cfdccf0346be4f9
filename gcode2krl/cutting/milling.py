"""The stage: Motion and stock to Forces, and the findings of the material removal."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.cell import Cell
from gcode2krl.cell.sections import Tool
from gcode2krl.cutting.dexels import Dexels
from gcode2krl.cutting.engagement import NODES_PER_DIAMETER, Engaged, Engagement
from gcode2krl.cutting.findings import Cut, Findings
from gcode2krl.cutting.force import peak_force
from gcode2krl.cutting.height_field import HeightField
from gcode2krl.cutting.law import feed_per_tooth, law_array, linear_edge_law
from gcode2krl.cutting.outlook import Outlook, outlook_of, turned
from gcode2krl.cutting.raw_part import dexels_of, height_field_of
from gcode2krl.cutting.reading import Result
from gcode2krl.cutting.records import copied, followed, taken
from gcode2krl.cutting.stock_checks import StockChecks, TurnedStockChecks, Work
from gcode2krl.cutting.tool_use import Uses
from gcode2krl.cutting.turned import TurnedEngagement, TurnedPoints
from gcode2krl.cutting.way import Points
from gcode2krl.errors import Issue, input_error
from gcode2krl.tables import BLOCK_ROWS, Forces, Gathered, Motion, Toolpath, blocks_of, lengths

# The path between two samples where it turns: points that shape the sweep, so that it is not cut short.
#
# A chord across a corner leaves material standing that the tool has cut, and takes some that it has not,
# the more the farther samples lie apart. The path turns between two samples as the controller blends: along
# the tangent of the first, a parabola about the vertex of both tangents, along the tangent of the second.

LEAST_TURN_RAD = math.radians(3.0)
"""Turn between two samples below which the chord serves: 25 mm/s at 12 ms leave it by 4 µm."""
_PER_POINT_RAD = math.radians(10.0)
"""Turn of a parabola from point to point."""
_BACK = -0.999
"""Cosine of a turn that leads back along the same line, whose vertex is where it ends."""
_NO_LENGTH_MM = 1e-6


class Shaped(NamedTuple):
    """A path (k) of samples and the points between them."""

    position_mm: Floats
    """(k, 3)"""
    sample: Ints
    """(k,) the sample that the sweep which ends here leads to."""
    read: Bools
    """(k,) True at samples."""

    def gathered(self, values: Floats) -> Floats:
        """Return the largest value (m, ...) on the way to each sample."""
        return np.maximum.reduceat(values, np.flatnonzero(np.append(True, self.read[:-1])), axis=0)


def shaped(position_mm: Floats, direction: Floats, path_mm: Floats, joined: Bools) -> Shaped:
    """Return the path of samples (m) with points where it turns between two of them.

    Parameters
    ----------
    direction : (m, 3) unit tangents; zero where there is none.
    path_mm : (m,) arc length, which tells how far before the vertex the blend begins.
    joined : (m,) True where a sweep leads from the sample before.
    """
    count = len(position_mm)
    x, y, z = (direction[1:] * direction[:-1]).T
    cosine = x + y + z
    moves = (direction[:, 0] != 0.0) | (direction[:, 1] != 0.0) | (direction[:, 2] != 0.0)
    turns = (cosine < math.cos(LEAST_TURN_RAD)) & moves[1:] & moves[:-1] & joined[1:]
    after = np.flatnonzero(turns) + 1
    way_mm = np.diff(path_mm)[after - 1]
    between, owner = _between(position_mm, direction, after, way_mm, cosine[after - 1])
    every = np.empty((count + len(owner), 3))
    sample, read = np.empty(len(every), dtype=np.int64), np.zeros(len(every), dtype=np.bool_)
    # a sample comes after the points before it
    at = np.arange(count) + np.cumsum(np.bincount(owner, minlength=count))
    read[at] = True
    every[at], sample[at] = position_mm, np.arange(count)
    every[~read], sample[~read] = between, owner
    return Shaped(every, sample, read)


def _between(
    position_mm: Floats, direction: Floats, after: Ints, way_mm: Floats, cosine: Floats
) -> tuple[Floats, Ints]:
    """Return the points before the samples ``after`` and the samples that they belong to."""
    start, end, u, w = position_mm[after - 1], position_mm[after], direction[after - 1], direction[after]
    to_vertex, from_vertex = _legs(end - start, u, w, way_mm, cosine)
    meets = (
        (to_vertex >= 0.0) & (from_vertex >= 0.0) & (to_vertex + from_vertex < 2.0 * way_mm + _NO_LENGTH_MM)
    )
    after, start, u, w = after[meets], start[meets], u[meets], w[meets]
    to_vertex, from_vertex, way_mm, cosine = (
        values[meets] for values in (to_vertex, from_vertex, way_mm, cosine)
    )
    vertex = start + to_vertex[:, None] * u
    saved = 2.0 - _parabola_length(cosine)
    blend = np.clip((to_vertex + from_vertex - way_mm) / np.maximum(saved, 1e-9), 0.0, None)
    blend = np.where(cosine < _BACK, 0.0, np.minimum(blend, np.minimum(to_vertex, from_vertex)))
    turn = np.arccos(np.clip(cosine, -1.0, 1.0))
    pieces = np.where(blend > _NO_LENGTH_MM, np.ceil(turn / _PER_POINT_RAD), 0.0).astype(np.int64)
    row = np.repeat(np.arange(len(after)), pieces + 1)
    number = np.arange(len(row)) - np.repeat(np.cumsum(pieces + 1) - pieces - 1, pieces + 1)
    tau = (number / np.maximum(pieces[row], 1))[:, None]
    points = vertex[row] + blend[row, None] * (tau**2 * w[row] - (1.0 - tau) ** 2 * u[row])
    return points, after[row]


def _legs(step: Floats, u: Floats, w: Floats, way_mm: Floats, cosine: Floats) -> tuple[Floats, Floats]:
    """Return the distances from the first sample along u, and along w to the second, of the vertex."""
    along, onward = (step * u).sum(axis=1), (step * w).sum(axis=1)
    sine2 = np.maximum(1.0 - cosine**2, 1e-12)
    to_vertex, from_vertex = (along - cosine * onward) / sine2, (onward - cosine * along) / sine2
    back = cosine < _BACK
    out = 0.5 * (way_mm + along)
    return np.where(back, out, to_vertex), np.where(back, way_mm - out, from_vertex)


def _parabola_length(cosine: Floats) -> Floats:
    """Return the length of a parabola from tangent to tangent, in units of its distance to the vertex.

    The closed form of ``|(1 - t)·u + t·w|`` integrated from 0 to 1, twice.
    """
    half = np.sqrt(np.clip(0.5 * (1.0 - cosine), 1e-12, 1.0))  # sine of half the turn
    low = np.sqrt(np.clip(1.0 - half**2, 1e-12, 1.0))
    return 1.0 + low**2 / half * np.arctanh(np.minimum(half, 1.0 - 1e-12))


TURNED_BAND = 0.2
"""Half-width of the band that a turning axis adds to that of the material, in quadrature: assumed. The edge
near the tip of a tilted ball drags at almost no speed, which no coefficient was fitted to."""
_AXIS_TURNS = Issue(
    "note",
    "axis-turns",
    0,
    f"the tool axis turns: forces there were never compared with a measured cut, are less sure by "
    f"{TURNED_BAND:.0%}, and peaks are upper bounds",
    "lean a ball forward rather than back: its tip drags less",
)
_APPROACH_MM = 1e-3
_ARC_COLUMNS = 6
_SHANK_MM = 1.0
_CDIS_OF_TOLERANCE = 2.0 * 2.0**0.5
"""CDIS of a corner of 90° for a tolerance, d = 2·tolerance/cos(alpha/2)."""


@dataclass(frozen=True)
class Removal:
    """The result of `remove`."""

    forces: Forces
    material: HeightField | Dexels
    """The material that is left; dexels where the tool axis turns."""
    to_field: Floats
    """(3, 3) rotation from ``$BASE`` to its frame."""


def cut(toolpath: Toolpath, motion: Motion, cell: Cell) -> Forces:
    """Return the force that the cutter feels at every sample, from removing the stock along the motion.

    Means over one spindle revolution (Altintas' linear edge model, or Kienzle), read at the place of the
    sample before its sweep is removed; feed per tooth from the predicted speed. ``issues`` name collisions
    and cuts that tool or spindle cannot take, with their lines. Not predicted: run-out, chatter, dynamics.

    Raises
    ------
    NotUnderstoodError
        Where the stock cannot be read, or the material has no force law.

    Examples
    --------
    >>> from gcode2krl import cut, load_cell, plan_motion, read_gcode
    >>> cell = load_cell("cell.toml")
    >>> toolpath = read_gcode("part.nc", cell)
    >>> forces = cut(toolpath, plan_motion(toolpath, cell), cell)
    >>> forces
    Forces(... samples, up to ... N)
    >>> round(float(forces.a_p_mm.max()), 3)
    4.0
    """
    return remove(toolpath, motion, cell).forces


def mean_cut(toolpath: Toolpath, motion: Motion, cell: Cell) -> Forces:
    """Return what `cut` does without what takes a third of its time: findings, and peaks above the means."""
    return remove(toolpath, motion, cell, is_checked=False).forces


def force_basis(toolpath: Toolpath, motion: Motion, cell: Cell) -> Floats:
    """Return the force (m, 3, 6) along ``$BASE`` for a unit of each coefficient of the linear edge law.

    The force is their sum, multiplied by Ktc, Krc, Kac (N/mm²), Kte, Kre, Kae (N/mm). Errors as for `cut`.
    """
    parts = [remove(toolpath, motion, cell, linear_edge_law(unit)).forces.force_base_N for unit in np.eye(6)]
    return np.stack(parts, axis=2)


def remove(
    toolpath: Toolpath,
    motion: Motion,
    cell: Cell,
    law: Floats | None = None,
    *,
    is_checked: bool = True,
    nodes_per_diameter: float = NODES_PER_DIAMETER,
    rows: int = BLOCK_ROWS,
) -> Removal:
    """Return the result of `cut` and the machined part; ``law`` (8,) replaces that of the material.

    Unless ``is_checked``, that of `mean_cut`. ``nodes_per_diameter`` as in `engagement.Engagement`. So many
    ``rows`` are cut at a time, which changes nothing.
    """
    if cell.material is None:
        raise input_error("material-missing", "the cell names no material", "give [material] in the cell")
    outlook = outlook_of(block for block, _ in blocks_of(motion, rows)).on(_left_before(toolpath))
    dt_s = float(motion.time_s[1] - motion.time_s[0]) if len(motion) > 1 else 0.0
    milling = Milling(
        toolpath, cell, outlook, dt_s, law, is_checked=is_checked, nodes_per_diameter=nodes_per_diameter
    )
    gathered = Gathered[Forces](len(motion))
    for block, ends in blocks_of(motion, rows):
        gathered.take(milling.take(block, ends))
    return Removal(replace(gathered.table(), issues=milling.issues()), milling.part(), outlook.to_field)


class RawBox(NamedTuple):
    """The box around a raw part."""

    low_mm: Floats
    """(3,) its low corner in the frame of the field."""
    high_mm: Floats
    to_field: Floats
    """(3, 3) rotation from ``$BASE`` to the frame of the field."""
    guessed: bool


class _UncutSamples(NamedTuple):
    """What is known of samples (m) before they are cut."""

    position_mm: Floats
    """(m, 3) in the frame of the field."""
    direction: Floats
    """(m, 3) in the frame of the field."""
    path_mm: Floats
    number: Ints32
    """(m,) tool."""
    tool: Ints32
    """(m,) row of the tools."""
    rapid: Bools
    feed: Bools
    """(m,) True on feed moves."""
    source_line: Ints32
    spindle_rad_s: Floats
    f_z_mm: Floats
    programmed_f_z_mm: Floats
    step_mm: Floats
    descent_mm: Floats


class Approach(NamedTuple):
    """Samples that are about to be cut."""

    rows: _UncutSamples
    cut: Callable[[], Engaged]
    """Cuts along them, and returns what is read."""


class Contact(NamedTuple):
    """The same samples, and what is read at those that are done by then."""

    rows: _UncutSamples
    engaged: Engaged


class Milling:
    """Removes the stock along a motion that comes some samples at a time; see `cut`."""

    def __init__(
        self,
        toolpath: Toolpath,
        cell: Cell,
        outlook: Outlook,
        dt_s: float,
        law: Floats | None = None,
        *,
        is_checked: bool = True,
        has_peaks: bool = True,
        nodes_per_diameter: float = NODES_PER_DIAMETER,
        threads: int | None = None,
    ) -> None:
        """Take what is known of the motion, and the time between its samples; the others as in `remove`.

        Without peaks, which take long, ``peak_N`` of the forces is their mean.
        """
        material = cell.material
        if material is None:
            raise input_error("material-missing", "the cell names no material", "give [material] in the cell")
        outlook = outlook.on(_left_before(toolpath))
        self._toolpath, self._to_field = toolpath, outlook.to_field
        self._law = law_array(material) if law is None else law
        self._band = material.relative_band
        self._numbers = np.array(outlook.numbers)
        self._tools = [cell.tool[number] for number in outlook.numbers]
        self._teeth = np.array([one.teeth for one in self._tools])
        self._flutes_mm = np.array([one.flute_length_mm or np.inf for one in self._tools])
        shanks = [_with_shank(one) for one in self._tools]
        is_raw, self._dt_s = toolpath.restart is None, dt_s
        checks: StockChecks | TurnedStockChecks
        if outlook.turns:
            dexels, self._is_guessed = dexels_of(toolpath, cell, self._tools)
            self._engagement: Engagement | TurnedEngagement = TurnedEngagement(dexels, shanks, self._law)
            self._band = math.hypot(self._band, TURNED_BAND)
            self._low_mm, self._high_mm = dexels.low_mm, dexels.low_mm + dexels.cells * dexels.cell_mm
            stock = None if self._is_guessed else cell.stock
            corners = self._low_mm, self._high_mm
            checks = TurnedStockChecks(self._tools, outlook.numbers, stock, *corners, is_raw)
        else:
            field = height_field_of(toolpath, cell, outlook.to_field, self._tools)
            self._before, self._is_guessed = _uncut(field), field.guessed
            places_mm = outlook.places_mm
            self._engagement = Engagement(field, shanks, self._law, places_mm, threads, nodes_per_diameter)
            self._low_mm, self._high_mm = _box_of(self._before)
            checks = StockChecks(self._tools, outlook, cell.stock, self._before, is_raw)
        self._checks: _Checks | None = None
        if is_checked:
            blend_mm = _largest_cdis(toolpath, cell)
            findings = Findings(cell, outlook.numbers, self._is_guessed, blend_mm, dt_s)
            self._checks = _Checks(findings, checks, Uses(cell, outlook.numbers))
        self._last_axis = np.zeros((0, 3))
        self._last: _UncutSamples | None = None
        self._waiting: _UncutSamples | None = None
        self._peaks = _Peaks(self._tools, self._law) if is_checked and has_peaks else None

    def take(self, motion: Motion, ends: bool) -> Forces:
        """Cut the next samples; return the forces at those that follow the ones returned before.

        The motion ``ends`` with these samples: then there is a row for every one.
        """
        return self.loaded(self.touched(self.approached(motion, ends)))

    # The steps of `take`. A step takes block after block; each may be at work on another block.

    def approached(self, motion: Motion, ends: bool) -> Approach:
        """Return what is known of the next samples before they are cut."""
        rows = self._rows(motion)
        engagement = self._engagement
        cut = (
            partial(engagement.take, self._points(rows), ends)
            if isinstance(engagement, Engagement)
            else partial(engagement.take, self._turned_points(rows, tool_axes(motion)), ends)
        )
        self._last = copied(rows, slice(-1, None))
        return Approach(rows, cut)

    def touched(self, approach: Approach) -> Contact:
        """Cut along the next samples."""
        return Contact(approach.rows, approach.cut())

    def loaded(self, contact: Contact) -> Forces:
        """Return the forces at the samples that are done, and take what is found of them."""
        rows, engaged = contact
        if self._waiting is not None:
            rows = followed(self._waiting, rows)
        count = len(engaged.result.a_p_mm)
        self._waiting = copied(rows, slice(count, None))
        return self._forces(taken(rows, slice(0, count)), engaged)

    def issues(self) -> tuple[Issue, ...]:
        """Return what was found, by line."""
        issues = self._checks.issues() if self._checks is not None else ()
        return (*issues, _AXIS_TURNS) if isinstance(self._engagement, TurnedEngagement) else issues

    def raw_box(self) -> RawBox:
        """Return the box around the material before the first cut."""
        return RawBox(self._low_mm, self._high_mm, self._to_field, self._is_guessed)

    def bodies_in(self, ends_mm: Floats, radius_mm: Floats) -> tuple[Floats, Floats]:
        """Return how deep capsules (n) are in what stands now, 0 where they are not, and where (n, 3).

        ``ends_mm`` (n, 6) and the places in mm in ``$BASE``, ``radius_mm`` (n,).
        """
        ends = turned(ends_mm.reshape(-1, 3), self._to_field).reshape(-1, 6)
        depth, place = self._engagement.bodies_in(ends, radius_mm)
        return depth, turned(place, self._to_field.T)

    def part(self) -> HeightField | Dexels:
        """Return the material that is left."""
        if isinstance(self._engagement, TurnedEngagement):
            return self._engagement.dexels
        field = self._before.copy()
        self._engagement.write_back(field)
        return field

    def _rows(self, motion: Motion) -> _UncutSamples:
        toolpath, row = self._toolpath, np.clip(motion.move, 0, len(self._toolpath) - 1)
        position = turned(motion.position_mm, self._to_field)
        before = position[:1] if self._last is None else self._last.position_mm
        steps = np.diff(position, axis=0, prepend=before)
        tool = np.searchsorted(self._numbers, motion.tool).astype(np.int32)
        rapid, spindle, teeth = toolpath.rapid[row], toolpath.spindle_rad_s[row], self._teeth[tool]
        programmed_mm_s = np.where(rapid, 0.0, toolpath.feed_mm_s[row])
        return _UncutSamples(
            position_mm=position,
            direction=turned(motion.direction, self._to_field),
            path_mm=motion.path_mm,
            number=motion.tool,
            tool=tool,
            rapid=rapid,
            feed=~rapid & ~toolpath.machine[row] & (motion.move > 0),
            source_line=toolpath.source_line[row],
            spindle_rad_s=spindle,
            f_z_mm=feed_per_tooth(motion.speed_mm_s, spindle, 1) / teeth,
            programmed_f_z_mm=feed_per_tooth(programmed_mm_s, spindle, 1) / teeth,
            step_mm=lengths(steps),
            descent_mm=np.maximum(-steps[:, 2], 0.0),
        )

    def _way(self, rows: _UncutSamples) -> tuple[_UncutSamples, Shaped, slice, Bools]:
        """Return samples behind the last one, the path of the tip, what of it is new, and what is rapid."""
        last = self._last
        if last is not None:
            rows = followed(last, rows)
        is_joined = np.concatenate([[False], rows.tool[1:] == rows.tool[:-1]])
        way = shaped(rows.position_mm, rows.direction, rows.path_mm, is_joined)
        # the sweep to the first sample of a rapid move began on the feed move before it
        wholly_rapid = rows.rapid & np.concatenate([rows.rapid[:1], rows.rapid[:-1]])
        return rows, way, slice(0 if last is None else 1, None), wholly_rapid

    def _points(self, rows: _UncutSamples) -> Points:
        """Return the path of the tip, with the turns between samples."""
        rows, way, new, wholly_rapid = self._way(rows)
        owner = way.sample[new]
        return Points(
            position_mm=way.position_mm[new],
            direction=rows.direction[owner],
            tool=rows.tool[owner],
            rapid=wholly_rapid[owner],
            f_z_mm=rows.f_z_mm[owner],
            wanted=way.read[new],
        )

    def _turned_points(self, rows: _UncutSamples, axis: Floats) -> TurnedPoints:
        """Return the path of a tool whose axis is (m, 3) at samples."""
        begins = self._last is None
        if self._checks is not None and isinstance(self._checks.stock, TurnedStockChecks):
            self._checks.stock.pass_by(rows.position_mm, axis, rows.tool, rows.source_line, rows.feed)
        rows, way, new, wholly_rapid = self._way(rows)
        axis = np.concatenate([self._last_axis, axis])
        self._last_axis = axis[-1:].copy()
        tooth_s = feed_per_tooth(1.0, rows.spindle_rad_s, 1) / self._teeth[rows.tool]
        rate = np.diff(axis, axis=0, prepend=axis[:1]) / (self._dt_s or 1.0)
        owner = way.sample[new]
        points = TurnedPoints(
            position_mm=way.position_mm[new],
            axis=axes_between(axis, way)[new],
            feed_mm=(rows.f_z_mm[:, None] * rows.direction)[owner],
            swing=(tooth_s[:, None] * rate)[owner],
            tool=rows.tool[owner],
            rapid=wholly_rapid[owner],
            wanted=way.read[new],
        )
        if not begins or not len(owner) or not rows.rapid[0]:
            return points
        # the approach, a rapid along the axis, ends at the first sample
        first = taken(points, slice(0, 1))
        above = first._replace(
            position_mm=first.position_mm + _APPROACH_MM * first.axis, wanted=np.zeros(1, bool)
        )
        return followed(above, points._replace(rapid=np.append(True, points.rapid[1:])))

    def _forces(self, rows: _UncutSamples, engaged: Engaged) -> Forces:
        cut, checks = engaged.result, self._checks
        # a rapid through material is reported as a collision, and is not a cut
        for column in (cut.force_N, cut.moment_Nmm, cut.torque_Nmm):
            column[rows.rapid] = 0.0
        mean_N = lengths(cut.force_N)
        forces = Forces(
            force_base_N=turned(cut.force_N, self._to_field.T),
            moment_base_Nmm=turned(cut.moment_Nmm, self._to_field.T),
            peak_N=mean_N if self._peaks is None else self._peaks.take(cut, rows.f_z_mm, rows.tool, mean_N),
            torque_Nmm=cut.torque_Nmm,
            a_p_mm=cut.a_p_mm,
            a_e_mm=cut.a_e_mm,
            phi_rad=cut.phi_rad,
            tool=rows.number,
            relative_band=self._band,
        )
        if checks is not None:
            overlap_mm = cut.overlap_mm[:, 1:]
            overlap_mm[:, 0] = np.maximum(overlap_mm[:, 0], cut.a_p_mm - self._flutes_mm[rows.tool])
            checks.take(rows, engaged, overlap_mm, forces)
        return forces


@dataclass(frozen=True)
class _Checks:
    """What is found on the way."""

    findings: Findings
    stock: StockChecks | TurnedStockChecks
    uses: Uses

    def take(self, rows: _UncutSamples, engaged: Engaged, overlap_mm: Floats, forces: Forces) -> None:
        milled = engaged.result
        cut = Cut(
            source_line=rows.source_line,
            rapid=rows.rapid,
            engaged=np.isfinite(forces.phi_rad[:, 0]),
            spindle_rad_s=rows.spindle_rad_s,
            f_z_mm=rows.f_z_mm,
            ramp_rad=milled.ramp_rad,
            centre_mm=milled.centre_mm,
            overlap_mm=overlap_mm,
            step_mm=rows.step_mm,
            descent_mm=rows.descent_mm,
        )
        self.findings.take(cut, forces)
        self.findings.rapids_met(engaged.rapid_row, engaged.rapid_mm, engaged.settled)
        self.stock.take(Work(rows.position_mm, rows.tool, rows.source_line, rows.feed, cut.engaged))
        of_uses = (rows.source_line, rows.rapid, rows.programmed_f_z_mm, milled.ramp_rad, milled.centre_mm)
        self.uses.take(*of_uses, forces)

    def issues(self) -> tuple[Issue, ...]:
        issues = (*self.findings.issues(), *self.stock.issues(), *self.uses.issues())
        return tuple(sorted(issues, key=lambda issue: issue.line))


def raw_material(toolpath: Toolpath, motion: Motion, cell: Cell) -> HeightField | Dexels:
    """Return the material before the first cut, as fine as the tools of the motion need; dexels if it turns.

    Raises what `cut` raises.
    """
    outlook = outlook_of([motion]).on(_left_before(toolpath))
    tools = [cell.tool[number] for number in outlook.numbers]
    if outlook.turns:
        return dexels_of(toolpath, cell, tools)[0]
    return height_field_of(toolpath, cell, outlook.to_field, tools)


def _left_before(toolpath: Toolpath) -> object:
    """Return what the lines before a restart have left."""
    return toolpath.restart.material if toolpath.restart is not None else None


def _largest_cdis(toolpath: Toolpath, cell: Cell) -> float:
    """Return the largest CDIS that tolerances need at corners of 90° and wider, or the cell's."""
    tolerances = np.append(toolpath.tolerance_mm, cell.controller.tolerance_mm or 0.0)
    return max(cell.controller.cdis_mm, _CDIS_OF_TOLERANCE * float(np.nanmax(tolerances)))


def tool_axes(motion: Motion) -> Floats:
    """Return the tool axis (m, 3) at each sample, from tip to holder in ``$BASE``."""
    x, y, z, w = motion.rotation.T
    columns = [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)]
    return np.ascontiguousarray(np.stack(columns, axis=1))


def axes_between(axis: Floats, way: Shaped) -> Floats:
    """Return the axis (k, 3) on a way: between two samples in even parts from one to the other."""
    row = np.arange(len(way.read))
    at = np.interp(row, row[way.read], way.sample[way.read].astype(np.float64))
    low = np.clip(at.astype(np.int64), 0, max(len(axis) - 2, 0))
    share = (at - low)[:, None]
    between = axis[low] + share * (axis[np.minimum(low + 1, len(axis) - 1)] - axis[low])
    unit: Floats = between / lengths(between)[:, None]
    return unit


def _box_of(field: HeightField) -> tuple[Floats, Floats]:
    """Return the corners (3,) of the box around the material of a field."""
    size = np.array(field.height_mm.shape[::-1]) * field.cell_mm
    low = np.append(field.origin_mm, field.bottom_mm)
    return low, np.append(field.origin_mm + size, float(field.height_mm.max()))


def _uncut(field: HeightField) -> HeightField:
    """Return the field before it is cut; a block is one number."""
    low, high = field.height_mm.min(), field.height_mm.max()
    if low != high:
        return field.copy()
    height = np.broadcast_to(low, field.height_mm.shape)
    return HeightField(height, field.origin_mm, field.cell_mm, field.bottom_mm, field.guessed)


def no_forces(motion: Motion) -> Forces:
    """Return the Forces of a motion that cuts nothing."""
    count = len(motion)
    return Forces(
        force_base_N=np.zeros((count, 3)),
        moment_base_Nmm=np.zeros((count, 3)),
        peak_N=np.zeros(count),
        torque_Nmm=np.zeros(count),
        a_p_mm=np.zeros(count),
        a_e_mm=np.zeros(count),
        phi_rad=np.full((count, _ARC_COLUMNS), np.nan),
        tool=motion.tool,
    )


def _with_shank(tool: Tool) -> Tool:
    """Return a tool whose edges reach a little up a cylindrical shank, so that deeper cuts become visible."""
    if tool.kind in ("tapered", "drill") or tool.flute_length_mm is None:
        return tool
    return tool.model_copy(update={"flute_length_mm": tool.flute_length_mm + _SHANK_MM})


class _Peaks:
    """The largest force of a revolution, at least the mean; zero in air.

    Between two samples that were read it lies between theirs.
    """

    def __init__(self, tools: list[Tool], law: Floats) -> None:
        self._tools, self._law = tools, law
        self._row, self._known_N = np.zeros(0), np.zeros((2, 0))
        """The last sample that was read in material, counted from the next one; its peak and its mean."""

    def take(self, engaged: Result, f_z_mm: Floats, tool: Ints32, mean_N: Floats) -> Floats:
        """Return the peaks (m,) of the next samples."""
        peak = np.zeros(len(mean_N))
        cuts = np.isfinite(engaged.phi_rad[:, 0]) & (mean_N > 0.0)
        read, between = np.flatnonzero(cuts & engaged.is_read), np.flatnonzero(cuts & ~engaged.is_read)
        for number, cutter in enumerate(self._tools):
            rows = read[tool[read] == number]
            if len(rows):
                arcs, depth, ramp = engaged.phi_rad[rows], engaged.a_p_mm[rows], engaged.ramp_rad[rows]
                peak[rows] = peak_force(cutter, self._law, arcs, depth, f_z_mm[rows], ramp)
        row = np.concatenate([self._row, read])
        known_N = np.concatenate([self._known_N, [peak[read], mean_N[read]]], axis=1)
        if len(between):
            # a sample's feed raises its peak as it does its mean
            peak_N, usual_N = (np.interp(between, row, column) for column in known_N)
            peak[between] = peak_N * mean_N[between] / usual_N
        self._row, self._known_N = row[-1:] - len(mean_N), known_N[:, -1:]
        return np.maximum(peak, mean_N)
