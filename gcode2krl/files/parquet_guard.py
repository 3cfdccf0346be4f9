"""Checks what a Parquet file announces against its size, before a library allocates memory for it.

A damaged or made-up footer may announce 10¹⁸ rows; a reader that believes it asks for as much memory, and the
process ends. So the footer and the header of every page are read here first, by a reader that allocates no
more than the file holds: Parquet format 2.9 (parquet.thrift), written in Thrift's compact protocol.
"""

import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

if TYPE_CHECKING:
    import polars as pl

MAGIC = b"PAR1"
LARGEST_FOOTER = 64_000_000
MOST_TIMES_SIZE = 200
"""Largest size of a decoded table over that of its file, our choice: our own tables take 2 to 10 times."""
SMALL_BYTES = 64_000_000
"""A smaller table is read whatever the size of its file: a constant column takes almost no room there."""
_DEEPEST = 12
_PAGE_HEADER = 65_536
_WIDTH = {0: 1, 1: 4, 2: 8, 3: 12, 4: 4, 5: 8, 6: 16, 7: 16}
"""Bytes of a value by Parquet's type: BOOLEAN, INT32, INT64, INT96, FLOAT, DOUBLE, and views of texts."""
TYPE_NAMES = ("BOOLEAN", "INT32", "INT64", "INT96", "FLOAT", "DOUBLE", "BYTE_ARRAY", "FIXED_LEN_BYTE_ARRAY")
_DATA, _INDEX, _DICTIONARY, _DATA_2 = range(4)


class DamagedError(ValueError):
    """The file is not a whole Parquet file; the text says why, without the file's name."""


@dataclass(frozen=True)
class Outline:
    """What a whole Parquet file announces."""

    rows: int
    columns: dict[str, str]
    """Name → Parquet's type; a nested column has the name of its root and the type ``nested``."""


def outline_of(file: Path) -> Outline:
    """Return rows and columns of a Parquet file; raises `DamagedError`, or `OSError` where it is unreadable.

    Checks both magic words, the length of the footer, that each column of each group of rows lies in
    the file and has as many values as there are rows, that each page lies in its column, and that the
    decoded table is not out of all proportion to the file.
    """
    with file.open("rb") as stream:
        size = stream.seek(0, 2)
        footer = _footer(stream, size)
        columns = _columns(footer)
        groups = [_struct(group) for group in _list(footer, 4)]
        rows = _whole(footer, 3)
        if sum(_whole(group, 3) for group in groups) != rows:
            raise DamagedError(f"{rows} rows announced, its groups have another number")
        decoded = sum(_group_bytes(stream, size, group, columns) for group in groups)
    if decoded > max(MOST_TIMES_SIZE * size, SMALL_BYTES):
        raise DamagedError(f"{decoded / 1e6:.0f} MB announced in a file of {size / 1e6:.3g} MB")
    return Outline(rows, columns)


def read_parquet(file: Path, columns: Sequence[str] | None = None) -> "pl.DataFrame":
    """Return columns of a Parquet file that `outline_of` finds whole; None = all.

    Raises `DamagedError` where its values cannot be read, too: polars panics over some of them, and a panic
    is no `Exception`.
    """
    # arro3-io reads these files too, and believes no footer. But its panics cross a border of C and end the
    # process: at 3 of 2,400 tables with damaged bytes, behind `outline_of`; polars survived all of them.
    import polars as pl

    rows = outline_of(file).rows
    wanted = None if columns is None else list(columns)
    try:
        with _silenced_panics():
            frame = pl.read_parquet(file, columns=wanted, use_statistics=False)
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        why = str(error).splitlines() or [type(error).__name__]
        raise DamagedError(why[0][:120]) from None
    if frame.height != rows:
        raise DamagedError(f"{frame.height} rows read of {rows} announced")
    return frame


