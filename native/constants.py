"""Write native/constants.h: what the Python modules and the core must agree about, from the Python modules.

Run after a change of one of these modules; a test compares the file with what they say::

    python native/constants.py

A number ``NAME`` of a module becomes ``PREFIX_NAME``, a word ``PREFIX_NAME`` in quotes, a tuple of whole
numbers what an array begins with, and a record of numpy a C struct with the same fields in the same places.
"""

import math
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np

from gcode2krl.compiled import core

HEADER = Path(__file__).resolve().parent / "constants.h"
MODULES = {
    "U": "gcode2krl.units",
    "CH": "gcode2krl.ascii_codes",
    "W": "gcode2krl.krl_words",
    "V": "gcode2krl.gcode.vocabulary",
    "F": "gcode2krl.gcode.findings",
    "S": "gcode2krl.gcode.state",
}
"""Prefix -> module whose numbers and words the core uses."""
RECORDS = {
    "State": ("gcode2krl.gcode.state", "STATE"),
    "Counts": ("gcode2krl.gcode.reporting", "COUNTS"),
    "Event": ("gcode2krl.gcode.reporting", "EVENT"),
    "Found": ("gcode2krl.gcode.reporting", "FOUND"),
}
"""Name of the struct -> module and numpy record."""
_TYPES = {"f8": "double", "i8": "int64_t", "i4": "int32_t", "i1": "int8_t", "u1": "uint8_t", "b1": "uint8_t"}


def header() -> str:
    """Return the text of the header."""
    lines = ["/* Made by native/constants.py from the Python modules; not to be edited. */", ""]
    lines += [
        "#ifndef CONSTANTS_H",
        "#define CONSTANTS_H",
        "",
        "#include <stddef.h>",
        "#include <stdint.h>",
        "",
    ]
    for prefix, name in MODULES.items():
        lines += [*_constants(prefix, import_module(name)), ""]
    for name, (module, record) in RECORDS.items():
        lines += [*_struct(name, getattr(import_module(module), record)), ""]
    return "\n".join([*lines, "#endif", ""])


def _constants(prefix: str, module: ModuleType) -> Iterator[str]:
    yield f"/* {module.__name__} */"
    for name, value in vars(module).items():
        if name.isupper() and not name.startswith("_") and (text := _literal(value)):
            yield f"#define {prefix}_{name} {text}"


def _literal(value: object) -> str:
    """Return a constant as C writes it, empty for what is none."""
    if type(value) in (int, float) and math.isfinite(value):
        return f"{value!r}" if value >= 0 else f"({value!r})"
    if type(value) is str and value.isascii() and value.isprintable():
        text = value.replace("\\", "\\\\").replace('"', '\\"')
        return f'"{text}"'
    if type(value) is tuple and value and all(type(each) is int for each in value):
        return f"{{{', '.join(map(str, value))}}}"
    return ""


def _struct(name: str, record: np.dtype) -> Iterator[str]:
    yield "typedef struct {"
    for field, (kind, *_) in record.fields.items():
        base, shape = (kind.subdtype[0], kind.subdtype[1]) if kind.subdtype else (kind, ())
        yield f"    {_TYPES[base.str[1:]]} {field}{''.join(f'[{length}]' for length in shape)};"
    yield f"}} {name};"
    for field, (_, offset, *_) in record.fields.items():
        yield (
            f"typedef char {name}_{field}_stands_at_{offset}[offsetof({name}, {field}) == {offset} ? 1 : -1];"
        )
    yield f"typedef char {name}_has_its_size[sizeof({name}) == {record.itemsize} ? 1 : -1];"


if __name__ == "__main__":
    core.core_function = lambda *_, **__: None  # what is asked here comes before the core that has it
    HEADER.write_text(header(), encoding="ascii", newline="\n")
