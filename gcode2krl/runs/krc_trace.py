"""A KRC trace → the columns of ``controller.csv``.

One recording is several data sets, ``<name>_<module>.dat``: the interpolator's (``KRCIpo``: ``X_CmdIpo``,
``AxisPos_CmdIpo1``, ``AxisPos_Act1``, …) and one for each drive (``NextGenDrive#1``: Sollposition,
Istposition, Iststrom, …, the axis is in the file's name). Modules of other rates are put on the clock of the
slowest by linear interpolation between their own, closer samples. Angles of the drives, which include the
servo error, replace those of the interpolator.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.errors import Issue, input_error
from gcode2krl.runs.diadem import Channel, DataSet, is_data_set, read_data_set
from gcode2krl.runs.tables import Sheet
from gcode2krl.units import DEG_PER_RAD, MM_PER_M

# Motor angles of the drives → axis angles, by the commanded angles of the interpolator.
#
# axis_n(t) = sum of c_k · motor_k(t + lag) + zero, with k = n for A1 to A4 and k = 4 … n for A5 and A6,
# whose motors turn with the wrist axes before them (``$COUP_COMP``). c and zero come from least squares
# over the whole recording; all axes have one lag: the interpolator is ahead of the drives, by 40-100 ms on
# a KRC. Commanded and actual angle of a drive get the same c and zero, so that the fit does not remove
# their difference, the servo error.

_AXIS_RANGE_DEG = 370.0
"""No axis of the robots here turns further; a motor does."""
_LONGEST_LAG_S = 0.2
_LEAST_TURN_DEG = 0.2
_SAME_SCALE = 0.02
_WORST_FIT_DEG = 0.05
_MOST_SAMPLES = 2000


class Angles(NamedTuple):
    """Angles in degrees over time, NaN columns where a joint was not recorded."""

    time_s: Floats
    """(n,)"""
    deg: Floats
    """(n, 6)"""


class _DriveFit(NamedTuple):
    factors: Floats
    """(6,)"""
    zero_deg: float
    rms_deg: float


def axis_angles(
    drive: Angles, actual_deg: Floats, wanted: Angles | None, gear_ratio: Sequence[float] | None
) -> tuple[Floats, Floats, list[str]]:
    """Return commanded and actual axis angles (n, 6) in degrees, and a text for each axis on what was done.

    Parameters
    ----------
    drive : commanded angles of the drives.
    actual_deg : (n, 6) actual angles of the drives, at the same times.
    wanted : the interpolator's commanded axis angles, where they were recorded.
    gear_ratio : (6,) used where there is no other source; sign and zero are then unknown.

    Columns that cannot be turned into axis angles become NaN.
    """
    command, actual, words = drive.deg.copy(), actual_deg.copy(), []
    without_command = np.isnan(drive.deg).all(axis=0)
    motor = Angles(drive.time_s, np.where(without_command, actual_deg, drive.deg))
    lag_s = _common_lag(motor, wanted) if wanted is not None else 0.0
    for axis in range(6):
        both = np.stack([drive.deg[:, axis], actual_deg[:, axis]])
        if np.isnan(both).all():
            continue
        fit, text = _axis(axis, motor, float(np.nanmax(np.abs(both))), wanted, lag_s, gear_ratio)
        if text:
            words.append(f"A{axis + 1}: {text}")
        command[:, axis], actual[:, axis] = _applied(fit, drive.deg), _applied(fit, actual_deg)
    return command, actual, words


def _axis(
    axis: int,
    drive: Angles,
    largest_deg: float,
    wanted: Angles | None,
    lag_s: float,
    gear_ratio: Sequence[float] | None,
) -> tuple[_DriveFit, str]:
    """Return the map from motor angles to the angle of one axis, NaN where it is unknown."""
    as_is, unknown = _DriveFit(np.eye(6)[axis], 0.0, 0.0), _DriveFit(np.full(6, np.nan), 0.0, 0.0)
    if wanted is not None and _moves(wanted.deg[:, axis]) and _moves(drive.deg[:, axis]):
        alone = _fit(axis, [axis], drive, wanted, lag_s)
        if abs(alone.factors[axis] - 1.0) < _SAME_SCALE and alone.rms_deg < _WORST_FIT_DEG:
            return as_is, ""
        fit = _fit(axis, list(range(min(axis, 3), axis + 1)), drive, wanted, lag_s)
        if fit.rms_deg > _WORST_FIT_DEG or fit.factors[axis] == 0.0:
            return unknown, "the drive does not follow the interpolator's angle, left out"
        ratio = 1.0 / fit.factors[axis]
        return fit, f"motor angle, gear ratio {ratio:.6g} found with {fit.rms_deg:.2g} deg rms"
    if largest_deg <= _AXIS_RANGE_DEG:
        return as_is, ""
    if gear_ratio is None:
        return unknown, "motor angle of unknown gear ratio, left out; record AxisPos_CmdIpo of a moving axis"
    fit = _DriveFit(np.eye(6)[axis] / gear_ratio[axis], 0.0, 0.0)
    return fit, f"motor angle over the cell's gear ratio {gear_ratio[axis]:g}; sign and zero unknown"


def _common_lag(drive: Angles, wanted: Angles) -> float:
    """Return the lag with the smallest sum of squared relative misfits."""
    moving = [n for n in range(6) if _moves(wanted.deg[:, n]) and _moves(drive.deg[:, n])]
    if not moving:
        return 0.0

    def misfit(lag_s: float) -> float:
        fits = [(n, _fit(n, list(range(min(n, 3), n + 1)), drive, wanted, lag_s)) for n in moving]
        return sum((fit.rms_deg / _range(wanted.deg[:, n])) ** 2 for n, fit in fits)

    lags = np.arange(0.0, _LONGEST_LAG_S, 4e-3)
    lags = lags[int(np.argmin([misfit(float(lag)) for lag in lags]))] + np.arange(-4e-3, 4.1e-3, 2.5e-4)
    return float(lags[int(np.argmin([misfit(float(lag)) for lag in lags]))])


def _fit(axis: int, motors: list[int], drive: Angles, wanted: Angles, lag_s: float) -> _DriveFit:
    """Return the least squares fit of one axis to some motors; motors at rest are ignored."""
    motors = [n for n in motors if _moves(drive.deg[:, n])]
    every = max(1, len(wanted.time_s) // _MOST_SAMPLES)
    time_s, y = wanted.time_s[::every] + lag_s, wanted.deg[::every, axis]
    x = np.stack([np.interp(time_s, drive.time_s, drive.deg[:, n]) for n in motors], axis=1)
    good = (time_s >= drive.time_s[0]) & (time_s <= drive.time_s[-1]) & np.isfinite(y + x.sum(axis=1))
    if np.count_nonzero(good) <= len(motors) + 1:
        return _DriveFit(np.zeros(6), 0.0, float("inf"))
    x, y = x[good], y[good]
    factors = np.linalg.lstsq(x - x.mean(axis=0), y - y.mean(), rcond=None)[0]
    zero = float(y.mean() - x.mean(axis=0) @ factors)
    spread = np.zeros(6)
    spread[motors] = factors
    return _DriveFit(spread, zero, float(np.sqrt(np.mean((y - x @ factors - zero) ** 2))))


def _applied(fit: _DriveFit, motor_deg: Floats) -> Floats:
    used = np.flatnonzero(fit.factors)
    result: Floats = motor_deg[:, used] @ fit.factors[used] + fit.zero_deg
    return result


def _moves(deg: Floats) -> bool:
    return _range(deg) > _LEAST_TURN_DEG


def _range(deg: Floats) -> float:
    known = deg[np.isfinite(deg)]
    return float(np.ptp(known)) if len(known) else 0.0


_UNITS = {
    "deg": {"°": 1.0, "deg": 1.0, "grad": 1.0, "m°": 1e-3, "mdeg": 1e-3, "µ°": 1e-6, "rad": DEG_PER_RAD},
    "mm": {"mm": 1.0, "m": MM_PER_M, "µm": 1e-3, "um": 1e-3},
    "A": {"a": 1.0, "ma": 1e-3},
    "Nm": {"nm": 1.0, "nmm": 1.0 / MM_PER_M, "mnm": 1e-3},
}
_COMMAND, _ACTUAL, _LAG = "q{}_cmd_deg", "q{}_act_deg", "lag{}_deg"


@dataclass
class _Module:
    """One data set: its clock and its channels under the names of the columns."""

    time_s: Floats
    columns: dict[str, Floats] = field(default_factory=dict)
    drive: bool = False


def read_krc_trace(path: str | Path, gear_ratio: Sequence[float] | None = None) -> Sheet:
    """Read all modules of a recording; ``path`` is any one of its ``.dat`` files.

    Parameters
    ----------
    gear_ratio : (6,) for drives that state motor angles in a recording without the interpolator's angles;
        sign and zero are then unknown.

    Raises
    ------
    NotUnderstoodError
        As in `read_data_set`, and where no channel is known.
    """
    file = Path(path)
    issues: list[Issue] = []
    unknown: list[str] = []
    modules = [_module(read_data_set(module_file), issues, unknown) for module_file in modules_of(file)]
    modules = [module for module in modules if module.columns and len(module.time_s) > 1]
    if not modules:
        raise input_error(
            "krc-trace",
            f"no channel is known; the trace has {', '.join(unknown[:12])}",
            "record AxisPos_CmdIpo, AxisPos_Act, X_CmdIpo …, or Sollposition and Istposition of the drives",
            source=str(file),
        )
    others, drives = (_merged([m for m in modules if m.drive is drive]) for drive in (False, True))
    if drives is not None:
        words = _turn_to_axes(drives, others, gear_ratio)
        issues += [Issue("warning", "krc-trace", 0, f"{file.name}: {text}") for text in words]
    merged = _merged([module for module in (others, drives) if module is not None])
    columns = {"t_s": merged.time_s, **merged.columns} if merged else {}
    return Sheet(columns, (*columns, *unknown), 1, str(file), tuple(issues))


def _merged(modules: list[_Module]) -> _Module | None:
    """Return modules on the clock of the slowest; the later module wins if two have the same column."""
    if not modules:
        return None
    slowest = max(modules, key=lambda module: float(np.median(np.diff(module.time_s))))
    result = _Module(slowest.time_s)
    for module in modules:
        for name, values in module.columns.items():
            result.columns[name] = _at(slowest.time_s, module.time_s, values)
    return result


def _turn_to_axes(drives: _Module, others: _Module | None, gear_ratio: Sequence[float] | None) -> list[str]:
    """Turn the drives' angles into those of the axes, in place; returns a text for each axis."""
    command = Angles(drives.time_s, _six(drives, _COMMAND))
    wanted = Angles(others.time_s, _six(others, _COMMAND)) if others else None
    *turned, words = axis_angles(command, _six(drives, _ACTUAL), wanted, gear_ratio)
    for pattern, deg in zip((_COMMAND, _ACTUAL), turned, strict=True):
        for number in range(1, 7):
            drives.columns.pop(pattern.format(number), None)
            if np.isfinite(deg[:, number - 1]).any():
                drives.columns[pattern.format(number)] = deg[:, number - 1]
    return words


