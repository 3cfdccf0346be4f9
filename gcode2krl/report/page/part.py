"""The part on the page: heights over time, the sample that left each cell, and how far that is off."""

from typing import Any, NamedTuple

import numpy as np

from gcode2krl.arrays import Floats, Ints, Ints32
from gcode2krl.report.page.packing import packed
from gcode2krl.report.part_error import scale_end
from gcode2krl.tables import PartHistory, SurfaceHistory

_HEIGHT_STEP_MM = 0.01
_OFF_STEP_MM = 1e-3


class DrawnPart(NamedTuple):
    """What a page carries of a part."""

    head: dict[str, Any]
    events: str
    cells: str


def drawn_part(
    history: PartHistory | SurfaceHistory, rows: Ints, error_mm: Floats | None, nominal_mm: Floats | None
) -> DrawnPart:
    """Return a part as the page takes it; ``rows`` are the samples of the motion that the page has.

    Parameters
    ----------
    error_mm, nominal_mm : how far the surface is off by the deflection, and how far it is above the nominal
        part, of each cell (r, c) or site (s,); NaN where that is not known, None where nothing is.
    """
    if isinstance(history, PartHistory):
        head, of_events, of_cells = _heights(history, rows)
    else:
        head, of_events, of_cells = _surface(history, rows)
    maps = {"error": error_mm, "nominal": nominal_mm}
    drawn = {name: off for name, off in maps.items() if off is not None}
    of_cells["left"] = (np.where(history.left_by >= 0, _row(rows, history.left_by), -1).ravel(), 1.0)
    of_cells |= {name: (off.ravel(), _OFF_STEP_MM) for name, off in drawn.items()}
    events, columns_of_events = packed(of_events)
    cells, described = packed(of_cells)
    head |= {
        "events": {"columns": columns_of_events, "rows": len(history.cell)},
        "places": history.left_by.size,
        "columns": described,
        "ends": {name: scale_end(off) for name, off in drawn.items()},
    }
    return DrawnPart(head, events, cells)


_Columns = dict[str, tuple[Any, float]]


def _heights(history: PartHistory, rows: Ints) -> tuple[dict[str, Any], _Columns, _Columns]:
    """Return what the page has to know of a field, the columns of its events and those of its cells."""
    order = _by_visit(history.cell)
    events: _Columns = {
        "cell": (history.cell[order], 1.0),
        "row": (_row(rows, history.sample)[order], 1.0),
        "height": (history.height_mm[order], _HEIGHT_STEP_MM),
    }
    steep = 1.0 - np.abs(history.normal[:, :, 2])
    cells: _Columns = {"raw": (history.raw_mm.ravel(), _HEIGHT_STEP_MM), "steep": (steep.ravel(), 0.1)}
    frame = np.eye(4)
    frame[:3, :3] = history.to_field  # its transpose, written column by column
    head = {
        "frame": frame.reshape(-1).tolist(),
        "low": history.origin_mm.tolist(),
        "size": history.cell_mm.tolist(),
        "cells": list(history.raw_mm.shape[::-1]),
        "bottom": history.bottom_mm,
    }
    return head, events, cells


def _surface(history: SurfaceHistory, rows: Ints) -> tuple[dict[str, Any], _Columns, _Columns]:
    """Return the same of a surface."""
    events: _Columns = {
        "cell": (history.cell, 1.0),
        "row": (np.where(history.sample < 0, -1, _row(rows, history.sample)), 1.0),
        "shown": (_row(rows, history.shown), 1.0),
        "state": (history.state, 1.0),
    }
    events |= {axis: (history.share[:, k], 1.0) for k, axis in enumerate("xyz")}
    head = {
        "frame": np.eye(4).reshape(-1).tolist(),
        "low": history.low_mm.tolist(),
        "size": history.cell_mm.tolist(),
        "cubes": history.cubes.tolist(),
        "raw": int(np.searchsorted(history.shown, 0)),
    }
    return head, events, {"cube": (history.site, 1.0)}


def _row(rows: Ints, sample: Ints) -> Ints:
    """Return the first of the page's rows that is not before a sample."""
    return np.minimum(np.searchsorted(rows, sample), len(rows) - 1)


def _by_visit(cell: Ints32) -> Ints:
    """Return the order of events in which all first ones of the cells come first, then all second ones, ….

    Neighbours then differ little, as a tool passes one after the other; this halves their size.
    """
    order = np.argsort(cell, kind="stable")
    begins = np.append(True, np.diff(cell[order]) != 0)[: len(cell)]
    place = np.arange(len(cell))
    visit = np.empty(len(cell), dtype=np.int64)
    visit[order] = place - np.maximum.accumulate(np.where(begins, place, 0))
    return np.lexsort((cell, visit))
