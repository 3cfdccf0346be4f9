"""Verify: the program read back against what it should say, and against the controller's rules."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from gcode2krl import krl_words as w
from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.chain import Plan, forecast_of, foresee, prepare
from gcode2krl.compiled.inputs import distinct
from gcode2krl.errors import MOST_PLACES, Issue, RefusedError
from gcode2krl.exchange.findings import Findings, counted, findings_block
from gcode2krl.exchange.html import block, text_table
from gcode2krl.krl.announce import pilot_force
from gcode2krl.krl.arcs import unrolled
from gcode2krl.krl.cell_hashes import StatedCell
from gcode2krl.krl.composition import MESSAGE_SETUP, TextLayout, compose
from gcode2krl.krl.differences import JOINT_LIMIT_DEG, POSITION_LIMIT_MM, REMEDY, differences_of
from gcode2krl.krl.original_path import OriginalFigures, compare_with_original, require_stated
from gcode2krl.krl.pieces import pieces_in, split
from gcode2krl.krl.pilot_check import PilotCase, PilotFigures, check_pilot, checksum_of
from gcode2krl.krl.pilot_text import PilotText
from gcode2krl.krl.read import KrlProgram, Statement, read_krl, read_texts
from gcode2krl.krl.release import is_refusing, released_again
from gcode2krl.krl.rsi_refusals import online_issues, retract_issues
from gcode2krl.krl.rsi_rules import rsi_file_issues, rsi_name
from gcode2krl.krl.rules import in_file, rule_issues, state_issues
from gcode2krl.krl.side_files import beside, data_issues, declares_itself, missing, missing_parts
from gcode2krl.krl.splines import at_rest_behind, passing
from gcode2krl.pilot import knot_rows, read_pilot
from gcode2krl.pipeline import plan_motion
from gcode2krl.prediction import Prediction
from gcode2krl.program.arcs import arcs_of
from gcode2krl.program.splines import splines_of
from gcode2krl.tables import Joints, Targets, Toolpath
from gcode2krl.units import DEG_PER_RAD, S_PER_MIN

# The findings that would refuse a program, or be told with it, judged anew with the cell as it is now.


def judged(
    plan: Plan,
    prediction: Prediction | None,
    releases: Mapping[str, int | None],
    *,
    online: bool,
    forces: bool,
) -> list[Issue]:
    """Return errors and warnings of the checks of a translation, each with the G-code as its file.

    Those that a Prediction brings along are not run again.
    ``releases`` are those in the header of the program and how many findings each was for, None for any.
    ``forces`` cuts material too.
    """
    targets, cell = plan.targets, plan.cell
    known = [*targets.issues] if prediction is None else [*prediction.issues]
    if online:
        known = [*online_issues(targets, cell), *retract_issues(targets, cell), *known]
    if prediction is None and not is_refusing(known, releases):  # else nothing can be foreseen
        forecast = foresee(plan, forces=forces)
        known += forecast.issues[len(targets.issues) :]
    return list(_of_gcode(released_again(known, releases), plan.toolpath.source))


def _of_gcode(issues: Iterable[Issue], source: str) -> Iterator[Issue]:
    """Yield the findings but the notes, with the file that they are about."""
    for issue in issues:
        if issue.severity != "note":
            yield issue if issue.file else replace(issue, file=source)


@dataclass(frozen=True, repr=False)
class VerifyReport:
    """Outcome of a verification.

    ``max_deviation_mm`` and ``max_rotation_deg`` are NaN where the motions cannot be paired.
    """

    max_deviation_mm: float
    max_rotation_deg: float
    max_speed_difference_mm_min: float
    motions: int
    intended: int
    worst: tuple[dict[str, Any], ...] = ()
    issues: tuple[Issue, ...] = field(default=())
    pilot: PilotFigures | None = None
    """None without a pilot force."""
    original: OriginalFigures | None = None
    """How a program that leaves out corners keeps to its G-code, None where it leaves out none."""

    @property
    def ok(self) -> bool:
        """True where no finding is an error."""
        return not any(issue.severity == "error" for issue in self.issues)

    @property
    def findings(self) -> Findings:
        """The ``issues`` as a table: severity, code, line, message, remedy."""
        return Findings(self.issues)

    def __repr__(self) -> str:
        return f"VerifyReport({self.words()})"

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the worst differences and the findings."""
        head = ("file", "line", "G-code line", "off by (mm)")
        rows = [(each["file"], each["line"], each["gcode_line"], each["deviation_mm"]) for each in self.worst]
        table = text_table(head, rows) if rows else ""
        return block(repr(self), table, findings_block(self.issues))

    def words(self) -> str:
        """Return the outcome in words: ``457 motions, off by 0.0007 mm``."""
        off = f"off by {self.max_deviation_mm:.4f} mm, {self.max_rotation_deg:.4f} deg"
        counts = counted(self.issues)
        return ", ".join([f"{self.motions} motions", off, *([counts] if counts else [])])

    def as_dict(self) -> dict[str, Any]:
        """Return the object that ``--json`` prints; what is not a number is null."""
        return {
            "max_deviation_mm": _number(self.max_deviation_mm),
            "max_rotation_deg": _number(self.max_rotation_deg),
            "max_speed_difference_mm_min": _number(self.max_speed_difference_mm_min),
            "motions": self.motions,
            "intended": self.intended,
            "ok": self.ok,
            "worst": list(self.worst),
            **({"pilot": self.pilot.as_dict()} if self.pilot is not None else {}),
            **({"original": self.original.as_dict()} if self.original is not None else {}),
        }


