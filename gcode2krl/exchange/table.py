"""The base of all tables: columns with a declared type and shape, checked once, read-only from then on."""

from dataclasses import Field, dataclass, field, fields
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from gcode2krl.compiled.inputs import locked
from gcode2krl.errors import Issue
from gcode2krl.exchange.disk_names import split_columns
from gcode2krl.exchange.findings import findings_block
from gcode2krl.exchange.frame import Frame
from gcode2krl.exchange.html import beside, block, path_picture


def column(dtype: DTypeLike, *tail: int | None) -> Any:
    """Declare a column of the given dtype and trailing shape; None is a width that the data decide."""
    return field(metadata={"dtype": np.dtype(dtype), "tail": tail})


def derived_column(dtype: DTypeLike, *tail: int, on_disk: str = "") -> Any:
    """Declare a column that the table derives from the others where it is not given.

    With a name ``on_disk`` its parts are called by that, and left out of files where all of them are 0.
    """
    names = {"on_disk": on_disk} if on_disk else {}
    return field(default=None, metadata={"dtype": np.dtype(dtype), "tail": tail, **names})


def columns_of(table: Any) -> tuple[Field[Any], ...]:
    """Return the fields of a table that are columns."""
    kind: Any = type(table)  # to the checker of types no class of tables is hashable
    return _columns_of(kind)


@cache
def _columns_of(kind: Any) -> tuple[Field[Any], ...]:
    return tuple(spec for spec in fields(kind) if "tail" in spec.metadata)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Table(Frame):
    """A frozen dataclass of numpy columns, rows first, which other libraries take as a frame."""

    issues: tuple[Issue, ...] = ()

    def __post_init__(self) -> None:
        rows = -1
        for spec in columns_of(self):
            values = np.asarray(getattr(self, spec.name), dtype=spec.metadata["dtype"])
            rows = len(values) if rows < 0 else rows
            wanted = (rows, *spec.metadata["tail"])
            fits = values.ndim == len(wanted) and all(
                size in (None, length) for size, length in zip(wanted, values.shape, strict=True)
            )
            if not fits:
                raise ValueError(
                    f"{type(self).__name__}.{spec.name}: shape {values.shape}, expected {wanted}"
                )
            object.__setattr__(self, spec.name, locked(values))

    def __len__(self) -> int:
        return len(getattr(self, columns_of(self)[0].name))

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return the columns by name, vectors split as in the files: ``position_x_mm`` ….

        >>> from gcode2krl import read_gcode
        >>> list(read_gcode("part.nc").columns())[:4]
        ['position_x_mm', 'position_y_mm', 'position_z_mm', 'axis_x']
        """
        return split_columns(self)

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the columns, the path from above where there is one, and findings."""
        position_mm = getattr(self, "position_mm", None)
        picture = "" if position_mm is None else path_picture(position_mm)
        findings = findings_block(self.issues) if self.issues else ""
        return block("", beside(super()._repr_html_(), picture), findings)
