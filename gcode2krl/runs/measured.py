"""The measured tables of a run: columns of a file → frozen arrays, with what was dropped and why."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple, TypeVar

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.compiled.inputs import locked
from gcode2krl.errors import Issue, NotUnderstoodError, input_error
from gcode2krl.runs.tables import Sheet, missing_column
from gcode2krl.units import MM_PER_M, RAD_PER_DEG

TIME = "t_s"
LEAST_ROWS = 10
LARGEST_VALUE = 1e15
"""No instrument states more, in any unit; our choice. Squares and differences of smaller values do not
overflow."""
_GAP_STEPS, _GAP_JITTERS = 1.5, 5.0
"""A step is a gap if it exceeds this many medians plus this many times the usual jitter of the clock."""


class Signal(NamedTuple):
    """A quantity of a table and the columns that make it."""

    name: str
    columns: tuple[str, ...]
    factor: float = 1.0
    one_by_one: bool = False
    """Columns may be missing one by one (a joint without encoder)."""
    joints: bool = False
    """A joint may be missing if only some joints are required."""
    gaps: bool = False
    """A missing value does not cost its row."""
    some: bool = False
    """There may be fewer columns than the format knows; the others are not missed."""


def _six(pattern: str) -> tuple[str, ...]:
    return tuple(pattern.format(number) for number in range(1, 7))


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Measured:
    """One measured table: rows in order of time, without missing values."""

    time_s: Floats
    """(n,) on the table's own clock, minus the offset in ``run.toml``."""
    row: Ints
    """(n,) number of each row in its file: the line of a CSV, the 1-based row of a Parquet table."""
    segments: Ints
    """(s, 2) first row and one past the last of each stretch without a gap; filters restart at each."""
    source: str = ""
    dropped: Mapping[str, int] = field(default_factory=dict)
    """Column → rows in which its value is missing."""
    dropped_rows: int = 0
    ignored: tuple[str, ...] = ()
    """Columns of the file that are not in the format."""
    missing: tuple[str, ...] = ()
    """Columns of the format that are not in the file, or empty."""
    constant: tuple[str, ...] = ()
    """Columns that never change."""
    issues: tuple[Issue, ...] = ()

    sampled: ClassVar[bool] = True
    """Rows follow each other at the rate of an instrument, so that a longer step is a gap."""

    def __post_init__(self) -> None:
        for spec in fields(self):
            value = getattr(self, spec.name)
            if isinstance(value, np.ndarray):
                object.__setattr__(self, spec.name, locked(value))
        object.__setattr__(self, "dropped", MappingProxyType(dict(self.dropped)))

    def __len__(self) -> int:
        return len(self.time_s)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({len(self)} rows: {', '.join(signals_of(self))})"


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Controller(Measured):
    """``controller.csv``; a signal is None where its columns are missing, a joint's column NaN."""

    position_cmd_mm: Floats | None = None
    """(n, 3) commanded TCP in ``$BASE``."""
    abc_cmd_rad: Floats | None = None
    """(n, 3) commanded A, B, C."""
    q_cmd_rad: Floats | None = None
    """(n, 6)"""
    q_act_rad: Floats | None = None
    """(n, 6) motor side."""
    q_load_rad: Floats | None = None
    """(n, 6) after the gear."""
    current_A: Floats | None = None
    """(n, 6)"""
    torque_Nmm: Floats | None = None
    """(n, 6)"""
    position_act_mm: Floats | None = None
    """(n, 3) TCP that the controller computes from its encoders."""
    abc_act_rad: Floats | None = None
    """(n, 3)"""
    correction_mm: Floats | None = None
    """(n, 3) logged RSI correction (RKorr), NaN where no answer was logged."""
    correction_rad: Floats | None = None
    """(n, 3) its A, B, C."""
    q_correction_rad: Floats | None = None
    """(n, 6) logged RSI correction of the joints (AKorr)."""
    temperature_C: Floats | None = None
    """(n, 8) of the places in the order of their columns, NaN where there is none or nothing was logged."""
    ambient_C: Floats | None = None
    """(n, 1)"""

    @property
    def path_rad(self) -> Floats | None:
        """Return the joints (n, 6) that show how far a run has come: the commanded, else the actual ones."""
        return self.q_act_rad if self.q_cmd_rad is None else self.q_cmd_rad

    @property
    def joints_measured(self) -> tuple[int, ...]:
        """Return the joints 1 to 6 that have both a commanded and an actual angle."""
        return _present(self.q_cmd_rad, self.q_act_rad)

    @property
    def joints_with_load_encoder(self) -> tuple[int, ...]:
        """Return the joints 1 to 6 that have a load side angle."""
        return _present(self.q_load_rad)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Tracker(Measured):
    """``tracker.csv``: the TCP by a separate instrument, in the frame that ``run.toml`` names."""

    position_mm: Floats
    """(n, 3)"""
    abc_rad: Floats | None = None
    """(n, 3)"""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Force(Measured):
    """``force.csv``, in the frame that ``run.toml`` names."""

    force_N: Floats
    """(n, 3)"""
    moment_Nmm: Floats | None = None
    """(n, 3)"""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Poses(Measured):
    """``poses.csv``: the TCP at poses in which the robot stands still, each one a row."""

    q_rad: Floats
    """(n, 6) indicated joints."""
    position_mm: Floats
    """(n, 3) measured TCP, in the frame that ``run.toml`` names for the tracker."""
    abc_rad: Floats | None = None
    """(n, 3)"""
    temperature_C: Floats | None = None
    """(n, 8)"""
    ambient_C: Floats | None = None
    """(n, 1)"""

    sampled: ClassVar[bool] = False


