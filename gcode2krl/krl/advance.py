"""The advance run: which triggers wait at the same time, and which statements halt it."""

from collections.abc import Sequence

import numpy as np

from gcode2krl import krl_words as w
from gcode2krl.arrays import Rows
from gcode2krl.cell import Cell
from gcode2krl.compiled.inputs import distinct


def view(cell: Cell) -> int:
    """Return how many motions in a row have their triggers waiting at the same time.

    While one motion runs, the advance run has read ``$ADVANCE`` more and what stands before the next.
    """
    advance = 5 if cell.controller.advance == "unlimited" else cell.controller.advance
    return advance + 2 if advance else 1


def most_active(row: Rows, in_view: int) -> int:
    """Return the largest number of triggers (at rising numbers of `read_order`) within so many motions."""
    waiting = np.searchsorted(row, row + in_view, side="left") - np.arange(len(row))
    return int(waiting.max(initial=0))


def read_order(motions: int, halts: Rows, cell: Cell) -> Rows:
    """Return a number (p + 1,) for each motion; triggers whose numbers differ by less than `view` may wait
    at the same time.

    The advance run reads nothing beyond a wait or a halt before it is over, so the numbers jump by `view`
    behind each motion in ``halts``: triggers before and behind it never wait at the same time.
    """
    after = np.zeros(motions + 1, dtype=np.int64)
    after[distinct(halts) + 1] = view(cell)
    return np.arange(motions + 1) + np.cumsum(after)


def halts_advance(statements: Sequence[str]) -> bool:
    """Tell whether statements hold the advance run: a WAIT or a HALT that no CONTINUE precedes."""
    first = [text.split(maxsplit=1)[0].upper() for text in statements if text.strip()]
    holds = [word in (w.WAIT, w.HALT) for word in first]
    return any(hold and before != w.CONTINUE for before, hold in zip(["", *first], holds, strict=False))
