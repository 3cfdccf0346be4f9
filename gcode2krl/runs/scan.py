"""Points of the finished part: ``scan.csv``, Parquet, or the vertices of a PLY file (Turk 1994)."""

from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.compiled.inputs import locked
from gcode2krl.errors import Issue, NotUnderstoodError, input_error
from gcode2krl.runs.measured import LARGEST_VALUE, LEAST_ROWS, XYZ
from gcode2krl.runs.tables import missing_column, read_sheet

_LONGEST_HEADER = 65536
_TYPES = {
    "char": "i1",
    "int8": "i1",
    "uchar": "u1",
    "uint8": "u1",
    "short": "i2",
    "int16": "i2",
    "ushort": "u2",
    "uint16": "u2",
    "int": "i4",
    "int32": "i4",
    "uint": "u4",
    "uint32": "u4",
    "float": "f4",
    "float32": "f4",
    "double": "f8",
    "float64": "f8",
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass(frozen=True, eq=False)
class Scan:
    """Points of the part in ``$BASE``."""

    position_mm: Floats
    """(n, 3) read-only."""
    source: str = ""
    dropped_rows: int = 0
    issues: tuple[Issue, ...] = ()

    def __len__(self) -> int:
        return len(self.position_mm)


def read_scan(path: str | Path) -> Scan:
    """Read a scan; points without a value are dropped and counted.

    Raises `NotUnderstoodError` naming the file: unreadable, without points, or of another format.
    """
    file = Path(path)
    points = _read_ply(file) if file.suffix.lower() == ".ply" else _read_table(file)
    keep = np.isfinite(points).all(axis=1)
    lost = int(np.count_nonzero(~keep))
    if len(points) - lost < LEAST_ROWS:
        raise input_error(
            "trace-short", f"{len(points) - lost} points, at least {LEAST_ROWS} are needed", source=str(file)
        )
    kept = np.ascontiguousarray(points[keep])
    if np.abs(kept).max() > LARGEST_VALUE:
        row = int(np.argmax(np.abs(kept).max(axis=1)))
        words = f"point {row + 1}: {np.abs(kept).max():.3g} mm is not a measured value"
        raise input_error("trace-unit", words, "export the scan in mm", source=str(file))
    text = f"{file.name}: {lost} of {len(points)} points dropped for missing values"
    return Scan(locked(kept), str(file), lost, (Issue("warning", "trace-dropped", 0, text),) if lost else ())


def _read_table(file: Path) -> Floats:
    sheet = read_sheet(file, XYZ)
    absent = [name for name in XYZ if name not in sheet.columns]
    if absent:
        raise missing_column(sheet, absent, f"name the columns {', '.join(XYZ)}")
    return np.stack([sheet.columns[name] for name in XYZ], axis=1)


def _read_ply(file: Path) -> Floats:
    try:
        data = file.read_bytes()
    except OSError as error:
        raise input_error("file-unreadable", f"cannot read: {error.strerror}", source=str(file)) from None
    order, count, fields, body = _ply_header(data, file)
    if order == "":
        return _ascii_vertices(data[body:], count, fields, file, data.count(b"\n", 0, body))
    layout = np.dtype([(name, order + kind) for name, kind in fields])
    if len(data) - body < count * layout.itemsize:
        available = (len(data) - body) // layout.itemsize
        _refuse(file, f"{count} vertices announced, {available} there: the file is cut off")
    table = np.frombuffer(data, dtype=layout, count=count, offset=body)
    with np.errstate(invalid="ignore"):  # a NaN that signals
        return np.stack([table[axis].astype(np.float64) for axis in "xyz"], axis=1)


def _ply_header(data: bytes, file: Path) -> tuple[str, int, list[tuple[str, str]], int]:
    """Return byte order ("" = text), number of vertices, their fields, and where the body begins."""
    end = data.find(b"end_header", 0, _LONGEST_HEADER)
    body = data.find(b"\n", end) + 1
    if not data.startswith(b"ply") or end < 0 or body == 0:
        _refuse(file, "no PLY header")
    order, count, fields = _header_lines(data[:end].decode("latin-1").splitlines(), file)
    names = [name for name, _ in fields]
    if order is None or count < 0 or not {"x", "y", "z"} <= set(names) or len(set(names)) < len(names):
        _refuse(file, "the header names no format, or no vertices with x, y, z")
    return order, count, fields, body


def _header_lines(lines: list[str], file: Path) -> tuple[str | None, int, list[tuple[str, str]]]:
    """Return byte order, number of vertices and their fields, each as far as the lines name it."""
    order, count, fields, element = None, -1, [], ""
    for number, line in enumerate(lines, start=1):
        words = line.split()
        if words[:1] == ["format"] and len(words) > 1 and words[1] in _ORDERS:
            order = _ORDERS[words[1]]
        elif words[:1] == ["element"] and len(words) == 3:
            if element and count < 0:
                _refuse(file, f"element {element} stands before the vertices", number)
            element = words[1]
            count = int(words[2]) if element == "vertex" and words[2].isdecimal() else count
        elif words[:1] == ["property"] and element == "vertex":
            if len(words) != 3 or words[1] not in _TYPES:
                _refuse(file, f"property {' '.join(words[1:])!r} of the vertices", number)
            fields.append((words[2], _TYPES[words[1]]))
    return order, count, fields


def _ascii_vertices(
    body: bytes, count: int, fields: list[tuple[str, str]], file: Path, lines_before: int
) -> Floats:
    lines = body.decode("latin-1").splitlines()[:count]
    if len(lines) < count:
        _refuse(file, f"{count} vertices announced, {len(lines)} there: the file is cut off")
    at = [[name for name, _ in fields].index(axis) for axis in "xyz"]
    points = np.empty((count, 3))
    for index, line in enumerate(lines):
        words = line.split()
        try:
            points[index] = [float(words[place]) for place in at]
        except (ValueError, IndexError):
            _refuse(file, f"{line[:40]!r} is not a vertex", lines_before + index + 1)
    return points


def _refuse(file: Path, message: str, line: int = 0) -> NoReturn:
    raise _error(file, message, line)


def _error(file: Path, message: str, line: int) -> NotUnderstoodError:
    return input_error(
        "scan-ply",
        message,
        "export PLY (text or binary) with x, y, z in mm, or CSV",
        line=line,
        source=str(file),
    )
