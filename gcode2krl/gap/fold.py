"""Splits: a run, or a stretch of one, is never used both to choose or fit an effect and to report on it."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gcode2krl.gap.evidence import STRETCH_S
from gcode2krl.gap.part import Part

Bools = NDArray[np.bool_]
_GUARD_S = STRETCH_S
_QUARTERS = 4


def folds_of(parts: Sequence[Part]) -> list[tuple[list[Part], list[Part]]]:
    """Return (to explain, held out) pairs: whole runs by turns; of a single run quarters with guard gaps."""
    if len(parts) > 1:
        return [([part for part in parts if part is not held], [held]) for held in parts]
    part = parts[0]
    edges = np.linspace(part.time_s[0], part.time_s[-1] + 1e-9, _QUARTERS + 1)
    found = []
    for first, last in pairwise(edges):
        held = (part.time_s >= first) & (part.time_s < last)
        near = (part.time_s >= first - _GUARD_S) & (part.time_s < last + _GUARD_S)
        found.append(([with_rows(part, ~near)], [with_rows(part, held)]))
    return [(a, b) for a, b in found if len(a[0].time_s) >= 30 and len(b[0].time_s) >= 10]


def with_rows(part: Part, chosen: Bools) -> Part:
    """Return a part with some of its rows; what is left out makes a gap."""
    rows = np.flatnonzero(chosen)
    owner = np.zeros(len(chosen), dtype=np.int64)
    for number, (first, last) in enumerate(part.segments):
        owner[first:last] = number
    breaks = np.flatnonzero((np.diff(rows) > 1) | (np.diff(owner[rows]) > 0)) + 1
    edges = np.concatenate([[0], breaks, [len(rows)]]).astype(np.int64)
    segments = np.stack([edges[:-1], edges[1:]], axis=1)
    return replace(part, time_s=part.time_s[rows], measured=part.measured[rows], segments=segments)
