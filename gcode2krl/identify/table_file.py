"""Reading a measured table from CSV: a missing value, or one that is not a number, is an error with row and
column."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.errors import input_error

if TYPE_CHECKING:
    import polars as pl

FIRST_ROW = 2
"""Line of the first row of values; line 1 is the header."""


class MeasuredTable:
    """A CSV file with a header line, its columns as text."""

    def __init__(self, path: str | Path) -> None:
        """Read the file; raises `NotUnderstoodError` where it is missing, empty or not a table."""
        self.source = str(path)
        self._frame = _read(Path(path))

    def __len__(self) -> int:
        return self._frame.height

    @property
    def columns(self) -> list[str]:
        """Names in the header line."""
        return self._frame.columns

    def has(self, names: Sequence[str]) -> bool:
        """Tell whether all of these columns are there."""
        return set(names) <= set(self.columns)

    def require(self, names: Sequence[str]) -> None:
        """Raise `NotUnderstoodError` that names the columns that are not there."""
        missing = [name for name in names if name not in self.columns]
        if missing:
            raise input_error(
                "table-column",
                f"column {', '.join(missing)}: missing; the file has {', '.join(self.columns[:12])}",
                "docs/identification.md lists the columns; separate them by commas",
                line=1,
                source=self.source,
            )

    def texts(self, name: str) -> list[str]:
        """Return a column (n,) of words, stripped of blanks."""
        self.require([name])
        return [(word or "").strip() for word in self._frame[name].to_list()]

    def numbers(self, names: Sequence[str]) -> Floats:
        """Return columns (n, c); an empty, infinite or unreadable value is an error with row and column."""
        import polars as pl

        self.require(names)
        values = np.empty((len(self), len(names)))
        for column, name in enumerate(names):
            text = self._frame[name].str.strip_chars()
            read = text.cast(pl.Float64, strict=False).fill_null(np.nan).to_numpy()
            wrong = np.flatnonzero(~np.isfinite(read))
            if len(wrong):
                raise self._number_error(int(wrong[0]), name, text[int(wrong[0])])
            values[:, column] = read
        return values

    def _number_error(self, index: int, name: str, text: str | None) -> Exception:
        what = f"{text!r} is not a finite number" if text else "empty"
        return input_error(
            "table-number",
            f"row {index + FIRST_ROW}, column {name}: {what}",
            "decimals with a point; delete the row where the reading failed",
            line=index + FIRST_ROW,
            source=self.source,
        )


def _read(file: Path) -> "pl.DataFrame":
    import polars as pl

    try:
        frame = pl.read_csv(file, infer_schema=False)
    except OSError as error:
        raise input_error("file-unreadable", f"cannot read: {error.strerror}", source=str(file)) from None
    except pl.exceptions.NoDataError:
        raise input_error(
            "table-empty", "the file is empty", "begin with a header line", source=str(file)
        ) from None
    except pl.exceptions.PolarsError as error:
        why = str(error).splitlines()[0]
        raise input_error("table-unreadable", f"not a table: {why}", source=str(file)) from None
    if frame.height == 0:
        raise input_error("table-empty", "no row below the header", "one row a reading", source=str(file))
    return frame