def _six(module: _Module, pattern: str) -> Floats:
    """Return (n, 6) the columns of the six joints, NaN where there is none."""
    none = np.full(len(module.time_s), np.nan)
    return np.stack([module.columns.get(pattern.format(n), none) for n in range(1, 7)], axis=1)


def modules_of(file: Path) -> list[Path]:
    """Return the data sets of one recording, in order of their names."""
    stem = recording_of(file)
    files = sorted(file.parent.glob("*.dat"))
    return [
        module_file for module_file in files if recording_of(module_file) == stem and is_data_set(module_file)
    ] or [file]


def recording_of(file: Path) -> str:
    """Return the name of the recording that a file belongs to: the part before the last underscore."""
    return file.stem.rpartition("_")[0] or file.stem


def _module(data: DataSet, issues: list[Issue], unknown: list[str]) -> _Module:
    issues += data.issues
    axis = re.search(r"#(\d)", data.file.stem)
    module = _Module(data.time_s, drive=axis is not None)
    named: dict[str, Channel] = {}
    for channel in data.channels:
        column = column_of(channel.name, axis[1] if axis else "")
        if column == "" or (column in named and not channel.name.casefold().endswith("ipo")):
            unknown.append(channel.name)
        else:
            named[column] = channel
    for column, channel in named.items():
        module.columns[column] = channel.values * _factor(channel, column, data.file, issues)
    for number in range(1, 7):
        lag, command = (
            module.columns.pop(_LAG.format(number), None),
            module.columns.get(_COMMAND.format(number)),
        )
        if lag is not None and command is not None:
            module.columns.setdefault(_ACTUAL.format(number), command - lag)
    return module


