"""The tangential part of the path link, as time: by how much the run is late at each place."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gcode2krl.effects import Applied
from gcode2krl.gap.part import Part

Floats = NDArray[np.float64]
_SLOW = 0.05
"""Below this share of the rms rate a sample tells nothing about time."""


def late_s(part: Part, residual: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Return how late the run is (n,) in s, and where it moves fast enough to tell."""
    power = np.sum(part.rate**2, axis=1)
    moves = power > (_SLOW**2) * float(np.mean(power))
    late = np.zeros(len(power))
    late[moves] = -np.sum(part.rate[moves] * residual[moves], axis=1) / power[moves]
    return late, moves


def timing_share(parts: Sequence[Part]) -> float:
    """Return the share of the path residual's power that lies along the motion."""
    along, total = 0.0, 0.0
    for part in parts:
        late, moves = late_s(part, part.residual)
        along += float(np.sum((late[moves, None] * part.rate[moves]) ** 2))
        total += float(np.sum(part.residual**2))
    return along / total if total > 0.0 else 0.0


def timing_sizes(parts: Sequence[Part], applied: Sequence[Applied]) -> tuple[float, float]:
    """Return the rms (s) by which runs are late, without and with effects."""
    return _rms(parts, ()), _rms(parts, applied) if applied else _rms(parts, ())


def _rms(parts: Sequence[Part], applied: Sequence[Applied]) -> float:
    values = []
    for part in parts:
        late, moves = late_s(part, part.measured - part.sample(applied))
        values.append(late[moves])
    every = np.concatenate(values)
    return float(np.sqrt(np.mean(every**2))) if len(every) else 0.0
