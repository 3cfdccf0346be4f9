"""Knots of the pilot force: cutting forces as a sparse polyline along the path.

Cutting forces along a Motion are compressed to few knots between which an online controller ramps linearly
(pilot control: Haehn & Weigold 2020, section 2.3). Before the first knot and after the last the pilot force
is zero. `krl` announces the knots in the program, `online` reads them.
"""

import math
from dataclasses import dataclass

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.arrays import Bools, Floats, Ints32, Rows
from gcode2krl.cell import Cell, controller_axes
from gcode2krl.compiled.chunks import chunk_borders, in_chunks
from gcode2krl.compiled.core import FLOAT, FLOATS, INTS, OUT_BOOLS, OUT_FLOATS, OUT_INTS, core_function
from gcode2krl.compiled.inputs import distinct
from gcode2krl.errors import Issue
from gcode2krl.exchange import Table, column

LEAST_TOLERANCE_N = 10.0
TOLERANCE_SHARE = 0.03
"""The default tolerance: the larger of 10 N and this fraction of the largest force."""
CYCLE_S = 0.012
FORCE_DECIMALS, DEFLECTION_DECIMALS = 2, 5
TIME_DECIMALS, PATH_DECIMALS, LEAD_DECIMALS = 6, 6, 4
_WRITTEN_N = 0.1
"""Part of the tolerance reserved for rounding to the decimals in which knots are written."""

_mark_spaced = core_function("pilot_spaced", FLOATS, FLOAT, OUT_BOOLS)
_thin = core_function("pilot_thin", FLOATS, FLOATS, FLOATS, INTS, FLOAT, FLOAT, OUT_INTS, OUT_BOOLS)
_errors = core_function("pilot_errors", FLOATS, FLOATS, FLOATS, INTS, FLOATS, FLOATS, FLOATS, OUT_FLOATS)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Knots(Table):
    """Knots of the pilot force, counted from 0, rounded to the decimals in which they are written."""

    line: Ints32 = column(np.int32)
    """(k,) line of the G-code."""
    path_mm: Floats = column(np.float64)
    """(k,) arc length along the predicted path."""
    time_s: Floats = column(np.float64)
    lead_s: Floats = column(np.float64)
    """(k,) time by which a knot is announced ahead; NaN until the announcements are placed."""
    force_N: Floats = column(np.float64, 3)
    """(k, 3) on the tool, in the pilot frame."""
    deflection_mm: Floats = column(np.float64, 3)
    """(k, 3) that the force causes, in the pilot frame; NaN where it is not known."""
    tolerance_N: float = math.nan
    max_error_N: float = math.nan
    """Largest distance of a sample's force to the polyline."""
    rms_error_N: float = math.nan
    """Root of the mean square of that distance over the samples with a force."""


def knots_of(
    time_s: Floats,
    path_mm: Floats,
    force_N: Floats,
    deflection_mm: Floats | None = None,
    breaks: Rows | None = None,
    *,
    line: Ints32 | None = None,
    tolerance_N: float | None = None,
    cycle_s: float = CYCLE_S,
) -> Knots:
    """Compress forces along a path to the knots of a polyline.

    Parameters
    ----------
    time_s, path_mm : (m,) rising time and arc length of the samples.
    force_N : (m, 3), exactly zero in air.
    deflection_mm : (m, 3) in the same frame, or None.
    breaks : samples with a force that become knots in any case (changes of direction).
    line : (m,) lines of the G-code, for the knots and for the words of a finding.
    tolerance_N : largest distance of a sample to the polyline; default max(10 N, 3 % of the largest force).
    cycle_s : least time between two knots; closer ones are merged.

    Returns
    -------
    Knots, without their lead. The last sample before a contact and the first after it are knots; between
    them lies a Ramer-Douglas-Peucker polyline (Douglas & Peucker 1973) in the three components. The polyline
    may be read linearly in the path or in time, which differs where the speed changes; the larger error of
    the two is stated. A change within one cycle cannot be followed; if the tolerance is exceeded for that
    reason, ``issues`` has a finding.
    """
    acting = in_contact(force_N)
    lines = np.zeros(len(time_s), dtype=np.int32) if line is None else line
    if tolerance_N is None:
        tolerance_N = max(LEAST_TOLERANCE_N, TOLERANCE_SHARE * _largest(force_N))
    least_s = cycle_s * (1.0 - 1e-6)
    kept = _always_kept(time_s, acting, np.zeros(0, dtype=np.int64) if breaks is None else breaks, least_s)
    inner_N = tolerance_N - min(_WRITTEN_N, 0.05 * tolerance_N)
    force = np.ascontiguousarray(force_N)
    ends = np.empty(len(time_s), dtype=np.int64)
    _thin(time_s, path_mm, force, np.flatnonzero(kept), inner_N, least_s, ends, kept)
    del ends  # as long as the motion
    rows = np.flatnonzero(kept)
    knot_force = _rounded(force[rows], FORCE_DECIMALS)
    knot_time, knot_path = _rounded(time_s[rows], TIME_DECIMALS), _rounded(path_mm[rows], PATH_DECIMALS)
    error = np.zeros(len(time_s))
    _errors(time_s, path_mm, force, rows, knot_time, knot_path, knot_force, error)
    largest = float(error.max(initial=0.0))
    issues: tuple[Issue, ...] = ()
    if largest > tolerance_N:
        issues = (_too_steep(largest, tolerance_N, cycle_s, int(lines[np.argmax(error)])),)
    touched = error[acting]
    del error
    touched *= touched
    return Knots(
        line=lines[rows],
        path_mm=knot_path,
        time_s=knot_time,
        lead_s=np.full(len(rows), np.nan),
        force_N=knot_force,
        deflection_mm=_deflection_at(rows, deflection_mm),
        tolerance_N=tolerance_N,
        max_error_N=largest,
        rms_error_N=float(np.sqrt(np.mean(touched))) if len(touched) else 0.0,
        issues=issues,
    )


