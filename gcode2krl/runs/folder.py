"""A measured run: a folder with ``run.toml`` and what was recorded."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import combinations
from pathlib import Path
from typing import Literal, NamedTuple, TypeVar, get_args

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.cell import load_cell
from gcode2krl.errors import Issue, NotUnderstoodError, input_error
from gcode2krl.exchange.findings import counted, findings_block
from gcode2krl.exchange.html import block, text_table
from gcode2krl.files.there import is_there
from gcode2krl.runs import matching
from gcode2krl.runs.controller_trace import resolution_mm
from gcode2krl.runs.diadem import is_data_set
from gcode2krl.runs.head import RunHead, read_head
from gcode2krl.runs.krc_trace import read_krc_trace, recording_of
from gcode2krl.runs.measured import (
    SIGNALS,
    TIME,
    XYZ,
    Controller,
    Force,
    Measured,
    Poses,
    Tracker,
    build,
    columns_of,
    signals_of,
)
from gcode2krl.runs.rsi_log import is_rsi_log, read_rsi_log
from gcode2krl.runs.scan import Scan, read_scan
from gcode2krl.runs.tables import Sheet, read_sheet, read_words
from gcode2krl.units import DEG_PER_RAD, RAD_PER_REV

# Checks of a run by itself: rising time in seconds, units, columns that belong together.

_LONGEST_CYCLE_S = 0.5
_SHORTEST_CYCLE_S = 1e-6
_EPOCH_S = 1e8
_SCALED = (300.0, 3000.0)
"""Two recordings of one run whose durations differ by a factor in this range are in s and ms."""
_WORKSPACE_MM = 50_000.0
_FURTHEST_DEG = 1000.0
_LENGTH_FLOOR_MM, _ANGLE_FLOOR_DEG = 0.2, 0.02
_RADIANS_SHOW_ABOVE = 0.3
_LONGEST_FAST_CYCLE_S = 0.05
_FOLLOWS, _LIKE = 0.95, 0.15
_REACH_S = 10.0
_LEAST_MOTION_MM = 0.5
_COARSE = {"mm": 0.05, "deg": 0.005}
"""Larger steps of the last decimal are reported even where no noise is stated."""
_POSITIONS = ("position_cmd_mm", "position_act_mm", "position_mm")
_ANGLES = ("q_cmd_rad", "q_act_rad", "q_load_rad", "q_rad")


def check_table(table: Measured, head: RunHead) -> None:
    """Raise `NotUnderstoodError` for time that does not rise or is not in s, and for impossible values."""
    _check_order(table)
    if table.sampled:
        _check_cycle(table)
    for signal in SIGNALS[type(table)]:
        values = getattr(table, signal.name)
        if values is not None and signal.name in _POSITIONS:
            _check_reach(table, signal.columns, values, _WORKSPACE_MM, "mm", "no robot reaches that far")
        if values is not None and signal.name in _ANGLES:
            degrees = values * DEG_PER_RAD
            _check_reach(table, signal.columns, degrees, _FURTHEST_DEG, "deg", "no joint turns that far")
    if isinstance(table, Controller) and head.angles == "absolute":
        _check_radians(table)


def check_together(controller: Controller | None, tracker: Tracker | None, force: Force | None) -> None:
    """Raise `NotUnderstoodError` for tables that do not overlap in time, and columns in s and in ms."""
    tables = [table for table in (controller, tracker, force) if table is not None]
    for first, second in combinations(tables, 2):
        _check_clocks(first, second)


def check_columns(controller: Controller | None, tracker: Tracker | None, head: RunHead) -> None:
    """Raise `NotUnderstoodError` where columns of one run are swapped, of another unit or of another sign."""
    if controller is not None:
        for name, reference in (("q_act_rad", "q_cmd_rad"), ("q_load_rad", "q_act_rad")):
            _compare_joints(controller, name, reference)
    if controller is None or tracker is None or head.frames.tracker != "base":
        return
    commanded = controller.position_cmd_mm
    if commanded is None or np.ptp(commanded, axis=0).max() < _LEAST_MOTION_MM:
        return
    own_s = tracker.time_s
    shift = matching.best_shift(controller.time_s, commanded, own_s, tracker.position_mm, _REACH_S)
    if shift.share >= _FOLLOWS:
        times_s = controller.time_s + shift.seconds
        inside = (times_s >= own_s[0]) & (times_s <= own_s[-1])
        measured = matching.at(times_s[inside], own_s, tracker.position_mm)
        odd = matching.odd_columns(commanded[inside], measured, _LENGTH_FLOOR_MM, matching.LENGTH_FACTORS)
        if matching.agree(commanded[inside], matching.corrected(measured, odd), _LIKE):
            _refuse_odd(_Sides(tracker, XYZ, controller, _names("position_cmd_mm"), "mm"), odd)


def quantised(table: Measured, head: RunHead) -> Iterator[Issue]:
    """Yield a warning for each signal whose last decimal is coarser than its noise, measured or declared."""
    stated = {
        "position_mm": head.noise.tcp_mm,
        "q_act_rad": head.noise.q_act_deg,
        "q_load_rad": head.noise.q_load_deg,
    }
    declared = 0.0 if head.channels.decimals is None else 1.01 * 10.0**-head.channels.decimals
    for signal in SIGNALS[type(table)]:
        values = getattr(table, signal.name)
        unit = "mm" if signal.name in _POSITIONS else "deg" if signal.name in _ANGLES else ""
        if values is None or not unit:
            continue
        known = values[:, np.isfinite(values).all(axis=0)] / signal.factor
        moving = known[:, np.ptp(known, axis=0) > 0.0]
        step, noise = resolution_mm(moving), stated.get(signal.name)
        if moving.size and step > (max(_COARSE[unit], declared) if noise is None else noise):
            words = f"{Path(table.source).name}: {signal.columns[0]} … in steps of {step:g} {unit}"
            than = f", the noise is {noise:g}" if noise is not None else ""
            yield Issue("warning", "trace-decimals", 0, words + than, "record more decimals")


def _check_order(table: Measured) -> None:
    step = np.diff(table.time_s)
    back = np.flatnonzero(step <= 0)
    if len(back):
        at = int(back[0])
        before, after = table.time_s[at], table.time_s[at + 1]
        words = f"row {table.row[at + 1]}, column {TIME}: {after:g} s does not come after {before:g} s"
        raise _error("trace-time", words, "export one recording, in order", table, at + 1)


def _check_cycle(table: Measured) -> None:
    step = np.diff(table.time_s)
    cycle_s = float(np.median(step))
    if not _SHORTEST_CYCLE_S < cycle_s <= _LONGEST_CYCLE_S:
        words = f"column {TIME}: {cycle_s:g} s between rows, so not seconds"
        raise _error("trace-unit", words, "divide the column by 1000 if it is in ms", table, 1)
    if abs(float(table.time_s[0])) > _EPOCH_S:
        words = f"column {TIME}: begins at {table.time_s[0]:.0f} s, a date"
        raise _error("trace-unit", words, "let the column be 0 where the program starts", table, 0)


def _check_reach(
    table: Measured, columns: tuple[str, ...], values: Floats, most: float, unit: str, why: str
) -> None:
    with np.errstate(invalid="ignore"):
        beyond = np.argwhere(np.abs(values) > most)
    if len(beyond):
        row, column = beyond[0]
        words = f"row {table.row[row]}, column {columns[column]}: {values[row, column]:g} {unit}, {why}"
        raise _error("trace-unit", words, f"state the column in {unit}", table, int(row))


def _check_radians(table: Controller) -> None:
    """Raise if all absolute angles stay within 2 pi and A2, A3 off 0: as degrees, a stretched arm."""
    for name in ("q_cmd_rad", "q_act_rad"):
        values = getattr(table, name)
        if values is None or not np.isfinite(values).all():
            continue
        degrees = np.abs(values) * DEG_PER_RAD
        if degrees.max() <= RAD_PER_REV and degrees[:, 1:3].min() > _RADIANS_SHOW_ABOVE:
            columns = f"{_names(name)[0]} … {_names(name)[5]}"
            words = f"columns {columns}: all six joints stay within 6.3 deg, a stretched arm; so radians"
            remedy = 'multiply by 57.2958, or write angles = "relative" into run.toml'
            raise _error("trace-unit", words, remedy, table, 0)


def _check_clocks(table: Measured, other: Measured) -> None:
    spans = [float(np.ptp(each.time_s)) for each in (table, other)]
    first, last = (
        max(table.time_s[0], other.time_s[0]),
        min(table.time_s[-1], other.time_s[-1]),
    )
    file = Path(table.source).name
    long, short = (table, other) if spans[0] > spans[1] else (other, table)
    slow = float(np.median(np.diff(long.time_s))) > _LONGEST_FAST_CYCLE_S
    if slow and _SCALED[0] < max(spans) / min(spans) < _SCALED[1]:
        words = (
            f"column {TIME} spans {max(spans):.4g} s, that of {Path(short.source).name} {min(spans):.4g} s: "
            "about 1000 times more, so ms"
        )
        raise _error("trace-unit", words, "divide the column by 1000", long, 0)
    if first >= last:
        words = (
            f"column {TIME} runs from {other.time_s[0]:.4g} to {other.time_s[-1]:.4g} s, that of {file} from "
            f"{table.time_s[0]:.4g} to {table.time_s[-1]:.4g} s: they do not overlap"
        )
        raise _error("trace-overlap", words, "export one run; [clocks] in run.toml shifts a clock", other, 0)


def _compare_joints(table: Controller, name: str, reference: str) -> None:
    measured, wanted = getattr(table, name), getattr(table, reference)
    if measured is None or wanted is None:
        return
    there: Bools = np.isfinite(measured).all(axis=0)
    known = there & np.isfinite(wanted).all(axis=0)
    if not known.any():
        return
    columns, references = (
        tuple(c for c, there in zip(_names(signal), known.tolist(), strict=True) if there)
        for signal in (name, reference)
    )
    odd = matching.odd_columns(
        wanted[:, known] * DEG_PER_RAD,
        measured[:, known] * DEG_PER_RAD,
        _ANGLE_FLOOR_DEG,
        matching.ANGLE_FACTORS,
    )
    _refuse_odd(_Sides(table, columns, table, references, "deg"), odd)


class _Sides(NamedTuple):
    """Two sets of columns that ought to agree."""

    table: Measured
    columns: tuple[str, ...]
    other: Measured
    references: tuple[str, ...]
    unit: str


def _refuse_odd(sides: _Sides, odd: list[matching.Odd]) -> None:
    """Raise for the first column that is in another unit, swapped or reversed.

    If two columns have different units the smaller is reported: metres, inches and radians are the usual
    slips.
    """
    if not odd:
        return
    kind, column, other, factor = odd[0]
    table, name, wanted = sides.table, sides.columns[column], sides.references[other]
    if kind == "unit":
        if abs(factor) > 1.0:
            table, name, wanted, factor = sides.other, wanted, name, 1.0 / factor
        factors = matching.ANGLE_FACTORS if sides.unit == "deg" else matching.LENGTH_FACTORS
        unit = min(factors.items(), key=lambda item: abs(item[0] - abs(factor)))[1]
        words = f"column {name} moves {1.0 / abs(factor):.4g} times less than {wanted}, so {unit}"
        raise _error("trace-unit", words, f"state the column in {sides.unit}", table, 0)
    if kind == "swapped":
        words = f"column {name} follows {wanted} and not {sides.references[column]}"
        raise _error("trace-columns", words, "the columns are swapped: rename them", table, 0)
    words = f"column {name} runs against {wanted}"
    raise _error("trace-columns", words, "its sign is reversed", table, 0)


def _names(signal: str) -> tuple[str, ...]:
    return next(entry.columns for entry in SIGNALS[Controller] if entry.name == signal)


def _error(code: str, words: str, remedy: str, table: Measured, index: int) -> NotUnderstoodError:
    return input_error(code, words, remedy, line=int(table.row[index]), source=table.source)


# ``poses.csv``: measured poses, with their times in seconds or as dates.

_DATE = "time"


def read_poses(file: Path) -> Sheet:
    """Return the columns of a table of poses; a column ``time`` of ISO 8601 dates becomes ``t_s``.

    t_s = 0 is then the first pose. Raises `NotUnderstoodError` for what is no date.
    """
    sheet = read_sheet(file, columns_of(Poses))
    if TIME in sheet.columns or _DATE not in sheet.names:
        return sheet
    seconds = [
        _seconds(word, row + sheet.first_row, file) for row, word in enumerate(read_words(file, _DATE))
    ]
    first = next((value for value in seconds if np.isfinite(value)), 0.0)
    names = tuple(name for name in sheet.names if name != _DATE)
    return replace(sheet, columns={TIME: np.array(seconds) - first, **sheet.columns}, names=names)


def _seconds(word: str | None, row: int, file: Path) -> float:
    """Return a date as seconds, NaN where there is none."""
    if word is None or not word.strip():
        return float("nan")
    try:
        return datetime.fromisoformat(word.strip()).timestamp()
    except ValueError:
        raise input_error(
            "trace-time",
            f"row {row}, column {_DATE}: {word[:40]!r} is no date",
            f"2024-05-06T07:08:09, or seconds in a column {TIME}",
            line=row,
            source=str(file),
        ) from None


AnyMeasured = TypeVar("AnyMeasured", bound=Measured)
What = Literal["controller", "tracker", "force", "scan", "poses"]
_ENDINGS = {"scan": (".csv", ".parquet", ".ply")}
_RSI_NAMES = ("rsi.log", "rsi.xml", "rsi.txt", "rsi.csv")


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """What one run recorded; None where there is no file.

    >>> from gcode2krl import load_run
    >>> run = load_run("run-1")
    >>> run
    Run(run-1: controller ... rows, tracker ... rows...)
    >>> run.tracker.position_mm.shape[1]
    3
    """

    name: str
    folder: Path
    head: RunHead
    controller: Controller | None = None
    tracker: Tracker | None = None
    force: Force | None = None
    scan: Scan | None = None
    issues: tuple[Issue, ...] = ()
    poses: Poses | None = None

    def path(self, key: Literal["cell", "program", "prediction"]) -> Path | None:
        """Return a path that ``run.toml`` names, relative to the run's folder; None where it names none.

        >>> from gcode2krl import load_run
        >>> load_run("run-1").path("prediction")
        """
        value: str | None = getattr(self.head, key)
        return None if value is None else self.folder / value

    def _tables(self) -> dict[str, Measured]:
        named = {
            "controller": self.controller,
            "tracker": self.tracker,
            "force": self.force,
            "poses": self.poses,
        }
        return {name: table for name, table in named.items() if table is not None}

    def __repr__(self) -> str:
        parts = [f"{name} {len(table)} rows" for name, table in self._tables().items()]
        parts += ["scan"] if self.scan is not None else []
        counts = counted(self.issues)
        return (
            f"Run({self.name[-60:]}: {', '.join([*(parts or ['no table']), *([counts] if counts else [])])})"
        )

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the tables with their signals, and the findings."""
        rows = [
            (
                name,
                len(table),
                f"{table.time_s[0]:.2f} to {table.time_s[-1]:.2f}",
                ", ".join(signals_of(table)),
            )
            for name, table in self._tables().items()
        ]
        head = ("table", "rows", "time (s)", "signals")
        return block(repr(self), text_table(head, rows), findings_block(self.issues))


