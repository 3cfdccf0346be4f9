"""Exact whitening: the innovations of an autoregressive process plus parts that forget exponentially.

State space form: x_t = u_t + Σ_i v_i,t, with u_t = Σ_j a_j·u_{t-1-j} + s·w_t and v_i,t = φ_i·v_i,t-1 + noise,
each v_i of variance σ_i². The Kalman filter, begun in the stationary state, gives the innovations
e_t = x_t - E[x_t | x_0 … x_{t-1}] and their variance S_t; e_t/√S_t are white with unit variance from the
first row on, and Σ log S_t is the log determinant of the covariance (Schweppe 1965; Harvey 1989, ch. 3).
"""

from collections.abc import Sequence

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.compiled.core import FLOATS, INT, INTS, OUT_FLOATS, core_function

_gains = core_function("gap_gains", *(FLOATS, FLOATS, OUT_FLOATS, FLOATS), *(OUT_FLOATS,) * 3, returns=INT)
_innovations = core_function(
    "gap_innovations", *(FLOATS, INTS, FLOATS, FLOATS, FLOATS, FLOATS), *(OUT_FLOATS,) * 4
)


def innovation_gains(
    a: Floats, scale: float, slow: Sequence[tuple[float, float]], count: int
) -> tuple[Floats, Floats]:
    """Return gains K (g, m) and variances S (g,) of the first g <= count rows; later rows have the last ones.

    ``slow``: (φ_i, σ_i) of each slow part.
    """
    transition = transition_of(a, slow)
    order = max(len(a), 1)
    variance = np.zeros_like(transition)
    variance[:order, :order] = _stationary(transition[:order, :order], scale)
    driven = np.zeros_like(transition)
    driven[0, 0] = scale**2
    for i, (pole, sigma) in enumerate(slow, start=order):
        variance[i, i] = sigma**2
        driven[i, i] = sigma**2 * (1.0 - pole**2)
    states = len(transition)
    gains, variances = np.empty((count, states)), np.empty(count)
    feedback, poles = _parts(a, slow)
    work = np.empty((states + 1, states))
    steady = _gains(feedback, poles, variance, driven, work, gains, variances)
    return gains[:steady].copy(), variances[:steady].copy()


def _parts(a: Floats, slow: Sequence[tuple[float, float]]) -> tuple[Floats, Floats]:
    """Return the feedback, one zero where there is none, and the poles of the slow parts."""
    feedback = np.zeros(max(len(a), 1))
    feedback[: len(a)] = a
    return feedback, np.array([pole for pole, _ in slow])


def transition_of(a: Floats, slow: Sequence[tuple[float, float]]) -> Floats:
    """Return F (m, m): u in observer form, its first state being u itself, then each slow part."""
    order = max(len(a), 1)
    transition = np.zeros((order + len(slow), order + len(slow)))
    transition[: len(a), 0] = a
    transition[range(order - 1), range(1, order)] = 1.0
    for i, (pole, _) in enumerate(slow, start=order):
        transition[i, i] = pole
    return transition


def innovations(
    values: Floats, segments: Ints, a: Floats, slow: Sequence[tuple[float, float]], gains: Floats, s: Floats
) -> Floats:
    """Return e_t/√S_t of columns (n, c), each segment by itself."""
    feedback, poles = _parts(a, slow)
    values, rows = np.ascontiguousarray(values, dtype=np.float64), np.ascontiguousarray(segments, np.int64)
    out, columns = np.empty_like(values), values.shape[1]
    states = np.empty((len(feedback) + 1, columns)), np.empty((len(poles), columns)), np.empty((2, columns))
    if out.size:
        weights = 1.0 / np.sqrt(s)
        _innovations(values, rows, feedback, poles, gains, weights, *states, out)
    return out


def _stationary(transition: Floats, scale: float) -> Floats:
    """Return P (m, m) = F·P·Fᵀ + Q of the autoregressive states, Q the variance of the first one."""
    count = len(transition)
    driven = np.zeros(count * count)
    driven[0] = scale**2
    system = np.eye(count * count) - np.kron(transition, transition)
    return np.asarray(np.linalg.solve(system, driven), dtype=np.float64).reshape(count, count)
