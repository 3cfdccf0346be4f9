"""A polars frame as an Arrow stream whose fields carry units; and its schema alone, for Parquet files."""

import ctypes
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gcode2krl.exchange.arrow_structs import (
    ArrowArrayStream,
    ArrowField,
    ArrowSchema,
    GetLastError,
    GetNext,
    GetSchema,
    ReleaseStream,
    fill_schema,
    formats_of,
    keep,
    let_go,
)

if TYPE_CHECKING:
    import polars as pl

_NO_MEMORY = 12
"""ENOMEM: what the interface returns where Python itself fails."""
_api = ctypes.pythonapi
_Destructor = ctypes.PYFUNCTYPE(None, ctypes.c_void_p)
_new_capsule = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p, ctypes.c_char_p, _Destructor)(
    ("PyCapsule_New", _api)
)
_pointer_of = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.py_object, ctypes.c_char_p)(
    ("PyCapsule_GetPointer", _api)
)
_pointer_at = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_char_p)(
    ("PyCapsule_GetPointer", _api)
)
_STREAM, _SCHEMA = b"arrow_array_stream", b"arrow_schema"


def stream_with_units(frame: "pl.DataFrame", units: Mapping[str, str]) -> object:
    """Return a capsule with the frame's own stream behind a schema that has the units. Nothing is copied."""
    inner = frame.__arrow_c_stream__(None)
    source = ArrowArrayStream.from_address(_pointer_of(inner, _STREAM))
    return _capsule(_outer_stream(source, inner, _fields_of(source, units)), _STREAM)


class SchemaWithUnits:
    """The schema of a frame with units, as `polars.DataFrame.write_parquet` takes it."""

    def __init__(self, frame: "pl.DataFrame", units: Mapping[str, str]) -> None:
        """Take a frame and the units of its columns."""
        capsule = frame.clear().__arrow_c_stream__(None)
        self._fields = _fields_of(ArrowArrayStream.from_address(_pointer_of(capsule, _STREAM)), units)

    def __arrow_c_schema__(self) -> object:
        schema = ArrowSchema()
        fill_schema(schema, self._fields)
        return _capsule(schema, _SCHEMA)


def write_parquet(frame: "pl.DataFrame", units: Mapping[str, str], file: Path) -> None:
    """Write a frame to a Parquet file whose Arrow schema has the units of its columns."""
    frame.write_parquet(file, arrow_schema=SchemaWithUnits(frame, units))


def _fields_of(source: ArrowArrayStream, units: Mapping[str, str]) -> list[ArrowField]:
    """Return the columns of a stream with their units."""
    schema = ArrowSchema()
    if source.get_schema(ctypes.addressof(source), ctypes.pointer(schema)) != 0:
        raise AssertionError("polars has a schema of every frame")
    formats = formats_of(schema)
    schema.release(ctypes.pointer(schema))
    return [ArrowField(name, formats[name], units.get(name)) for name in formats]


def _outer_stream(source: ArrowArrayStream, owner: Any, fields: list[ArrowField]) -> ArrowArrayStream:
    """Return a stream with a schema of its own and the pieces of another."""
    inner = ctypes.addressof(source)
    stream = ArrowArrayStream()

    def schema_of(_: Any, schema: Any) -> int:
        try:
            fill_schema(schema.contents, fields)
        except Exception:  # a callback has nobody to raise to
            return _NO_MEMORY
        return 0

    def next_piece(_: Any, piece: Any) -> int:
        return int(source.get_next(inner, piece))

    def last_error(_: Any) -> Any:
        return source.get_last_error(inner)

    def release(pointer: Any) -> None:
        held = ArrowArrayStream.from_address(pointer)
        number = held.private_data
        held.release = ReleaseStream()
        let_go(number)  # the capsule of the inner stream goes with it

    calls = GetSchema(schema_of), GetNext(next_piece), GetLastError(last_error), ReleaseStream(release)
    stream.get_schema, stream.get_next, stream.get_last_error, stream.release = calls
    stream.private_data = keep((calls, owner))
    return stream


def _capsule(value: Any, name: bytes) -> object:
    """Return a capsule that owns a struct, and releases it unless a consumer has."""
    address = ctypes.addressof(value)
    _held[address] = value
    return _new_capsule(address, name, _forget_stream if name == _STREAM else _forget_schema)


_held: dict[int, Any] = {}
"""Address to struct, as long as its capsule lives."""


def _forget(capsule: int, name: bytes) -> None:
    value = _held.pop(_pointer_at(capsule, name) or 0, None)
    if value is not None and value.release:
        value.release(ctypes.pointer(value) if name == _SCHEMA else ctypes.addressof(value))


@_Destructor
def _forget_stream(capsule: int) -> None:
    _forget(capsule, _STREAM)


@_Destructor
def _forget_schema(capsule: int) -> None:
    _forget(capsule, _SCHEMA)