def load_run(folder: str | Path, *, partial: bool = False) -> Run:
    """Read and check a measured run.

    Parameters
    ----------
    partial : joints may be missing in the commanded and actual angles (a log of some joints only).

    Raises
    ------
    NotUnderstoodError
        Names file, row and column: a file that cannot be read, a missing column, time that does not rise,
        wrong units, swapped columns, tables that do not overlap.

    Examples
    --------
    >>> from gcode2krl import load_run
    >>> load_run("run-1").controller.q_act_rad.shape[1]
    6
    """
    place = Path(folder)
    if not is_there(place, Path.is_dir):
        raise input_error(
            "file-unreadable", "is not a folder", "a run is a folder with run.toml", source=str(place)
        )
    head, issues = read_head(place / "run.toml")
    files = {what: _file_of(what, place, head) for what in get_args(What)}

    def controller_sheet(file: Path) -> Sheet:
        if is_data_set(file):
            return read_krc_trace(file, _gear_ratio(place, head))
        return read_rsi_log(file) if is_rsi_log(file) else _sheet(Controller)(file)

    readers = {
        "controller": controller_sheet,
        "tracker": _sheet(Tracker),
        "force": _sheet(Force),
        "poses": read_poses,
    }
    sheets = {what: read(file) for what, read in readers.items() if (file := files[what]) is not None}
    traced = files["controller"] is not None and is_data_set(files["controller"])  # angles of the drives
    scan = read_scan(files["scan"]) if files["scan"] else None
    issues = (*issues, *_paths(place, head), *_not_read(place, files["controller"]))
    name = place.resolve().name
    return assembled(name, place, head, sheets, partial=partial, traced=traced, scan=scan, issues=issues)


