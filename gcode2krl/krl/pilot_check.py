"""The pilot force of a program that was read: its triggers carried out along the predicted motion."""

import re
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from gcode2krl import krc4
from gcode2krl import krl_words as w
from gcode2krl.arrays import Floats, Ints
from gcode2krl.cell import Cell
from gcode2krl.compiled.chunks import chunked
from gcode2krl.compiled.inputs import distinct
from gcode2krl.errors import MOST_PLACES, Issue
from gcode2krl.krl.advance import halts_advance, most_active, read_order, view
from gcode2krl.krl.pilot_text import NO_KNOT_YET, PilotText, checksum
from gcode2krl.krl.read import KrlProgram
from gcode2krl.krl.windows import Windows, windows_of
from gcode2krl.pilot import Knots, force_at, in_contact
from gcode2krl.pilot.sidecar import NOT_YET
from gcode2krl.tables import Motion, PilotForce, Targets
from gcode2krl.units import MS_PER_S

_ROUNDING_S = 0.001
"""A delay is written in whole ms."""
_REMEDY = "translate again"


@dataclass(frozen=True)
class PilotFigures:
    """Figures of a program's pilot force; None where a figure is not known."""

    knots: int
    tolerance_N: float | None
    max_error_N: float | None
    """Largest distance of the predicted force to the knots' polyline."""
    rms_error_N: float | None
    min_lead_s: float | None
    """Least time by which a knot is announced ahead, carried out along the predicted motion."""
    max_active: int
    """Largest number of triggers that wait at the same time."""

    def as_dict(self) -> dict[str, Any]:
        """Return the figures for ``--json``."""
        return asdict(self)


@dataclass(frozen=True)
class PilotCase:
    """What the pilot force of a program is checked against."""

    text: PilotText
    motion: Motion | PilotForce
    force_N: Floats | None = None
    """(m, 3) predicted, in the pilot frame, where known."""
    windows: Windows | None = None
    """When the motions run, where known already."""


def check_pilot(
    program: KrlProgram, case: PilotCase, targets: Targets, cell: Cell
) -> tuple[PilotFigures, list[Issue]]:
    """Carry out the triggers of a program along a Motion, and compare with the knots of its sidecar.

    ``targets`` are those of the program, motion by motion. What differs from the sidecar, and what the
    controller cannot do, is an error.
    """
    pilot, knots = case.text, case.text.knots
    ends = _ends_early(program, pilot)
    error_N, rms_N = _errors_of(knots, case.motion, case.force_N, ends)
    issues = [*_checksum_issues(program, pilot), *_form_issues(program, pilot)]
    lead_s: float | None = None
    windows = case.windows or windows_of(targets, krc4.build_chain(targets, cell), case.motion, cell)
    if len(program.triggers.motion) == len(knots) + ends > ends and len(windows.row):
        lead, late = _timing(program, pilot, windows, cell)
        issues += late
        lead_s = float(lead.min())
    order = read_order(len(program.ptp), _halts(program), cell)
    active = most_active(order[program.triggers.motion], view(cell))
    if active > cell.pilot.max_active:
        sentence = f"{active} triggers wait at the same time, allowed are {cell.pilot.max_active}"
        issues.append(_issue(program, 0, "pilot-active", sentence))
    if error_N is not None and error_N > knots.tolerance_N and not knots.issues:
        sentence = f"the knots are {error_N:.1f} N off the forces, allowed are {knots.tolerance_N:.1f} N"
        issues.append(Issue("error", "pilot-error", 0, sentence, _REMEDY))
    figures = PilotFigures(len(knots), _known(knots.tolerance_N), error_N, rms_N, lead_s, active)
    return figures, issues


def checksum_of(program: KrlProgram, rows: bytes) -> int:
    """Return the checksum of a program that was read, with the rows of its sidecar."""
    return checksum(
        program.position_mm,
        program.abc_deg,
        program.joint_rows,
        program.joint_deg,
        program.ptp,
        program.speed_mm_s,
        program.cdis_mm,
        rows,
        external=program.external,
    )


def _checksum_issues(program: KrlProgram, pilot: PilotText) -> list[Issue]:
    """Check that the program and its sidecar state the checksum of what was read, before any motion."""
    right = checksum_of(program, pilot.rows)
    set_to = re.compile(re.escape(pilot.hash_variable) + r"=(\d+)", re.IGNORECASE)
    matches = [(set_to.fullmatch(re.sub(r"\s+", "", s.text)), s) for s in program.statements]
    stated = [(int(match[1]), s) for match, s in matches if match]
    issues = []
    if len(stated) != 1 or stated[0][1].motion > 0 or stated[0][0] != right:
        line = stated[0][1].line if stated else program.def_line
        sentence = f"{pilot.hash_variable} must be set once, before the first motion, to {right}"
        issues.append(Issue("error", "pilot-checksum", line, sentence, _REMEDY))
    if pilot.header.checksum not in (NOT_YET, right):
        sentence = f"the sidecar is of another program: checksum {pilot.header.checksum}, here {right}"
        issues.append(Issue("error", "pilot-checksum", 0, sentence, _REMEDY))
    return issues


def _known(value: float) -> float | None:
    return None if np.isnan(value) else value


def _halts(program: KrlProgram) -> Ints:
    """Return the motions behind which a wait or a halt holds the advance run."""
    texts: dict[int, list[str]] = {}
    for statement in program.statements:
        texts.setdefault(statement.motion, []).append(statement.text)
    rows = [motion - 1 for motion, said in texts.items() if motion > 0 and halts_advance(said)]
    return distinct(np.append(np.flatnonzero(program.wait_s > 0), np.array(rows, dtype=np.int64)))