def verify_krl(
    path: str | Path,
    toolpath: Toolpath,
    cell: Cell,
    tolerance_mm: float | None = None,
    *,
    simplify_mm: float | None = None,
    prediction: Prediction | None = None,
    forces: bool = True,
    allow: Sequence[str] = (),
) -> VerifyReport:
    """Read a program back, compare it with what the G-code and the cell ask for, and judge its hazards anew.

    ``tolerance_mm`` and ``simplify_mm`` must be those the program was made with; a program that leaves out
    corners is compared with every move of ``toolpath`` too (`krl.original_path`). A pilot force is compared
    with the sidecar beside the program and carried out along the Motion of ``prediction``, or along one
    planned here; with ``prediction`` its targets (which may be compensated) are what is intended, and the
    knots are compared with its forces. The RSI files beside a program that is corrected online must be as the
    cell asks for.

    Whatever would refuse or warn in a translation is found again, with the cell as it is now; without
    ``forces`` no material is cut. Those findings have the G-code as their ``file``; what the header of the
    program or ``allow`` releases is a warning. A section of the cell that is not as when the program was
    written is an error.

    Raises `NotUnderstoodError` where a file cannot be read or the G-code has no motion, and `RefusedError`
    where no program can be made of it.

    >>> from gcode2krl import load_cell, predict, verify_krl, write_krl
    >>> prediction = predict("part.nc")
    >>> program = write_krl(prediction, "PART.src")
    >>> verify_krl("PART.src", prediction.toolpath, prediction.cell).ok
    True
    """
    program = read_krl(path)
    if prediction is not None:
        simplified = prediction.targets.simplified
        simplify_mm = simplified.tolerance_mm if simplified is not None else None
    require_stated(program, simplify_mm)
    stated = StatedCell(program)
    try:
        if prediction is not None:
            plan = Plan.of(toolpath, prediction.targets, cell)
        else:
            plan, _ = prepare(toolpath, cell, tolerance_mm, simplify_mm).with_corners(tolerance_mm)
    except RefusedError as refused:
        raise RefusedError([*refused.issues, *stated.changes(cell)], refused.source) from None
    targets, joints = plan.targets, plan.joints
    parts = missing_parts(program, cell.program.externals)
    if parts:  # nothing behind them could be told from a difference
        return _not_whole(program, targets, parts)
    online = rsi_name(program, Path(path).parent)
    issues = [*stated.changes(cell, distinct(targets.tool).tolist())]
    releases = {**stated.releases(), **dict.fromkeys(allow)}
    hazards = judged(plan, prediction, releases, online=bool(online), forces=forces)
    issues += hazards
    pilot, announced = _pilot_of(program, Path(path), cell)
    case: PilotCase | None = None
    if pilot is not None:
        if prediction is not None:
            force = pilot_force(forecast_of(prediction))
            case = PilotCase(pilot, force, force.force_N)
        else:
            case = PilotCase(pilot, plan_motion(targets, cell, cell.controller.cycle_s, watches=False))
    if announced:
        pieces = pieces_in(
            program.position_mm, program.ptp, program.cdis_mm, targets, cell, POSITION_LIMIT_MM
        )
        targets, joints, _ = split(targets, joints, pieces, cell)
    if announced and pilot is None:
        issues.append(_no_sidecar(program, Path(path)))
        program = _without_pilot(program, cell)
    alone = declares_itself(program)
    arcs = tuple(arcs_of(targets)) if len(program.circ_rows) else ()
    splines = tuple(splines_of(targets, bool(arcs))) if len(program.spl_rows) else ()
    layout = TextLayout(guard=program.guard, online=online, single_file=alone, arcs=arcs, splines=splines)
    composed = compose(targets, joints, cell, program.name, layout, pilot)
    expected = {name: b"".join(pieces) for name, pieces in composed.items()}
    if not alone:
        issues += data_issues(Path(path), program, expected[f"{program.name}{w.DATA_SUFFIX}"])
    if online:
        issues += rsi_file_issues(Path(path), expected)
    intended = read_texts(expected, f"{program.name}{w.SOURCE_SUFFIX}")
    return compare(program, targets, joints, cell, intended, issues, case, toolpath)


