"""A table as another program wrote it: separator, decimal sign, lines above the header and units below it."""

import csv
import io
import re
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, NamedTuple
from xml.etree.ElementTree import Element, ParseError, iterparse

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.errors import NotUnderstoodError, input_error
from gcode2krl.files.parquet_guard import MAGIC, DamagedError, read_parquet
from gcode2krl.runs.foreign.names import unit_of
from gcode2krl.runs.tables import numbers, printable, refuse_twins

if TYPE_CHECKING:
    import polars as pl


_MOST_BYTES = 2_000_000_000
"""Of one part when unpacked: a sheet of 1,048,576 rows and 20 columns has about one."""

_DAMAGED = (zipfile.BadZipFile, ParseError, KeyError, ValueError, IndexError, OSError, NotImplementedError)


def lines_of_sheets(path: Path) -> list[list[str]]:
    """Return of each sheet its rows with cells separated by tabs; dates are days since 1899-12-30.

    Raises `NotUnderstoodError`: no Excel file, damaged.
    """
    try:
        with zipfile.ZipFile(path) as book:
            parts = [re.fullmatch(r"xl/worksheets/sheet(\d+)\.xml", name) for name in book.namelist()]
            sheets = [part[0] for part in sorted(filter(None, parts), key=lambda part: int(part[1]))]
            if any(book.getinfo(name).file_size > _MOST_BYTES for name in sheets):
                words = "a sheet of more than 2 GB"
                raise input_error("trace-unreadable", words, "cut it to the run", source=str(path))
            shared = _shared_words(book)
            return [_lines(book.open(name), shared) for name in sheets]
    except _DAMAGED as error:
        text = f"not an Excel sheet, or a damaged one: {type(error).__name__}"
        raise input_error("trace-unreadable", text, "save it as CSV", source=str(path)) from None


def _tag(element: Element) -> str:
    return element.tag.rpartition("}")[2]


def _shared_words(book: zipfile.ZipFile) -> list[str]:
    """Return the texts that cells refer to by number."""
    if "xl/sharedStrings.xml" not in book.namelist():
        return []
    texts = []
    for _, element in iterparse(book.open("xl/sharedStrings.xml")):
        if _tag(element) == "si":
            texts.append("".join(part.text or "" for part in element.iter() if _tag(part) == "t"))
            element.clear()
    return texts


def _lines(stream: IO[bytes], words: list[str]) -> list[str]:
    lines = []
    for _, element in iterparse(stream):
        if _tag(element) == "row":
            cells: dict[int, str] = {}
            for position, cell in enumerate(element):
                cells[_column(cell.get("r", ""), position)] = _value(cell, words)
            lines.append("\t".join(cells.get(k, "") for k in range(max(cells, default=-1) + 1)))
            element.clear()  # a sheet is larger than its numbers
    return lines


def _column(place: str, position: int) -> int:
    """Return the column of ``AB12``, from 0; a cell without a place follows the one before."""
    letters = re.match(r"[A-Z]{1,3}", place)
    if letters is None:
        return position
    number = 0
    for letter in letters[0]:
        number = 26 * number + ord(letter) - ord("A") + 1
    return number - 1


def _value(cell: Element, words: list[str]) -> str:
    text = "".join(part.text or "" for part in cell.iter() if _tag(part) in ("v", "t"))
    value = words[int(text)] if cell.get("t") == "s" and text else text
    return re.sub(r"[\t\r\n]+", " ", value)


_LARGEST_BYTES = 1_000_000_000
_LOOKED_AT, _LEAST_ROWS = 400, 3
_SEPARATORS = (",", ";", "\t", "|", " ")
_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?")
_NOTHING = ("", "nan", "null", "none", "na", "inf", "-inf")
_STAMPS = (
    "%Y-%m-%dT%H:%M:%S%.f", "%Y-%m-%d %H:%M:%S%.f", "%Y/%m/%d %H:%M:%S%.f", "%d.%m.%Y %H:%M:%S%.f",
    "%m/%d/%Y %H:%M:%S%.f", "%d/%m/%Y %H:%M:%S%.f", "%m/%d/%Y %I:%M:%S%.f %p", "%d-%m-%Y %H:%M:%S%.f",
)  # fmt: skip
_OTHER_FORMATS = {
    b"\xd0\xcf\x11\xe0": "an old Excel sheet: save it as CSV",
    b"\x89HDF\r\n": "an HDF5 file: save it as MATLAB v5 (save … -v6) or as CSV",
}


