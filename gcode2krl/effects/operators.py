"""Operators with memory along time: play, first-order lag, second-order mode, reversals; compiled."""

import math

import numba
import numpy as np

from gcode2krl.arrays import Floats

_REVERSAL_RAD = 1e-5
"""An angle that goes back by less is no reversal: it lies within the noise and rounding of an encoder."""
_PLATEAU_RAD = 1e-7


def play(values: Floats, half_width: float) -> Floats:
    """Return the play operator of (m,): follows its input at a distance of at most ``half_width``.

    Starts at the first value, in the middle (Krasnosel'skii and Pokrovskii 1989).
    """
    return _play(np.ascontiguousarray(values), max(half_width, 0.0))


def lag(values: Floats, time_s: Floats, tau_s: float) -> Floats:
    """Return tau·y' + y = x for (m,), from rest; exact for an input whose slope is linear between samples.

    Slopes are central differences; with those of single intervals a lag of a tenth of the step would come out
    half a step late.
    """
    if tau_s <= 0.0:
        return values
    return _lag(np.ascontiguousarray(values), np.ascontiguousarray(time_s), tau_s)


def second_order(values: Floats, time_s: Floats, hz: float, damping: float) -> Floats:
    """Return y'' + 2·zeta·w·y' + w²·y = w²·x for (m,), from rest at the first value.

    Exact for an input that is linear between samples, for 0 <= damping < 1.
    """
    return _second_order(
        np.ascontiguousarray(values), np.ascontiguousarray(time_s), 2.0 * math.pi * hz, damping
    )


def since_reversal(q_rad: Floats, time_s: Floats) -> tuple[Floats, Floats]:
    """Return the direction of motion (m,), ±1 with memory, and the time (m,) since it last reversed.

    Before the first reversal the time is infinite. A reversal is at the sample where the angle, having
    stood or turned, leaves its extreme value, to a part of a sample where three samples show it.
    """
    return _since_reversal(np.ascontiguousarray(q_rad), np.ascontiguousarray(time_s))


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _play(values: Floats, half_width: float) -> Floats:
    out = np.empty_like(values)
    y = values[0] if len(values) > 0 else 0.0
    for i in range(len(values)):
        y = min(max(y, values[i] - half_width), values[i] + half_width)
        out[i] = y
    return out


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _lag(values: Floats, time_s: Floats, tau_s: float) -> Floats:
    out = np.empty_like(values)
    behind = slope = 0.0  # y - x, x'
    last = len(values) - 1
    for i in range(len(values)):
        before, slope = slope, 0.0
        a, b = max(i - 1, 0), min(i + 1, last)
        if time_s[b] > time_s[a]:
            slope = (values[b] - values[a]) / (time_s[b] - time_s[a])
        if i == 0 and last > 1 and time_s[2] > time_s[1] > time_s[0]:  # as a parabola begins
            slope = 2.0 * slope - (values[2] - values[0]) / (time_s[2] - time_s[0])
        dt = time_s[i] - time_s[i - 1] if i > 0 else 0.0
        if dt > 0.0:
            kept = math.exp(-dt / tau_s)
            gone = tau_s * (1.0 - kept)
            behind = behind * kept - before * gone - (slope - before) * (tau_s - tau_s * gone / dt)
        out[i] = values[i] + behind
    return out


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _second_order(values: Floats, time_s: Floats, w: float, zeta: float) -> Floats:
    out = np.empty_like(values)
    decay, ringing = zeta * w, w * math.sqrt(1.0 - zeta * zeta)
    y, speed = values[0] if len(values) > 0 else 0.0, 0.0
    for i in range(len(values)):
        if i > 0:
            dt = time_s[i] - time_s[i - 1]
            slope = (values[i] - values[i - 1]) / dt if dt > 0.0 else 0.0
            # the particular solution for x + slope·t is that line, 2·zeta/w·slope behind
            start = values[i - 1] - 2.0 * zeta / w * slope
            free, free_speed = y - start, speed - slope
            part = (free_speed + decay * free) / ringing
            shrunk, c, s = math.exp(-decay * dt), math.cos(ringing * dt), math.sin(ringing * dt)
            y = start + slope * dt + shrunk * (free * c + part * s)
            speed = slope + shrunk * (
                (part * ringing - decay * free) * c - (free * ringing + decay * part) * s
            )
        out[i] = y
    return out


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _since_reversal(q: Floats, time_s: Floats) -> tuple[Floats, Floats]:
    count = len(q)
    direction, since = np.zeros(count), np.full(count, np.inf)
    if count == 0:
        return direction, since
    sense, extreme, at, began, written = 0.0, q[0], 0, -np.inf, 0
    low, high = q[0], q[0]
    for i in range(1, count):
        if sense == 0.0:  # not yet known which way it goes
            low, high = min(low, q[i]), max(high, q[i])
            if high - low < _REVERSAL_RAD:
                continue
            sense = 1.0 if q[i] == high else -1.0
            extreme, at = q[i], i
            continue
        ahead = sense * (q[i] - extreme)
        if ahead > 0.0:
            extreme = q[i]
        if ahead > -_PLATEAU_RAD:
            at = i
        if ahead < -_REVERSAL_RAD:
            _write(direction, since, time_s, written, at + 1, sense, began)
            written, began, sense = at + 1, _vertex(q, time_s, at), -sense
            extreme, at = q[i], i
    _write(direction, since, time_s, written, count, sense, began)
    return direction, since


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _write(
    direction: Floats, since: Floats, time_s: Floats, start: int, end: int, sense: float, began: float
) -> None:
    for i in range(start, end):
        direction[i] = sense
        since[i] = max(time_s[i] - began, 0.0)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _vertex(q: Floats, time_s: Floats, at: int) -> float:
    """Return the time of the extreme value at a sample: the vertex of the parabola through its neighbours."""
    if at == 0 or at + 1 >= len(q):
        return time_s[at]  # type: ignore[no-any-return]
    before, after = q[at] - q[at - 1], q[at] - q[at + 1]
    if abs(before) < _PLATEAU_RAD or before * after <= 0.0:
        return time_s[at]  # type: ignore[no-any-return]
    part = 0.5 * (before - after) / (before + after)
    return time_s[at] + part * (time_s[at + 1] - time_s[at])  # type: ignore[no-any-return]
