"""What can become a frame of another library: named columns with units."""

from abc import abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gcode2krl.errors import input_error
from gcode2krl.exchange.column_units import unit_of
from gcode2krl.exchange.html import column_table

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl

_ROWS = "rows"


class Frame:
    """Named columns with units; polars, pandas, pyarrow and whatever reads Arrow take it as it is."""

    @abstractmethod
    def columns(self) -> dict[str, NDArray[Any]]:
        """Return the columns (n,) by name."""

    @abstractmethod
    def __len__(self) -> int:
        """Return the number of rows."""

    def facts(self) -> str:
        """Return in a few words what the rows are and what matters of them."""
        return f"{len(self)} {_ROWS}"

    def units(self) -> dict[str, str]:
        """Return the unit of each column that has one, in words that ``pint`` and ``astropy`` read.

        >>> from gcode2krl import read_gcode
        >>> read_gcode("part.nc").units()["feed_mm_s"]
        'mm/s'
        """
        units = {name: unit_of(name) for name in self.columns()}
        return {name: unit for name, unit in units.items() if unit is not None}

    def to_polars(self) -> "pl.DataFrame":
        """Return the columns as a polars frame; `units` has their units, which polars does not keep.

        >>> from gcode2krl import read_gcode
        >>> frame = read_gcode("part.nc").to_polars()
        >>> frame["feed_mm_s"].max()
        inf
        """
        import polars as pl

        return pl.DataFrame(self.columns())

    def to_pandas(self) -> "pd.DataFrame":
        """Return the columns as a pandas frame, with `units` in its ``attrs["units"]``.

        Raises `NotUnderstoodError` where pandas is not installed.

        >>> from gcode2krl import read_gcode
        >>> frame = read_gcode("part.nc").to_pandas()
        >>> frame.attrs["units"]["position_x_mm"]
        'mm'
        """
        try:
            import pandas as pd
        except ImportError:
            remedy = "python -m pip install pandas, or use .to_polars()"
            raise input_error("option-value", "pandas is not installed", remedy) from None
        frame = pd.DataFrame({name: _for_pandas(values) for name, values in self.columns().items()})
        frame.attrs["units"] = self.units()
        return frame

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        """Return the columns as an Arrow stream whose fields carry their units: ``{"unit": "mm"}``.

        pyarrow, polars, pandas 3, DuckDB and others call this: ``pyarrow.table(prediction.motion)``.
        """
        from gcode2krl.exchange.arrow import arrow_table

        return arrow_table(self.columns()).__arrow_c_stream__(requested_schema)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.facts()})"

    def _repr_html_(self) -> str:
        """Return what a notebook shows: each column with its unit, lowest and highest value."""
        return column_table(repr(self), self.columns(), self.units())


def _for_pandas(values: NDArray[Any]) -> Any:
    """Return a column that a frame may own: pandas would keep a read-only one read-only."""
    return values.tolist() if values.dtype.kind == "U" else np.array(values)


class ColumnFrame(Frame):
    """Named columns that stand beside each other: ``samples["time_s"]`` is a numpy array."""

    def __init__(self, columns: Mapping[str, NDArray[Any]], what: str = _ROWS) -> None:
        """Take the columns (n,), and the word for their rows."""
        self._columns, self._what = dict(columns), what

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return the columns (n,) by name."""
        return dict(self._columns)

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self._columns[name]

    def __len__(self) -> int:
        return len(next(iter(self._columns.values()), ()))

    def facts(self) -> str:
        """Return in a few words what the rows are."""
        return f"{len(self)} {self._what}, {len(self._columns)} columns"