def _ends_early(program: KrlProgram, pilot: PilotText) -> bool:
    """Tell whether the last trigger says that there is no knot any more."""
    read = program.triggers
    if len(read.motion) == 0:
        return False
    if pilot.header.form == "index":
        return bool(read.written[-1, 0] == NO_KNOT_YET)
    return len(read.motion) > len(pilot.knots) and not read.written[-1].any()


def _errors_of(
    knots: Knots, motion: Motion | PilotForce, force_N: Floats | None, ends_early: bool
) -> tuple[float | None, float | None]:
    """Return the largest and the RMS distance of forces to the ramps that the online side makes of knots.

    The figures of the compression count the ramps along the path as well; the larger ones are returned.
    Where a pilot force ends early, the forces behind its end are not compared.
    """
    if force_N is None:
        return _known(knots.max_error_N), _known(knots.rms_error_N)
    time_s = motion.time_s
    if ends_early:
        said = time_s <= (knots.time_s[-1] if len(knots) else -np.inf)
        time_s, force_N = time_s[said], force_N[said]

    acting = np.empty(len(time_s), dtype=np.bool_)

    def squares(rows: slice) -> Floats:
        off = force_N[rows] - force_at(knots, time_s[rows])
        acting[rows] = in_contact(force_N[rows])
        return np.asarray(np.einsum("ij,ij->i", off, off))

    square = chunked(squares, len(time_s))
    mean = float(np.mean(square[acting])) if acting.any() else 0.0
    figures = np.sqrt([float(square.max(initial=0.0)), mean])
    figures = np.fmax(figures, [knots.max_error_N, knots.rms_error_N])
    return float(figures[0]), float(figures[1])


def _issue(program: KrlProgram, row: int, code: str, sentence: str) -> Issue:
    """Return an error at the trigger of a row."""
    line = int(program.triggers.line[row]) if row < len(program.triggers.line) else 0
    file = program.file[program.triggers.file_of[row]] if line else program.file[0]
    place = "" if file == program.file[0] else f"{file}: "
    return Issue("error", code, line, place + sentence, _REMEDY)


def _form_issues(program: KrlProgram, pilot: PilotText) -> list[Issue]:
    """Check that there is a trigger for each knot, in order, that writes what the sidecar says."""
    read, header, knots = program.triggers, pilot.header, pilot.knots
    count = len(read.motion) - _ends_early(program, pilot)
    if count != len(knots):
        return [
            _issue(program, count, "pilot-count", f"{count} triggers, the sidecar has {len(knots)} knots")
        ]
    if count == 0:
        return []
    by_index = header.form == "index"
    name = (header.variable if by_index else w.PILOT_SUBPROGRAM).upper()
    if read.names != (name,) or (read.calls == by_index).any():
        row = int(np.argmax(read.calls == by_index))
        sentence = f"triggers write to {', '.join(read.names)}, the sidecar says {name}"
        return [_issue(program, row, "pilot-form", sentence)]
    if by_index:
        wrong = read.written[:count, 0] != np.arange(count)
    else:
        said = np.column_stack([knots.force_N, knots.lead_s])
        wrong = ~(np.abs(read.written[:count] - said) <= 1e-9 + 1e-12 * np.abs(said)).all(axis=1)
    unlike = (read.distance != 0.0) | (read.delay_ms < 0.0) | (read.delay_ms != np.rint(read.delay_ms))
    wrong = np.append(wrong, np.zeros(len(unlike) - count, dtype=np.bool_)) | unlike
    return [
        _issue(program, row, "pilot-knot", f"the trigger of knot {row} is not as in the sidecar")
        for row in np.flatnonzero(wrong)[:MOST_PLACES].tolist()
    ]


def _timing(
    program: KrlProgram, pilot: PilotText, windows: Windows, cell: Cell
) -> tuple[Floats, list[Issue]]:
    """Return the leads (k,) in s by which knots are really announced, and what is wrong with them."""
    read, knots = program.triggers, pilot.knots
    window = np.searchsorted(windows.row, read.motion)
    window = np.minimum(window, len(windows.row) - 1)
    carried = windows.row[window] == read.motion
    fire_s = windows.begin_s[window] + read.delay_ms / MS_PER_S
    outside = ~carried | (fire_s > windows.end_s[window] + _ROUNDING_S)
    count = len(knots)
    lead_s = knots.time_s - fire_s[:count]
    cycle_s, least_s = cell.controller.cycle_s, np.minimum(knots.lead_s, pilot.header.lead_s)
    together = np.diff(fire_s, prepend=-np.inf) < cycle_s - _ROUNDING_S
    together[:count] |= np.diff(knots.time_s, prepend=-np.inf) < cycle_s * (1.0 - 1e-3)
    beyond = np.zeros(len(fire_s), dtype=np.bool_)
    beyond[count:] = fire_s[count:] > knots.time_s[-1] - pilot.header.lead_s + _ROUNDING_S
    checks = (
        ("pilot-window", outside, "its instant is not within the motion that carries it"),
        ("pilot-lead", ~(lead_s >= least_s - _ROUNDING_S), "announced too late"),
        ("pilot-lead", ~(np.abs(lead_s - knots.lead_s) <= cycle_s), "its lead is not that of the sidecar"),
        ("pilot-cycle", together, f"within one cycle of {cycle_s:g} s with the knot before"),
        ("pilot-lead", beyond, "its end is told too late"),
    )
    issues = []
    for code, wrong, what in checks:
        for row in np.flatnonzero(wrong)[:MOST_PLACES].tolist():
            place = f"knot {row}, {lead_s[row]:.3f} s ahead" if row < count else "end of the pilot force"
            issues.append(_issue(program, row, code, f"{place}: {what}"))
    return lead_s, issues
