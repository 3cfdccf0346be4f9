"""Where the time goes, and the worst places of a quantity."""

from dataclasses import dataclass

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints32

_WINDOWS = 60
_SHORTEST_WINDOW_S = 0.5
_WORTH_SAYING = 0.01
"""Share of the whole time from which lost time is worth a word."""
_WORTH_SHOWING = 0.0005
_WORTH_NAMING = 0.04
"""Share of the lost time from which a window is named."""
_APART = 0.02
"""Share of the whole time by which two worst places lie apart."""
_STILL_MM_S = 1e-3
_NEARLY_STILL = 0.05
"""Share of its highest speed from which a ramp begins or to which it goes at a stop: samples may miss it."""


@dataclass(frozen=True)
class NotableSample:
    """A sample that is worth a look."""

    row: int
    value: float
    time_s: float
    line: int


@dataclass(frozen=True)
class Window:
    """A stretch of time in which the tool is slower than programmed."""

    row: int
    start_s: float
    end_s: float
    first_line: int
    last_line: int
    lost_s: float


def durations(time_s: Floats) -> Floats:
    """Return (m,) the time that each sample stands for: half of the way to either neighbour."""
    middle = np.concatenate([time_s[:1], (time_s[1:] + time_s[:-1]) / 2.0, time_s[-1:]])
    return np.diff(middle)


def time_shares(
    time_s: Floats, speed_mm_s: Floats, rapid: Bools, cutting: Bools | None
) -> list[tuple[str, float]]:
    """Return what the time is spent on and how long, in s; the parts add up to the whole, but for those below
    a thousandth."""
    each_s = durations(time_s)
    still = speed_mm_s < _STILL_MM_S
    feed = ~rapid & ~still
    parts = {"rapid": rapid & ~still, "standing still": still}
    if cutting is None:
        parts = {"at feed": feed, **parts}
    else:
        parts = {"cutting": feed & cutting, "at feed in air": feed & ~cutting, **parts}
    sums = {name: float(each_s[mask].sum()) for name, mask in parts.items()}
    return [
        (name, spent_s) for name, spent_s in sums.items() if spent_s > _WORTH_SHOWING * sum(sums.values())
    ]


def lost_time(time_s: Floats, speed_mm_s: Floats, feed_mm_s: Floats) -> Floats:
    """Return (m,) by how much longer each sample takes than at the programmed feed, in s; 0 on rapids.

    What is lost at a sample of speed v is (1 - v/feed) of its time.
    """
    at_feed = np.isfinite(feed_mm_s) & (feed_mm_s > 0.0)
    ratio = np.divide(speed_mm_s, feed_mm_s, out=np.ones(len(time_s)), where=at_feed)
    return durations(time_s) * np.clip(1.0 - ratio, 0.0, 1.0)


def lost_parts(lost_s: Floats, speed_mm_s: Floats) -> list[tuple[str, float]]:
    """Return what of the lost time (m,) is lost on the way into and out of stops, and what elsewhere."""
    slope = np.sign(np.round(np.diff(speed_mm_s), 6))
    if not len(slope):
        return []
    begin = np.flatnonzero(np.append(True, slope[1:] != slope[:-1]))
    end = np.append(begin[1:], len(slope))  # also the last sample of a run of one slope
    first, last = speed_mm_s[begin], speed_mm_s[end]
    is_ramp = np.repeat(np.minimum(first, last) < _NEARLY_STILL * np.maximum(first, last), end - begin)
    at_stop = (speed_mm_s < _STILL_MM_S) | np.append(is_ramp, False) | np.append(False, is_ramp)
    stops_s = float(lost_s[at_stop].sum())
    return [("at stops", stops_s), ("at corners and on short moves", float(lost_s.sum()) - stops_s)]


def is_worth_saying(lost_s: float, whole_s: float) -> bool:
    """Tell whether so much lost time of a whole is worth a word."""
    return lost_s > _WORTH_SAYING * whole_s


def worst_windows(time_s: Floats, lost_s: Floats, line: Ints32, most: int = 3) -> list[Window]:
    """Return the windows in which most time is lost, the worst first."""
    whole_s, whole_lost_s = float(time_s[-1] - time_s[0]), float(lost_s.sum())
    if not is_worth_saying(whole_lost_s, whole_s):
        return []
    width_s = max(whole_s / _WINDOWS, _SHORTEST_WINDOW_S)
    slot = ((time_s - time_s[0]) / width_s).astype(np.int64)
    sums = np.bincount(slot, weights=lost_s)
    moves = []
    for window in np.argsort(-sums, kind="stable")[:most]:
        rows = np.flatnonzero(slot == window)
        if sums[window] < _WORTH_NAMING * whole_lost_s:
            continue
        lines = line[rows][line[rows] > 0]
        first, last = (int(lines.min()), int(lines.max())) if len(lines) else (0, 0)
        worst = int(rows[np.argmax(lost_s[rows])])
        start_s, end_s = float(time_s[rows[0]]), float(time_s[rows[-1]])
        moves.append(Window(worst, start_s, end_s, first, last, float(sums[window])))
    return moves


def worst_places(values: Floats, time_s: Floats, line: Ints32, most: int = 3) -> list[NotableSample]:
    """Return the samples of the largest values, the worst first, apart in time and in different lines."""
    apart_s = _APART * float(time_s[-1] - time_s[0])
    remaining = np.where(np.isfinite(values), values, -np.inf)
    samples: list[NotableSample] = []
    while len(samples) < most:
        row = int(np.argmax(remaining))
        if not np.isfinite(remaining[row]):
            break
        samples.append(NotableSample(row, float(values[row]), float(time_s[row]), int(line[row])))
        remaining[(np.abs(time_s - time_s[row]) <= apart_s) | (line == line[row])] = -np.inf
    return samples