ABC_CMD, ABC = ("a_cmd_deg", "b_cmd_deg", "c_cmd_deg"), ("a_deg", "b_deg", "c_deg")
XYZ = ("x_mm", "y_mm", "z_mm")
TEMPERATURES = (
    Signal("temperature_C", tuple(f"temp{n}_C" for n in range(1, 9)), one_by_one=True, gaps=True, some=True),
    Signal("ambient_C", ("ambient_C",), gaps=True),
)
SIGNALS: dict[type[Measured], tuple[Signal, ...]] = {
    Controller: (
        Signal("position_cmd_mm", ("x_cmd_mm", "y_cmd_mm", "z_cmd_mm")),
        Signal("abc_cmd_rad", ABC_CMD, RAD_PER_DEG),
        Signal("q_cmd_rad", _six("q{}_cmd_deg"), RAD_PER_DEG, joints=True),
        Signal("q_act_rad", _six("q{}_act_deg"), RAD_PER_DEG, joints=True),
        Signal("q_load_rad", _six("q{}_load_deg"), RAD_PER_DEG, one_by_one=True),
        Signal("current_A", _six("i{}_A"), one_by_one=True),
        Signal("torque_Nmm", _six("tau{}_Nm"), MM_PER_M, one_by_one=True),
        Signal("position_act_mm", ("x_act_mm", "y_act_mm", "z_act_mm")),
        Signal("abc_act_rad", ("a_act_deg", "b_act_deg", "c_act_deg"), RAD_PER_DEG),
        Signal("correction_mm", ("x_corr_mm", "y_corr_mm", "z_corr_mm"), gaps=True),
        Signal("correction_rad", ("a_corr_deg", "b_corr_deg", "c_corr_deg"), RAD_PER_DEG, gaps=True),
        Signal("q_correction_rad", _six("q{}_corr_deg"), RAD_PER_DEG, one_by_one=True, gaps=True),
        *TEMPERATURES,
    ),
    Poses: (
        Signal("q_rad", _six("q{}_deg"), RAD_PER_DEG),
        Signal("position_mm", XYZ),
        Signal("abc_rad", ABC, RAD_PER_DEG),
        *TEMPERATURES,
    ),
    Tracker: (Signal("position_mm", XYZ), Signal("abc_rad", ABC, RAD_PER_DEG)),
    Force: (
        Signal("force_N", ("fx_N", "fy_N", "fz_N")),
        Signal("moment_Nmm", ("mx_Nm", "my_Nm", "mz_Nm"), MM_PER_M),
    ),
}
_ALWAYS = ("position_mm", "force_N", "q_rad")
_USUAL = ("position_cmd_mm", "abc_cmd_rad", "q_cmd_rad", "q_act_rad")
"""Signals of the format that are not marked optional: their absence is reported."""
AnyMeasured = TypeVar("AnyMeasured", bound=Measured)