def _not_whole(program: KrlProgram, targets: Targets, issues: Sequence[Issue]) -> VerifyReport:
    """Return the report of a program of which parts are missing: nothing else is said of it."""
    nan = float("nan")
    return VerifyReport(nan, nan, nan, len(program.ptp), len(targets), issues=tuple(issues))


def _pilot_of(program: KrlProgram, path: Path, cell: Cell) -> tuple[PilotText | None, bool]:
    """Return the pilot force that belongs to a program, None without a sidecar, and whether it has one."""
    variable = _normal(cell.pilot.hash_variable)
    announced = any(_normal(statement.text).startswith(f"{variable}=") for statement in program.statements)
    announced |= len(program.triggers.motion) > 0
    sidecar = beside(path, w.SIDECAR_SUFFIX)
    if not sidecar.is_file() or not announced:
        return None, announced
    knots, header = read_pilot(sidecar)
    stated = checksum_of(program, knot_rows(knots))  # a piece is known no better than as it was read
    return PilotText(knots, header, cell.pilot.hash_variable, stated=stated), announced


def _no_sidecar(program: KrlProgram, path: Path) -> Issue:
    name, lines = path.with_suffix(w.SIDECAR_SUFFIX).name, program.triggers.line
    why = "the pilot force that the program announces is not known to fit"
    return missing(name, "pilot-sidecar", int(lines[0]) if len(lines) else 0, why)


def _without_pilot(program: KrlProgram, cell: Cell) -> KrlProgram:
    """Return a program without what it sets and calls for a pilot force whose sidecar is missing."""
    set_names = (cell.pilot.index_variable, cell.pilot.hash_variable, f"{cell.pilot.value_variable}[")
    prefixes = tuple(_normal(name) for name in set_names)
    statements = tuple(s for s in program.statements if not _normal(s.text).startswith(prefixes))
    uncalled = {
        key: text for key, text in program.uncalled.items() if not key.endswith(f"/{w.PILOT_SUBPROGRAM}")
    }
    return replace(program, statements=statements, uncalled=uncalled)


