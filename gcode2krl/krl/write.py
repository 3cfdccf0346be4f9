"""``write_krl``: Targets to files, checked, read back and verified before anything is written."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from gcode2krl import krl_words as w
from gcode2krl import robot
from gcode2krl.cell import Cell
from gcode2krl.cell.checked_parts import CollisionScope, collision_scope
from gcode2krl.chain import forecast_of
from gcode2krl.compiled.inputs import distinct
from gcode2krl.errors import Issue, RefusedError, input_error
from gcode2krl.exchange.findings import Findings, counted, findings_block
from gcode2krl.exchange.html import beside, block, path_picture, text_table
from gcode2krl.krl.announce import PilotPlan
from gcode2krl.krl.composition import TextLayout, compose
from gcode2krl.krl.pilot_check import PilotCase, PilotFigures
from gcode2krl.krl.pilot_plan import left_out, plan_pilot
from gcode2krl.krl.pilot_text import PilotText
from gcode2krl.krl.places import ProgramFiles, program_file, require_name
from gcode2krl.krl.read import read_texts
from gcode2krl.krl.release import header_words, matching, released
from gcode2krl.krl.rsi_files import refuse_file_name
from gcode2krl.krl.rsi_refusals import online_issues, retract_issues
from gcode2krl.krl.verify import VerifyReport, compare
from gcode2krl.krl.versions import version_issues
from gcode2krl.prediction import Prediction
from gcode2krl.prediction.forecast import Forecast
from gcode2krl.program.arcs import Arc, arcs_of
from gcode2krl.program.splines import SplineBlock, splines_of
from gcode2krl.tables import Joints, Targets, Toolpath
from gcode2krl.units import BYTES_PER_MB

_CHORD_BYTES = 66
"""What a LIN takes, more or less."""
PilotForm = Literal["index", "values", "none"]


@dataclass(frozen=True, repr=False)
class WrittenProgram:
    """What `write_krl` wrote."""

    name: str
    files: tuple[Path, ...]
    texts: Mapping[str, bytes]
    """File name → what it says."""
    report: VerifyReport
    issues: tuple[Issue, ...]
    targets: Targets
    """As written: with the pieces that the pilot force needs."""

    @property
    def size_bytes(self) -> int:
        """Bytes of all files."""
        return sum(map(len, self.texts.values()))

    @property
    def pilot(self) -> PilotFigures | None:
        """Figures of the pilot force, None where the program has none."""
        return self.report.pilot

    @property
    def findings(self) -> Findings:
        """The ``issues`` as a table: severity, code, line, message, remedy."""
        return Findings(self.issues)

    def __repr__(self) -> str:
        counts = counted(self.issues)
        facts = [f"{len(self.files)} files", self.report.words(), *([counts] if counts else [])]
        return f"WrittenProgram({self.name}: {', '.join(facts)})"

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the files, the read-back, the findings and the path from above."""
        rows = [("file", f"{name}, {len(text) / BYTES_PER_MB:.3f} MB") for name, text in self.texts.items()]
        rows.append(("read back", self.report.words()))
        if self.pilot is not None:
            rows.append(("pilot", f"{self.pilot.knots} knots"))
        moves = ~self.targets.ptp
        picture = path_picture(self.targets.position_mm[moves])
        return block(repr(self), beside(text_table((), rows), picture), findings_block(self.issues))


