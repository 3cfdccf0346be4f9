"""Write native/constants.h: what the Python modules and the core must agree about, from the Python modules.

`native/build.py` runs it before it compiles, and compiles in the digest of all sources that it prints; the
header is not kept. Needs numpy, pydantic and jinja2, as the
modules do.

A number ``NAME`` of a module becomes ``PREFIX_NAME``, a word ``PREFIX_NAME`` in quotes, a tuple of numbers
what an array begins with, an enumeration of whole numbers ``PREFIX_NAME_MEMBER``, a record of numpy a C
struct with the same fields in the same places, and a `StructOf` the C struct that the core gets.
"""

import enum
import math
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

HEADER = Path(__file__).resolve().parent / "constants.h"
sys.path.insert(0, str(HEADER.parents[1]))  # the modules beside this file, also where they are not installed

from gcode2krl.compiled import core  # noqa: E402

MODULES = {
    "CH": "gcode2krl.ascii_codes",
    "W": "gcode2krl.krl_words",
    "U": "gcode2krl.units",
    "V": "gcode2krl.gcode.vocabulary",
    "D": "gcode2krl.gcode.dialect_marks",
    "DR": "gcode2krl.gcode.dialects",
    "S": "gcode2krl.gcode.state",
    "P": "gcode2krl.gcode.program_tables",
    "N": "gcode2krl.gcode.parameter_names",
    "SW": "gcode2krl.cutting.sweep",
    "ED": "gcode2krl.cutting.edge",
    "RD": "gcode2krl.cutting.reading",
    "TD": "gcode2krl.cutting.dexels",
    "TU": "gcode2krl.cutting.turned",
    "LAW": "gcode2krl.cutting.law",
    "PROCESS": "gcode2krl.cutting.stiffness",
    "STANDING": "gcode2krl.robot.standing",
    "CHAIN": "gcode2krl.compliance.chain",
    "SCENE": "gcode2krl.collision.scene",
    "ADVANCE": "gcode2krl.collision.along",
    "FEED": "gcode2krl.online.feed",
    "LIMITS": "gcode2krl.online.limits",
    "BLENDING": "gcode2krl.online.compensator",
    "PILOT": "gcode2krl.online.pilot_gate",
    "DIFF": "gcode2krl.krl.differences",
}
"""Prefix -> module whose numbers and words the core uses."""
FINDINGS = "gcode2krl.gcode.findings"
"""The module whose tables of numbers bear the prefixes themselves."""
RECORDS = {
    "State": ("gcode2krl.gcode.state", "STATE"),
    "Modes": ("gcode2krl.gcode.state", "MODES"),
    "Counts": ("gcode2krl.gcode.reporting", "COUNTS"),
    "Event": ("gcode2krl.gcode.reporting", "EVENT"),
    "Found": ("gcode2krl.gcode.reporting", "FOUND"),
    "MarkedLine": ("gcode2krl.gcode.program_tables", "LINE"),
    "Subprogram": ("gcode2krl.gcode.program_tables", "SUBPROGRAM"),
    "ParameterName": ("gcode2krl.gcode.program_tables", "NAME"),
    "Frame": ("gcode2krl.gcode.program_tables", "FRAME"),
    "Repeat": ("gcode2krl.gcode.program_tables", "REPEAT"),
    "Assignment": ("gcode2krl.gcode.program_tables", "ASSIGNMENT"),
    "Label": ("gcode2krl.gcode.program_tables", "LABEL"),
    "Array": ("gcode2krl.gcode.program_tables", "ARRAY"),
    "Course": ("gcode2krl.gcode.program_tables", "COURSE"),
    "Ray": ("gcode2krl.cutting.dexels", "RAY"),
    "RayEnd": ("gcode2krl.cutting.dexels", "END"),
}
"""Name of the struct -> module and numpy record."""
ARGUMENTS = {
    "Scan": ("gcode2krl.gcode.words", "SCAN"),
    "Rows": ("gcode2krl.gcode.columns", "ROWS"),
    "Machine": ("gcode2krl.gcode.machine", "MACHINE"),
    "Program": ("gcode2krl.gcode.program_tables", "PROGRAM"),
    "Shape": ("gcode2krl.cutting.cutter", "SHAPE"),
    "Grid": ("gcode2krl.cutting.sweep", "GRID"),
    "Path": ("gcode2krl.cutting.sweep", "PATH"),
    "Samples": ("gcode2krl.cutting.sweep", "SAMPLES"),
    "Cutters": ("gcode2krl.cutting.edge", "CUTTERS"),
    "Work": ("gcode2krl.cutting.edge", "WORK"),
    "Result": ("gcode2krl.cutting.reading", "RESULT"),
    "Dexels": ("gcode2krl.cutting.dexels", "DEXELS"),
    "Turned": ("gcode2krl.cutting.turned", "TURNED"),
    "Surface": ("gcode2krl.cutting.surface", "SURFACE"),
    "Bodies": ("gcode2krl.collision.scene", "BODIES"),
    "Obstacles": ("gcode2krl.collision.scene", "OBSTACLES"),
    "Watched": ("gcode2krl.collision.along", "WATCHED"),
    "ReadMotions": ("gcode2krl.krl.differences", "READ"),
    "Wanted": ("gcode2krl.krl.differences", "WANTED"),
    "Noted": ("gcode2krl.krl.differences", "NOTED"),
}
"""Name of the struct -> module and `StructOf`."""
_VIEWS = {
    "f8": "Floats",
    "f4": "Floats32",
    "i8": "Ints",
    "i4": "Ints32",
    "u1": "Bytes",
    "b1": "Bools",
}
_TYPES = {
    "f8": "double",
    "f4": "float",
    "i8": "int64_t",
    "i4": "int32_t",
    "i1": "int8_t",
    "u1": "uint8_t",
    "b1": "uint8_t",
}


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
        '#include "core.h"',
        "",
    ]
    for prefix, name in MODULES.items():
        lines += [f"/* {name} */", *_constants(prefix, import_module(name)), ""]
    findings = import_module(FINDINGS)
    for prefix in (*findings.TABLES, findings.FAULTS):
        lines += [f"/* {FINDINGS} */", *_constants(prefix, getattr(findings, prefix)), ""]
    lines += [f"#define F_WARNINGS {_literal(findings.warnings())}", ""]
    for name, place in RECORDS.items():
        lines += [*_struct(name, _at(place)), f"VIEW({name}View, {name});", ""]
    for name, place in ARGUMENTS.items():
        lines += [*_argument(name, _at(place)), ""]
    return "\n".join([*lines, "#endif", ""])