@contextmanager
def _silenced_panics() -> Iterator[None]:
    """Suppress what a panic itself writes to standard error; anything else is written afterwards."""
    try:
        before = os.dup(2)
    except OSError:  # there is no standard error
        yield
        return
    panicked = False
    with tempfile.TemporaryFile() as words:
        os.dup2(words.fileno(), 2)
        try:
            yield
        except BaseException:
            panicked = True
            raise
        finally:
            os.dup2(before, 2)
            os.close(before)
            words.seek(0)
            if not panicked and (output := words.read()):
                os.write(2, output)


def _footer(stream: BinaryIO, size: int) -> dict[int, Any]:
    if size < 12:
        raise DamagedError(f"a file of {size} bytes is not a Parquet file")
    stream.seek(0)
    head = stream.read(4)
    stream.seek(size - 8)
    tail = stream.read(8)
    if head != MAGIC or tail[4:] != MAGIC:
        raise DamagedError("not a Parquet file, or cut off: PAR1 is missing at its start or end")
    length = int.from_bytes(tail[:4], "little")
    if length > min(size - 12, LARGEST_FOOTER):
        raise DamagedError(f"a footer of {length} bytes in a file of {size}")
    stream.seek(size - 8 - length)
    return _Thrift(stream.read(length)).struct()


def _columns(footer: dict[int, Any]) -> dict[str, str]:
    """Return the columns at the root of the schema."""
    elements = [_struct(element) for element in _list(footer, 2)]
    if not elements:
        raise DamagedError("a footer without a schema")
    types: dict[str, str] = {}
    at = 1
    for _ in range(_whole(elements[0], 5, 0)):
        if at >= len(elements):
            raise DamagedError("the schema is cut off")
        name, nested = _text(elements[at], 4), _whole(elements[at], 5, 0) > 0
        if name in types:
            raise DamagedError(f"column {name[:40]!r} is there twice")
        types[name] = "nested" if nested else _type_name(elements[at])
        at = _index_after(elements, at)
    if at != len(elements):
        raise DamagedError("the schema has more columns than it announces")
    return types


def _index_after(elements: list[dict[int, Any]], at: int) -> int:
    """Return the index behind an element and all below it."""
    open_ = 1
    while open_:
        if at >= len(elements):
            raise DamagedError("the schema is cut off")
        open_ += _whole(elements[at], 5, 0) - 1
        at += 1
    return at


def _type_name(element: dict[int, Any]) -> str:
    number = _whole(element, 1)
    if number >= len(TYPE_NAMES):
        raise DamagedError(f"a column of the unknown type {number}")
    return TYPE_NAMES[number]


def _group_bytes(stream: BinaryIO, size: int, group: dict[int, Any], columns: dict[str, str]) -> int:
    """Return how many bytes a group of rows takes when it is decoded."""
    rows, decoded = _whole(group, 3), 0
    seen: set[str] = set()
    for chunk in _list(group, 1):
        about = _struct(_struct(chunk).get(3))
        path = _list(about, 3)
        name = path[0].decode("utf-8", "replace") if path and isinstance(path[0], bytes) else ""
        if name not in columns:
            raise DamagedError(f"values of a column {name[:40]!r} that the schema does not have")
        flat = columns[name] != "nested"
        if flat and (TYPE_NAMES.index(columns[name]) != _whole(about, 1) or name in seen):
            raise DamagedError(f"column {name[:40]!r}: another type than the schema says, or there twice")
        seen.add(name)
        values = _whole(about, 5)
        if flat and values != rows:
            raise DamagedError(f"column {name[:40]!r}: {values} values in {rows} rows")
        decoded += max(_pages_bytes(stream, size, about, name), values * _WIDTH.get(_whole(about, 1), 0))
    if seen != set(columns):
        raise DamagedError("a group of rows without all columns")
    return decoded


