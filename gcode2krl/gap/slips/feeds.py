"""Feeds of another program: feed moves at another share of their predicted speed than rapids."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects import Inputs
from gcode2krl.gap.beside.commanded import CommandedPath
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.slips


@dataclass(frozen=True)
class _Ratio:
    """Measured over predicted speed on a stretch at the programmed speed."""

    value: float
    rapid: bool


def other_feeds(paths: Sequence[CommandedPath]) -> str | None:
    """Return what shows that feeds are not the predicted ones, as a sentence; None where nothing does.

    An override scales feeds and rapids alike, so the share of feeds is compared with that of rapids. Rapids
    at a smaller share than feeds show nothing: T1 and the limits of the axes slow them down.
    """
    ratios = [ratio for path in paths for ratio in _ratios(path)]
    rapid = np.array([ratio.value for ratio in ratios if ratio.rapid])
    feed = np.array([ratio.value for ratio in ratios if not ratio.rapid])
    if len(rapid) == 0 or len(feed) == 0:
        return None
    of_feed, of_rapid = float(np.median(feed)), float(np.median(rapid))
    spread = float(np.median(np.abs(feed / of_feed - 1.0)))
    slower = of_feed < (1.0 - _LIMITS.feed_other) * of_rapid
    faster = of_feed > 1.0 + _LIMITS.feed_other and abs(of_rapid - 1.0) < _LIMITS.feed_consistent
    if spread > _LIMITS.feed_consistent or not (slower or faster):
        return None
    return (
        f"feed moves at {100.0 * of_feed:.0f} % of the predicted speed, rapid ones at "
        f"{100.0 * of_rapid:.0f} %: the run is of another program"
    )


def _ratios(path: CommandedPath) -> Iterator[_Ratio]:
    """Yield the ratio of speeds on each stretch of constant predicted speed, where the curve is the same."""
    inputs = path.inputs
    steps = np.linalg.norm(np.diff(inputs.position_mm, axis=0), axis=1)
    planned_mm = np.concatenate([[0.0], np.cumsum(steps)])
    length_mm = path.gone_mm[-1]
    same = path.share(path.apart_mm <= path.off_mm) >= _LIMITS.feed_same_curve and planned_mm[-1] > 0.0
    if (
        inputs.toolpath is None
        or not same
        or abs(length_mm / planned_mm[-1] - 1.0) > _LIMITS.feed_same_length
    ):
        return
    gone_mm = path.gone_mm * (planned_mm[-1] / length_mm)
    for start, end in _steady(steps, inputs):
        edge_mm = _LIMITS.feed_edge_share * (planned_mm[end] - planned_mm[start])
        at_mm = np.linspace(planned_mm[start] + edge_mm, planned_mm[end] - edge_mm, 3)
        there_s = np.diff(np.interp(at_mm, planned_mm, inputs.time_s))
        here_s = np.diff(np.interp(at_mm, gone_mm, path.time_s))
        if (here_s > 0.0).all() and abs(here_s[0] / here_s[1] - 1.0) < _LIMITS.feed_constant:
            rapid = bool(inputs.toolpath.rapid[inputs.move[end]])
            yield _Ratio(float(there_s.sum() / here_s.sum()), rapid)


def _steady(steps_mm: Floats, inputs: Inputs) -> Iterator[tuple[int, int]]:
    """Yield the first and last sample of stretches at the programmed speed; steps are (m - 1,).

    A move too short to reach its programmed speed has no such stretch: an override does not change its peak.
    """
    toolpath, targets = inputs.toolpath, inputs.targets
    if toolpath is None or targets is None:
        return
    programmed_mm_s = np.full(len(toolpath.rapid), np.nan)
    of_moves = targets.move >= 0
    programmed_mm_s[targets.move[of_moves]] = targets.speed_mm_s[of_moves]
    speed_mm_s = steps_mm / np.diff(inputs.time_s)
    at_speed = np.abs(speed_mm_s / programmed_mm_s[inputs.move[1:]] - 1.0) < _LIMITS.feed_constant
    same_move = np.append(True, inputs.move[1:-1] == inputs.move[2:])
    starts = at_speed & ~(np.append(False, at_speed[:-1]) & same_move)
    ends = at_speed & ~(np.append(at_speed[1:], False) & np.append(same_move[1:], False))
    for start, end in zip(np.flatnonzero(starts).tolist(), np.flatnonzero(ends).tolist(), strict=True):
        if inputs.time_s[end + 1] - inputs.time_s[start] >= _LIMITS.feed_least_s:
            yield start, end + 1
