"""What instruments within normal mismatch do to a signal, as columns (k, n, c) for one standard deviation."""

from typing import TYPE_CHECKING

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.mismatch import Mismatch, sigma
from gcode2krl.effects.operators import play
from gcode2krl.gap.beside.interpolation import nearest_rows

if TYPE_CHECKING:
    from gcode2krl.gap.beside.trace import Trace

CLOCK, ENCODER_ZERO, PLAY_START = "table clock", "encoder zero", "start of play"
"""Names of several words, so that no effect can have such a name."""
ROUGH = 1e3
"""Standard deviation of a quantity that is never reported, however large, in units of its bound."""
_KNOTS_S, _MOST_KNOTS = 1.0, 120


def _stacked(values: Floats) -> Floats:
    return np.ascontiguousarray(values.T)


def constants(trace: "Trace") -> Floats:
    """Return (k, n, k): column j is one in component j."""
    n, k = trace.shape
    return np.repeat(np.eye(k)[:, None, :], n, axis=1)


def component_columns(values: Floats) -> Floats:
    """Return (k, n, k): column j is component j alone."""
    n, k = values.shape
    columns = np.zeros((k, n, k))
    for j in range(k):
        columns[j, :, j] = values[:, j]
    return columns


def play_start_columns(trace: "Trace", mismatch: Mismatch) -> Floats:
    """Return (k, n, k): where in its play each joint stands when the run begins, even between its ends.

    Until the play has been crossed once (Krasnosel'skii and Pokrovskii 1989); that it is even is assumed.
    """
    inputs, half_rad = trace.inputs, mismatch.play_rad / 2.0
    rows = nearest_rows(inputs.time_s, trace.time_s)
    motor_rad = (inputs.q_cmd_rad if inputs.q_act_rad is None else inputs.q_act_rad)[rows]
    # a row before the first one puts the joint at the end of its play
    at_end = np.vstack([motor_rad[:1] + half_rad, motor_rad])
    begun = [play(at_end[:, j], half_rad)[1:] - play(motor_rad[:, j], half_rad) for j in trace.columns]
    begun_rad = np.nan_to_num(np.stack(begun, axis=1))  # joints without an encoder
    return component_columns(begun_rad * sigma(1.0))


def force_zero_columns(trace: "Trace") -> Floats:
    """Return a unit force along each axis of the sensor, in the frame of the measured values."""
    if trace.in_sensor_frame or trace.in_tool_frame:
        return constants(trace)
    rows = nearest_rows(trace.inputs.time_s, trace.time_s)
    turned = trace.inputs.sensor_rotation[rows]
    return np.ascontiguousarray(np.moveaxis(turned, 0, 1))


def frame_columns(trace: "Trace", mismatch: Mismatch) -> Floats:
    """Return a shift along and a small turn about each axis of ``$BASE``, about the path's middle."""
    position = trace.nominal
    turned = np.zeros((3, len(position), 6))
    for axis in range(3):
        turned[axis, :, axis] = sigma(mismatch.frame_mm)
    arm = position - position.mean(axis=0)
    for axis in range(3):
        turn = np.cross(np.eye(3)[axis], arm)
        turned[:, :, 3 + axis] = turn.T * sigma(mismatch.frame_rad)
    return turned


def clock_columns(trace: "Trace", mismatch: Mismatch) -> Floats:
    """Return (k, n, 1): what the clock of the table does to the signal, to first order."""
    columns: Floats = -_stacked(trace.clock_rate)[:, :, None] * sigma(mismatch.clock_s)
    return columns


def time_law_columns(trace: "Trace", mismatch: Mismatch) -> Floats:
    """Return (k, n, c): the signal's rate times hats over time, for a time law that is slightly off."""
    start, end = trace.time_s[0], trace.time_s[-1]
    knots = np.linspace(start, end, max(2, min(round((end - start) / _KNOTS_S), _MOST_KNOTS) + 1))
    hats = np.maximum(0.0, 1.0 - np.abs(trace.time_s[:, None] - knots) / (knots[1] - knots[0]))
    columns: Floats = -_stacked(trace.rate)[:, :, None] * hats[None]
    return columns * sigma(mismatch.clock_s)
