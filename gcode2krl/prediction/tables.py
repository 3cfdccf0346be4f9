"""The Parquet tables of a prediction, checked as they are read: types, counts, numbers, references."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints32
from gcode2krl.errors import input_error
from gcode2krl.files.parquet_guard import DamagedError, outline_of, read_parquet
from gcode2krl.tables import Clearance, Forces, Motion, Table, Targets, Toolpath

if TYPE_CHECKING:
    import polars as pl

REMEDY = "predict the part again"
PARQUET_TYPES = {"f": "DOUBLE", "i": "INT32", "b": "BOOLEAN"}
"""Parquet type by the kind of a column's dtype, as `Prediction.save` writes it."""
_MAY_BE_NAN = {
    "Toolpath": ("tolerance_mm", "length_offset_mm"),
    "Targets": ("speed_mm_s",),
    "Clearance": ("clearance_mm",),
    "Joints": ("q_rad", "qd_rad_s", "limit_margin_rad", "sigma_min"),
    "Forces": ("phi_rad",),
    "Deflection": ("deflection_base_mm", "correction_base_mm"),
}
_MAY_BE_INF = {"Toolpath": ("feed_mm_s",)}
_UNIT_ERROR = 1e-3


def read_table(file: Path, kind_of: Callable[[str], str | None]) -> "pl.DataFrame":
    """Return the known columns of a table.

    ``kind_of`` tells the Parquet type of a column by its name, None for one that is left out.

    Raises `NotUnderstoodError` of one line: a damaged file, or a column of another type.
    """
    try:
        outline = outline_of(file)
        kinds = {name: kind for name in outline.columns if (kind := kind_of(name)) is not None}
        for name, kind in kinds.items():
            if outline.columns[name] != kind:
                raise DamagedError(f"column {name}: found {outline.columns[name]}, allowed: {kind}")
        if outline.rows == 0:
            raise DamagedError("no rows")
        frame = read_parquet(file, list(kinds))
        _refuse_other_types(frame, kinds)
    except OSError as error:
        words = f"cannot read: {error.strerror or 'no such file'}"
        raise input_error("file-unreadable", words, REMEDY, source=str(file)) from None
    except DamagedError as error:
        raise input_error("prediction-damaged", f"damaged: {error}", REMEDY, source=str(file)) from None
    return frame


def _refuse_other_types(frame: "pl.DataFrame", kinds: dict[str, str]) -> None:
    """Raise if values are missing or of another type: an INT32 may also be a date or unsigned."""
    import polars as pl

    allowed = {"DOUBLE": pl.Float64, "INT32": pl.Int32, "BOOLEAN": pl.Boolean}
    for name in frame.columns:
        if frame[name].dtype != allowed[kinds[name]]:
            raise DamagedError(f"column {name}: found {frame[name].dtype}, allowed: {allowed[kinds[name]]}")
        if frame[name].null_count():
            raise DamagedError(f"column {name}: {frame[name].null_count()} values are missing")


def check_numbers(table: Table) -> None:
    """Raise `ValueError` where a column has a NaN or an infinite value that its meaning does not allow."""
    kind = type(table).__name__
    for name, values in vars(table).items():
        if not isinstance(values, np.ndarray) or values.dtype.kind != "f":
            continue
        if name not in _MAY_BE_NAN.get(kind, ()) and np.isnan(values).any():
            raise ValueError(f"{kind}.{name}: a value is not a number (row {_first_row(np.isnan(values))})")
        if name not in _MAY_BE_INF.get(kind, ()) and np.isinf(values).any():
            raise ValueError(f"{kind}.{name}: a value is infinite (row {_first_row(np.isinf(values))})")


def check_references(
    toolpath: Toolpath,
    targets: Targets,
    motion: Motion | None,
    forces: Forces | None,
    tools: set[int],
    clearance: Clearance | None = None,
) -> None:
    """Raise `ValueError` where tables do not fit each other: rows, tools, time, orientations, names."""
    _within("Targets.move", targets.move, -1, len(toolpath) - 1)
    _known_tools("Targets.tool", targets.tool, tools)
    _unit("Targets.rotation", targets.rotation)
    _unit("Toolpath.axis", toolpath.axis)
    _within("Toolpath.source_line", toolpath.source_line, 0, np.iinfo(np.int32).max)
    if motion is None:
        return
    _within("Motion.move", motion.move, 0, len(toolpath) - 1)
    _known_tools("Motion.tool", motion.tool, tools)
    _unit("Motion.rotation", motion.rotation)
    late = np.flatnonzero(np.diff(motion.time_s) <= 0.0)
    if len(late):
        raise ValueError(f"Motion.time_s: does not rise at row {int(late[0]) + 1}")
    if forces is not None:
        _known_tools("Forces.tool", forces.tool, tools)
    if clearance is not None:
        _within("Clearance.clearance_link", clearance.clearance_link, -1, len(clearance.links) - 1)
        obstacles = len(clearance.obstacles)
        _within("Clearance.clearance_obstacle", clearance.clearance_obstacle, -1, obstacles - 1)


def _within(name: str, values: Ints32, low: int, high: int) -> None:
    wrong = np.flatnonzero((values < low) | (values > high))
    if len(wrong):
        row = int(wrong[0])
        raise ValueError(f"{name}: row {row} says {int(values[row])}, allowed: {low} to {high}")


def _known_tools(name: str, values: Ints32, tools: set[int]) -> None:
    unknown = {int(number) for number in np.unique(values)} - tools
    if unknown:
        raise ValueError(f"{name}: tool {min(unknown)} is not in the prediction's cell")


def _unit(name: str, vectors: Floats) -> None:
    with np.errstate(over="ignore"):
        off = np.abs(np.linalg.norm(vectors, axis=1) - 1.0)
    wrong = np.flatnonzero(~(off <= _UNIT_ERROR))
    if len(wrong):
        raise ValueError(f"{name}: row {int(wrong[0])} is not of length 1")


def _first_row(wrong: Bools) -> int:
    return int(np.flatnonzero(wrong.reshape(len(wrong), -1).any(axis=1))[0])