def signals_of(table: Measured) -> list[str]:
    """Return the names of the signals that a table has."""
    names = (spec.name for spec in fields(table))
    return [name for name in names if name not in _NO_SIGNALS and _is_array(getattr(table, name))]


_NO_SIGNALS = ("time_s", "row", "segments")


def _is_array(value: object) -> bool:
    return isinstance(value, np.ndarray)


def columns_of(kind: type[Measured]) -> tuple[str, ...]:
    """Return every column that the format knows for a table."""
    return (TIME, *(column for signal in SIGNALS[kind] for column in signal.columns))


def build(
    kind: type[AnyMeasured], sheet: Sheet, *, partial: bool = False, clock_s: float = 0.0
) -> AnyMeasured:
    """Return the table of a file.

    A signal must have all of its columns or none, except joints that ``Signal.one_by_one`` (or ``partial``
    for commanded and actual angles) allows to be missing; rows with a missing value are dropped and counted.

    Raises `NotUnderstoodError` for a missing column, and for fewer than 10 rows.
    """
    present = {name for name, values in sheet.columns.items() if np.isfinite(values).any()}
    used = _used_signals(kind, sheet, present, partial)
    strict = [c for signal in used if not signal.gaps for c in signal.columns if c in present]
    needed = (TIME, *strict)
    finite = np.stack([np.isfinite(sheet.columns[name]) for name in needed], axis=1)
    kept = np.flatnonzero(finite.all(axis=1))
    _refuse_few(len(kept), len(finite), sheet)
    time_s = sheet.columns[TIME][kept] - clock_s
    columns: dict[str, Any] = {signal.name: _signal(signal, sheet, present, kept) for signal in used}
    table = kind(
        time_s=time_s,
        row=kept + sheet.first_row,
        segments=_segments(time_s, kept) if kind.sampled else np.array([[0, len(kept)]], dtype=np.int64),
        source=sheet.source,
        dropped=_lost(needed, finite),
        dropped_rows=len(finite) - len(kept),
        ignored=tuple(name for name in sheet.names if name not in columns_of(kind)),
        missing=tuple(name for name in _expected(kind, used) if name not in present),
        constant=_constant(strict, sheet, kept),
        **columns,
    )
    first_lost = int(np.argmin(finite.all(axis=1))) + sheet.first_row
    return replace(table, issues=(*sheet.issues, *_findings(table, first_lost)))


def _used_signals(kind: type[Measured], sheet: Sheet, present: set[str], partial: bool) -> list[Signal]:
    """Return the signals that a file has; raises where it is no table of this kind."""
    if TIME not in sheet.columns:
        raise missing_column(sheet, [TIME], f"time in seconds in a column {TIME}")
    _refuse_few(sheet.rows(), sheet.rows(), sheet)
    used = [signal for signal in SIGNALS[kind] if _is_there(signal, present, sheet, partial)]
    if not used:
        wanted = ", ".join(SIGNALS[kind][0].columns)
        raise missing_column(sheet, [wanted], f"a table of measured values has {TIME} and, say, {wanted}")
    _refuse_absurd(sheet, (TIME, *(c for signal in used for c in signal.columns if c in present)))
    return used


def _lost(names: Sequence[str], finite: Bools) -> dict[str, int]:
    """Return of each column that lacks values how many."""
    counts = zip(names, np.count_nonzero(~finite, axis=0).tolist(), strict=True)
    return {name: count for name, count in counts if count}


def _constant(names: Sequence[str], sheet: Sheet, kept: Ints) -> tuple[str, ...]:
    """Return the columns that have one value in all rows that are kept."""
    return tuple(name for name in names if np.ptp(sheet.columns[name][kept]) == 0.0)


def _expected(kind: type[Measured], used: list[Signal]) -> Iterator[str]:
    """Yield the columns whose absence is reported."""
    for signal in SIGNALS[kind]:
        if (signal in used or signal.name in _USUAL) and not signal.some:
            yield from signal.columns


def _is_there(signal: Signal, there: set[str], sheet: Sheet, partial: bool) -> bool:
    """Tell whether a signal is there; raises where only some of its columns are."""
    absent = [column for column in signal.columns if column not in there]
    if not absent:
        return True
    loose = signal.one_by_one or (signal.joints and partial)
    if len(absent) == len(signal.columns) and signal.name not in _ALWAYS:
        return False
    if loose and len(absent) < len(signal.columns):
        return True
    raise _incomplete(signal, absent, there, sheet)