@dataclass(frozen=True, eq=False)
class LogTable:
    """The columns of one file by their own names, and how they were read."""

    source: str
    columns: dict[str, Floats]
    """name -> (n,) those that are numbers; a stamp of date and time counts in seconds."""
    units: dict[str, str]
    """name -> unit, where a line of units or a stamp states it."""
    words: tuple[str, ...]
    """Columns that are not numbers."""
    first_row: int
    how: str
    started: str = ""
    """The first stamp in ISO form, where there is one of date and time."""

    @property
    def names(self) -> tuple[str, ...]:
        """Return all names."""
        return (*self.columns, *self.words)


def read_table(path: str | Path) -> LogTable:
    """Read CSV of any separator and decimal sign, Excel, Parquet or MATLAB v5.

    Raises `NotUnderstoodError`: unreadable, no table, another format, a value that is not a number.
    """
    file = Path(path)
    try:
        if file.stat().st_size > _LARGEST_BYTES:
            raise input_error("trace-unreadable", "larger than 1 GB", "cut it to the run", source=str(file))
        data = file.read_bytes()
    except OSError as error:
        words = f"cannot read: {error.strerror}"
        raise input_error("file-unreadable", words, "name a file", source=str(file)) from None
    for start, remedy in _OTHER_FORMATS.items():
        if data.startswith(start):
            raise input_error("trace-unreadable", f"it is {remedy.split(':')[0]}", remedy, source=str(file))
    if data.startswith(MAGIC):
        try:
            return table_of(read_parquet(file), str(file), "Parquet", 1)
        except DamagedError as error:
            words = f"a damaged Parquet file: {error}"
            raise input_error("trace-unreadable", words, "export it again", source=str(file)) from None
    if data.startswith(b"MATLAB 5.0"):
        return _of_matlab(file)
    if data.startswith(b"PK\x03\x04"):
        return _of_excel(file)
    return _of_text(_decoded(data), file)


def table_of(frame: Any, source: str = "table", how: str = "a frame", first_row: int = 1) -> LogTable:
    """Return the table of a frame: polars, pandas, Arrow, a mapping, or a structured array.

    Raises `NotUnderstoodError` for anything else.
    """
    import polars as pl

    try:
        if isinstance(frame, np.ndarray) and frame.dtype.names:
            frame = {name: frame[name] for name in frame.dtype.names}
        elif isinstance(frame, np.ndarray):
            frame = pl.from_numpy(frame)
        elif type(frame).__module__.partition(".")[0] == "pandas":
            frame = {str(name): frame[name].to_numpy() for name in frame.columns}
        made = frame if isinstance(frame, pl.DataFrame) else pl.DataFrame(frame)
    except (pl.exceptions.PolarsError, TypeError, ValueError, KeyError) as error:
        first = (str(error).splitlines() or ["no table"])[0]
        remedy = "give a frame of polars, pandas or Arrow, or columns by name"
        raise input_error("trace-unreadable", f"not a table: {first[:120]}", remedy, source=source) from None
    return _numeric(made, source, how, first_row, {})


