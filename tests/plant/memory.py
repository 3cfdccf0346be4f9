"""Signals with memory: lag, play, friction, hysteresis. One column at a time, integrated at the plant's
step."""

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def lag(x, tau_s, dt_s):
    """First-order lag of a signal that is straight between its samples, exactly; starts settled.

    `tau_s` (n,) may change with time.
    """
    out = np.empty_like(x)
    out[0] = x[0]
    for i in range(1, len(x)):
        tau = tau_s[i]
        if tau <= 1e-9:
            out[i] = x[i]
            continue
        slope = (x[i] - x[i - 1]) / dt_s
        fade = np.exp(-dt_s / tau)
        out[i] = x[i] - tau * slope + (out[i - 1] - x[i - 1] + tau * slope) * fade
    return out


@njit(cache=True, nogil=True)
def second_order(x, hz, damping, dt_s):
    """Response of a mass on a spring and damper to a driving place, settled at the start.

    Semi-implicit steps, a twentieth of the sample each; x is straight between samples.
    """
    out = np.empty_like(x)
    w = 2.0 * np.pi * hz
    fine = 20
    h = dt_s / fine
    y, v = x[0], 0.0
    out[0] = y
    for i in range(1, len(x)):
        for k in range(fine):
            u = x[i - 1] + (x[i] - x[i - 1]) * (k + 0.5) / fine
            v += h * (w * w * (u - y) - 2.0 * damping * w * v)
            y += h * v
        out[i] = y
    return out


@njit(cache=True, nogil=True)
def play(x, half, start):
    """Play with memory: the output is dragged by an input that is more than `half` away.

    `half` (n,) may change with time; `start` in -1 ... 1 is where in the gap the output stands first.
    """
    out = np.empty_like(x)
    y = x[0] + start * half[0]
    for i in range(len(x)):
        y = min(max(y, x[i] - half[i]), x[i] + half[i])
        out[i] = y
    return out


@njit(cache=True, nogil=True)
def reversal_spikes(velocity, spike, decay_s, dt_s, still):
    """-sign(velocity)·spike·exp(-t/decay) after each change of sign; slower than `still` is standing."""
    out = np.zeros_like(velocity)
    last, since = 0.0, 1e9
    for i in range(len(velocity)):
        if abs(velocity[i]) > still:
            sign = 1.0 if velocity[i] > 0.0 else -1.0
            if last != 0.0 and sign != last:
                since = 0.0
            last = sign
        out[i] = -last * spike * np.exp(-since / decay_s)
        since += dt_s
    return out


@njit(cache=True, nogil=True)
def lugre(velocity, breakaway_rad, stribeck_rad_s, extra, dt_s):
    """Friction of elastic bristles (Canudas de Wit et al. 1995) over the Coulomb level.

    Bristles deflect by up to `breakaway_rad`; standing friction is higher by the share `extra`.
    """
    out = np.empty_like(velocity)
    z = 0.0
    fine = 10
    h = dt_s / fine
    for i in range(len(velocity)):
        v = velocity[i]
        limit = breakaway_rad * (1.0 + extra * np.exp(-((v / stribeck_rad_s) ** 2)))
        for _ in range(fine):
            z += h * (v - abs(v) / limit * z)
        z = min(max(z, -2.0 * limit), 2.0 * limit)
        out[i] = z / breakaway_rad
    return out


@njit(cache=True, nogil=True)
def high_pass(x, tau_s, dt_s):
    """Rest of a disturbance behind a controller with an integral part; starts settled."""
    out = np.empty_like(x)
    slow = x[0]
    fade = np.exp(-dt_s / tau_s)
    for i in range(len(x)):
        slow = x[i] + (slow - x[i]) * fade
        out[i] = x[i] - slow
    return out


@njit(cache=True, nogil=True)
def bouc_wen(x, full, sharpness):
    """Hysteretic part in -1 ... 1 of an input of this full scale (Bouc-Wen with n = 1)."""
    out = np.empty_like(x)
    z = 0.0
    out[0] = 0.0
    for i in range(1, len(x)):
        d = (x[i] - x[i - 1]) / full * sharpness
        fine = int(abs(d) / 0.02) + 1
        d /= fine
        for _ in range(fine):
            z += d - 0.5 * (abs(d) * z + d * abs(z))
        out[i] = z
    return out


@njit(cache=True, nogil=True)
def coloured(white, memory):
    """First-order autoregressive noise with the variance of `white`."""
    out = np.empty_like(white)
    out[0] = white[0]
    fresh = np.sqrt(1.0 - memory * memory)
    for i in range(1, len(white)):
        out[i] = memory * out[i - 1] + fresh * white[i]
    return out


@njit(cache=True, nogil=True)
def limited(x, most, hz, dt_s):
    """Place of a drive that follows `x` with a second-order loop, its acceleration at most `most`.

    The command's own acceleration is fed forward, so that without a limit nothing lags.
    """
    out = x.copy()
    w = 2.0 * np.pi * hz
    for i in range(2, len(x)):
        push = (x[i] - 2.0 * x[i - 1] + x[i - 2]) / dt_s**2
        off, before = x[i - 1] - out[i - 1], x[i - 2] - out[i - 2]
        a = push + 1.6 * w * (off - before) / dt_s + w * w * off
        a = min(max(a, -most), most)
        out[i] = 2.0 * out[i - 1] - out[i - 2] + a * dt_s * dt_s
    return out


@njit(cache=True, nogil=True)
def ratchet(load, hold):
    """Steps taken: one each time that a load comes above `hold`, and none back."""
    out = np.zeros_like(load)
    count, above = 0.0, False
    for i in range(len(load)):
        if load[i] > hold and not above:
            count += 1.0
        above = load[i] > 0.9 * hold if above else load[i] > hold
        out[i] = count
    return out
