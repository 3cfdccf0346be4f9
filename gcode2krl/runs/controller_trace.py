"""The controller's trace of the commanded position, read, checked and cut at standstills.

Columns as in ``controller.csv``: ``t_s``, ``x_cmd_mm``, ``y_cmd_mm``, ``z_cmd_mm``; others are ignored.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.errors import NotUnderstoodError, input_error
from gcode2krl.runs.measured import LEAST_ROWS, TIME
from gcode2krl.runs.tables import missing_column, read_sheet

POSITION = ("x_cmd_mm", "y_cmd_mm", "z_cmd_mm")
_LONGEST_CYCLE_S = 1.0
_METRES_SHOW_BELOW = 0.02
"""A trace that spans a smaller fraction of the program on an axis is assumed to be in another unit."""
_MOST_DECIMALS = 7
_QUIET_SHARE = 0.25
_STILL_SIGMA = 8.0
_SAME_PLACE_MM = 0.2


@dataclass(frozen=True)
class ControllerTrace:
    """The commanded position over time, in order, without missing values."""

    time_s: Floats
    """(n,)"""
    position_mm: Floats
    """(n, 3) in ``$BASE``."""
    row: Ints
    """(n,) number of each sample in the file: its line in a CSV, its 1-based row in Parquet."""
    dropped: int
    """Rows left out because a value is missing (empty, NaN or infinite)."""
    source: str

    def __len__(self) -> int:
        return len(self.time_s)


def read_controller_trace(path: str | Path) -> ControllerTrace:
    """Read a trace from CSV with a header line, or from Parquet.

    Raises
    ------
    NotUnderstoodError
        Names file, row and column: unreadable file, missing column, a value that is not a number, time that
        does not rise or is not in seconds, fewer than 10 rows.
    """
    sheet = read_sheet(path, (TIME, *POSITION))
    missing = [name for name in (TIME, *POSITION) if name not in sheet.columns]
    if missing:
        raise missing_column(sheet, missing, f"name the columns {TIME}, {', '.join(POSITION)}")
    values = np.stack([sheet.columns[name] for name in (TIME, *POSITION)], axis=1)
    complete = np.isfinite(values).all(axis=1)
    row = np.flatnonzero(complete) + sheet.first_row
    trace = ControllerTrace(
        time_s=np.ascontiguousarray(values[complete, 0]),
        position_mm=np.ascontiguousarray(values[complete, 1:]),
        row=row,
        dropped=int(np.count_nonzero(~complete)),
        source=sheet.source,
    )
    _check_rows(trace)
    _check_time(trace)
    return trace


def check_scale(trace: ControllerTrace, program_mm: Floats) -> None:
    """Raise `NotUnderstoodError` where a column spans about a thousandth of the program's (p, 3) positions.

    Such a column is in metres although it is named ``_mm``.
    """
    wanted, traced = np.ptp(program_mm, axis=0), np.ptp(trace.position_mm, axis=0)
    for name, programmed_mm, traced_mm in zip(POSITION, wanted.tolist(), traced.tolist(), strict=True):
        if programmed_mm > 1.0 and 1e-4 * programmed_mm < traced_mm < _METRES_SHOW_BELOW * programmed_mm:
            raise input_error(
                "trace-unit",
                f"column {name} spans {traced_mm:.4g}, the program {programmed_mm:.4g} mm: "
                "about 1000 times less, so metres",
                "multiply the column by 1000",
                line=int(trace.row[0]),
                source=trace.source,
            )


def resolution_mm(position_mm: Floats) -> float:
    """Return the step of the last decimal in which positions were recorded; 0 where no rounding shows."""
    for decimals in range(_MOST_DECIMALS):
        if np.abs(np.round(position_mm, decimals) - position_mm).max(initial=0.0) < 1e-9:
            return float(10.0**-decimals)
    return 0.0


def noise_mm(trace: ControllerTrace, window: int = 10) -> float:
    """Return a rough 1-sigma noise of one axis: second differences in the quietest quarter of a trace."""
    second = np.diff(trace.position_mm, n=2, axis=0)
    if len(second) < window:
        return 0.0
    squares = np.cumsum(np.concatenate([np.zeros((1, 3)), second**2]), axis=0)
    power = (squares[window:] - squares[:-window]).max(axis=1) / window
    return math.sqrt(max(float(np.quantile(power, _QUIET_SHARE)), 0.0) / 6.0)  # 1² + 2² + 1²


def standstills(trace: ControllerTrace, least_s: float, still_mm: float) -> Ints:
    """Return (s, 2) first and last sample of each standstill of at least ``least_s``.

    Within a standstill no axis moves by more than ``still_mm``. The first and the last sample of the trace
    count as standstills, too, if the trace begins or ends in motion.
    """
    count = len(trace)
    width = min(count, math.ceil(least_s / float(np.median(np.diff(trace.time_s))) - 1e-6) + 1)
    windows = np.lib.stride_tricks.sliding_window_view(trace.position_mm, width, axis=0)
    quiet = (windows.max(axis=-1) - windows.min(axis=-1)).max(axis=1) <= still_mm
    still = np.zeros(count + 1, dtype=np.int64)
    starts = np.flatnonzero(quiet)
    np.add.at(still, starts, 1)
    np.add.at(still, starts + width, -1)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.cumsum(still)[:count] > 0, [0]]).astype(np.int8)))
    runs = [(int(first), int(end) - 1) for first, end in zip(edges[::2], edges[1::2], strict=True)]
    if not runs or runs[0][0] > 0:
        runs.insert(0, (0, 0))
    if runs[-1][1] < count - 1:
        runs.append((count - 1, count - 1))
    return np.array(_joined(runs, trace.position_mm, still_mm), dtype=np.int64)


def program_rests(trace: ControllerTrace, wanted_mm: Floats, line: Ints, least_s: float) -> tuple[Ints, int]:
    """Return the standstills (s + 1, 2) of a program's s sections, and how many other sections there are.

    Parameters
    ----------
    wanted_mm : (s + 1, 3) where the program stands still, in order.
    line : (s + 1,) its G-code lines, for the text of an error.
    least_s : what counts as a standstill.

    Raises
    ------
    NotUnderstoodError
        Where the trace does not stand still at exactly these places.
    """
    still_mm = _STILL_SIGMA * noise_mm(trace) + 2.0 * resolution_mm(trace.position_mm) + 1e-4
    rests = standstills(trace, least_s, still_mm)
    places = np.array([trace.position_mm[first : last + 1].mean(axis=0) for first, last in rests])
    gaps = [places[j : j + len(wanted_mm)] - wanted_mm for j in range(len(places) - len(wanted_mm) + 1)]
    tolerance_mm = _SAME_PLACE_MM + still_mm
    for j, gap in enumerate(gaps):
        if np.abs(gap).max() <= tolerance_mm:
            return rests[j : j + len(wanted_mm)], len(places) - len(wanted_mm)
    for gap in gaps:
        shift = gap.mean(axis=0)
        if np.abs(gap - shift).max() <= tolerance_mm and len(wanted_mm) > 2:
            x, y, z = shift.tolist()
            raise _no_match(
                trace,
                0,
                f"the trace is shifted against the program by ({x:.3f}, {y:.3f}, {z:.3f}) mm",
                "record with the $BASE and $TOOL of the program",
            )
    counts = f"the trace has {len(places) - 1} sections between standstills, the program {len(wanted_mm) - 1}"
    at, gap_start = 0, 0
    for j in range(len(places)):
        room = min(len(wanted_mm), len(places) - j)
        off = np.abs(places[j : j + room] - wanted_mm[:room]).max(axis=1) > tolerance_mm
        agree = int(np.argmax(off)) if off.any() else room
        if agree > at:
            at, gap_start = agree, j
    if gap_start + at >= len(places):
        where = f"; it ends before G-code line {line[min(at, len(line) - 1)]}"
        raise _no_match(trace, int(trace.row[-1]), counts + where, "record the whole program")
    traced, needed = (", ".join(f"{x:.3f}" for x in p) for p in (places[gap_start + at], wanted_mm[at]))
    raise _no_match(
        trace,
        int(trace.row[rests[gap_start + at, 0]]),
        f"{counts}; they differ at standstill {at + 1} (G-code line {line[at]}): "
        f"({traced}) instead of ({needed})",
        "record this program, without stops of your own; name it with --part",
    )


def _no_match(trace: ControllerTrace, row: int, message: str, remedy: str) -> NotUnderstoodError:
    return input_error("trace-sections", message, remedy, line=row, source=trace.source)


def _joined(runs: list[tuple[int, int]], position_mm: Floats, still_mm: float) -> list[tuple[int, int]]:
    """Join neighbours between which nothing moves: noise had split one standstill."""
    joined = [runs[0]]
    for first, last in runs[1:]:
        before = joined[-1]
        place = position_mm[before[0] : before[1] + 1].mean(axis=0)
        between = position_mm[before[1] : first + 1]
        if np.abs(between - place).max() <= still_mm:
            joined[-1] = (before[0], last)
        else:
            joined.append((first, last))
    return joined


def _check_rows(trace: ControllerTrace) -> None:
    if len(trace) < LEAST_ROWS:
        dropped = f" ({trace.dropped} dropped for missing values)" if trace.dropped else ""
        raise input_error(
            "trace-short",
            f"{len(trace)} usable rows{dropped}, at least {LEAST_ROWS} are needed",
            "record the whole program",
            source=trace.source,
        )


def _check_time(trace: ControllerTrace) -> None:
    step = np.diff(trace.time_s)
    back = np.flatnonzero(step <= 0)
    if len(back):
        raise _time_error(trace, int(back[0]))
    cycle_s = float(np.median(step))
    if cycle_s > _LONGEST_CYCLE_S:
        raise input_error(
            "trace-unit",
            f"column {TIME}: {cycle_s:g} s between samples, so not seconds",
            "divide the column by 1000 if it is in ms",
            line=int(trace.row[1]),
            source=trace.source,
        )


def _time_error(trace: ControllerTrace, index: int) -> NotUnderstoodError:
    row = int(trace.row[index + 1])
    before, after = trace.time_s[index], trace.time_s[index + 1]
    return input_error(
        "trace-time",
        f"row {row}, column {TIME}: {after:g} s does not come after {before:g} s",
        "export one recording, in order",
        line=row,
        source=trace.source,
    )
