"""Clocks that are far off: what was taken off the stamps of a table before everything else."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from gcode2krl.effects import Applied, Effect
from gcode2krl.gap.beside.links import MECHANICS, PATH, Link
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.slips.slip import Slip, rms_before

_NAME = "clock"


class ClockTest:
    """Large clock errors, which were taken off the stamps: one a table, whatever other slips there are."""

    effects = (_NAME,)

    def find(self, pairs: Sequence[Pair], library: Mapping[str, Effect]) -> list[Slip]:
        """Return the median offset of each table's clock, where it is not zero."""
        effect = library.get(_NAME)
        if effect is None:
            return []
        return [slip for link in (PATH, MECHANICS) if (slip := _clock_of(link, pairs, effect)) is not None]


def _clock_of(link: Link, pairs: Sequence[Pair], effect: Effect) -> Slip | None:
    """Return the clock of the table that a link's signal is in."""
    table = link.table
    offset_s = float(np.median([pair.clock_s.get(table, 0.0) for pair in pairs]))
    if offset_s == 0.0:
        return None
    as_stamped = [replace(pair, clock_s={**pair.clock_s, table: 0.0}) for pair in pairs]
    on_time, off = link.traces(pairs), link.traces(as_stamped)
    if not on_time or not off:
        return None
    factor, unit = on_time[0].factor, on_time[0].unit
    applied = Applied(effect, table, {"offset_s": offset_s, "skew": 0.0})
    words = f"the clock of {table} is {offset_s:+.3f} s off the prediction's"
    return Slip(applied, link, rms_before(off) * factor, rms_before(on_time) * factor, unit, words)
