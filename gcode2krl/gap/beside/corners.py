"""Corners of a plan: where they are passed, and what other roundings, ramps and stops would do to the run.

**Rounding.** A corner that is rounded by another law is off along the turn of the direction there, by a
function of the way from the corner: a sum of hats of several widths.

**Lateness.** What changes at corners, ramps or stops makes a run later from there on. An approximation
distance d larger by δ takes δ·|1/v₁ - 1/v₂| more where the speed changes from v₁ to v₂, since the slower one
has more of the way; a ramp of dv takes (|dv|/a + k)/2; a stop takes what it takes.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.effects.inputs import Inputs, gradient
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.beside
_WIDTHS_MM = (0.3, 0.6, 1.2, 2.5, 5.0)
"""Of roundings: approximation distances of milling programs."""
_REACH_MM = 2.0
"""Before and after a corner, between which the direction turns."""
_AT_REST = 0.01
"""Of the highest speed."""


def rows_of_passing(path_mm: Floats, points_mm: Floats) -> Ints:
    """Return the samples of a path (m, 3) nearest to points (c, 3) that are passed one after the other."""
    rows, first = [], 0
    x, y, z = np.ascontiguousarray(path_mm.T)
    for at_x, at_y, at_z in points_mm:
        away = np.sqrt((x[first:] - at_x) ** 2 + (y[first:] - at_y) ** 2 + (z[first:] - at_z) ** 2)
        # the first local minimum that is as near as any: a path may come by again
        near = np.flatnonzero(away < away.min() + _LIMITS.corner_near_mm)
        breaks = np.flatnonzero(np.diff(near) > 1)
        passage = near[: breaks[0] + 1] if len(breaks) else near
        first += int(passage[np.argmin(away[passage])])
        rows.append(first)
    return np.array(rows, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Corners:
    """What the targets of a motion say of its m samples; all is zero or empty without targets."""

    inputs: Inputs

    @cached_property
    def _blended(self) -> Bools:
        """(t,) which targets are corners that the plan rounds."""
        targets = self.inputs.targets
        return np.zeros(0, dtype=np.bool_) if targets is None else targets.cdis_mm > 0.0

    @cached_property
    def _rows(self) -> Ints:
        """(c,) the samples at rounded corners."""
        targets = self.inputs.targets
        if targets is None or not self._blended.any():
            return np.zeros(0, dtype=np.int64)
        return rows_of_passing(self.inputs.position_mm, targets.position_mm[self._blended])

    def passed(self, samples: Ints) -> Floats:
        """Return for some samples (n,) 1 from each blended corner on, (n, c)."""
        steps: Floats = (samples[:, None] >= self._rows).astype(np.float64)
        return steps

    @cached_property
    def roundings(self) -> Floats:
        """(m, w, 6) what rounding the nearest corner within each width does to the commanded joints."""
        inputs, rows = self.inputs, self._rows
        if not len(rows):
            return np.zeros((len(inputs), len(_WIDTHS_MM), 6))
        gone, moves = inputs.path_mm, np.append(True, np.diff(inputs.path_mm) > 0.0)
        at_mm = gone[rows]
        apart = np.diff(at_mm, prepend=-np.inf, append=np.inf)
        reach_mm = np.clip(np.minimum(apart[:-1], apart[1:]) / 2.0, 1e-3, _REACH_MM)

        def along(length_mm: Floats) -> Floats:
            return np.stack([np.interp(length_mm, gone[moves], q[moves]) for q in inputs.q_cmd_rad.T], axis=1)

        turn = along(at_mm + reach_mm) - 2.0 * along(at_mm) + along(at_mm - reach_mm)
        turn /= reach_mm[:, None]
        after = np.clip(np.searchsorted(at_mm, gone), 1, max(len(at_mm) - 1, 1))
        before, after = after - 1, np.minimum(after, len(at_mm) - 1)
        nearest = np.where(gone - at_mm[before] <= at_mm[after] - gone, before, after)
        away_mm = np.abs(gone - at_mm[nearest])[:, None]
        hats = np.maximum(0.0, 1.0 - away_mm / np.array(_WIDTHS_MM))
        bent: Floats = hats[:, :, None] * turn[nearest][:, None, :]
        return bent

    @cached_property
    def late_by_rounding(self) -> Floats:
        """(m, 2) how late larger corners make a run, in s for a mm, and corners passed so far."""
        targets = self.inputs.targets
        if targets is None or not self._blended.any():
            return np.zeros((len(self.inputs), 2))
        slowness = 1.0 / np.maximum(targets.speed_mm_s, 1e-6)
        change = np.abs(np.diff(slowness, append=slowness[-1:]))[self._blended]
        late = np.append(0.0, np.cumsum(change))
        passed = np.searchsorted(self._rows, np.arange(len(self.inputs)), side="right")
        return np.stack([late[passed], passed.astype(np.float64)], axis=1)

    @cached_property
    def late_by_ramps(self) -> Floats:
        """(m, 4) speed gained and lost so far, stops so far, and within a ramp acceleration and speed."""
        inputs = self.inputs
        speed = np.linalg.norm(inputs.velocity_mm_s, axis=1)
        gained = np.cumsum(np.abs(np.diff(speed, prepend=speed[:1])))
        rests = speed < _AT_REST * float(speed.max(initial=0.0))
        stops = np.cumsum(np.diff(rests.astype(np.float64), prepend=0.0) > 0.0).astype(np.float64)
        return np.stack([gained, stops, gradient(speed[:, None], inputs.time_s)[:, 0], speed], axis=1)
