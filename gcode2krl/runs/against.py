"""Checks whether a run belongs to a prediction: units, axes, frame, clock, override and program."""

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.errors import Issue, Severity
from gcode2krl.runs import matching
from gcode2krl.runs.folder import Run
from gcode2krl.runs.head import RunHead
from gcode2krl.runs.measured import SIGNALS, XYZ, Controller, Measured
from gcode2krl.units import DEG_PER_RAD

_REACH_S = 10.0
_CLOCK_S = 0.5
"""A larger offset of the clock is reported; smaller ones are fitted in the diagnosis."""
_FOLLOWS = 0.95
_LIKE = 0.15
_OVERRIDE_SLACK = 0.05
_DECLARED_SLACK = 0.15
_T1_MM_S = 250.0
_MOST_POINTS = 1500
_NEAR, _PARTLY, _ALONG = 0.9, 0.5, 0.7


class _Kind(NamedTuple):
    """Constants that differ between positions and joint angles."""

    unit: str
    factors: dict[float, str]
    floor: float
    near: float
    apart: float
    """A larger mean difference means another frame."""


_LENGTH = _Kind("mm", matching.LENGTH_FACTORS, 0.2, 5.0, 20.0)
_ANGLE = _Kind("deg", matching.ANGLE_FACTORS, 0.02, 1.0, 5.0)


class _Signal(NamedTuple):
    """One measured signal beside the predicted one."""

    table: Measured
    columns: tuple[str, ...]
    measured: Floats
    predicted: Floats
    kind: _Kind

    @property
    def file(self) -> str:
        return Path(self.table.source).name

    @property
    def clock(self) -> str:
        return f"{type(self.table).__name__.lower()}_s"

    def issue(self, severity: Severity, code: str, message: str, remedy: str) -> Issue:
        return Issue(severity, code, int(self.table.row[0]), f"{self.file}: {message}", remedy)


def check_against(run: Run, time_s: Floats, position_mm: Floats, q_rad: Floats | None = None) -> list[Issue]:
    """Return findings that contradict a run being one of this prediction; empty if there are none.

    Parameters
    ----------
    time_s : (m,) of the prediction.
    position_mm : (m, 3) tool tip in ``$BASE``.
    q_rad : (m, 6) joint angles, where they are known.

    Codes: ``run-unit``, ``run-axes``, ``run-frame``, ``run-program``, ``run-override``, ``run-t1`` are
    errors; ``run-clock``, and ``run-frame`` for a mere shift, are warnings: a diagnosis can fit those.
    Differences of a few millimetres and clocks within half a second are not reported.
    """
    by_file: dict[str, list[Issue]] = {}
    for signal in _signals(run, position_mm, q_rad):
        if not by_file.get(signal.file):  # other signals of a table would repeat the findings of the first
            by_file[signal.file] = list(_check(signal, time_s, run.head))
    return [issue for issues in by_file.values() for issue in issues]


def check_program(run: Run, program_sha256: str) -> list[Issue]:
    """Return an error if the program that ``run.toml`` names does not have that SHA-256."""
    program = run.path("program")
    if program is None or not program.is_file():
        return []
    if hashlib.sha256(program.read_bytes()).hexdigest() == program_sha256:
        return []
    words = f"run.toml: program: {program.name} is not the program that was predicted: its SHA-256 differs"
    return [Issue("error", "run-program", 0, words, "predict the program that ran")]


def _signals(run: Run, position_mm: Floats, q_rad: Floats | None) -> Iterator[_Signal]:
    xyz_cmd, q_cmd, q_act = (_columns(name) for name in ("position_cmd_mm", "q_cmd_rad", "q_act_rad"))
    if run.controller is not None and run.controller.position_cmd_mm is not None:
        yield _Signal(run.controller, xyz_cmd, run.controller.position_cmd_mm, position_mm, _LENGTH)
    path_rad = None if run.controller is None else run.controller.path_rad
    if run.controller is not None and path_rad is not None and q_rad is not None:
        both = np.vstack([path_rad, q_rad])
        known: Bools = np.asarray(np.isfinite(both).all(axis=0))
        if known.any() and run.head.angles == "absolute":
            names = q_act if run.controller.q_cmd_rad is None else q_cmd
            columns = tuple(name for name, good in zip(names, known.tolist(), strict=True) if good)
            measured, predicted = path_rad[:, known], q_rad[:, known]
            yield _Signal(run.controller, columns, measured * DEG_PER_RAD, predicted * DEG_PER_RAD, _ANGLE)
    if run.tracker is not None and run.head.frames.tracker == "base":
        yield _Signal(run.tracker, XYZ, run.tracker.position_mm, position_mm, _LENGTH)