def assembled(
    name: str,
    place: Path,
    head: RunHead,
    sheets: Mapping[str, Sheet],
    *,
    partial: bool = False,
    traced: bool = False,
    scan: Scan | None = None,
    issues: Iterable[Issue] = (),
) -> Run:
    """Return the run of sheets by the names of its tables, checked; errors as for `load_run`.

    ``traced``: joints may be missing in the controller's table.
    """
    controller = _table(Controller, sheets.get("controller"), head, partial or traced)
    tracker = _table(Tracker, sheets.get("tracker"), head, partial)
    force = _table(Force, sheets.get("force"), head, partial)
    poses = _table(Poses, sheets.get("poses"), head, partial)
    check_together(controller, tracker, force)
    check_columns(controller, tracker, head)
    tables = (controller, tracker, force, poses)
    table_issues = [issue for table in (*tables, scan) if table for issue in table.issues]
    table_issues += [issue for table in tables if table for issue in quantised(table, head)]
    return Run(name, place, head, controller, tracker, force, scan, (*issues, *table_issues), poses)


def _sheet(kind: type[Measured]) -> Callable[[Path], Sheet]:
    return lambda file: read_sheet(file, columns_of(kind))


def _table(kind: type[AnyMeasured], sheet: Sheet | None, head: RunHead, partial: bool) -> AnyMeasured | None:
    if sheet is None:
        return None
    clock_s = getattr(head.clocks, f"{kind.__name__.lower()}_s", 0.0)
    table = build(kind, sheet, partial=partial, clock_s=clock_s)
    check_table(table, head)
    return table