def write_krl(
    source: Targets | Prediction | Forecast,
    path: str | Path | None,
    cell: Cell | None = None,
    *,
    joints: Joints | None = None,
    name: str | None = None,
    allow: Sequence[str] = (),
    allow_where_found: Sequence[str] = (),
    guard: bool = True,
    split: Literal["defs", "files"] = "defs",
    options: str = "",
    strict: bool = False,
    pilot: PilotForm | None = None,
    online: str | None = None,
    inputs: Sequence[str | Path] = (),
    toolpath: Toolpath | None = None,
) -> WrittenProgram:
    """Write a KRL program: ``.src``, ``.dat`` (parts, ``.pilot.csv``, RSI), all together or not at all.

    Parameters
    ----------
    source : Targets from `set_targets`, a Prediction or a Forecast; errors among its ``issues`` refuse the
        program.
    path : the ``.src``, or the folder that it is written into under a name that a controller takes; None
        composes and verifies without writing (everything in one ``.src`` text).
    cell : needed with Targets; the others have their own.
    joints : joints at the targets where they are known already.
    name : program name; default: the file's stem. A controller needs both alike.
    allow : findings released by hand, ``CODE:LINE``, ``CODE:FILE:LINE`` or ``CODE`` for all; the header
        lists them.
    allow_where_found : the same for many programs: one that matches nothing here is left out.
    guard : compare frames, robot and inputs before the first motion.
    split : ``defs`` puts parts of a long program into subprograms of the same file, ``files`` into files.
    options : words for the header.
    strict : warnings refuse the program too.
    pilot : how the program carries the pilot force, by default as the cell says where the prediction has
        forces, and not without a path; ``index`` needs the sidecar beside the program. The default is left
        out from where it cannot be announced, with a warning; a form that is named is carried or refused.
    online : name of the RSI files of a program that is corrected online by the cell's ``[online]``; they
        are written beside it. RSI is on from above the first cut to above the last.
    inputs : files and folders that must not be overwritten, beside those that the tables name.
    toolpath : needed with Targets that leave out corners of it; the others have their own.

    Raises
    ------
    RefusedError
        Where a finding forbids the program, or its own verification does.
    NotUnderstoodError
        Where the output cannot be written or is an input, or a name or release is wrong.

    Examples
    --------
    >>> from gcode2krl import predict, write_krl
    >>> program = write_krl(predict("part.nc"), "WRITTEN.src")
    >>> program
    WrittenProgram(WRITTEN: 3 files, ... motions, off by 0.000... mm, 0.0000 deg, ...)
    >>> [file.name for file in program.files]
    ['WRITTEN.src', 'WRITTEN.dat', 'WRITTEN.pilot.csv']
    """
    forecast = _forecast_of(source, cell, toolpath)
    targets, cell = forecast.targets, forecast.cell
    file, of_name = _named(path, name, targets.source, cell)
    of_name += version_issues(cell)
    if online is not None:
        _refuse_name(online, file)
        of_name += [*online_issues(targets, cell), *retract_issues(targets, cell)]
    joints = robot.ptp_joints(targets, cell) if joints is None else joints
    arcs, splines, about_curves = _curves(targets, cell, pilot, is_online=online is not None)
    findings = [*of_name, *about_curves, *forecast.issues]
    allow = (*allow, *matching(findings, allow_where_found))
    issues = list(released(findings, allow, strict))
    layout = TextLayout(
        guard,
        split if file is not None else "defs",
        single_file=file is None,
        options=options,
        allowed=header_words(findings, allow),
        forces=forecast.has_forces,
        online=online or "",
        collisions=_scope(forecast),
        arcs=tuple(arcs),
        splines=tuple(splines),
    )
    plan = _pilot_plan(forecast, "none" if arcs or splines else pilot, joints, file is not None)
    program_name = file.stem.upper() if file is not None else (name or "PART").upper()
    with ProgramFiles(file, program_name, [*_inputs(targets, cell), *inputs]) as files:
        written = _Writing(files, layout, cell, forecast.toolpath)
        plain = _Content(targets, joints)
        content = plain if not isinstance(plan, PilotPlan) else _Content.of(plan)
        report = written.read_back(content)
        failure = _pilot_failure(report) if pilot is None else None
        if failure is not None:
            plan, content = left_out(failure), plain
            report = written.read_back(content)
        issues += released(_issues_of(plan), (), strict)
        issues += released(_size_issues(files.texts, content.targets, cell, split), (), strict)
        if not report.ok:
            raise RefusedError([*report.issues, *issues], source="" if file is None else file.name)
        places = files.take_places()
    return WrittenProgram(program_name, tuple(places), files.texts, report, tuple(issues), content.targets)


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