def _pages_bytes(stream: BinaryIO, size: int, about: dict[int, Any], name: str) -> int:
    """Return the uncompressed size of a column's pages; raises where they do not fit the column."""
    first, length = _whole(about, 9), _whole(about, 7)
    start = min(first, _whole(about, 11, first) or first)
    end = start + length
    if end > size - 8 or start < 4:
        raise DamagedError(f"column {name[:40]!r} lies outside the file")
    at, values, decoded = start, 0, 0
    while at < end:
        stream.seek(at)
        reader = _Thrift(stream.read(min(_PAGE_HEADER, end - at)))
        header = reader.struct()
        compressed, uncompressed = _whole(header, 3), _whole(header, 2)
        kind = _whole(header, 1)
        if kind in (_DATA, _DATA_2):
            values += _whole(_struct(header.get(5 if kind == _DATA else 8)), 1)
        elif kind == _DICTIONARY:
            entries = _whole(_struct(header.get(7)), 1)
            if entries > max(uncompressed, _whole(about, 5)):
                raise DamagedError(f"column {name[:40]!r}: a dictionary of {entries} values")
        elif kind != _INDEX:
            raise DamagedError(f"column {name[:40]!r}: a page of the unknown kind {kind}")
        decoded += uncompressed
        at += reader.at + compressed
    if at != end or values != _whole(about, 5):
        raise DamagedError(f"column {name[:40]!r}: its pages do not fit it")
    return decoded


def _whole(fields: dict[int, Any], key: int, default: int | None = None) -> int:
    """Return a count, which is never below 0."""
    value = fields.get(key, default)
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise DamagedError("a count is missing or impossible")
    return value


def _text(fields: dict[int, Any], key: int) -> str:
    value = fields.get(key)
    if not isinstance(value, bytes):
        raise DamagedError("a name is missing")
    return value.decode("utf-8", "replace")


def _list(fields: dict[int, Any], key: int) -> list[Any]:
    value = fields.get(key, [])
    if not isinstance(value, list):
        raise DamagedError("a list is missing")
    return value


def _struct(value: Any) -> dict[int, Any]:
    if not isinstance(value, dict):
        raise DamagedError("a record is missing")
    return value


class _Thrift:
    """Thrift's compact protocol: the part that Parquet uses, bounded by the bytes of the file."""

    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 0

    def struct(self, depth: int = 0) -> dict[int, Any]:
        """Return field number → value."""
        if depth > _DEEPEST:
            raise DamagedError("records nested too deeply")
        record: dict[int, Any] = {}
        number = 0
        while (head := self._byte()) != 0:
            delta, kind = head >> 4, head & 15
            number = number + delta if delta else self._signed()
            record[number] = self._value(kind, depth) if kind > 2 else kind == 1
        return record

    def _value(self, kind: int, depth: int) -> Any:
        if kind in (1, 2):  # in a list; in a record it is the field's kind itself
            return self._byte() == 1
        if kind == 3:
            return self._byte()
        if kind in (4, 5, 6):
            return self._signed()
        if kind == 7:
            return self._bytes(8)
        if kind == 8:
            return self._bytes(self._unsigned())
        if kind in (9, 10):
            return self._values(depth)
        if kind == 12:
            return self.struct(depth + 1)
        raise DamagedError(f"a value of the unknown kind {kind}")

    def _values(self, depth: int) -> list[Any]:
        head = self._byte()
        count = head >> 4 if head >> 4 < 15 else self._unsigned()
        if count > len(self.data) - self.at or depth > _DEEPEST:
            raise DamagedError(f"a list of {count} values")
        return [self._value(head & 15, depth + 1) for _ in range(count)]

    def _byte(self) -> int:
        if self.at >= len(self.data):
            raise DamagedError("cut off")
        self.at += 1
        return self.data[self.at - 1]

    def _bytes(self, count: int) -> bytes:
        if count > len(self.data) - self.at:
            raise DamagedError("cut off")
        self.at += count
        return self.data[self.at - count : self.at]

    def _unsigned(self) -> int:
        value = shift = 0
        while True:
            byte = self._byte()
            value |= (byte & 127) << shift
            if byte < 128:
                return value
            shift += 7
            if shift > 63:
                raise DamagedError("a number of more than 64 bits")

    def _signed(self) -> int:
        value = self._unsigned()
        return (value >> 1) ^ -(value & 1)
