"""The straight lines of a program, sampled: a limit or a singularity may lie between two targets."""

import functools
from dataclasses import dataclass

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.cell import Cell
from gcode2krl.cell.carried import at_rest
from gcode2krl.cell.carriers import most_of
from gcode2krl.cell.tool_tips import Rows, external_starts, motion_starts
from gcode2krl.compiled.chunks import chunk_borders, in_chunks
from gcode2krl.compiled.inputs import distinct
from gcode2krl.robot.branch import Path
from gcode2krl.tables import Targets
from gcode2krl.units import RAD_PER_DEG

STEP_MM, STEP_RAD = 10.0, 2.0 * RAD_PER_DEG
"""Largest step between the samples of a line that are checked."""
_STEP_EXTERNAL = 10.0
"""The same of E1 to E6, in mm or degrees."""


@dataclass(frozen=True)
class Line:
    """Samples along the LIN motions (m of them), target rows among them."""

    position_mm: Floats
    rotation: Floats
    tool: Ints32
    target: Ints
    """(m,) the target each sample leads to."""
    duration_s: Floats
    """(m,) time from the sample before, NaN at the start of a chain."""
    is_target: Bools
    external: Floats
    """(m, 6) E1 to E6 in mm and degrees."""

    def from_sample(self, first: int) -> "Line":
        """Return the line without the samples before ``first``."""
        rows = slice(first, None)
        return Line(
            self.position_mm[rows],
            self.rotation[rows],
            self.tool[rows],
            self.target[rows],
            self.duration_s[rows],
            self.is_target[rows],
            self.external[rows],
        )


def path_of(line: Line, cell: Cell) -> Path:
    """Return the poses of a line as the arm sees them."""
    poses = at_rest(line.position_mm, line.rotation, line.external, cell)
    return Path(*poses, line.tool, np.isnan(line.duration_s))


def external_times(way: Floats, cell: Cell) -> Floats:
    """Return the time (p,) in s that E1 to E6 need at least for ways (p, 6); 0 where no speed is stated."""
    return np.asarray((np.abs(way) / most_of(cell.external, "speed")).max(axis=1))


@dataclass(frozen=True)
class _Motions:
    """Some motions (p of them) from where they begin to their targets."""

    start_mm: Floats
    start_rotation: Floats
    end_mm: Floats
    end_rotation: Floats
    length_mm: Floats
    angle_rad: Floats
    steps: Ints
    """(p,) samples of each: none for HOME, one for a PTP."""
    start_external: Floats
    end_external: Floats
    needed_s: Floats
    """(p,) time that the turn of the tool and the external axes need at least."""


def _motions(targets: Targets, cell: Cell, rows: Rows) -> _Motions:
    start, start_rotation = motion_starts(targets, cell, rows)
    end, end_rotation = targets.position_mm[rows], targets.rotation[rows]
    ptp, home = targets.ptp[rows], targets.home[rows]
    if ptp.any():  # the start of a PTP does not matter
        start, start_rotation = np.array(start), np.array(start_rotation)
        start[ptp], start_rotation[ptp] = end[ptp], end_rotation[ptp]
    x, y, z = (end - start).T
    length = np.sqrt(x * x + y * y + z * z)
    angle = np.zeros(len(length))
    if not np.array_equal(start_rotation, end_rotation):
        turning = functools.reduce(np.logical_or, (start_rotation != end_rotation).T)
        angle[turning] = fr.angle_between(end_rotation[turning], start_rotation[turning])
    way = np.maximum(length / STEP_MM, angle / STEP_RAD)
    start_external, end_external = external_starts(targets, rows), targets.external[rows]
    needed_s = angle / (cell.controller.vel_ori_deg_s * RAD_PER_DEG)
    if cell.external:
        needed_s = np.maximum(needed_s, external_times(end_external - start_external, cell))
        carried = np.abs(end_external - start_external).max(axis=1) / _STEP_EXTERNAL
        way = np.maximum(way, np.where(ptp, 0.0, carried))
    steps = np.maximum(1, np.ceil(way)).astype(np.int64)
    steps[ptp] = 1
    steps[home] = 0
    poses = start, start_rotation, end, end_rotation
    return _Motions(*poses, length, angle, steps, start_external, end_external, needed_s)


def count_samples(targets: Targets, cell: Cell) -> Ints:
    """Return the number (p,) of samples up to and with each target."""

    def steps(start: int, end: int) -> Ints:
        return _motions(targets, cell, slice(start, end)).steps

    counts = np.concatenate(in_chunks(steps, chunk_borders(len(targets))))
    return np.cumsum(counts, out=counts)


def sample_lines(targets: Targets, cell: Cell, start: int, end: int) -> Line:
    """Sample the lines to the targets ``start`` to ``end`` - 1; a PTP target starts a new chain.

    After a tool change a line begins where the new tool's tip stands, the flange at rest.
    """
    rows = slice(start, end)
    motions = _motions(targets, cell, rows)
    if (motions.steps == 1).all():
        return _line(targets, motions, rows, np.arange(start, end), slice(None), np.ones(end - start))
    which = np.repeat(np.arange(end - start), motions.steps)
    done = np.cumsum(motions.steps)
    part = (np.arange(len(which)) - (done - motions.steps)[which] + 1) / motions.steps[which]
    return _line(targets, motions, rows, which + start, which, part)


def samples_at(targets: Targets, cell: Cell, counts: Ints, samples: Ints) -> Line:
    """Return the line thinned to some of its rising samples (t,); ``counts`` as from `count_samples`."""
    target = np.searchsorted(counts, samples, side="right")
    rows = distinct(target)
    which = np.searchsorted(rows, target)
    motions = _motions(targets, cell, rows)
    part = (samples - (counts[target] - motions.steps[which]) + 1) / motions.steps[which]
    return _line(targets, motions, rows, target, which, part)


def _line(targets: Targets, motions: _Motions, rows: Rows, target: Ints, which: Rows, part: Floats) -> Line:
    """Return the samples at the fractions ``part`` (m,) of the motions ``which``."""
    position, rotation = motions.end_mm[which], motions.end_rotation[which]
    external = motions.end_external[which]
    on_the_way = np.flatnonzero(part < 1.0)
    if len(on_the_way):
        way = which[on_the_way] if not isinstance(which, slice) else on_the_way
        share, start = part[on_the_way], motions.start_mm[way]
        position[on_the_way] = start + (motions.end_mm[way] - start) * share[:, None]
        turned = motions.angle_rad[way] > 0
        rotation[on_the_way[turned]] = fr.slerp(
            motions.start_rotation[way[turned]], motions.end_rotation[way[turned]], share[turned]
        )
        if motions.end_external.any() or motions.start_external.any():
            begins = motions.start_external[way]
            external = np.array(external)
            external[on_the_way] = begins + (motions.end_external[way] - begins) * share[:, None]
    time_s = np.maximum(motions.length_mm, 1e-9) / targets.speed_mm_s[rows]
    time_s = np.maximum(time_s, motions.needed_s) / np.maximum(motions.steps, 1)
    time_s[targets.ptp[rows]] = np.nan
    tool = targets.tool[rows][which]
    return Line(position, rotation, tool, target, time_s[which], part == 1.0, external)