def column_of(channel: str, axis: str) -> str:
    """Return the column that a channel fills, "" if none; ``axis`` is that of the file's name."""
    name = re.sub(r"\s+", "", channel).casefold()
    number = re.search(r"_?a?([1-6])$", name)
    digit = number[1] if number else axis
    stem = name[: number.start()] if number else name
    german = {
        "sollposition": _COMMAND,
        "istposition": _ACTUAL,
        "positionsschleppfehler": _LAG,
        "iststrom": "i{}_A",
        "istmoment": "tau{}_Nm",
    }
    if stem in german:
        return german[stem].format(digit) if digit else ""
    if re.fullmatch(r"axispos_(cmd|act)\w*", stem):
        return f"q{digit}_{stem[8:11]}_deg" if digit else ""
    cartesian = re.fullmatch(r"([xyzabc])_(cmd|act)\w*", name)
    if cartesian:
        return f"{cartesian[1]}_{cartesian[2]}_{'mm' if cartesian[1] in 'xyz' else 'deg'}"
    return ""


def _factor(channel: Channel, column: str, file: Path, issues: list[Issue]) -> float:
    """Return the factor from a channel's unit to that of its column."""
    wanted = column.rpartition("_")[2]
    unit = channel.unit.casefold().replace("μ", "µ").replace("\N{MASCULINE ORDINAL INDICATOR}", "°")
    factor = _UNITS[wanted].get(unit)
    if factor is None:
        text = f"{file.name}: channel {channel.name} has the unit {channel.unit!r}, taken as {wanted}"
        issues.append(Issue("warning", "trace-unit", 0, text))
        return 1.0
    return factor


def _at(time_s: Floats, own_s: Floats, values: Floats) -> Floats:
    """Return a channel at other times, NaN outside its own."""
    if own_s is time_s or np.array_equal(own_s, time_s):
        return values
    result = np.interp(time_s, own_s, values)
    slack = 1e-9 * max(1.0, float(np.abs(own_s).max(initial=0.0)))
    result[(time_s < own_s[0] - slack) | (time_s > own_s[-1] + slack)] = np.nan
    return result
