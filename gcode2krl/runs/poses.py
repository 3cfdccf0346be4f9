"""``poses.csv``: measured poses, with their times in seconds or as dates."""

from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np

from gcode2krl.errors import input_error
from gcode2krl.runs.measured import TIME, Poses, columns_of
from gcode2krl.runs.tables import Sheet, read_sheet, read_words

_DATE = "time"


def read_poses(file: Path) -> Sheet:
    """Return the columns of a table of poses; a column ``time`` of ISO 8601 dates becomes ``t_s``.

    t_s = 0 is then the first pose. Raises `NotUnderstoodError` for what is no date.
    """
    sheet = read_sheet(file, columns_of(Poses))
    if TIME in sheet.columns or _DATE not in sheet.names:
        return sheet
    seconds = [
        _seconds(word, row + sheet.first_row, file) for row, word in enumerate(read_words(file, _DATE))
    ]
    first = next((value for value in seconds if np.isfinite(value)), 0.0)
    names = tuple(name for name in sheet.names if name != _DATE)
    return replace(sheet, columns={TIME: np.array(seconds) - first, **sheet.columns}, names=names)


def _seconds(word: str | None, row: int, file: Path) -> float:
    """Return a date as seconds, NaN where there is none."""
    if word is None or not word.strip():
        return float("nan")
    try:
        return datetime.fromisoformat(word.strip()).timestamp()
    except ValueError:
        raise input_error(
            "trace-time",
            f"row {row}, column {_DATE}: {word[:40]!r} is no date",
            f"2024-05-06T07:08:09, or seconds in a column {TIME}",
            line=row,
            source=str(file),
        ) from None
