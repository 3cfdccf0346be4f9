"""The samples that the page shows: where, when, how fast, how loaded; of a motion or of a mere path."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.prediction import Prediction
from gcode2krl.tables import Clearance, Toolpath, rows_at
from gcode2krl.units import DEG_PER_RAD

MOST_SAMPLES = 400_000
"""What a browser draws and turns without waiting; of longer motions the extremes are kept."""
_TOP = 99.5
_ALMOST_ALL = 1.02
"""A largest value that exceeds the end of the colour scale by less is not worth a word."""


@dataclass(frozen=True)
class Quantity:
    """What the path is coloured by and the plots show."""

    name: str
    label: str
    unit: str
    values: Floats
    """(m,), NaN where it is not known."""
    step: float
    """To which the page rounds it."""
    is_low_bad: bool = False

    @property
    def is_margin(self) -> bool:
        """True where the least value is the worst, below zero too."""
        return self.is_low_bad and self.name != "speed"

    def described(self, rapid: Bools) -> dict[str, Any]:
        """Return name, unit, the colour scale's ends, and what exceeds it.

        The scale ends at a percentile of the feed moves, so that one spike does not flatten it.
        """
        present = np.isfinite(self.values)
        rows = present & ~rapid if (present & ~rapid).any() else present
        values = self.values[rows] if rows.any() else np.zeros(1)
        low, high = (float(end) for end in np.percentile(values, (100.0 - _TOP, _TOP)))
        least, most = float(values.min()), float(values.max())
        if not self.is_margin:
            low = 0.0
        if most <= _ALMOST_ALL * high:
            high = most
        beyond = None
        if self.is_margin and least < low - 0.02 * (high - low):
            beyond = least
        elif not self.is_margin and most > high:
            beyond = most
        return {
            "name": self.name,
            "label": self.label,
            "unit": self.unit,
            "low": low,
            "high": high if high > low else low + 1.0,
            "beyond": beyond,
            "lowIsBad": self.is_low_bad,
        }


@dataclass(frozen=True)
class PageSamples:
    """Columns (m,) along the path."""

    time_s: Floats
    position_mm: Floats
    speed_mm_s: Floats
    feed_mm_s: Floats
    """Programmed, inf on rapids."""
    rapid: Bools
    line: Ints32
    tool: Ints32
    quantities: tuple[Quantity, ...]
    cutting: Bools | None = None
    q_rad: Floats | None = None
    external: Floats | None = None
    """(m, 6) E1 to E6 in mm and degrees, None where no motion is planned."""
    near: Clearance | None = None
    """What comes near what, None where nothing is watched."""
    is_timed: bool = True
    """False where no motion is planned: the time is length over programmed feed."""

    def __len__(self) -> int:
        return len(self.time_s)

    def at(self, rows: Ints) -> "PageSamples":
        """Return some of the samples."""
        if len(rows) == len(self):
            return self
        columns: dict[str, Any] = {
            name: column[rows] for name, column in vars(self).items() if isinstance(column, np.ndarray)
        }
        quantities = tuple(replace(column, values=column.values[rows]) for column in self.quantities)
        near = None if self.near is None else rows_at(self.near, rows)
        return replace(self, quantities=quantities, near=near, **columns)


def samples_of(prediction: Prediction) -> PageSamples | None:
    """Return the samples of a prediction's motion, None where none is planned."""
    motion, toolpath = prediction.motion, prediction.toolpath
    if motion is None:
        return None
    row = np.clip(motion.move, 0, len(toolpath) - 1)
    quantities = [_speed(motion.speed_mm_s)]
    forces, deflection, joints = prediction.forces, prediction.deflection, prediction.joints
    if forces is not None:
        size_N = np.linalg.norm(forces.force_base_N, axis=1)
        quantities.append(Quantity("force", "force", "N", size_N, 0.1))
    if deflection is not None:
        bent_mm = np.linalg.norm(deflection.deflection_base_mm, axis=1)
        quantities.append(Quantity("deflection", "deflection", "mm", bent_mm, 1e-4))
    if joints is not None and np.isfinite(joints.limit_margin_rad).any():
        margin_deg = joints.limit_margin_rad * DEG_PER_RAD
        quantities.append(Quantity("margin", "joint limit margin", "°", margin_deg, 1e-3, is_low_bad=True))
    near = prediction.clearance
    if near is not None:
        label = "least distance"
        quantities.append(Quantity("clearance", label, "mm", near.clearance_mm, 1e-2, is_low_bad=True))
    return PageSamples(
        time_s=motion.time_s,
        position_mm=motion.position_mm,
        speed_mm_s=motion.speed_mm_s,
        feed_mm_s=toolpath.feed_mm_s[row],
        rapid=toolpath.rapid[row],
        line=np.where(motion.move >= 0, toolpath.source_line[row], 0).astype(np.int32),
        tool=motion.tool,
        quantities=tuple(quantities),
        cutting=np.isfinite(forces.phi_rad[:, 0]) if forces is not None else None,
        q_rad=joints.q_rad if joints is not None else None,
        external=motion.external,
        near=near,
    )


def samples_of_path(toolpath: Toolpath, rapid_mm_s: float | None) -> PageSamples | None:
    """Return the programmed points as samples at length over programmed feed; None where there are none."""
    rows = np.flatnonzero(toolpath.is_position() & ~toolpath.machine)
    if not len(rows):
        return None
    position = toolpath.position_mm[rows]
    feed = toolpath.feed_mm_s[rows]
    fastest = rapid_mm_s or float(np.max(feed, where=np.isfinite(feed), initial=1.0))
    speed = np.where(np.isfinite(feed) & (feed > 0.0), feed, fastest)
    length = np.linalg.norm(np.diff(position, axis=0, prepend=position[:1]), axis=1)
    return PageSamples(
        time_s=np.cumsum(length / speed),
        position_mm=position,
        speed_mm_s=speed,
        feed_mm_s=feed,
        rapid=toolpath.rapid[rows],
        line=toolpath.source_line[rows],
        tool=toolpath.tool[rows],
        quantities=(_speed(speed),),
        is_timed=False,
    )


def thinned(samples: PageSamples, most: int = MOST_SAMPLES) -> Ints:
    """Return the rows that are drawn: all, or at most ``most`` with the extremes of every quantity."""
    count = len(samples)
    if count <= most:
        return np.arange(count)
    picks = 2 * len(samples.quantities) + 1
    bins = (most - 2) // picks
    starts = np.arange(bins) * count // bins
    kept = [np.array([0, count - 1]), starts]
    for quantity in samples.quantities:
        for sign in (1.0, -1.0):
            kept.append(
                _extremes(np.where(np.isfinite(quantity.values), sign * quantity.values, -np.inf), starts)
            )
    return np.unique(np.concatenate(kept))


def _extremes(values: Floats, starts: Ints) -> Ints:
    """Return the row of the largest value between each start and the next."""
    largest = np.maximum.reduceat(values, starts)
    owner = np.searchsorted(starts, np.arange(len(values)), side="right") - 1
    hits = np.flatnonzero(values == largest[owner])
    _, first = np.unique(owner[hits], return_index=True)
    return hits[first]


def _speed(speed_mm_s: Floats) -> Quantity:
    return Quantity("speed", "speed", "mm/s", speed_mm_s, 1e-2, is_low_bad=True)