def compare(
    program: KrlProgram,
    targets: Targets,
    joints: Joints,
    cell: Cell,
    intended: KrlProgram | None = None,
    more_issues: Sequence[Issue] = (),
    pilot: PilotCase | None = None,
    original: Toolpath | None = None,
) -> VerifyReport:
    """Compare a program as read with the intended targets.

    With ``intended``, also what is between them; with ``pilot``, also what announces the pilot force; with
    ``original``, where corners are left out, also with every move of the G-code.
    """
    program = passing(unrolled(at_rest_behind(program), targets), targets)
    intended = passing(unrolled(intended, targets), targets) if intended is not None else None
    issues = [*program.issues, *more_issues]
    issues += rule_issues(program, cell)
    issues += state_issues(program, targets.tool, cell)
    issues += _start_issues(program, targets)
    issues += _arc_issues(program)
    paired = len(program.ptp) == len(targets)
    count = len(targets)
    if not paired:  # behind the first difference every motion would be compared with another
        count, line = _first_difference(program, targets)
        text = f"{len(program.ptp)} motions read, {len(targets)} intended; they differ from this line on"
        issues.append(Issue("error", "verify-count", line, text, REMEDY))
    differences = differences_of(program, targets, joints, cell, count)
    issues += _home_issues(program, targets, joints, count)
    issues += differences.issues
    if intended is not None:
        read, wished = (
            _behind_split(tuple(s for s in p.statements if paired or s.motion <= count))
            for p in (program, intended)
        )
        issues += _statement_issues(read, wished, program)
        declared, wanted = (_own_declarations(p.declarations) for p in (program, intended))
        issues += _statement_issues(declared, wanted, program)
        issues += _uncalled_issues(program, intended)
    figures: PilotFigures | None = None
    if pilot is not None and paired:
        figures, more = check_pilot(program, pilot, targets, cell)
        issues += more
    kept: OriginalFigures | None = None
    if targets.simplified is not None and original is not None and paired:
        kept, more = compare_with_original(program, targets, original, cell)
        issues += more
    worst = tuple(
        {
            "file": program.file[program.file_of[row]],
            "line": int(program.line[row]),
            "gcode_line": int(targets.source_line[row]),
            "deviation_mm": _number(deviation_mm),
        }
        for row, deviation_mm in differences.worst
    )
    deviation_mm, rotation_deg, speed_mm_s = differences.largest if paired else (float("nan"),) * 3
    return VerifyReport(
        max_deviation_mm=deviation_mm,
        max_rotation_deg=rotation_deg,
        max_speed_difference_mm_min=speed_mm_s * S_PER_MIN,
        motions=len(program.ptp),
        intended=len(targets),
        worst=worst,
        issues=tuple(issues),
        pilot=figures,
        original=kept,
    )


def _home_issues(program: KrlProgram, targets: Targets, joints: Joints, count: int) -> list[Issue]:
    """Return where HOME is another, axis by axis."""
    issues = []
    for row in np.flatnonzero(targets.home[:count] & program.ptp[:count]):
        stated_deg, wanted = _joints_at(program, int(row)), joints.q_rad[row] * DEG_PER_RAD
        wrong = np.flatnonzero(~(np.abs(stated_deg - wanted) <= JOINT_LIMIT_DEG))
        if not len(wrong):
            continue
        if np.isnan(stated_deg).all():
            text = "HOME is not given by its joints, A1 to A6"
        else:
            text = "HOME: " + ", ".join(
                f"A{k + 1} is {'missing' if np.isnan(stated_deg[k]) else f'{stated_deg[k]:.4f}'}, "
                f"intended {wanted[k]:.4f} deg"
                for k in wrong
            )
        text = in_file(program, program.file[program.file_of[row]]) + text
        issues.append(Issue("error", "verify-position", int(program.line[row]), text, REMEDY))
    return issues


def _joints_at(program: KrlProgram, row: int) -> Floats:
    """Return the joint target (6,) in degrees of a motion, NaN where it has none."""
    at = int(np.searchsorted(program.joint_rows, row))
    has = at < len(program.joint_rows) and program.joint_rows[at] == row
    joints: Floats = program.joint_deg[at] if has else np.full(6, np.nan)
    return joints


