"""Tables of numbers from CSV with a header line or from Parquet; errors name file, row and column."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.errors import Issue, NotUnderstoodError, input_error
from gcode2krl.files.parquet_guard import DamagedError, read_parquet

if TYPE_CHECKING:
    import polars as pl

_EMPTY_WORDS = ("", "nan", "null", "none", "na")
_MOST_NAMES, _LONGEST_NAME = 12, 60


@dataclass(frozen=True)
class Sheet:
    """The wanted columns of one file, NaN where a cell is empty."""

    columns: dict[str, Floats]
    """name → (n,)"""
    names: tuple[str, ...]
    """All columns of the file, wanted or not."""
    first_row: int
    """Number of the first row: its line in a CSV, 1 in Parquet."""
    source: str
    issues: tuple[Issue, ...] = ()

    def rows(self) -> int:
        """Return the number of rows."""
        return len(next(iter(self.columns.values()), ()))

    def listing(self) -> str:
        """Return the columns of the file as words for an error."""
        more = f" and {len(self.names) - _MOST_NAMES} more" if len(self.names) > _MOST_NAMES else ""
        return ", ".join(name[:_LONGEST_NAME] for name in self.names[:_MOST_NAMES]) + more


def read_sheet(path: str | Path, wanted: Iterable[str]) -> Sheet:
    """Read the wanted columns of a CSV or Parquet file; columns that are missing are left out.

    Raises
    ------
    NotUnderstoodError
        Names file, row and column: unreadable file, not a table, a column twice, a value that is not a
        number.
    """
    file = Path(path)
    frame, first_row = _read_frame(file)
    names = tuple(printable(name.strip()) for name in frame.columns)
    refuse_twins(names, file)
    frame.columns = list(names)
    needed = set(wanted)
    columns = {name: numbers(frame[name], name, first_row, file) for name in names if name in needed}
    return Sheet(columns, names, first_row, str(file))


def read_words(path: str | Path, name: str) -> list[str | None]:
    """Return a column of a CSV or Parquet file as words, None where a cell is empty."""
    import polars as pl

    frame, _ = _read_frame(Path(path))
    frame.columns = [printable(each.strip()) for each in frame.columns]
    return frame[name].cast(pl.String).to_list()


def printable(name: str) -> str:
    """Return a name from a file, safe to print on one line."""
    return name if name.isprintable() else "".join(sign if sign.isprintable() else "?" for sign in name)


def missing_column(sheet: Sheet, missing: Iterable[str], remedy: str) -> NotUnderstoodError:
    """Return the error for columns that a file must have."""
    hint = "; separate columns by commas" if len(sheet.names) == 1 and ";" in sheet.names[0] else ""
    return input_error(
        "trace-column",
        f"column {', '.join(missing)}: missing; the file has {sheet.listing()}",
        remedy + hint,
        line=max(sheet.first_row - 1, 0),
        source=sheet.source,
    )


def _read_frame(file: Path) -> "tuple[pl.DataFrame, int]":
    """Return the table, and the number of its first row in the file."""
    import polars as pl

    try:
        with file.open("rb") as stream:
            parquet = stream.read(4) == b"PAR1"
        if parquet:
            return read_parquet(file), 1
        return _without_trailing_blanks(pl.read_csv(file, infer_schema=False)), 2
    except OSError as error:
        why = error.strerror or str(error).splitlines()[0]
        raise input_error("file-unreadable", f"cannot read: {why}", source=str(file)) from None
    except pl.exceptions.NoDataError:
        raise input_error(
            "trace-empty", "the file is empty", "export the trace with a header line", source=str(file)
        ) from None
    except DamagedError as error:
        raise input_error(
            "trace-unreadable", f"a damaged Parquet file: {error}", "export it again", source=str(file)
        ) from None
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        raise _no_table(file, str(error)) from None


def _without_trailing_blanks(frame: "pl.DataFrame") -> "pl.DataFrame":
    """Return the table without empty lines at its end, which are not rows."""
    rows = frame.height
    while rows and all(value is None for value in frame.row(rows - 1)):
        rows -= 1
    return frame.head(rows)


def _no_table(file: Path, why: str) -> NotUnderstoodError:
    """Return the error for a file that is not a table; it names the first line that is too long."""
    text = file.read_bytes().decode("latin-1").splitlines()
    wide = text[0].count(",") if text else 0
    for number, line in enumerate(text, start=1):
        if line.count(",") > wide and '"' not in line:
            return input_error(
                "trace-unreadable",
                f"row {number}: {line.count(',') + 1} values under {wide + 1} column names",
                "decimals with a point, columns separated by commas",
                line=number,
                source=str(file),
            )
    first = (why.splitlines() or ["unreadable"])[0]
    return input_error(
        "trace-unreadable",
        f"not a table: {first}",
        "write CSV (UTF-8, commas, a header line) or Parquet",
        source=str(file),
    )


def refuse_twins(names: tuple[str, ...], file: Path) -> None:
    """Raise `NotUnderstoodError` for a column that is there twice."""
    for name in names:
        stem = name.partition("_duplicated_")[0]
        if names.count(name) > 1 or (stem != name and stem in names):
            raise input_error("trace-column", f"column {stem}: is present twice", line=1, source=str(file))


def numbers(column: "pl.Series", name: str, first_row: int, file: Path) -> Floats:
    """Return a column (n,) as numbers, NaN where empty; anything else is an error with its row."""
    import polars as pl

    if column.dtype.is_numeric():
        return column.cast(pl.Float64).fill_null(math.nan).to_numpy().astype(np.float64)
    if column.dtype not in (pl.String, pl.Null):
        raise input_error(
            "trace-number", f"column {name}: holds {column.dtype}, not numbers", line=1, source=str(file)
        )
    text = column.cast(pl.String).str.strip_chars()
    numbers = text.cast(pl.Float64, strict=False)
    wrong = (numbers.is_null() & text.is_not_null() & ~text.str.to_lowercase().is_in(_EMPTY_WORDS)).arg_true()
    if len(wrong):
        index = int(wrong[0])
        raise input_error(
            "trace-number",
            f"row {index + first_row}, column {name}: {_brief(text[index])} is not a number",
            "decimals with a point, columns separated by commas",
            line=index + first_row,
            source=str(file),
        )
    return numbers.fill_null(math.nan).to_numpy().astype(np.float64)


def _brief(text: object) -> str:
    words = repr(text)
    return words if len(words) <= 40 else words[:37] + "…'"
