"""``write_krl``: Targets to files, checked, read back and verified before anything is written."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from gcode2krl.cell import Cell
from gcode2krl.errors import Issue, RefusedError, input_error
from gcode2krl.krl.announce import PilotPlan
from gcode2krl.krl.compose import SIDECAR, Layout, compose
from gcode2krl.krl.files import write_together
from gcode2krl.krl.names import name_problem, suggested_name
from gcode2krl.krl.pilot_check import PilotCase, PilotFigures
from gcode2krl.krl.pilot_plan import left_out, plan_pilot
from gcode2krl.krl.pilot_text import PilotText
from gcode2krl.krl.read import read_texts
from gcode2krl.krl.release import header_words, released
from gcode2krl.krl.rsi_files import file_names
from gcode2krl.krl.rsi_refusals import online_issues
from gcode2krl.krl.verify import VerifyReport, compare
from gcode2krl.predict import solve_ptp_joints
from gcode2krl.prediction import Prediction
from gcode2krl.tables import Joints, Targets
from gcode2krl.units import BYTES_PER_MB

PilotForm = Literal["index", "values", "none"]


@dataclass(frozen=True)
class WrittenProgram:
    """What `write_krl` wrote."""

    name: str
    files: tuple[Path, ...]
    texts: dict[str, bytes]
    """File name → bytes."""
    report: VerifyReport
    issues: tuple[Issue, ...]
    targets: Targets
    """As written: with the pieces that the pilot force needs."""

    @property
    def pilot(self) -> PilotFigures | None:
        """Figures of the pilot force, None where the program has none."""
        return self.report.pilot


def write_krl(
    source: Targets | Prediction,
    path: str | Path | None,
    cell: Cell | None = None,
    *,
    joints: Joints | None = None,
    name: str | None = None,
    allow: Sequence[str] = (),
    guard: bool = True,
    split: Literal["defs", "files"] = "defs",
    options: str = "",
    strict: bool = False,
    pilot: PilotForm | None = None,
    online: str | None = None,
) -> WrittenProgram:
    """Write a KRL program: ``.src``, ``.dat`` (parts, ``.pilot.csv``, RSI), all together or not at all.

    Parameters
    ----------
    source : Targets from `set_targets`, or a Prediction; errors among its ``issues`` refuse the program.
    path : the ``.src``; None composes and verifies without writing (everything in one ``.src`` text).
    cell : needed with Targets; a Prediction has its own.
    joints : joints at the targets where they are known already.
    name : program name; default: the file's stem.
    allow : findings released by hand, ``CODE:LINE`` or ``CODE`` for all of a kind; the header lists them.
    guard : compare frames, robot and inputs before the first motion.
    split : ``defs`` puts parts of a long program into subprograms of the same file, ``files`` into files.
    options : words for the header.
    strict : warnings refuse the program too.
    pilot : how the program carries the pilot force, by default as the cell says where the prediction has
        forces, and not without a path; ``index`` needs the sidecar beside the program. The default is left
        out from where it cannot be announced, with a warning; a form that is named is carried or refused.
    online : name of the RSI files of a program that is corrected online by the cell's ``[online]``; they
        are written beside it. RSI is on from above the first cut to above the last.

    Raises
    ------
    RefusedError
        Where a finding forbids the program, or its own verification does.
    NotUnderstoodError
        Where the output cannot be written or a name or release is wrong.
    """
    targets, cell = (source.targets, source.cell) if isinstance(source, Prediction) else (source, cell)
    if cell is None:
        raise input_error("option-value", "write_krl needs a cell with Targets")
    file = Path(path) if path is not None else None
    program_name, issues = _program_name(file, name)
    if online is not None:
        _refuse_name(online, file)
        issues += online_issues(targets, cell)
    header_allowed = header_words([*issues, *source.issues], allow)
    issues = list(released([*issues, *source.issues], allow, strict))
    joints = solve_ptp_joints(targets, cell) if joints is None else joints
    plan = _pilot_plan(source, pilot, joints, file is not None)
    known = isinstance(source, Prediction) and source.forces is not None
    layout = Layout(
        guard,
        split if file is not None else "defs",
        single_file=file is None,
        options=options,
        allowed=header_allowed,
        forces=known,
        online=online or "",
    )
    bare = _Content(targets, joints)
    content = bare if plan is None or isinstance(plan, Issue) else _Content.of(plan)
    texts, report = _composed(content, cell, program_name, layout)
    failed = [issue for issue in report.issues if issue.severity == "error"]
    if pilot is None and failed and all(issue.code.startswith("pilot-") for issue in failed):
        plan, content = left_out(failed[0]), bare
        texts, report = _composed(content, cell, program_name, layout)
    if plan is not None:
        issues += released([plan] if isinstance(plan, Issue) else plan.issues, (), strict)
    targets = content.targets
    issues += released(_size_issues(texts, targets, cell), (), strict)
    if not report.ok:
        raise RefusedError([*report.issues, *issues], source="" if file is None else file.name)
    written: dict[Path, bytes] = {}
    if file is not None:
        written = {_place(file, part, program_name): text for part, text in texts.items()}
        write_together(written)
    return WrittenProgram(program_name, tuple(written), texts, report, tuple(issues), targets)


@dataclass(frozen=True)
class _Content:
    """What a program says: its motions, and a pilot force or none."""

    targets: Targets
    joints: Joints
    text: PilotText | None = None
    case: PilotCase | None = None

    @classmethod
    def of(cls, plan: PilotPlan) -> "_Content":
        return cls(plan.targets, plan.joints, plan.text, plan.case)


def _composed(
    content: _Content, cell: Cell, name: str, layout: Layout
) -> tuple[dict[str, bytes], VerifyReport]:
    """Return the files of a program, and what reading them back finds."""
    targets, joints = content.targets, content.joints
    texts = compose(targets, joints, cell, name, layout, content.text)
    return texts, compare(read_texts(texts, f"{name}.src"), targets, joints, cell, pilot=content.case)


def _pilot_plan(
    source: Targets | Prediction, form: PilotForm | None, joints: Joints, sidecar: bool
) -> PilotPlan | Issue | None:
    """Return the pilot force to write, None where there is none to write or it is not wanted.

    One that was not asked for by name is left out where it cannot be announced, with a finding.
    """
    asked = form is not None
    if isinstance(source, Targets):
        if form in ("index", "values"):
            sentence = f"pilot {form}: Targets have no forces"
            raise input_error("option-value", sentence, "give write_krl a prediction with forces")
        return None
    if form is None:
        form = source.cell.pilot.form if sidecar and source.forces is not None else "none"
    if form == "none":
        return None
    if form == "index" and not sidecar:
        sentence = "--pilot index needs the sidecar .pilot.csv, which standard output cannot carry"
        raise input_error("option-value", sentence, "give -o part.src, or --pilot values")
    return plan_pilot(source, joints, form, sidecar, asked=asked)


def _refuse_name(online: str, file: Path | None) -> None:
    """Raise where RSI files of that name cannot be written."""
    file_names(online)
    if file is None:
        sentence = "--online needs the RSI files, which standard output cannot carry"
        raise input_error("option-value", sentence, "give -o part.src")


def _place(file: Path, part: str, program_name: str) -> Path:
    if part == f"{program_name}.src":
        return file
    for suffix in (".dat", SIDECAR):
        if part == f"{program_name}{suffix}":
            return file.with_suffix(suffix)
    return file.with_name(part)


def _program_name(file: Path | None, name: str | None) -> tuple[str, list[Issue]]:
    """Return the program's name and what there is to say about it."""
    if name is not None:
        problem = name_problem(name) if name else "is empty"
        if problem:
            raise input_error(
                "krl-name",
                f"--name {name!r}: {problem}",
                "at most 24 of A-Z, 0-9, _; not starting with a digit",
            )
        if file is not None and file.stem.upper() != name.upper():
            sentence = f"the file {file.name} holds the program {name.upper()}"
            remedy = f"call it {name.upper()}.src on the controller"
            return name.upper(), [Issue("warning", "krl-name", 0, sentence, remedy)]
        return name.upper(), []
    stem = file.stem if file is not None else "PART"
    good = suggested_name(stem)
    if good == stem.upper():
        return good, []
    remedy = f"name the output {good}.src, or give --name"
    return good, [
        Issue(
            "warning", "krl-name", 0, f"{stem!r} is no KRL program name; the program is called {good}", remedy
        )
    ]


def _size_issues(texts: dict[str, bytes], targets: Targets, cell: Cell) -> list[Issue]:
    program = (text for name, text in texts.items() if not name.endswith((SIDECAR, ".xml")))
    size_mb = sum(map(len, program)) / BYTES_PER_MB
    motions = int(np.count_nonzero(~targets.ptp))
    if size_mb <= cell.program.warn_size_mb and motions <= cell.program.memory_moves:
        return []
    return [
        Issue(
            "warning", "program-large", 0,
            f"{size_mb:.1f} MB, {motions} LIN: more than controllers are known to hold "
            f"({cell.program.warn_size_mb:g} MB, {cell.program.memory_moves} LIN)",
            "use --split files, a larger arc chord tolerance, or split the job in the CAM",
        )
    ]  # fmt: skip
