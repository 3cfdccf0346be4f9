"""DIAdem data sets as the KRC's trace writes them: a ``.dat`` header with numbered keys, values in ``.r64``.

Keys of a channel (National Instruments, "DIAdem header files"): 200 name, 202 unit, 210 implicit (start 240,
step 241, count 220) or explicit, 211 file, 213 BLOCK (rows of all channels) or CHANNEL (one after the other),
214 data type, 220 count, 221 first value (1-based), 240 offset, 241 factor. The KRC writes the German words
IMPLIZIT and EXPLIZIT, and float64 in little-endian order whatever key 112 says.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path, PureWindowsPath
from typing import NoReturn

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.errors import Issue, input_error
from gcode2krl.runs.tables import printable

_FIRST_WORD = "DIAEXTENDED"
_LONGEST_HEADER = 4_000_000
_MOST_VALUES = 2_000_000_000
_ABSURD = 1e30
_REMEDY = "copy the .dat and the .r64 of a trace together, unchanged"


@dataclass(frozen=True, eq=False)
class Channel:
    """One channel of a data set."""

    name: str
    unit: str
    values: Floats
    """(n,)"""


@dataclass(frozen=True, eq=False)
class DataSet:
    """A header file with the values it points to."""

    file: Path
    comment: str
    """Key 102: the robot, as the KRC writes it."""
    time_s: Floats
    """(n,)"""
    channels: tuple[Channel, ...]
    issues: tuple[Issue, ...] = ()


@dataclass
class _Block:
    """The keys of one channel as text, and the line each stands in."""

    keys: dict[int, str] = field(default_factory=dict)
    lines: dict[int, int] = field(default_factory=dict)

    @property
    def name(self) -> str:
        return printable(self.keys.get(200, "?"))

    @property
    def explicit(self) -> bool:
        return self.keys.get(210, "").upper().startswith("EXPLI")

    @property
    def file(self) -> str:
        return PureWindowsPath(self.keys.get(211, "")).name


def is_data_set(file: Path) -> bool:
    """Tell whether a file begins as a DIAdem header."""
    try:
        with file.open("rb") as stream:
            return stream.read(64).lstrip().startswith(_FIRST_WORD.encode("ascii"))
    except OSError:
        return False


def read_data_set(path: str | Path) -> DataSet:
    """Read a header and its values; the time channel becomes ``time_s``.

    Raises `NotUnderstoodError` naming file, line and channel: no such header, keys that are missing or not
    numbers, values that are missing or not float64 in little-endian order.
    """
    file = Path(path)
    comment, blocks = _read_header(file)
    clocks = [block for block in blocks if not block.explicit]
    blocks = [block for block in blocks if block.explicit]
    if not blocks:
        _refuse(file, "no channel with values (key 210 EXPLIZIT)")
    raw: dict[str, Floats] = {}
    issues: list[Issue] = []
    columns = [_values(file, block, blocks, raw) for block in blocks]
    rows = min(len(values) for values in columns)
    announced = max(_whole(file, block, 220) for block in blocks)
    if rows < announced:
        text = f"{file.name}: {announced} values announced, {rows} there: the recording is cut off"
        issues.append(Issue("warning", "krc-trace", 0, text))
    channels = [
        Channel(block.name, block.keys.get(202, "").strip("[] "), values[:rows])
        for block, values in zip(blocks, columns, strict=True)
    ]
    time_s, used = _time(file, clocks, channels, rows)
    others = tuple(channel for channel in channels if channel is not used)
    return DataSet(file, comment, time_s, others, tuple(issues))


def _read_header(file: Path) -> tuple[str, list[_Block]]:
    """Return the comment and the channels' blocks."""
    try:
        with file.open("rb") as stream:
            lines = stream.read(_LONGEST_HEADER).decode("latin-1").splitlines()
    except OSError as error:
        raise input_error("file-unreadable", f"cannot read: {error.strerror}", source=str(file)) from None
    if not lines or not lines[0].strip().startswith(_FIRST_WORD):
        _refuse(file, f"the first line is not {_FIRST_WORD}", 1)
    common, blocks, inside = _Block(), [], False
    for number, line in enumerate(lines, start=1):
        word = line.strip().upper()
        if word.startswith("#"):
            inside = "BEGIN" in word and "CHANNEL" in word
            if inside:
                blocks.append(_Block())
            continue
        key = re.match(r"\s*(\d{1,4}),(.*)", line)
        if key is None:
            continue
        block = blocks[-1] if inside else common
        block.keys[int(key[1])] = key[2].strip()
        block.lines[int(key[1])] = number
    return common.keys.get(102, ""), [block for block in blocks if 200 in block.keys]


