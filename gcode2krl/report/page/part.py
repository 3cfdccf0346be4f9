"""The part on the page: heights over time, the sample that left each cell, and how far that is off."""

from typing import Any, NamedTuple

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.report.page.packing import packed
from gcode2krl.tables import PartHistory

_HEIGHT_STEP_MM = 0.01
_OFF_STEP_MM = 1e-3
_MOST_OF_CELLS = 99.5
_STEPS_MM = (0.01, 0.02, 0.03, 0.05, 0.1, 0.2, 0.3, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 5.0)


class DrawnPart(NamedTuple):
    """What a page carries of a part."""

    head: dict[str, Any]
    events: str
    cells: str


def drawn_part(
    history: PartHistory, rows: Ints, error_mm: Floats | None, nominal_mm: Floats | None
) -> DrawnPart:
    """Return a part as the page takes it; ``rows`` are the samples of the motion that the page has.

    Parameters
    ----------
    error_mm, nominal_mm : (r, c) how far the surface is off by the deflection, and how far it is above the
        nominal part; NaN where that is not known, None where nothing is.
    """
    order = _by_visit(history.cell)
    columns = {"cell": (history.cell, 1.0), "row": (_row(rows, history.sample), 1.0)}
    columns["height"] = (history.height_mm, _HEIGHT_STEP_MM)
    events, of_events = packed({name: (values[order], step) for name, (values, step) in columns.items()})
    maps = {"error": error_mm, "nominal": nominal_mm}
    drawn = {name: off for name, off in maps.items() if off is not None and np.isfinite(off).any()}
    left = np.where(history.left_by >= 0, _row(rows, history.left_by), -1)
    of_cells: dict[str, tuple[Any, float]] = {
        "raw": (history.raw_mm.ravel(), _HEIGHT_STEP_MM),
        "left": (left.ravel(), 1.0),
    }
    cells, described = packed(of_cells | {name: (off.ravel(), _OFF_STEP_MM) for name, off in drawn.items()})
    frame = np.eye(4)
    frame[:3, :3] = history.to_field  # its transpose, written column by column
    head = {
        "frame": frame.reshape(-1).tolist(),
        "low": history.origin_mm.tolist(),
        "size": history.cell_mm.tolist(),
        "cells": list(history.raw_mm.shape[::-1]),
        "bottom": history.bottom_mm,
        "events": {"columns": of_events, "rows": len(order)},
        "columns": described,
        "ends": {name: _end_of(off) for name, off in drawn.items()},
    }
    return DrawnPart(head, events, cells)


def _row(rows: Ints, sample: Ints) -> Ints:
    """Return the first of the page's rows that is not before a sample."""
    return np.minimum(np.searchsorted(rows, sample), len(rows) - 1)


def _by_visit(cell: Ints) -> Ints:
    """Return the order of events in which all first ones of the cells come first, then all second ones, ….

    Neighbours then differ little, as a tool passes one after the other; this halves their size.
    """
    order = np.argsort(cell, kind="stable")
    begins = np.append(True, np.diff(cell[order]) != 0)[: len(cell)]
    place = np.arange(len(cell))
    visit = np.empty(len(cell), dtype=np.int64)
    visit[order] = place - np.maximum.accumulate(np.where(begins, place, 0))
    return np.lexsort((cell, visit))


def _end_of(off_mm: Floats) -> float:
    """Return where a scale ends that nearly all cells are within."""
    most = float(np.nanpercentile(np.abs(off_mm), _MOST_OF_CELLS))
    return next((step for step in _STEPS_MM if step >= most), _STEPS_MM[-1])