def _columns(name: str) -> tuple[str, ...]:
    return next(signal.columns for signal in SIGNALS[Controller] if signal.name == name)


def _check(signal: _Signal, time_s: Floats, head: RunHead) -> Iterator[Issue]:
    """Yield the findings of one signal: aligned in time if possible, else as a path only."""
    if float(np.ptp(signal.predicted, axis=0).max()) < signal.kind.near:
        return
    if head.override_percent == 100.0 and head.mode != "T1":
        shift = matching.best_shift(time_s, signal.predicted, signal.table.time_s, signal.measured, _REACH_S)
        issues = _aligned(signal, time_s, shift) if shift.share >= _FOLLOWS else None
        if issues is not None:
            yield from issues
            return
    yield from _as_path(signal, time_s, head)


def _aligned(signal: _Signal, time_s: Floats, shift: matching.Shift) -> list[Issue] | None:
    """Return the findings if the motion agrees in time, None if it does not."""
    own_s = signal.table.time_s
    inside = (time_s + shift.seconds >= own_s[0]) & (time_s + shift.seconds <= own_s[-1])
    predicted = signal.predicted[inside]
    measured = matching.at(time_s[inside] + shift.seconds, own_s, signal.measured)
    clock = list(_clock(signal, shift.seconds))
    odd = matching.odd_columns(predicted, measured, signal.kind.floor, signal.kind.factors)
    if odd and matching.agree(predicted, matching.corrected(measured, odd), _LIKE):
        return [_odd_issue(signal, each, predicted, measured) for each in odd] + clock
    if matching.agree(predicted, measured, _LIKE):
        return list(_offset_issues(signal, measured.mean(axis=0) - predicted.mean(axis=0))) + clock
    if signal.kind is _LENGTH:
        rotation, shift_mm = matching.rotation_between(predicted, measured)
        if matching.agree(predicted @ rotation.T, measured, _LIKE):
            return [_turned(signal, rotation, shift_mm), *clock]
    return None


def _odd_issue(signal: _Signal, odd: matching.Odd, predicted: Floats, measured: Floats) -> Issue:
    name, other = signal.columns[odd.column], signal.columns[odd.other]
    if odd.kind == "swapped":
        words, remedy = f"column {name} follows the predicted {other}", "the columns are swapped: rename them"
        return signal.issue("error", "run-axes", words, remedy)
    if odd.kind == "sign":
        words, remedy = f"column {name} runs against the prediction", "its sign is reversed"
        return signal.issue("error", "run-axes", words, remedy)
    spans = np.ptp(measured[:, odd.column]), np.ptp(predicted[:, odd.column])
    factor, unit = abs(odd.factor), signal.kind.factors[abs(odd.factor)]
    times = f"{1 / factor:.4g} times less" if factor < 1 else f"{factor:.4g} times more"
    sides = f"spans {spans[0]:.4g}, the prediction {spans[1]:.4g} {signal.kind.unit}"
    words = f"column {name} {sides}: {times}, so {unit}"
    return signal.issue("error", "run-unit", words, f"multiply the column by {1 / odd.factor:.6g}")


def _clock(signal: _Signal, seconds: float) -> Iterator[Issue]:
    if abs(seconds) > _CLOCK_S:
        words = f"column t_s is {seconds:+.3f} s off the prediction's clock"
        remedy = f"[clocks] {signal.clock} = {seconds:.3f} in run.toml"
        yield signal.issue("warning", "run-clock", words, remedy)


def _offset_issues(signal: _Signal, apart: Floats) -> Iterator[Issue]:
    if np.abs(apart).max() > signal.kind.apart:
        values = ", ".join(f"{value:.2f}" for value in apart)
        words = f"{', '.join(signal.columns)} lie ({values}) {signal.kind.unit} off the prediction"
        remedy = "another $BASE or $TOOL: record in those of the program"
        yield signal.issue("warning", "run-frame", words, remedy)


