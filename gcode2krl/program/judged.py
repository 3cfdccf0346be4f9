"""Which rows of a program are judged where not all of them can be."""

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints


def spread(rows: Ints, position_mm: Floats, most: int) -> Ints:
    """Return at most so many rows spread over a run, its outermost points among them where there is room."""
    if len(rows) <= most:
        return rows
    extremes = [op(position_mm[rows, k]) for k in range(3) for op in (np.argmin, np.argmax)]
    evenly = np.linspace(0, len(rows) - 1, max(most - len(extremes), 2)).astype(np.int64)
    chosen = np.unique(np.concatenate([evenly, extremes]))
    picked = np.linspace(0, len(chosen) - 1, min(most, len(chosen))).astype(np.int64)
    return np.asarray(rows[chosen[picked]])


def of_pass(run: Ints, position_mm: Floats, is_target: Bools, most: int) -> Ints:
    """Return at most so many rows of a pass: half of them targets, at which an axis may change its way."""
    targets = run[is_target[run]]
    if len(run) <= most or len(targets) == len(run):
        return spread(run, position_mm, most)
    chosen = spread(targets, position_mm, max(most // 2, 2))
    others = spread(run[~is_target[run]], position_mm, max(most - len(chosen), 1))
    return np.union1d(chosen, others)
