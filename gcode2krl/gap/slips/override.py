"""The program ran at another override, by the time that the same path took."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects import Applied, Effect
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.slips.slip import Slip, best_of, motion_traces, slip_if_explained
from gcode2krl.gap.thresholds import THRESHOLDS

_NAME = "override"
_LIMITS = THRESHOLDS.slips


class OverrideTest:
    """Another override: its estimate by the duration is refined by simulating the motion again."""

    effects = (_NAME,)

    def find(self, pairs: Sequence[Pair], library: Mapping[str, Effect]) -> list[Slip]:
        """Return the override, where it is not that of the prediction."""
        effect = library.get(_NAME)
        if effect is None or any(pair.from_log for pair in pairs):
            return []
        percents = [percent for pair in pairs if (percent := _percent(pair)) is not None]
        if not percents or abs(float(np.median(percents)) - 100.0) < _LIMITS.override_off_percent:
            return []
        traces = motion_traces(pairs)
        if not traces:
            return []
        percent = float(np.median(percents))
        tried = percent * np.array(_LIMITS.override_first_tries)
        best, left = best_of(traces, [Applied(effect, None, {"percent": float(each)}) for each in tried])
        for width in _LIMITS.override_widths:
            around = best.values["percent"] * (1.0 + width * np.array([-0.5, 0.0, 0.5, -1.0, 1.0]))
            best, left = best_of(traces, [replace(best, values={"percent": float(each)}) for each in around])
        words = f"the run was at {best.values['percent']:.1f} % override"
        return slip_if_explained(traces, best, left, words)


def _percent(pair: Pair) -> float | None:
    """Return 100 times predicted over measured time in motion; None where paths differ in length."""
    controller, tracker = pair.run.controller, pair.run.tracker
    if controller is not None and controller.path_rad is not None and np.isfinite(controller.path_rad).all():
        measured = _in_motion(controller.time_s, controller.path_rad, _LIMITS.still_rad_s)
        predicted = _in_motion(pair.inputs.time_s, pair.inputs.q_cmd_rad, _LIMITS.still_rad_s)
    elif tracker is not None:
        measured = _in_motion(tracker.time_s, tracker.position_mm, _LIMITS.still_mm_s)
        predicted = _in_motion(pair.inputs.time_s, pair.inputs.position_mm, _LIMITS.still_mm_s)
    else:
        return None
    if measured.seconds <= 0.0 or predicted.seconds <= 0.0:
        return None
    if abs(measured.way / predicted.way - 1.0) > _LIMITS.override_same_length:
        return None
    return 100.0 * predicted.seconds / measured.seconds


class _InMotion(NamedTuple):
    """For how long a signal moves, and how far in its own unit."""

    seconds: float
    way: float


def _in_motion(time_s: Floats, values: Floats, still: float) -> _InMotion:
    """Return for how long values (n, k) move faster than ``still`` a second, and how far."""
    every = max(1, round(_LIMITS.motion_step_s / float(np.median(np.diff(time_s)))))
    way = np.linalg.norm(np.diff(values[::every], axis=0), axis=1)
    step_s = np.diff(time_s[::every])
    moves = way > still * step_s
    return _InMotion(float(step_s[moves].sum()), float(way[moves].sum()))
