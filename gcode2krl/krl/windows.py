"""When each motion of a program runs, by the predicted Motion, and at which instants a trigger can act.

A trigger of KRL stands before the motion that carries it; with ``DISTANCE=0`` its delay counts from the start
of that motion. Instants within the approximation of a corner belong to neither motion.
"""

from dataclasses import dataclass

import numpy as np

from gcode2krl.arrays import Bools, Floats, Rows
from gcode2krl.cell import Cell
from gcode2krl.compiled.chunks import chunked
from gcode2krl.compiled.core import BOOLS, FLOAT, FLOATS, INT, OUT_FLOATS, core_function
from gcode2krl.compiled.inputs import distinct
from gcode2krl.errors import Issue, RefusedError
from gcode2krl.krc4 import Chain
from gcode2krl.krl.advance import halts_advance, read_order
from gcode2krl.krl.statements import event_statements
from gcode2krl.tables import Motion, PilotForce, Targets
from gcode2krl.units import MM_PER_M

COUNTS_FROM_END_OF_ARC = True
"""At an approximated start point ``DISTANCE=0`` switches where the approximation ends, not where it begins
(KUKA's documentation as remembered; not confirmed by a trace)."""
_SAME_PATH = 1e-3
_AT_REST_MM = 1e-6

_straight = core_function("krl_straight", *(FLOATS,) * 4, BOOLS, FLOATS, *(OUT_FLOATS,) * 3)
_instants = core_function("krl_instants", *(FLOATS,) * 4, FLOAT, FLOATS, BOOLS, INT, FLOAT, OUT_FLOATS)


@dataclass(frozen=True)
class Windows:
    """The LIN motions (w) that can carry triggers, in the order in which they run."""

    row: Rows
    """(w,) row of Targets."""
    order: Rows
    """(w,) its number in the order in which the advance run reads, see `read_order`."""
    begin_s: Floats
    """(w,) instant from which a delay counts, in the time of the Motion."""
    end_s: Floats
    """(w,) last instant of the motion, before the approximation of its end."""
    begin_mm: Floats
    """(w,) path of the Motion at ``begin_s``; the motion is straight from there to ``end_mm``."""
    end_mm: Floats
    head_mm: Floats
    """(w,) part of the motion that belongs to the corner at its start."""
    tail_mm: Floats
    section_s: Floats
    """(c,) instants at which the robot starts anew after a standstill whose length nobody knows (M-codes,
    tool changes, PTP), the program's start being the first."""
    dwell_from_s: Floats
    """(d,) instants at which the robot comes to rest for a dwell of stated length."""
    dwell_s: Floats
    """(d,) how long each lasts."""

    def dwelt_s(self, time_s: Floats) -> Floats:
        """Return for how long the robot has dwelt up to instants (k,)."""
        if len(self.dwell_s) == 0:
            return np.zeros(len(time_s))
        begins_and_ends_s = np.column_stack([self.dwell_from_s, self.dwell_from_s + self.dwell_s])
        whole_s = np.concatenate([[0.0], np.cumsum(self.dwell_s)])
        dwelt_s = np.column_stack([whole_s[:-1], whole_s[1:]])
        return np.asarray(np.interp(time_s, begins_and_ends_s.ravel(), dwelt_s.ravel()))

    def earliest_s(self, time_s: Floats) -> Floats:
        """Return the start of the section to which instants (k,) belong."""
        section = np.searchsorted(self.section_s, time_s + 1e-9, side="right") - 1
        return np.asarray(self.section_s[np.maximum(section, 0)])


def windows_of(targets: Targets, chain: Chain, motion: Motion | PilotForce, cell: Cell) -> Windows:
    """Return the windows of a program's LIN motions.

    ``chain`` is that of ``targets``. Path and time of the Motion are taken as they are, so a slower robot or
    an effect on the motion is followed. Raises `RefusedError` where the Motion is not that of the targets.
    """
    straight_mm, head_mm, tail_mm = _straight_parts(chain, targets)
    arc_mm = _arc_lengths(chain, head_mm, tail_mm)
    arrive_mm = np.cumsum(straight_mm) + np.concatenate([[0.0], np.cumsum(arc_mm)])
    leave_mm = arrive_mm - straight_mm
    total, path = float(arrive_mm[-1]) if len(arrive_mm) else 0.0, float(motion.path_mm[-1])
    if abs(total - path) > _SAME_PATH * max(total, 1.0):
        raise RefusedError(
            Issue(
                "error",
                "pilot-motion",
                0,
                f"the motion is {path:.3f} mm long, the program {total:.3f} mm",
                "predict again",
            )
        )
    scale = path / total if total > 0 else 1.0
    arrive_mm, leave_mm = arrive_mm * scale, leave_mm * scale
    stops = np.concatenate([[True], chain.stop])
    clock = _Clock(motion, cell)
    end_s = clock.arrival(arrive_mm, stops[1:])
    begin_s = clock.departure(leave_mm if COUNTS_FROM_END_OF_ARC else _arc_starts(arrive_mm), stops[:-1])
    rows = chain.first + 1 + np.arange(len(straight_mm))
    carries = ~targets.ptp[rows] & (straight_mm + head_mm + tail_mm > _AT_REST_MM)
    dwells = targets.wait_s[rows] > 0
    dwell_from_s, dwell_s = _one_after_another(end_s[dwells], targets.wait_s[rows][dwells])
    begin_s, end_s = begin_s[carries], end_s[carries]
    begin_s = np.maximum.accumulate(begin_s)
    return Windows(
        row=rows[carries],
        order=read_order(len(targets), _halts(targets, cell), cell)[rows[carries]],
        begin_s=begin_s,
        end_s=np.maximum(end_s, begin_s),
        begin_mm=leave_mm[carries],
        end_mm=arrive_mm[carries],
        head_mm=head_mm[carries],
        tail_mm=tail_mm[carries],
        section_s=_sections(targets, chain, clock, leave_mm),
        dwell_from_s=dwell_from_s,
        dwell_s=dwell_s,
    )


