"""The sidecar of a program, ``part.pilot.csv``: its knots, and in the first line how to read them.

The first line is ``# gcode2krl/pilot/1`` and words ``key=value``; then follow the names of the columns and a
row per knot, counted from 0.
"""

import math
import re
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Literal, cast

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.errors import NotUnderstoodError, input_error
from gcode2krl.pilot.knots import (
    DEFLECTION_DECIMALS,
    FORCE_DECIMALS,
    LEAD_DECIMALS,
    PATH_DECIMALS,
    TIME_DECIMALS,
    Knots,
)

SCHEMA = "gcode2krl/pilot/1"
NOT_YET = -1
"""The checksum of a program that has not been composed yet."""
COLUMNS = (
    *("knot", "line", "s_mm", "time_s", "lead_s"),
    *("fx_N", "fy_N", "fz_N"),
    *("dx_mm", "dy_mm", "dz_mm"),
)
_ALLOWED = {"frame": ("tcp", "base"), "sign": ("on-tool",), "form": ("index", "values")}
_REMEDY = "write the program again: .src and .pilot.csv belong together"


@dataclass(frozen=True)
class PilotHeader:
    """The first line of a sidecar."""

    frame: Literal["tcp", "base"]
    """Frame in which the knots state force and deflection: ``$TOOL`` or ``$BASE`` of the controller."""
    form: Literal["index", "values"]
    """What the program's triggers write: the number of a knot, or its values."""
    variable: str
    """The controller's variable they write to."""
    lead_s: float
    """Least time by which a knot is announced ahead, except for knots that begin a section of the program."""
    checksum: int = NOT_YET
    """31 bits over targets and knots as written; the program sets it at its start."""
    sign: Literal["on-tool"] = "on-tool"
    """The forces act on the tool, the deflection is what they cause."""


def sidecar_text(knots: Knots, header: PilotHeader) -> bytes:
    """Return the file of knots whose lead is known."""
    return sidecar_head(header) + knot_rows(knots)


def sidecar_head(header: PilotHeader) -> bytes:
    """Return the first two lines of the file."""
    words = (
        f"frame={header.frame} sign={header.sign} form={header.form} variable={header.variable} "
        f"lead_s={header.lead_s:.3f} checksum={header.checksum}"
    )
    return f"# {SCHEMA} {words}\n{','.join(COLUMNS)}\n".encode("ascii")


def knot_rows(knots: Knots) -> bytes:
    """Return the rows of the file without its head, the part of it that the checksum covers."""
    line = (
        f"%d,%d,%.{PATH_DECIMALS}f,%.{TIME_DECIMALS}f,%.{LEAD_DECIMALS}f"
        + f",%.{FORCE_DECIMALS}f" * 3
        + f",%.{DEFLECTION_DECIMALS}f" * 3
        + "\n"
    )
    columns = (
        range(len(knots)),
        knots.line.tolist(),
        *(column.tolist() for column in (knots.path_mm, knots.time_s, knots.lead_s)),
        *knots.force_N.T.tolist(),
        *knots.deflection_mm.T.tolist(),
    )
    text = "".join([line % row for row in zip(*columns, strict=True)])
    return text.replace("nan", "").encode("ascii")


def read_pilot(path: str | Path) -> tuple[Knots, PilotHeader]:
    """Read a sidecar.

    Raises
    ------
    NotUnderstoodError
        Names file, row and column: unreadable file, another format or version, a word of the head that is
        missing or not allowed, another column, a value that is not a number, knots out of order.
    """
    file = Path(path)
    try:
        text = file.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise input_error("file-unreadable", f"cannot read: {error.strerror}", source=str(file)) from None
    except UnicodeDecodeError:
        raise _wrong(file, 1, "not a text file") from None
    lines = text.splitlines()
    header = _header(lines[0] if lines else "", file)
    names = tuple(lines[1].split(",")) if len(lines) > 1 else ()
    if names != COLUMNS:
        raise _wrong(file, 2, f"columns: found {','.join(names)[:80]!r}, allowed {','.join(COLUMNS)}")
    values = _values(lines[2:], file)
    _check_order(values, file)
    knots = Knots(
        line=values[:, 1].astype(np.int32),
        path_mm=values[:, 2],
        time_s=values[:, 3],
        lead_s=values[:, 4],
        force_N=values[:, 5:8],
        deflection_mm=values[:, 8:11],
    )
    return knots, header


