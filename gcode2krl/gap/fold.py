"""Splits: a run, or a stretch of one, is never used both to choose or fit an effect and to report on it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gcode2krl.gap.evidence import STRETCH_S
from gcode2krl.gap.part import Part

Bools = NDArray[np.bool_]
_GUARD_S = STRETCH_S
_QUARTERS = 4
_NEARLY_ALL = 0.75
_LEAST_KEPT, _LEAST_HELD = 30, 10


def folds_of(parts: Sequence[Part], power: Sequence[float] = ()) -> list[tuple[list[Part], list[Part]]]:
    """Return (to explain, held out) pairs: whole runs by turns; of a single run quarters with guard gaps.

    ``power``: what a gap has in each part. Where one run has nearly all of it the others cannot tell of it,
    and quarters of all runs are held out by turns.
    """
    alone = len(parts) == 1 or (len(power) > 0 and max(power) > _NEARLY_ALL * sum(power))
    if not alone:
        return [([part for part in parts if part is not held], [held]) for held in parts]
    found = []
    for quarter in range(_QUARTERS):
        kept, held = [], []
        for part in parts:
            edges = np.linspace(part.time_s[0], part.time_s[-1] + 1e-9, _QUARTERS + 1)
            first, last = edges[quarter], edges[quarter + 1]
            near = (part.time_s >= first - _GUARD_S) & (part.time_s < last + _GUARD_S)
            kept.append(with_rows(part, ~near))
            held.append(with_rows(part, (part.time_s >= first) & (part.time_s < last)))
        kept = [part for part in kept if len(part.time_s) >= _LEAST_KEPT]
        held = [part for part in held if len(part.time_s) >= _LEAST_HELD]
        if kept and held:
            found.append((kept, held))
    return found


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