def _largest(force_N: Floats) -> float:
    """Return the largest of forces (m, 3)."""
    parts = in_chunks(lambda start, end: _largest_square(force_N[start:end]), chunk_borders(len(force_N)))
    return float(np.sqrt(max(parts, default=0.0)))


def _largest_square(vectors: Floats) -> float:
    return float(np.einsum("ij,ij->i", vectors, vectors).max(initial=0.0))


def in_contact(force_N: Floats) -> Bools:
    """Mark the samples (m,) at which a force acts."""
    acting = np.empty(len(force_N), dtype=np.bool_)

    def mark(start: int, end: int) -> None:
        x, y, z = force_N[start:end].T
        np.logical_or((x != 0.0) | (y != 0.0), z != 0.0, out=acting[start:end])

    in_chunks(mark, chunk_borders(len(force_N)))
    return acting


def force_at(knots: Knots, time_s: Floats) -> Floats:
    """Return the pilot force (n, 3) in N at times (n,): linear in time between knots, zero outside."""
    if len(knots) == 0:
        return np.zeros((len(time_s), 3))
    first, last = np.searchsorted(knots.time_s, [time_s.min(initial=np.inf), time_s.max(initial=-np.inf)])
    near = slice(max(first - 1, 0), last + 1)  # of all knots, those beside the times
    columns = knots.force_N[near].T
    force = np.stack([np.interp(time_s, knots.time_s[near], column) for column in columns], axis=1)
    written_s = 0.5 * 10.0**-TIME_DECIMALS
    force[(time_s < knots.time_s[0] - written_s) | (time_s > knots.time_s[-1] + written_s)] = 0.0
    return force


def to_pilot_frame(vector_base: Floats, rotation: Floats, tool: Ints32, cell: Cell) -> Floats:
    """Return vectors (m, 3) along ``$BASE`` in the frame in which the cell states its knots.

    ``tcp`` is the tool frame as the controller has it (``[tool] axis`` says which of its axes points from
    tip to holder), at the commanded pose with quaternions ``rotation`` (m, 4) of the inner tool frame.
    """
    if cell.pilot.frame == "base":
        return vector_base
    if fr.all_alike(rotation) and fr.all_alike(tool):
        first, run = np.zeros(1, dtype=np.int64), np.zeros(0, dtype=np.int64)
    else:
        first, run = fr.equal_runs(np.column_stack([rotation, tool]))
    turned = fr.rotation_from_quaternion(rotation[first])
    for number in distinct(tool[first]).tolist():
        turned[tool[first] == number] @= controller_axes(cell.tool[number].axis or "+z")[:3, :3].T
    if len(first) == 1 and (turned == np.eye(3)).all():
        return vector_base
    if len(first) == 1:
        return np.asarray(np.einsum("ij,ni->nj", turned[0], vector_base))
    return np.asarray(np.einsum("nij,ni->nj", turned[run], vector_base))


def _deflection_at(rows: Rows, deflection_mm: Floats | None) -> Floats:
    if deflection_mm is None:
        return np.full((len(rows), 3), np.nan)
    return _rounded(deflection_mm[rows], DEFLECTION_DECIMALS)


def _rounded(values: Floats, decimals: int) -> Floats:
    """Round to decimals, without a negative zero; first to 1e-9, so that processors agree."""
    return np.asarray(np.round(np.round(values, 9), decimals) + 0.0)


def _too_steep(error_N: float, tolerance_N: float, cycle_s: float, line: int) -> Issue:
    sentence = (
        f"the pilot force is {error_N:.0f} N off here, {tolerance_N:.0f} N are allowed: it changes within "
        f"one cycle of {cycle_s:g} s"
    )
    return Issue(
        "warning", "pilot-cycle", line, sentence, "predict with --dt equal to the controller's cycle"
    )


def _always_kept(time_s: Floats, acting: Bools, breaks: Rows, least_s: float) -> Bools:
    """Mark the samples (m,) at which a contact begins or ends and those of ``breaks``, a cycle apart."""
    kept = np.zeros(len(time_s), dtype=np.bool_)
    change = np.flatnonzero(acting[1:] != acting[:-1])
    ends = [row for row in (0, len(acting) - 1) if len(acting) and acting[row]]
    contacts = distinct(
        np.append(change + ~acting[change + 1], ends).astype(np.int64)
    )  # the sample without force
    kept[contacts[_spaced(time_s[contacts], least_s)]] = True
    contacts = np.flatnonzero(kept)
    inner = distinct(breaks[acting[breaks]])
    if len(contacts) and len(inner):
        behind = np.searchsorted(contacts, inner)
        after_s = time_s[contacts[np.minimum(behind, len(contacts) - 1)]] - time_s[inner]
        before_s = time_s[inner] - time_s[contacts[np.maximum(behind - 1, 0)]]
        inner = inner[(np.abs(after_s) >= least_s) & (np.abs(before_s) >= least_s)]
    kept[inner[_spaced(time_s[inner], least_s)]] = True
    return kept


def _spaced(time_s: Floats, least_s: float) -> Bools:
    """Mark the times (k,) that are at least ``least_s`` after the last marked one."""
    marked = np.empty(len(time_s), dtype=np.bool_)
    _mark_spaced(time_s, least_s, marked)
    return marked
