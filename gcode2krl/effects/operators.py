"""Operators with memory along time: play, lag, second-order mode, limited drive, reversals; compiled."""

import math

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.compiled.core import FLOAT, FLOATS, OUT_FLOATS, core_function

_play = core_function("effects_play", FLOATS, FLOAT, OUT_FLOATS)
_lag = core_function("effects_lag", FLOATS, FLOATS, FLOAT, OUT_FLOATS)
_second_order = core_function("effects_second_order", FLOATS, FLOATS, FLOAT, FLOAT, OUT_FLOATS)
_limited = core_function("effects_limited", FLOATS, FLOATS, FLOAT, FLOAT, OUT_FLOATS)
_since_reversal = core_function("effects_since_reversal", FLOATS, FLOATS, OUT_FLOATS, OUT_FLOATS)


def play(values: Floats, half_width: float) -> Floats:
    """Return the play operator of (m,): follows its input at a distance of at most ``half_width``.

    Starts at the first value, in the middle (Krasnosel'skii and Pokrovskii 1989).
    """
    values = _column(values)
    out = np.empty_like(values)
    _play(values, max(half_width, 0.0), out)
    return out


def lag(values: Floats, time_s: Floats, tau_s: float) -> Floats:
    """Return tau·y' + y = x for (m,), from rest; exact for an input that is a cubic between samples.

    Slopes are central differences; with those of single intervals a lag of a tenth of the step would come out
    half a step late.
    """
    if tau_s <= 0.0:
        return values
    values = _column(values)
    out = np.empty_like(values)
    _lag(values, _column(time_s), tau_s, out)
    return out


def delayed(values: Floats, time_s: Floats, delay_s: float) -> Floats:
    """Return y(t) = x(t - delay) of the columns of (m, c), the ends held; x is a cubic between samples.

    ``values`` (m, c) at ``time_s`` (m,) in s. Its slopes are central differences, as those of `lag`; at a
    kink it may overshoot. Straight between samples, half a step of delay would bend corners as much as a lag
    does.
    """
    from scipy.interpolate import CubicHermiteSpline

    at_s = np.clip(time_s - delay_s, time_s[0], time_s[-1])
    late: Floats = CubicHermiteSpline(time_s, values, np.gradient(values, time_s, axis=0))(at_s)
    return late


def second_order(values: Floats, time_s: Floats, hz: float, damping: float) -> Floats:
    """Return y'' + 2·zeta·w·y' + w²·y = w²·x for (m,), from rest at the first value.

    Exact for an input that is linear between samples, for 0 <= damping < 1.
    """
    values = _column(values)
    out = np.empty_like(values)
    _second_order(values, _column(time_s), 2.0 * math.pi * hz, damping, out)
    return out


def limited(values: Floats, time_s: Floats, limit: float, k_v_per_s: float) -> Floats:
    """Return what follows (m,) with an acceleration of at most ``limit``, the values themselves within it.

    It begins with what is commanded. Beyond the limit it falls behind; a critically damped loop on distance
    and speed brings it back, at a speed that a fifth of the limit can brake.
    """
    values = _column(values)
    out = np.empty_like(values)
    _limited(values, _column(time_s), max(limit, 0.0), k_v_per_s, out)
    return out


def since_reversal(q_rad: Floats, time_s: Floats) -> tuple[Floats, Floats]:
    """Return the direction of motion (m,), ±1 with memory, and the time (m,) since it last reversed.

    Before the first reversal the time is infinite. A reversal is at the sample where the angle, having
    stood or turned, leaves its extreme value, to a part of a sample where three samples show it.
    """
    direction, since_s = np.zeros(len(q_rad)), np.full(len(q_rad), np.inf)
    _since_reversal(_column(q_rad), _column(time_s), direction, since_s)
    return direction, since_s


def _column(values: Floats) -> Floats:
    return np.ascontiguousarray(values, dtype=np.float64)