def _one_after_another(from_s: Floats, lasting_s: Floats) -> tuple[Floats, Floats]:
    """Return begin and length (d,) of dwells; those at one place follow each other."""
    before_s = np.cumsum(lasting_s) - lasting_s
    return np.maximum.accumulate(from_s - before_s) + before_s, lasting_s


def _arc_starts(arrive_mm: Floats) -> Floats:
    """Return the path (n,) at which the arc at the start of each move begins."""
    return np.concatenate([[0.0], arrive_mm[:-1]])


def _straight_parts(chain: Chain, targets: Targets) -> tuple[Floats, Floats, Floats]:
    """Return (n,) lengths in mm of the straight part of each move, and of its parts in corners."""
    first, count = chain.first, len(chain.length_mm)
    straight_mm, head_mm, tail_mm = np.empty((3, count))
    corners = (chain.blend_mm, chain.scale, chain.stop, targets.cdis_mm[first + 1 : first + count])
    columns = map(np.ascontiguousarray, (chain.start_mm, chain.end_mm, *corners))
    _straight(*columns, straight_mm, head_mm, tail_mm)
    return straight_mm, head_mm, tail_mm


def _arc_lengths(chain: Chain, head_mm: Floats, tail_mm: Floats) -> Floats:
    """Return the lengths (n - 1,) of the parabolas between moves: B' = 2·((1 - t)·p + t·q), p and q its legs.

    The integral of |p + t·(q - p)| from 0 to 1, in closed form with the root of b·((t + m)² + r2).
    """
    count = max(len(head_mm) - 1, 0)
    return chunked(lambda rows: _arcs_behind(chain, head_mm, tail_mm, rows), count)


def _arcs_behind(chain: Chain, head_mm: Floats, tail_mm: Floats, rows: slice) -> Floats:
    """Return the lengths of the parabolas behind moves."""
    both = slice(rows.start, rows.stop + 1)
    way = chain.end_mm[both] - chain.start_mm[both]
    size = np.maximum(np.sqrt(np.einsum("ij,ij->i", way, way)), 1e-300)
    unit = way / size[:, None]
    p, q = unit[:-1] * tail_mm[rows, None], unit[1:] * head_mm[both][1:, None]
    pp, pq, qq = (np.einsum("ij,ij->i", a, b) for a, b in ((p, p), (p, q), (q, q)))
    b = pp - 2.0 * pq + qq
    bends = b > 1e-12 * (pp + qq)
    b = np.where(bends, b, 1.0)
    m = np.where(bends, (pq - pp) / b, 0.0)
    r2 = np.maximum(pp / b - m * m, 1e-300)
    root0, root1 = np.sqrt(m * m + r2), np.sqrt((1.0 + m) ** 2 + r2)
    r = np.sqrt(r2)
    area = (1.0 + m) * root1 - m * root0 + r2 * (np.arcsinh((1.0 + m) / r) - np.arcsinh(m / r))
    return np.asarray(np.where(bends, np.sqrt(b) * area, np.sqrt(pp) + np.sqrt(qq)))


def _halts(targets: Targets, cell: Cell) -> Rows:
    """Return the rows of Targets behind which the advance run waits: dwells, and events that say so."""
    rows = {event.row for event in targets.events if halts_advance(event_statements(event, cell).split("\n"))}
    return distinct(np.append(np.flatnonzero(targets.wait_s > 0), np.array(sorted(rows), dtype=np.int64)))


def _sections(targets: Targets, chain: Chain, clock: "_Clock", leave_mm: Floats) -> Floats:
    """Return the instants (c,) at which the program starts anew."""
    count = len(leave_mm)
    unknown = np.zeros(len(targets) + 1, dtype=np.bool_)
    unknown[[event.row for event in targets.events]] = True
    unknown[:-1] |= targets.ptp
    unknown[:-2] |= targets.ptp[1:]
    if count == 0:
        return np.zeros(1)
    vertex = distinct(np.append(0, np.flatnonzero(unknown[chain.first : chain.first + count])))
    return clock.departure(leave_mm[vertex], np.ones(len(vertex), dtype=np.bool_))


class _Clock:
    """Path to time of a Motion, with its standstills."""

    def __init__(self, motion: Motion | PilotForce, cell: Cell) -> None:
        k_s = cell.controller.k_s
        jerk = cell.controller.acc_cp_m_s2 * MM_PER_M / k_s if k_s > 0 else np.inf
        columns = (motion.time_s, motion.path_mm, motion.speed_mm_s, motion.acceleration_mm_s2)
        self._samples = (*map(np.ascontiguousarray, columns), jerk)

    def arrival(self, path_mm: Floats, at_rest: Bools) -> Floats:
        """Return the instants (n,) at which a path is reached; at rest it is where the motion ends."""
        return self._instants(path_mm, at_rest, leaves=False)

    def departure(self, path_mm: Floats, at_rest: Bools) -> Floats:
        """Return the instants (n,) at which a path is left; at rest it is where the motion begins."""
        return self._instants(path_mm, at_rest, leaves=True)

    def _instants(self, path_mm: Floats, at_rest: Bools, leaves: bool) -> Floats:
        instants = np.empty(len(path_mm))
        _instants(*self._samples, path_mm, at_rest, leaves, _AT_REST_MM, instants)
        return instants