def _incomplete(signal: Signal, absent: Sequence[str], there: set[str], sheet: Sheet) -> NotUnderstoodError:
    """Return the error of a signal some of whose columns are missing or empty."""
    empty = [column for column in absent if column in sheet.columns]
    if empty:
        return input_error(
            "trace-column",
            f"column {', '.join(empty)}: has no value in any row",
            "record it, or leave the column out",
            line=sheet.first_row,
            source=sheet.source,
        )
    if len(absent) < len(signal.columns):
        present = ", ".join(column for column in signal.columns if column in there)
        return missing_column(sheet, absent, f"it belongs with {present}: give all or none")
    return missing_column(sheet, absent, f"name the columns {', '.join(signal.columns)}")


def _signal(signal: Signal, sheet: Sheet, there: set[str], kept: Ints) -> Floats:
    none = np.full(len(kept), math.nan)
    parts = [sheet.columns[name][kept] if name in there else none for name in signal.columns]
    return np.stack(parts, axis=1) * signal.factor


def _segments(time_s: Floats, index: Ints) -> Ints:
    """Return (s, 2) the stretches without dropped rows and without a long step."""
    step = np.diff(time_s)
    usual, jittery = (float(quantile) for quantile in np.quantile(step, [0.5, 0.9]))
    longest = _GAP_STEPS * usual + _GAP_JITTERS * (jittery - usual)
    breaks = np.flatnonzero((np.diff(index) > 1) | ((step > longest) & (longest > 0.0))) + 1
    edges = np.concatenate([[0], breaks, [len(time_s)]])
    return np.stack([edges[:-1], edges[1:]], axis=1).astype(np.int64)


def _refuse_few(kept: int, rows: int, sheet: Sheet) -> None:
    if kept < LEAST_ROWS:
        lost = f" ({rows - kept} dropped for missing values)" if rows > kept else ""
        raise input_error(
            "trace-short",
            f"{kept} usable rows{lost}, at least {LEAST_ROWS} are needed",
            "record the whole program",
            line=sheet.first_row if rows else 0,
            source=sheet.source,
        )


def _refuse_absurd(sheet: Sheet, names: tuple[str, ...]) -> None:
    for name in names:
        values = np.abs(np.nan_to_num(sheet.columns[name], posinf=0.0, neginf=0.0))
        if values.max(initial=0.0) > LARGEST_VALUE:
            row = int(np.argmax(values)) + sheet.first_row
            words = f"row {row}, column {name}: {values.max():.3g} is not a measured value"
            raise input_error(
                "trace-number", words, "export the recording again", line=row, source=sheet.source
            )


def _findings(table: Measured, first_lost: int) -> Iterator[Issue]:
    """Yield what a user should know of the rows and columns."""
    name, time_s, segments, lost = Path(table.source).name, table.time_s, table.segments, table.dropped_rows
    if lost:
        counts = ", ".join(f"{column} {count}" for column, count in table.dropped.items())
        remedy = "most rows are lost: leave out the column" if lost > len(table) else ""
        text = f"{name}: {lost} of {len(table) + lost} rows dropped for missing values ({counts})"
        yield Issue("warning", "trace-dropped", first_lost, text, remedy)
    if len(segments) > 1:
        gap_s = time_s[segments[1:, 0]] - time_s[segments[:-1, 1] - 1]
        row = int(table.row[segments[int(np.argmax(gap_s)) + 1, 0]])
        text = f"{name}: {len(gap_s)} gaps, the longest {gap_s.max():.3g} s before row {row}"
        yield Issue("note", "trace-gap", row, text)
    for columns, code, words in (
        (table.missing, "trace-missing", "not recorded; analyses that need it are left out"),
        (table.constant, "trace-constant", "never changes"),
        (table.ignored, "trace-ignored", "not a column of the format, left out"),
    ):
        if columns:
            yield Issue("note", code, 0, f"{name}: {', '.join(columns)}: {words}")


def _present(*signals: Floats | None) -> tuple[int, ...]:
    """Return the joints whose column is there in every signal."""
    if any(signal is None for signal in signals):
        return ()
    good = np.logical_and.reduce([np.isfinite(s).all(axis=0) for s in signals if s is not None])
    return tuple(int(index) + 1 for index in np.flatnonzero(good))