def _turned(signal: _Signal, rotation: Floats, shift_mm: Floats) -> Issue:
    angle = np.degrees(np.arccos(np.clip((np.trace(rotation) - 1.0) / 2.0, -1.0, 1.0)))
    values = ", ".join(f"{value:.1f}" for value in shift_mm)
    words = f"the predicted path turned by {angle:.1f} deg and shifted by ({values}) mm: another frame"
    return signal.issue("error", "run-frame", words, "state the positions in the program's $BASE")


def _as_path(signal: _Signal, time_s: Floats, head: RunHead) -> Iterator[Issue]:
    """Yield the findings where motion and prediction do not agree in time: the path, then its speed."""
    predicted = matching.course(time_s, signal.predicted, _MOST_POINTS)
    measured = matching.course(signal.table.time_s, signal.measured, _MOST_POINTS)
    if not len(measured.position):
        words = f"{', '.join(signal.columns)} never move"
        yield signal.issue("error", "run-program", words, "record the program while it runs")
        return
    index, far = matching.nearest(measured.position, predicted.position)
    _, far_back = matching.nearest(predicted.position, measured.position)
    extent = float(np.linalg.norm(np.ptp(signal.predicted, axis=0)))
    near = max(signal.kind.near, 0.03 * extent, _spacing(predicted.position))
    shares = float(np.mean(far < near)), float(np.mean(far_back < near))
    along = np.abs(np.sum(measured.direction * predicted.direction[index], axis=1))[far < near]
    if max(shares) < _NEAR or min(shares) < _PARTLY or np.median(along) < _ALONG:
        words = (
            f"does not follow the predicted path: {shares[0]:.0%} of its points lie within {near:.3g} "
            f"{signal.kind.unit} of it, {shares[1]:.0%} of the predicted ones near it"
        )
        remedy = "another program, or another frame: name the prediction of the program that ran"
        yield signal.issue("error", "run-program", words, remedy)
        return
    if signal.kind is _ANGLE and head.mode == "T1":
        return
    both = measured.steady & predicted.steady[index] & (far < near)
    chosen = both if both.any() else far < near
    yield from _speed(signal, measured.speed[chosen], predicted.speed[index][chosen], head)


def _speed(signal: _Signal, measured: Floats, predicted: Floats, head: RunHead) -> Iterator[Issue]:
    """Yield findings from the speeds at the same places: capped as in T1, or another override."""
    if signal.kind is _LENGTH and _is_capped(measured, predicted):
        if head.mode != "T1":
            top = float(predicted.max())
            words = f"no faster than {measured.max():.0f} mm/s where {top:.0f} were predicted: run in T1"
            yield signal.issue("error", "run-t1", words, 'run it in AUT, or write mode = "T1" into run.toml')
        return
    percent = 100.0 * float(np.median(measured / predicted))
    declared = head.override_percent
    slack = _OVERRIDE_SLACK if declared == 100.0 else _DECLARED_SLACK
    if abs(percent / declared - 1.0) > slack:
        stated = f", {declared:g} % are declared" if declared != 100.0 else ""
        words = f"runs at {percent:.0f} % of the predicted speed{stated}"
        remedy = f"run it at 100 %, or write override_percent = {percent:.0f} into run.toml"
        yield signal.issue("error", "run-override", words, remedy)


def _is_capped(measured: Floats, predicted: Floats) -> bool:
    """Tell whether speeds are better explained by the limit of T1, 250 mm/s, than by an override."""
    if np.quantile(measured, 0.98) > 1.05 * _T1_MM_S or np.quantile(predicted, 0.98) < 1.1 * _T1_MM_S:
        return False
    ratio = measured / predicted
    override_misfit = np.median(np.abs(ratio / np.median(ratio) - 1.0))
    t1_misfit = np.median(np.abs(measured / np.minimum(predicted, _T1_MM_S) - 1.0))
    return bool(t1_misfit <= override_misfit + 0.02)


def _spacing(points: Floats) -> float:
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return float(np.quantile(step, 0.9)) if len(step) else 0.0