def _wrong(file: Path, row: int, what: str) -> NotUnderstoodError:
    return input_error("pilot-file", f"row {row}: {what}", _REMEDY, line=row, source=str(file))


def _header(line: str, file: Path) -> PilotHeader:
    match = re.fullmatch(r"#\s*(\S+)((?:\s+\S+=\S+)*)\s*", line)
    if match is None or match[1] != SCHEMA:
        raise _wrong(file, 1, f"found {line[:60]!r}, allowed '# {SCHEMA} frame=… sign=… …'")
    words = dict(word.split("=", 1) for word in match[2].split())
    for name in (spec.name for spec in fields(PilotHeader)):
        if name not in words:
            raise _wrong(file, 1, f"{name}= is missing")
    for name, allowed in _ALLOWED.items():
        if words[name] not in allowed:
            raise _wrong(file, 1, f"{name}: found {words[name]!r}, allowed {' or '.join(allowed)}")
    lead_s = _number(words["lead_s"])
    if not lead_s > 0:
        raise _wrong(file, 1, f"lead_s: found {words['lead_s']!r}, allowed a time in s above 0")
    if not re.fullmatch(r"\d{1,10}", words["checksum"]) or int(words["checksum"]) >= 2**31:
        raise _wrong(file, 1, f"checksum: found {words['checksum']!r}, allowed 0 to {2**31 - 1}")
    return PilotHeader(
        frame=cast(Literal["tcp", "base"], words["frame"]),
        form=cast(Literal["index", "values"], words["form"]),
        variable=words["variable"],
        lead_s=lead_s,
        checksum=int(words["checksum"]),
    )


def _values(lines: list[str], file: Path) -> Floats:
    """Return the table (k, 11); an empty deflection is NaN."""
    values = np.empty((len(lines), len(COLUMNS)))
    for index, line in enumerate(lines):
        words = line.split(",")
        if len(words) != len(COLUMNS):
            raise _wrong(file, index + 3, f"{len(words)} columns, there must be {len(COLUMNS)}")
        for column, word in enumerate(words):
            empty = word == "" and COLUMNS[column].startswith("d")
            values[index, column] = number = math.nan if empty else _number(word)
            if math.isnan(number) and not empty:
                raise _wrong(file, index + 3, f"column {COLUMNS[column]}: {word!r} is not a number")
    return values


def _number(word: str) -> float:
    """Return a finite decimal number, NaN where the word is not a number."""
    return float(word) if re.fullmatch(r"[-+]?\d+(\.\d*)?([eE][-+]?\d+)?", word.strip()) else math.nan


def _check_order(values: Floats, file: Path) -> None:
    """Raise unless knots count up from 0 and rise in time and G-code lines are whole and not negative."""
    number, line = values[:, 0], values[:, 1]
    checks = (
        ("knot", number != np.arange(len(values)), "knots count up from 0"),
        ("line", (line < 0) | (line != np.rint(line)) | (line >= 2**31), "a line of the G-code"),
        ("s_mm", np.diff(values[:, 2], prepend=-np.inf) < 0, "must not fall"),
        ("time_s", np.diff(values[:, 3], prepend=-np.inf) <= 0, "must rise"),
    )
    for name, wrong, rule in checks:
        if wrong.any():
            row = int(np.argmax(wrong))
            value = values[row, COLUMNS.index(name)]
            raise _wrong(file, row + 3, f"column {name}: found {value:g}; {rule}")
