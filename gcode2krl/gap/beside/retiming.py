"""The run's own timing: the prediction's samples get the times at which the run was there.

Links behind the path are then compared at the same place, whatever the controller's time law does.
"""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.beside.timing import late_s

if TYPE_CHECKING:
    from gcode2krl.gap.beside.links.base import Link

_SAME_LENGTH = 0.02
_STILL = 1e-7
_SMOOTH = 5
_NEGLIGIBLE_S, _FAR_S = 2e-4, 0.05
_ROUNDS = 3


def retimed(pair: Pair) -> Pair:
    """Return the pair on the run's own time, by how far the commanded joints have come.

    What is commanded at a place is then compared with what is predicted for that place. Nothing is changed
    where the two paths differ in length by more than 2 %: they are not the same path.
    """
    table = pair.run.controller
    if table is None or table.q_cmd_rad is None or not np.isfinite(table.q_cmd_rad).all():
        return pair
    inputs, own_s = pair.inputs, pair.stamps(table)
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(table.q_cmd_rad, axis=0), axis=1))])
    wanted = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(inputs.q_cmd_rad, axis=0), axis=1))])
    if way[-1] <= 0.0 or wanted[-1] <= 0.0 or abs(way[-1] / wanted[-1] - 1.0) > _SAME_LENGTH:
        return pair
    # standing still takes time and no way: a little way for every second keeps the order
    along = wanted * (way[-1] / wanted[-1]) + _STILL * inputs.time_s
    time_s = np.interp(along, way + _STILL * own_s, own_s)
    return _at_times(pair, time_s)


def refined(pair: Pair, path: "Link") -> Pair:
    """Return the pair with its times moved by how late the run is, while that is some hundredths of a second.

    How late it is comes from the commanded joints along the motion; through rests it goes on in a line.
    """
    for _ in range(_ROUNDS):
        traces = path.traces([pair])
        if not traces or traces[0].shape[1] < 6:
            return pair
        trace = traces[0]
        late, moves = late_s(trace, trace.residual)
        if np.count_nonzero(moves) < _SMOOTH or float(np.abs(late[moves]).max()) < _NEGLIGIBLE_S:
            return pair
        if float(np.quantile(np.abs(late[moves]), 0.95)) > _FAR_S:
            return pair
        kernel = np.ones(_SMOOTH) / _SMOOTH
        padded = np.pad(np.clip(late[moves], -_FAR_S, _FAR_S), _SMOOTH // 2, mode="edge")
        smooth = np.convolve(padded, kernel, mode="valid")
        now = pair.inputs.time_s
        pair = _at_times(pair, now + np.interp(now, trace.time_s[moves], smooth))
    return pair


def _at_times(pair: Pair, time_s: Floats) -> Pair:
    """Return the pair with other times of its samples; they are kept in order."""
    inputs = pair.inputs
    least = 0.01 * float(np.median(np.diff(inputs.time_s)))
    steps = np.maximum(np.diff(time_s), least)
    time_s = time_s[0] + np.concatenate([[0.0], np.cumsum(steps)])
    motion = None if inputs.motion is None else replace(inputs.motion, time_s=time_s)
    return replace(pair, inputs=replace(inputs, time_s=time_s, motion=motion))