def _constants(prefix: str, names: ModuleType | SimpleNamespace) -> Iterator[str]:
    for name, value in vars(names).items():
        if name.isupper() and not name.startswith("_") and (text := _literal(value)):
            yield f"#define {prefix}_{name} {text}"
        elif isinstance(value, enum.EnumMeta) and value.__module__ == names.__name__:
            yield from (f"#define {prefix}_{name.upper()}_{each.name} {int(each)}" for each in value)


def _literal(value: object) -> str:
    """Return a constant as C writes it, empty for what is none."""
    if type(value) in (int, float) and math.isfinite(value):
        return f"{value!r}" if value >= 0 else f"({value!r})"
    if type(value) is str and value.isascii() and value.isprintable():
        text = value.replace("\\", "\\\\").replace('"', '\\"')
        return f'"{text}"'
    if type(value) is tuple and value and all(type(each) in (int, float) for each in value):
        return f"{{{', '.join(map(repr, value))}}}"
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


def _argument(name: str, argument: core.StructOf) -> Iterator[str]:
    yield "typedef struct {"
    for field, kind in argument.fields.items():
        yield f"    {_field_type(kind)} {field};"
    yield f"}} {name};"


def _field_type(kind: object) -> str:
    """Return the C type of a field: a number, a view of numbers or of a numpy record, or another struct."""
    if isinstance(kind, core.StructOf):
        return next(name for name, place in ARGUMENTS.items() if _at(place) is kind)
    if isinstance(kind, core.ArrayOf) and kind.dtype.fields:
        return next(f"{name}View" for name, place in RECORDS.items() if _at(place) == kind.dtype)
    if isinstance(kind, core.ArrayOf):
        return _VIEWS[kind.dtype.str[1:]]
    return "double" if kind is core.FLOAT else "int64_t"


def _at(place: tuple[str, str]) -> Any:
    """Return what a module calls by a name."""
    module, name = place
    return getattr(import_module(module), name)


if __name__ == "__main__":
    core.core_function = lambda *_, **__: None  # what is asked here comes before the core that has it
    HEADER.write_text(header(), encoding="ascii", newline="\n")
    print(core.sources_digest())
