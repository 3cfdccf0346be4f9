"""The run's own timing: the prediction's samples get the times at which the run was there.

Links behind the path are then compared at the same place, whatever the controller's time law does.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gcode2krl.gap.links import parts_of
from gcode2krl.gap.side import Side
from gcode2krl.gap.timing import late_s

_SAME_LENGTH = 0.02
_STILL = 1e-7
_SMOOTH = 5
_NEGLIGIBLE_S, _FAR_S = 2e-4, 0.05
_ROUNDS = 3


def retimed(side: Side) -> Side:
    """Return the side on the run's own time, by how far the commanded joints have come.

    What is commanded at a place is then compared with what is predicted for that place. Nothing is changed
    where the two paths differ in length by more than 2 %: they are not the same path.
    """
    table = side.run.controller
    if table is None or table.q_cmd_rad is None or not np.isfinite(table.q_cmd_rad).all():
        return side
    inputs, own_s = side.inputs, side.stamps(table)
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(table.q_cmd_rad, axis=0), axis=1))])
    wanted = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(inputs.q_cmd_rad, axis=0), axis=1))])
    if way[-1] <= 0.0 or wanted[-1] <= 0.0 or abs(way[-1] / wanted[-1] - 1.0) > _SAME_LENGTH:
        return side
    # standing still takes time and no way: a little way for every second keeps the order
    along = wanted * (way[-1] / wanted[-1]) + _STILL * inputs.time_s
    time_s = np.interp(along, way + _STILL * own_s, own_s)
    return _at_times(side, time_s)


def refined(side: Side) -> Side:
    """Return the side with its times moved by how late the run is, while that is some hundredths of a second.

    How late it is comes from the commanded joints along the motion; through rests it goes on in a line.
    """
    for _ in range(_ROUNDS):
        parts = parts_of("path", [side])
        if not parts or parts[0].shape[1] < 6:
            return side
        part = parts[0]
        late, moves = late_s(part, part.residual)
        if np.count_nonzero(moves) < _SMOOTH or float(np.abs(late[moves]).max()) < _NEGLIGIBLE_S:
            return side
        if float(np.quantile(np.abs(late[moves]), 0.95)) > _FAR_S:
            return side
        kernel = np.ones(_SMOOTH) / _SMOOTH
        padded = np.pad(np.clip(late[moves], -_FAR_S, _FAR_S), _SMOOTH // 2, mode="edge")
        smooth = np.convolve(padded, kernel, mode="valid")
        now = side.inputs.time_s
        side = _at_times(side, now + np.interp(now, part.time_s[moves], smooth))
    return side


def _at_times(side: Side, time_s: NDArray[np.float64]) -> Side:
    """Return the side with other times of its samples; they are kept in order."""
    inputs = side.inputs
    least = 0.01 * float(np.median(np.diff(inputs.time_s)))
    steps = np.maximum(np.diff(time_s), least)
    time_s = time_s[0] + np.concatenate([[0.0], np.cumsum(steps)])
    motion = None if inputs.motion is None else replace(inputs.motion, time_s=time_s)
    return replace(side, inputs=replace(inputs, time_s=time_s, motion=motion))