def _start_issues(program: KrlProgram, targets: Targets) -> list[Issue]:
    """Check that the first programmed position is reached at rest: there the predicted motion begins."""
    first = int(np.argmax(targets.move >= 0))
    if first >= len(program.cdis_mm) or program.cdis_mm[first] == 0.0:  # NaN: C_DIS of unknown width
        return []
    file = in_file(program, program.file[program.file_of[first]])
    text = f"{file}the first programmed position is passed by C_DIS; the prediction starts there at rest"
    remedy = "translate again; a prediction of an older version must be made again"
    return [Issue("error", "verify-start", int(program.line[first]), text, remedy)]


def _arc_issues(program: KrlProgram) -> list[Issue]:
    """Return the arcs that could not be unrolled."""
    return [
        Issue(
            "error",
            "krl-motion-unknown",
            int(program.line[row]),
            f"{in_file(program, program.file[program.file_of[row]])}CIRC goes another way than the targets",
            REMEDY,
        )
        for row in program.circ_rows[:MOST_PLACES].tolist()
    ]


def _own_declarations(declarations: tuple[Statement, ...]) -> tuple[Statement, ...]:
    """Return the declarations but those of the program's own parts, which depend on how it is split."""
    return tuple(
        s for s in declarations if not re.match(rf"{w.EXT}\s+\w+_\d{{3,}}\s*\(\s*\)", s.text, re.IGNORECASE)
    )


def _behind_split(statements: tuple[Statement, ...]) -> tuple[Statement, ...]:
    """Return the statements but those with which a part prepares its messages, as the split decides that."""
    set_up = frozenset(_normal(line) for line in MESSAGE_SETUP.splitlines())
    return tuple(s for s in statements if s.motion == 0 or _normal(s.text) not in set_up)


def _statement_issues(
    read: tuple[Statement, ...], intended: tuple[Statement, ...], program: KrlProgram
) -> list[Issue]:
    """Compare what stands between the motions: settings, guard, outputs, waits, calls, declarations."""
    statements = [(s.motion, _normal(s.text)) for s in read]
    wanted = [(s.motion, _normal(s.text)) for s in intended]
    if statements == wanted:
        return []
    shorter = min(len(statements), len(wanted))
    at = next((k for k, (a, b) in enumerate(zip(statements, wanted, strict=False)) if a != b), shorter)
    here = read[min(at, len(read) - 1)] if read else Statement(0, "", program.file[0], 0)
    have = read[at].text if at < len(read) else "nothing"
    want = intended[at].text if at < len(intended) else "nothing"
    text = f"found {have[:60]!r}, intended {want[:60]!r}"
    if _normal(have) == _normal(want):
        text = f"{have[:60]!r} stands behind motion {read[at].motion}, intended behind {intended[at].motion}"
    text = in_file(program, here.file) + text
    remedy = "translate again, with the cell it was made with"
    return [Issue("error", "verify-statement", here.line, text, remedy)]


def _uncalled_issues(program: KrlProgram, intended: KrlProgram) -> list[Issue]:
    """Compare the subprograms that triggers call, whatever file they stand in."""
    read_tool, wanted = (
        {(key.split("/")[-1], texts) for key, texts in p.uncalled.items()} for p in (program, intended)
    )
    return [
        Issue("error", "verify-statement", program.def_line, f"subprogram {name} is not as intended", REMEDY)
        for name, _ in sorted(read_tool ^ wanted)
    ]


def _first_difference(program: KrlProgram, targets: Targets) -> tuple[int, int]:
    """Return the row and the .src line at which the motions begin to differ."""
    count = min(len(program.ptp), len(targets))
    off = np.linalg.norm(program.position_mm[:count] - targets.position_mm[:count], axis=1)
    joints = np.zeros(len(program.ptp), dtype=np.bool_)
    joints[program.joint_rows] = ~np.isnan(program.joint_deg).any(axis=1)
    other = np.where(targets.home[:count], ~joints[:count], ~(off <= POSITION_LIMIT_MM))
    row = int(np.argmax(other)) if other.any() else count
    line = program.line[min(row, len(program.line) - 1)] if len(program.line) else 0
    return row, int(line)


def _normal(text: str) -> str:
    return re.sub(r"\s+", "", text).upper()


def _number(value: float) -> float | None:
    return None if np.isnan(value) else value
