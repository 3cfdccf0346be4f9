"""What a compensation gains over the whole part, beside its largest deviation.

The largest deviation is one sample, often an entry; the root mean square and the share of the time say what
happens everywhere else, and the lines say where the compensation makes it worse.
"""

from typing import Any, NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints32

MATTERS_MM = 0.01
"""A smaller difference is neither better nor worse: a robot's path repeats no more closely."""
_MOST_LINES = 5


class WorseLine(NamedTuple):
    """A line of G-code in which a compensation makes the part worse."""

    line: int
    excess_mm: float
    """By how much at the worst sample."""
    time_s: float
    """For how long."""


class Gain(NamedTuple):
    """A case beside the uncompensated one, over the samples that are judged."""

    rms_mm: float
    rms_less_percent: float | None
    better_share: float
    worse_share: float
    """Of the judged time; the rest differs by less than `MATTERS_MM`."""
    worst_line: int
    """Where the largest deviation of the case is."""
    worse: tuple[WorseLine, ...]
    """The largest excess first."""

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain values."""
        return {**self._asdict(), "worse": [each._asdict() for each in self.worse]}


def gain_of(
    before_mm: Floats, after_mm: Floats, counts: Bools, source_line: Ints32, cycle_s: float
) -> Gain | None:
    """Return what a case gains; all (n,), deviations normal to the feed. None where nothing is judged."""
    if not counts.any():
        return None
    before, after, line = before_mm[counts], after_mm[counts], source_line[counts]
    excess = after - before
    rms_before, rms_after = _rms(before), _rms(after)
    worse = excess > MATTERS_MM
    found = [
        _worse_line(int(number), excess, worse & (line == number), cycle_s)
        for number in np.unique(line[worse])
    ]
    found.sort(key=lambda each: -each.excess_mm)
    return Gain(
        rms_mm=rms_after,
        rms_less_percent=100.0 * (1.0 - rms_after / rms_before) if rms_before else None,
        better_share=float((excess < -MATTERS_MM).mean()),
        worse_share=float(worse.mean()),
        worst_line=int(line[np.argmax(after)]),
        worse=tuple(found[:_MOST_LINES]),
    )


def _worse_line(number: int, excess_mm: Floats, where: Bools, cycle_s: float) -> WorseLine:
    return WorseLine(number, float(excess_mm[where].max()), float(where.sum() * cycle_s))


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