@dataclass(frozen=True)
class _Writing:
    """Where a program goes, how it is laid out, and the Toolpath that it is held against."""

    files: ProgramFiles
    layout: TextLayout
    cell: Cell
    original: Toolpath | None

    def read_back(self, content: _Content) -> VerifyReport:
        """Write a program; return what reading it back finds."""
        targets, joints, files = content.targets, content.joints, self.files
        files.write(compose(targets, joints, self.cell, files.name, self.layout, content.text))
        program = read_texts(files.texts, f"{files.name}{w.SOURCE_SUFFIX}")
        return compare(program, targets, joints, self.cell, pilot=content.case, original=self.original)


def _forecast_of(
    source: Targets | Prediction | Forecast, cell: Cell | None, toolpath: Toolpath | None
) -> Forecast:
    """Return what is known of a program: of targets alone nothing of their motion."""
    if isinstance(source, Forecast):
        return source
    if isinstance(source, Prediction):
        return forecast_of(source)
    if cell is None:
        raise input_error("option-value", "write_krl needs a cell with Targets")
    if source.simplified is not None and toolpath is None:
        sentence = "the targets leave out corners, which only their Toolpath tells"
        raise input_error("option-value", sentence, "give write_krl the toolpath too")
    return Forecast.of_targets(source, toolpath, cell)


def _curves(
    targets: Targets, cell: Cell, pilot: PilotForm | None, *, is_online: bool
) -> tuple[list[Arc], list[SplineBlock], list[Issue]]:
    """Return what becomes CIRC and SPLINE, and what there is to say of that where the cell asks for it.

    The triggers of a pilot force and RSI count on motions as they are predicted, so they need the chords: a
    pilot force that is asked for by name keeps them, the default one is left out instead.
    """
    if not (cell.controller.circ or cell.controller.spline):
        return [], [], []
    why = "RSI" if is_online else "a pilot force" if pilot in ("index", "values") else ""
    if why:
        kinds = "arcs" if cell.controller.circ else "short moves"
        sentence = f"{kinds} stay LIN: {why} needs the motions as they are predicted"
        return [], [], [Issue("note", "circ-left-out", 0, sentence, "leave out one of them")]
    arcs = arcs_of(targets) if cell.controller.circ and targets.simplified is None else []
    splines = splines_of(targets, bool(arcs)) if cell.controller.spline else []
    return arcs, splines, [*_about_arcs(arcs, targets, cell), *_about_splines(splines)]


def _about_arcs(arcs: list[Arc], targets: Targets, cell: Cell) -> Iterator[Issue]:
    if cell.controller.circ and targets.simplified is not None:
        sentence = "arcs stay LIN: --simplify needs the motions as they are predicted"
        yield Issue("note", "circ-left-out", 0, sentence, "leave out one of them")
    if arcs:
        chords = sum(arc.end - arc.first + 1 for arc in arcs)
        saved_kB = (chords - len(arcs)) * _CHORD_BYTES / 1e3
        sentence = (
            f"{len(arcs)} CIRC instead of {chords} LIN, about {saved_kB:.0f} kB less, without a pilot force; "
            "their time is that of the chords (assumed)"
        )
        yield Issue("note", "circ", 0, sentence, "measure one with the controller's trace")


def _about_splines(splines: list[SplineBlock]) -> Iterator[Issue]:
    if splines:
        points = sum(chain.end - chain.first + 1 for chain in splines)
        sentence = (
            f"{len(splines)} SPLINE blocks of {points} points, entered and left at rest, without a pilot "
            "force; their path between the points and their time are those of the chords (assumed)"
        )
        yield Issue("note", "spline", 0, sentence, "measure one with the controller's trace")


def _scope(forecast: Forecast) -> CollisionScope | None:
    """Return what has been checked for collisions."""
    if not forecast.has_motion:
        return None
    tools = [int(number) for number in distinct(forecast.targets.tool)]
    return collision_scope(forecast.cell, tools, is_cut=forecast.has_forces)