def _decoded(data: bytes) -> str:
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data.decode("utf-16", "replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("cp1252", "replace")  # what Excel and most Windows tools write


class _Shape(NamedTuple):
    """How the lines of a text are to be split."""

    score: float
    separator: str
    header: list[str]
    units: list[str]
    skipped: int
    """Lines above the first row of numbers."""
    decimal_comma: bool


def _of_text(text: str, file: Path) -> LogTable:
    import polars as pl

    if "\0" in text[:100_000]:
        raise input_error("trace-unreadable", "not text", "export it as CSV or Parquet", source=str(file))
    if not text.strip():
        raise input_error("trace-empty", "the file is empty", "export the recording again", source=str(file))
    lines = text.splitlines()
    # blanks that align columns are one separator
    aligned = [re.sub(r"[ \t]+", " ", line.strip()) for line in lines]
    shapes = [_shape(aligned if sep == " " else lines, sep, file) for sep in _SEPARATORS]
    best = max((shape for shape in shapes if shape), key=lambda shape: shape.score, default=None)
    if best is None:
        words = "no rows of numbers under a header line"
        remedy = "export columns of numbers with a line of names above them"
        raise input_error("trace-unreadable", words, remedy, source=str(file))
    body = (aligned if best.separator == " " else lines)[best.skipped :]
    while body and not body[-1].strip(best.separator + " \t"):
        body.pop()
    refuse_twins(tuple(best.header), file)
    try:
        frame = pl.read_csv(
            io.BytesIO("\n".join(body).encode()),
            has_header=False,
            separator=best.separator,
            infer_schema=False,
            new_columns=best.header,
        )
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        raise _ragged(body, best, file, str(error)) from None
    if frame.width > len(best.header):  # a separator at the end of each line
        frame = frame.select(frame.columns[: len(best.header)])
    units = {name: unit_of(word) for name, word in zip(best.header, best.units, strict=False)}
    if best.decimal_comma:
        frame = frame.with_columns(pl.all().str.replace(",", ".", literal=True))
    sign = {"\t": "tab", " ": "blanks"}.get(best.separator, best.separator)
    how = f"columns separated by {sign}, decimal {'comma' if best.decimal_comma else 'point'}"
    return _numeric(frame, str(file), how, best.skipped + 1, units)


def _ragged(body: list[str], best: _Shape, file: Path, why: str) -> NotUnderstoodError:
    """Return the error of a row with more values than names."""
    for number, cells in enumerate(csv.reader(body, delimiter=best.separator), best.skipped + 1):
        if len(cells) > len(best.header):
            words = f"row {number}: {len(cells)} values under {len(best.header)} column names"
            remedy = "a decimal comma needs another separator than the comma"
            return input_error("trace-unreadable", words, remedy, line=number, source=str(file))
    first = (why.splitlines() or ["unreadable"])[0]
    return input_error("trace-unreadable", f"not a table: {first}", "export it again", source=str(file))


def _is_value(cell: str) -> bool:
    return _NUMBER.fullmatch(cell) is not None or cell.lower() in _NOTHING or _is_stamp(cell)


def _is_stamp(cell: str) -> bool:
    return re.match(r"'?\d{1,4}[-./]\d{1,2}[-./]\d{1,4}[T ]\d{1,2}:\d\d|\d{1,2}:\d\d:\d\d", cell) is not None


def _shape(lines: list[str], separator: str, file: Path) -> _Shape | None:
    """Return how a separator splits the lines; None where it makes no rows of numbers below names."""
    try:
        rows = [[c.strip() for c in row] for row in csv.reader(lines[:_LOOKED_AT], delimiter=separator)]
    except csv.Error:
        return None
    values = [sum(_is_value(cell) for cell in row) for row in rows]
    good = [n > len(row) / 2 and len(row) > 1 and any(row) for n, row in zip(values, rows, strict=True)]
    first = next((k for k in range(len(rows) - 1) if all(good[k : k + _LEAST_ROWS])), None)
    if first is None:
        return None
    above = [row for row in rows[max(first - 2, 0) : first] if len(row) > 1]
    units: list[str] = []
    if len(above) > 1 and sum(bool(unit_of(c.strip("[]()"))) for c in above[-1]) > len(above[-1]) / 2:
        units = [cell.strip("[]()") for cell in above.pop()]
    width = len(rows[first])
    header = [cell.strip("#% ") for cell in above[-1]] if above else []
    while header and not header[-1]:
        header.pop()
    names = [printable(name) if name else f"column_{k}" for k, name in enumerate(header, 1)]
    names = names or [f"column_{k}" for k in range(1, width + 1)]
    below = [cell for row in rows[first:] for cell in row]
    plain = [cell for cell in below if _NUMBER.fullmatch(cell)]
    commas, points = (any(sign in cell for cell in plain) for sign in ",.")
    score = sum(1 if _is_value(cell) else -1 for cell in below if cell) / max(len(rows) - first, 1)
    if commas and points and separator != ",":
        words = "numbers with a decimal comma and numbers with a point"
        raise input_error(
            "trace-number", words, "export it with one of them", line=first + 1, source=str(file)
        )
    return _Shape(score, separator, names, units, first, commas and (separator != "," or not points))


def _numeric(
    frame: "pl.DataFrame", source: str, how: str, first_row: int, units: Mapping[str, str]
) -> LogTable:
    """Return the columns that are numbers or stamps, the others by name."""
    import polars as pl

    columns: dict[str, Floats] = {}
    words: list[str] = []
    stated, started = {name: unit for name, unit in units.items() if unit}, ""
    for name in frame.columns:
        series = frame[name]
        if series.dtype.is_temporal():
            seconds = series.cast(pl.Datetime("us"), strict=False)
            columns[printable(name)], started = _seconds(seconds), str(seconds[0])
            stated[printable(name)] = "s"
            continue
        if series.dtype == pl.Boolean or not (series.dtype.is_numeric() or series.dtype == pl.String):
            words.append(printable(name))
            continue
        if series.dtype == pl.String:
            stamps = _stamps(series.str.strip_chars())
            if stamps is not None:
                columns[name], stated[name] = _seconds(stamps), "s"
                started = "" if stamps[0].year == 1900 else str(stamps[0])
                continue
            cast = series.str.strip_chars().cast(pl.Float64, strict=False)
            if cast.null_count() > 0.5 * len(cast) and cast.null_count() > series.null_count():
                words.append(name)
                continue
        columns[printable(name)] = numbers(series, name, first_row, Path(source))
    return LogTable(source, columns, stated, tuple(words), first_row, how, started)


def _stamps(text: "pl.Series") -> "pl.Series | None":
    """Return stamps of date and time, or of a time of day on one day; None where the texts are neither."""
    first = text.drop_nulls().head(1)
    if not len(first) or not _is_stamp(str(first[0])):
        return None
    text = text.str.strip_prefix("'").str.replace(r",(\d+)", ".$1").str.replace(r"(Z|[+-]\d\d:?\d\d)$", "")
    for form in _STAMPS:
        stamps = text.str.to_datetime(form, time_unit="us", strict=False)
        if stamps.null_count() == text.null_count():
            return stamps
    of_day = ("1900-01-01 " + text).str.to_datetime("%Y-%m-%d %H:%M:%S%.f", time_unit="us", strict=False)
    return of_day if of_day.null_count() == text.null_count() else None


def _seconds(stamps: "pl.Series") -> Floats:
    import polars as pl

    passed = (stamps - stamps[0]).dt.total_microseconds()
    return np.asarray(passed.cast(pl.Float64).fill_null(float("nan")).to_numpy() * 1e-6, dtype=np.float64)


def _of_excel(file: Path) -> LogTable:
    """Return the first sheet that is a table; the last one's error where none is."""
    refused: NotUnderstoodError | None = None
    sheets = lines_of_sheets(file)
    for number, lines in enumerate(sheets, 1):
        try:
            return replace(_of_text("\n".join(lines), file), how=f"Excel, sheet {number} of {len(sheets)}")
        except NotUnderstoodError as error:
            refused = error
    raise refused or input_error("trace-empty", "no sheet", "export the recording again", source=str(file))


def _leaves(variables: Mapping[str, Any], parent: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the arrays of variables and of the fields of structures, each by its own name.

    What Simulink calls signals or values is named by the structure around it.
    """
    for name, value in variables.items():
        called = parent if name in ("signals", "values", "data") and parent else name
        if isinstance(value, np.ndarray) and value.dtype.names:
            if value.ndim == 0:
                yield from _leaves({field: value[field].item() for field in value.dtype.names}, called)
        elif isinstance(value, np.ndarray):
            yield called, value


def _of_matlab(file: Path) -> LogTable:
    """Return the vectors and matrices of a MATLAB v5 file that have as many rows as most of them."""
    import polars as pl
    import scipy.io

    try:
        variables = scipy.io.loadmat(file, squeeze_me=True, struct_as_record=True)
    except Exception as error:  # a damaged file raises whatever its bytes lead to
        words = f"a damaged MATLAB file: {type(error).__name__}"
        raise input_error("trace-unreadable", words, "export it again", source=str(file)) from None
    arrays: dict[str, Floats] = {}
    for name, held in _leaves({name: v for name, v in variables.items() if not name.startswith("__")}):
        if held.dtype.kind in "fiu" and held.ndim in (1, 2):
            name = name if name not in arrays else f"{name}_{len(arrays)}"
            arrays[name] = held if held.ndim == 1 or held.shape[0] >= held.shape[1] else held.T
    rows = max((len(array) for array in arrays.values()), default=0)
    made: dict[str, Floats] = {}
    for name, array in arrays.items():
        if len(array) == rows:
            split = {f"{name}_{k + 1}": array[:, k] for k in range(array.shape[1])} if array.ndim == 2 else {}
            made |= split or {name: array}
    if not made:
        words = "no vectors or matrices of numbers"
        raise input_error("trace-unreadable", words, "save columns of equal length", source=str(file))
    return _numeric(pl.DataFrame(made), str(file), "MATLAB v5", 1, {})
