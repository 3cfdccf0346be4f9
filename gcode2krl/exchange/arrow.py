"""Columns as an Arrow table whose fields state their units, and the Parquet files that state them too."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from arro3.core import Array, Field, Schema, Table
from numpy.typing import NDArray

from gcode2krl.exchange.column_units import unit_of

if TYPE_CHECKING:
    import polars as pl


def arrow_table(columns: Mapping[str, NDArray[Any]]) -> Table:
    """Return columns (n,) as a table; a field with a unit has it in its metadata: ``{"unit": "mm"}``."""
    arrays = [Array.from_numpy(np.ascontiguousarray(values)) for values in columns.values()]
    fields = [_with_unit(Field(name, array.type)) for name, array in zip(columns, arrays, strict=True)]
    return Table.from_arrays(arrays, schema=Schema(fields))


def write_parquet(frame: "pl.DataFrame", file: Path) -> None:
    """Write a frame to a Parquet file whose Arrow schema has the units of its columns."""
    fields = Table.from_arrow(frame.clear()).schema
    frame.write_parquet(file, arrow_schema=Schema([_with_unit(fields.field(name)) for name in frame.columns]))


def _with_unit(field: Field) -> Field:
    unit = unit_of(field.name)
    return field if unit is None else field.with_metadata({"unit": unit})
