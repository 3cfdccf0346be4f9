"""How a column of vectors is split into plain columns: ``position_x_mm`` …, ``rotation_w``, ``q1_rad`` …."""

import re
from dataclasses import Field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gcode2krl.exchange.column_units import suffix_of

_AXES = {3: "xyz", 4: "xyzw"}


def column_names(name: str, width: int) -> list[str]:
    """Return the names of the parts of a column of the given width (0 = a plain column).

    >>> from gcode2krl.exchange import column_names
    >>> column_names("position_mm", 3)
    ['position_x_mm', 'position_y_mm', 'position_z_mm']
    """
    if width == 0:
        return [name]
    unit = suffix_of(name)
    stem = name.removesuffix(unit)
    if width in _AXES:
        return [f"{stem}_{axis}{unit}" for axis in _AXES[width]]
    return [f"{stem}{number}{unit}" for number in range(1, width + 1)]


def names_of_parts(spec: Field[Any], width: int) -> list[str]:
    """Return the names of the parts of a table's column.

    One whose width the data decide is counted from 0: ``phi_0_rad`` ….
    """
    if spec.metadata["tail"] != (None,):
        return column_names(spec.metadata.get("on_disk", spec.name), width)
    unit = suffix_of(spec.name)
    return [f"{spec.name.removesuffix(unit)}_{number}{unit}" for number in range(width)]


def counted_pattern(name: str) -> re.Pattern[str]:
    """Return what the names of the parts of a column match whose width the data decide."""
    unit = suffix_of(name)
    return re.compile(rf"{name.removesuffix(unit)}_\d{{1,3}}{unit}")


def split_columns(table: Any) -> dict[str, NDArray[Any]]:
    """Return the columns of a `Table`, vectors split; each (n,) and contiguous."""
    columns: dict[str, NDArray[Any]] = {}
    for spec in fields(table):
        if "tail" not in spec.metadata:
            continue
        values = getattr(table, spec.name)
        if "on_disk" in spec.metadata and not values.any():
            continue
        parts = values.T if values.ndim == 2 else [values]
        names = names_of_parts(spec, values.shape[1] if values.ndim == 2 else 0)
        columns |= {name: np.ascontiguousarray(part) for name, part in zip(names, parts, strict=True)}
    return columns