def _file_of(what: What, place: Path, head: RunHead) -> Path | None:
    """Return the file of a table: the one that ``[files]`` names, else the usual one, else None."""
    named: str | None = getattr(head.files, what)
    if named is not None:
        if not is_there(place / named):
            words = f"files.{what}: no file {named[:80]!r} there"
            raise input_error("file-unreadable", words, source=str(place / "run.toml"))
        return place / named
    usual = [place / f"{what}{ending}" for ending in _ENDINGS.get(what, (".csv", ".parquet"))]
    files = [file for file in usual if file.is_file()]
    if not files and what == "controller":
        files = _controller_logs(place)
    if len(files) > 1:
        names = ", ".join(file.name for file in files)
        remedy = f"keep one, or name it: [files] {what} = {files[0].name!r}"
        raise input_error("run-files", f"{what}: several files: {names}", remedy, source=str(place))
    return files[0] if files else None


def _controller_logs(place: Path) -> list[Path]:
    """Return one file of each KRC trace in a folder, and the RSI logs."""
    traces: dict[str, Path] = {}
    for file in sorted(place.glob("*.dat")):
        if is_data_set(file):
            traces.setdefault(recording_of(file), file)
    return [*traces.values(), *(place / name for name in _RSI_NAMES if (place / name).is_file())]


def _not_read(place: Path, controller: Path | None) -> list[Issue]:
    """Return a note for each controller log beside the table that was read."""
    return [
        Issue("note", "run-files", 0, f"{file.name}: not read, {controller.name} is")
        for file in _controller_logs(place)
        if controller is not None and file != controller and recording_of(file) != recording_of(controller)
    ]


def _gear_ratio(place: Path, head: RunHead) -> tuple[float, ...] | None:
    """Return the gear ratios of the cell that ``run.toml`` names."""
    if head.cell is None or not is_there(place / head.cell):
        return None
    return load_cell(place / head.cell).robot.drives.gear_ratio


def _paths(place: Path, head: RunHead) -> list[Issue]:
    """Return a warning for each path of ``run.toml`` that leads nowhere."""
    named = {key: getattr(head, key) for key in ("cell", "program", "prediction")}
    return [
        Issue(
            "warning",
            "run-path",
            0,
            f"run.toml: {key}: nothing at {value[:80]!r}",
            "relative to the run's folder",
        )
        for key, value in named.items()
        if value is not None and not is_there(place / value, Path.exists)
    ]
