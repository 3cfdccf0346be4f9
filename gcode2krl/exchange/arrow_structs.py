"""Arrow's C data interface: its structs, and a schema whose fields carry units.

The layout is that of "The Arrow C data interface" (arrow.apache.org/docs/format). It is written here with
ctypes because polars hands over no metadata of fields, and pyarrow, which does, takes 170 MB installed, as
much as polars itself.
"""

import ctypes
import itertools
import struct
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

NULLABLE = 2
_Pointer = ctypes.c_void_p
_numbers = itertools.count(1)
_kept: dict[int, Any] = {}
"""Number of a struct that was handed out to what it points to, until its consumer releases it."""


class ArrowSchema(ctypes.Structure):
    """A type of a column, or of a table: its columns are its children."""


_ReleaseSchema = ctypes.CFUNCTYPE(None, ctypes.POINTER(ArrowSchema))
ArrowSchema._fields_ = [
    ("format", ctypes.c_char_p),
    ("name", ctypes.c_char_p),
    ("metadata", _Pointer),
    ("flags", ctypes.c_int64),
    ("n_children", ctypes.c_int64),
    ("children", ctypes.POINTER(ctypes.POINTER(ArrowSchema))),
    ("dictionary", _Pointer),
    ("release", _ReleaseSchema),
    ("private_data", _Pointer),
]


GetSchema = ctypes.CFUNCTYPE(ctypes.c_int, _Pointer, ctypes.POINTER(ArrowSchema))
GetNext = ctypes.CFUNCTYPE(ctypes.c_int, _Pointer, _Pointer)
GetLastError = ctypes.CFUNCTYPE(_Pointer, _Pointer)
ReleaseStream = ctypes.CFUNCTYPE(None, _Pointer)


class ArrowArrayStream(ctypes.Structure):
    """A table in pieces: a schema, then one piece after the other."""

    _fields_: ClassVar = [
        ("get_schema", GetSchema),
        ("get_next", GetNext),
        ("get_last_error", GetLastError),
        ("release", ReleaseStream),
        ("private_data", _Pointer),
    ]


class ArrowField(NamedTuple):
    """A column: name, Arrow's word for its type, and unit."""

    name: str
    format: str
    unit: str | None


def keep(value: Any) -> int:
    """Keep what a struct points to until `let_go`; returns its number."""
    number = next(_numbers)
    _kept[number] = value
    return number


def let_go(number: int | None) -> Any:
    """Return what was kept under a number, and keep it no longer."""
    return _kept.pop(number or 0, None)


def fill_schema(schema: ArrowSchema, fields: Sequence[ArrowField]) -> None:
    """Make a struct that a consumer brought along the schema of a table with these columns."""
    children = [ArrowSchema() for _ in fields]
    for child, each in zip(children, fields, strict=True):
        _fill(child, each.name, each.format, {"unit": each.unit} if each.unit else {}, [])
    _fill(schema, "", "+s", {}, children)


def formats_of(schema: ArrowSchema) -> dict[str, str]:
    """Return Arrow's word for the type of each column of a table's schema."""
    children = [schema.children[row].contents for row in range(schema.n_children)]
    return {child.name.decode("utf-8"): child.format.decode("ascii") for child in children}


def _fill(
    schema: ArrowSchema, name: str, type_format: str, metadata: Mapping[str, str], children: list[ArrowSchema]
) -> None:
    pointers = (ctypes.POINTER(ArrowSchema) * max(len(children), 1))(*map(ctypes.pointer, children))
    texts = (type_format.encode("ascii"), name.encode("utf-8"))
    words = ctypes.create_string_buffer(_packed(metadata)) if metadata else None
    schema.format, schema.name = texts
    schema.metadata = ctypes.cast(words, _Pointer) if words is not None else None
    schema.flags = 0 if children else NULLABLE
    schema.n_children = len(children)
    schema.children = ctypes.cast(pointers, ctypes.POINTER(ctypes.POINTER(ArrowSchema)))
    schema.dictionary = None
    schema.release = _release_schema
    schema.private_data = keep((texts, words, pointers, children))


def _packed(metadata: Mapping[str, str]) -> bytes:
    """Return key and value pairs as the interface wants them: counts and lengths of 32 bits before each."""
    packed = struct.pack("=i", len(metadata))
    for text in itertools.chain.from_iterable(metadata.items()):
        data = text.encode("utf-8")
        packed += struct.pack("=i", len(data)) + data
    return packed


@_ReleaseSchema
def _release_schema(pointer: Any) -> None:
    """Let go of a schema, and of its columns unless a consumer has moved them elsewhere."""
    schema = pointer.contents
    for row in range(schema.n_children):
        child = schema.children[row]
        if child.contents.release:
            child.contents.release(child)
    number = schema.private_data
    schema.release = _ReleaseSchema()
    let_go(number)
