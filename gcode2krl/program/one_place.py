"""One place of the external axes for a whole program.

Of good places that counts where the robot bends least, then that which is nearest. Most places are out of
question by a few rows of the program, so these are judged first; then places are judged by all rows, the most
promising first, until no other can be better. Of more places that are equally good by a few rows, as with two
axes, those near the start and others spread over the ranges are looked at.
"""

from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.program.judged import spread
from gcode2krl.program.places import (
    AS_STIFF,
    GOOD,
    LEAST,
    MOST_THAT_BEND,
    STEPS,
    Bending,
    Quality,
    Range,
    quality_table,
)

_ROWS = (12, 60, 300)
"""Rows by which places are judged, one after the other."""
_NEAREST = 12
_FEWEST_ROWS_THAT_BEND, _ROWS_THAT_BEND = 3, 24
_SCATTER = 0.6180339887
"""Multiples of the golden section, without their whole part, are spread evenly however many are taken."""


class Choice(NamedTuple):
    """The places to choose from."""

    places: Floats
    """(k, 6)"""
    far: Floats
    """(k,) how far each is from the start, in shares of the ranges."""


def best_place(
    position_mm: Floats,
    quality: Quality,
    bending: Bending | None,
    places: Floats,
    ranges: list[Range],
    start: Floats,
) -> int | None:
    """Return which place (k, 6) serves all positions (p, 3) best; None where none serves all.

    The place of the best quality; of those that are good, the stiffest; of those, the nearest to ``start``
    (6,).
    """
    far = np.zeros(len(places))
    for axis in ranges:
        far += axis.share * np.abs(places[:, axis.column] - start[axis.column])
    choice = Choice(places, far)
    worst = _worst_qualities(position_mm, quality, choice)
    if worst.max() < LEAST:
        return None
    score = _score(worst)
    candidates = np.flatnonzero(score == score.max())
    bent = np.ones(len(candidates))
    if bending is not None and len(candidates) > 1:
        most = int(np.clip(MOST_THAT_BEND // len(candidates), _FEWEST_ROWS_THAT_BEND, _ROWS_THAT_BEND))
        bent = _bent(bending, spread(np.arange(len(position_mm)), position_mm, most), places[candidates])
    as_stiff = bent <= (1.0 + AS_STIFF) * bent.min()
    order = np.lexsort((-worst[candidates], far[candidates], ~as_stiff))
    return int(candidates[order[0]])


def _worst_qualities(position_mm: Floats, quality: Quality, choice: Choice) -> Floats:
    """Return the quality (k,) of places over all positions (p, 3) in their best branch.

    Those that were not judged by all rows have -1: no better one is among them.
    """
    everything = np.arange(len(position_mm))
    few, *more = (spread(everything, position_mm, count) for count in _ROWS)
    bound = quality_table(quality, few, choice.places).min(axis=0)  # (k, branches)
    worst = np.full(len(choice.places), -1.0)
    order = _most_promising_first(_score(bound.max(axis=1)), choice)
    for first in range(0, len(order), STEPS):
        some = order[first : first + STEPS]
        if _score(bound[some].max(axis=1)).max() <= _score(worst).max():
            break
        for rows in more:
            some = some[bound[some].max(axis=1) >= LEAST]
            if len(some):
                found = quality_table(quality, rows, choice.places[some]).min(axis=0)
                bound[some] = np.minimum(bound[some], found)
        worst[some] = bound[some].max(axis=1)
    return worst


def _most_promising_first(score: Floats, choice: Choice) -> Ints:
    """Return the places in the order in which they are judged by all rows."""
    best = np.flatnonzero(score == score.max())
    is_near = np.zeros(len(score), dtype=np.bool_)
    is_near[best[np.argsort(choice.far[best], kind="stable")[:_NEAREST]]] = True
    scattered = np.arange(len(score)) * _SCATTER % 1.0
    return np.lexsort((scattered, ~is_near, -score))


def _score(quality: Floats) -> Floats:
    """Return what a quality counts: from `GOOD` on all are alike."""
    return np.asarray(np.minimum(np.round(quality, 2), GOOD))


def _bent(bending: Bending, rows: Ints, places: Floats) -> Floats:
    """Return how far the robot bends at places (k,), in root mean square over rows.

    Of the branches the stiffest counts that reaches all rows; inf where none does.
    """
    each = bending(np.tile(rows, len(places)), np.repeat(places, len(rows), axis=0))
    square = np.mean(each.reshape(len(places), len(rows), -1) ** 2, axis=1)  # (places, branches)
    return np.asarray(np.sqrt(np.min(np.where(np.isnan(square), np.inf, square), axis=1)))
