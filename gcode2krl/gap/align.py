"""Clocks within normal mismatch, run by run: stamps are moved so that what is left of them is linear.

A clock that is 2 ms off leaves a·t²/2, some micrometres at every change of speed, beside its linear
signature; over thousands of samples that is enough to look like something else.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gcode2krl.gap.bounds import sigma
from gcode2krl.gap.examine import Question, nuisance_for
from gcode2krl.gap.part import Part
from gcode2krl.gap.signatures import Signatures

Floats = NDArray[np.float64]
LINKS = ("gear", "mechanics")
"""Links whose signals change fast all the time; a force does where the cutter enters and leaves only."""
_ROUNDS = 2
_MOST_S = 0.02
_RIDGE = 1e-6


def with_set_clocks(parts: Sequence[Part], question: Question, known: Signatures) -> list[Part]:
    """Return the parts with each run's own clock error taken off its stamps; signatures stay as they are.

    What all runs share is kept where it is more than mismatch: it is a cause to be found.
    """
    parts = list(parts)
    if not parts or parts[0].link not in LINKS:
        return parts
    nuisance = nuisance_for(parts, question, known)
    total = np.zeros(len(parts))
    current = parts
    for _ in range(_ROUNDS):
        for number, part in enumerate(current):
            others = [each.columns for each in nuisance[number] if each.name != "clock"]
            clock = [each.columns for each in nuisance[number] if each.name == "clock"]
            if clock:
                share = _coefficient(part, clock[0], others)
                total[number] += share * sigma(question.mismatch.clock_s) * question.clocks**0.5
        limit = question.mismatch.clock_s * question.clocks
        common = float(np.median(np.clip(total, -_MOST_S, _MOST_S)))
        kept = common if abs(common) > limit else 0.0
        total = kept + np.clip(total - kept, -limit, limit)
        current = [_later(part, offset - kept) for part, offset in zip(parts, total.tolist(), strict=True)]
        if kept:
            break
    for before, after in zip(parts, current, strict=True):
        known.same(before, after)
    return current


def _later(part: Part, offset_s: float) -> Part:
    """Return the part with a clock error taken off: of the load encoders alone, or of the whole table."""
    if part.link == "gear":
        return replace(part, plus_late_s=offset_s)
    return replace(part, time_s=part.time_s - offset_s)


def _coefficient(part: Part, clock: Floats, others: Sequence[Floats]) -> float:
    """Return the coefficient of the clock's column beside all that other mismatch could explain."""
    k, n, _ = clock.shape
    flat = np.concatenate([clock, *others], axis=2).reshape(k * n, -1)
    scale = np.sqrt(np.sum(flat**2, axis=0))
    good = scale > 0.0
    if not good[0]:
        return 0.0
    flat = flat[:, good] / scale[good]
    gram = flat.T @ flat
    gram[np.diag_indices_from(gram)] += _RIDGE
    found = np.linalg.solve(gram, flat.T @ part.residual.T.reshape(k * n))
    return float(found[0] / scale[0])