def _pilot_plan(
    forecast: Forecast, form: PilotForm | None, joints: Joints, sidecar: bool
) -> PilotPlan | Issue | None:
    """Return the pilot force to write, None where there is none to write or it is not wanted.

    One that was not asked for by name is left out where it cannot be announced, with a finding.
    """
    asked = form is not None
    if not forecast.has_motion and form in ("index", "values"):
        sentence = f"pilot {form}: Targets have no forces"
        raise input_error("option-value", sentence, "give write_krl a prediction with forces")
    if form is None:
        form = forecast.cell.pilot.form if sidecar and forecast.has_forces else "none"
    if form == "none":
        return None
    if form == "index" and not sidecar:
        sentence = "--pilot index needs the sidecar .pilot.csv, which standard output cannot carry"
        raise input_error("option-value", sentence, "give -o part.src, or --pilot values")
    return plan_pilot(forecast, joints, form, sidecar, asked=asked)


def _named(
    path: str | Path | None, name: str | None, source: str, cell: Cell
) -> tuple[Path | None, list[Issue]]:
    """Return the file of a program, None where nothing is written, and what there is to say of its name."""
    if path is not None:
        return program_file(path, name, source, cell.program.externals)
    if name is not None:
        require_name(name, cell.program.externals)
    return None, []


def _issues_of(plan: PilotPlan | Issue | None) -> Sequence[Issue]:
    """Return what there is to say of a pilot force, or of its absence."""
    if plan is None:
        return ()
    return [plan] if isinstance(plan, Issue) else plan.issues


def _pilot_failure(report: VerifyReport) -> Issue | None:
    """Return the first error of a program whose only errors are those of its pilot force, else None."""
    failed = [issue for issue in report.issues if issue.severity == "error"]
    alone = all(issue.code.startswith("pilot-") for issue in failed)
    return failed[0] if failed and alone else None


def _refuse_name(online: str, file: Path | None) -> None:
    """Raise where RSI files of that name cannot be written."""
    refuse_file_name(online)
    if file is None:
        sentence = "--online needs the RSI files, which standard output cannot carry"
        raise input_error("option-value", sentence, "give -o part.src")


def _inputs(targets: Targets, cell: Cell) -> list[str]:
    """Return the files that a program is made from, as far as its tables name them."""
    stock = cell.stock.mesh if cell.stock is not None else None
    named = (targets.source, stock, cell.online.calibration, *(each.mesh for each in cell.obstacle))
    return [name for name in named if name]


def _size_issues(texts: Mapping[str, bytes], targets: Targets, cell: Cell, split: str) -> list[Issue]:
    suffixes = (w.SIDECAR_SUFFIX, w.ETHERNET_SUFFIX, *w.SIGNAL_FLOW_SUFFIXES.values())
    program = (text for name, text in texts.items() if not name.endswith(suffixes))
    sizes_mb = [len(text) / BYTES_PER_MB for text in program]
    size_mb, motions = sum(sizes_mb), int(np.count_nonzero(~targets.ptp))
    if cell.controller.kss == "8.3" and size_mb > cell.program.warn_size_mb:
        sentence = (
            f"{size_mb:.1f} MB: KSS 8.3 holds about {cell.program.warn_size_mb:g} MB of all programs "
            "together, as users report; parts in files of their own count too"
        )
        remedy = "use a larger arc chord tolerance or --simplify, split the job, or state warn_size_mb"
        return [Issue("error", "program-memory", 0, sentence, remedy)]
    if split == "files":  # each is loaded by itself
        size_mb, motions = max(sizes_mb, default=0.0), min(motions, cell.program.max_lines)
    if size_mb <= cell.program.warn_size_mb and motions <= cell.program.memory_moves:
        return []
    return [
        Issue(
            "warning",
            "program-large",
            0,
            f"{size_mb:.1f} MB, {motions} LIN: more than controllers are known to hold "
            f"({cell.program.warn_size_mb:g} MB, {cell.program.memory_moves} LIN)",
            ("" if split == "files" else "use --split files, ")
            + "use a larger arc chord tolerance or --simplify, or split the job in the CAM",
        )
    ]
