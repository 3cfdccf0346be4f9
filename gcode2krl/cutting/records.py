"""Named tuples of columns: some rows of one, several one behind the other."""

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Record = TypeVar("Record", bound=tuple[Any, ...])


def taken(record: Record, rows: slice | NDArray[Any]) -> Record:
    """Return rows of all columns; a slice shares their memory."""
    kind: Any = type(record)
    made: Record = kind(*(column[rows] for column in record))
    return made


def copied(record: Record, rows: slice) -> Record:
    """Return rows of all columns in memory of their own, so that the others can go."""
    kind: Any = type(record)
    made: Record = kind(*(column[rows].copy() for column in record))
    return made


def followed(first: Record, second: Record) -> Record:
    """Return the rows of one record and those of another behind them."""
    kind: Any = type(first)
    made: Record = kind(*(np.concatenate(pair) for pair in zip(first, second, strict=True)))
    return made