def _values(file: Path, block: _Block, blocks: list[_Block], raw: dict[str, Floats]) -> Floats:
    """Return an explicit channel's values: raw · factor + offset."""
    kind, method = block.keys.get(214, "REAL64").upper(), block.keys.get(213, "BLOCK").upper()
    if kind != "REAL64" or method not in ("BLOCK", "CHANNEL"):
        problem = f"found {method} of {kind}, allowed: BLOCK or CHANNEL of REAL64"
        _refuse(file, f"channel {block.name}, keys 213 and 214: {problem}", block.lines.get(214, 0))
    if block.file not in raw:
        raw[block.file] = _read_raw(file, block)
    data = raw[block.file]
    count, first = _whole(file, block, 220), _whole(file, block, 221, 1) - 1
    if method == "CHANNEL":
        values = data[first : first + count]
    else:
        width = _width(data, count, [other for other in blocks if other.file == block.file])
        if first >= width:
            problem = f"column {first + 1}, but {block.file} has {width}"
            _refuse(file, f"channel {block.name}, key 221: {problem}", block.lines.get(221, 0))
        values = data[: len(data) // width * width].reshape(-1, width)[:count, first]
    return values * _number(file, block, 241, 1.0) + _number(file, block, 240, 0.0)


def _width(data: Floats, count: int, blocks: list[_Block]) -> int:
    """Return the columns of a file of rows: as many as it has channels, or more if that fits exactly."""
    if len(data) % count == 0 and len(data) // count > len(blocks):
        return len(data) // count
    return len(blocks)


def _read_raw(file: Path, block: _Block) -> Floats:
    """Return the file of values that a channel names, beside the header."""
    place = file.with_name(block.file) if block.file else file.with_suffix(".r64")
    try:
        if not place.is_file():
            place = file.with_suffix(".r64")
        size = place.stat().st_size // 8
        data = np.fromfile(place, dtype="<f8", count=size)
    except OSError as error:
        words = f"cannot read {block.file or place.name} of channel {block.name}: {error.strerror}"
        raise input_error("file-unreadable", words, _REMEDY, source=str(file)) from None
    absurd = np.count_nonzero(np.isfinite(data) & (np.abs(data) > _ABSURD))
    if absurd > len(data) // 100:
        _refuse(file, f"{place.name} holds no float64 in little-endian order")
    return data


def _time(
    file: Path, clocks: list[_Block], channels: list[Channel], rows: int
) -> tuple[Floats, Channel | None]:
    """Return the time (rows,) and the channel it was taken from, None where it is implicit."""
    if clocks:
        step = _number(file, clocks[0], 241, 0.0) * _seconds(clocks[0].keys.get(202, ""))
        if step <= 0.0:
            problem = f"a step of {step:g} s"
            _refuse(file, f"channel {clocks[0].name}, key 241: {problem}", clocks[0].lines.get(241, 0))
        start = _number(file, clocks[0], 240, 0.0) * _seconds(clocks[0].keys.get(202, ""))
        return start + step * np.arange(rows, dtype=np.float64), None
    for channel in channels:
        if channel.name.casefold() in ("zeit", "time", "t"):
            return channel.values * _seconds(channel.unit), channel
    return _refuse(file, "no time channel (key 210 IMPLIZIT, or one named Zeit)")


def _seconds(unit: str) -> float:
    return {"ms": 1e-3, "us": 1e-6, "µs": 1e-6}.get(unit.strip("[] "), 1.0)


def _number(file: Path, block: _Block, key: int, default: float) -> float:
    text = block.keys.get(key, "")
    if not text:
        return default
    try:
        value = float(text.replace(",", "."))
    except ValueError:
        value = float("nan")
    if not np.isfinite(value):
        problem = f"{text[:40]!r} is not a number"
        _refuse(file, f"channel {block.name}, key {key}: {problem}", block.lines[key])
    return value


def _whole(file: Path, block: _Block, key: int, default: int = 0) -> int:
    value = _number(file, block, key, float(default))
    if value != int(value) or not 1 <= value <= _MOST_VALUES:
        problem = f"{block.keys.get(key, 'nothing')}, allowed: a whole number from 1"
        _refuse(file, f"channel {block.name}, key {key}: found {problem}", block.lines.get(key, 0))
    return int(value)


def _refuse(file: Path, message: str, line: int = 0) -> NoReturn:
    raise input_error("krc-trace", message, _REMEDY, line=line, source=str(file))
