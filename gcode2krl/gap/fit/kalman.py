"""Exact whitening: the innovations of an autoregressive process plus parts that forget exponentially.

State space form: x_t = u_t + Σ_i v_i,t, with u_t = Σ_j a_j·u_{t-1-j} + s·w_t and v_i,t = φ_i·v_i,t-1 + noise,
each v_i of variance σ_i². The Kalman filter, begun in the stationary state, gives the innovations
e_t = x_t - E[x_t | x_0 … x_{t-1}] and their variance S_t; e_t/√S_t are white with unit variance from the
first row on, and Σ log S_t is the log determinant of the covariance (Schweppe 1965; Harvey 1989, ch. 3).
"""

from collections.abc import Sequence

import numba
import numpy as np

from gcode2krl.arrays import Floats, Ints

_SETTLED = 1e-13
"""Relative change of the innovations' variance from which the gain is taken as steady."""
_LEAST_VARIANCE = 1e-300


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
    seen = np.zeros(len(transition))
    seen[0] = 1.0
    seen[order:] = 1.0
    gains: tuple[Floats, Floats] = _riccati(transition, seen, variance, driven, count)
    return gains


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
    poles = np.array([pole for pole, _ in slow])
    feedback = np.zeros(max(len(a), 1))
    feedback[: len(a)] = a
    out: Floats = _filtered(np.ascontiguousarray(values), segments, feedback, poles, gains, 1.0 / np.sqrt(s))
    return out


def _stationary(transition: Floats, scale: float) -> Floats:
    """Return P (m, m) = F·P·Fᵀ + Q of the autoregressive states, Q the variance of the first one."""
    count = len(transition)
    driven = np.zeros(count * count)
    driven[0] = scale**2
    system = np.eye(count * count) - np.kron(transition, transition)
    return np.asarray(np.linalg.solve(system, driven), dtype=np.float64).reshape(count, count)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _riccati(f: Floats, seen: Floats, p: Floats, q: Floats, count: int) -> tuple[Floats, Floats]:
    m = len(f)
    gains, variances = np.empty((count, m)), np.empty(count)
    for t in range(count):
        ph = p @ seen
        s = float(seen @ ph) + _LEAST_VARIANCE
        k = (f @ ph) / s
        gains[t], variances[t] = k, s
        if t > m and abs(s - variances[t - 1]) <= _SETTLED * s:
            return gains[: t + 1].copy(), variances[: t + 1].copy()
        p = f @ p @ f.T + q - s * np.outer(k, k)
        p = 0.5 * (p + p.T)
    return gains, variances


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _filtered(
    values: Floats, segments: Ints, a: Floats, poles: Floats, gains: Floats, weights: Floats
) -> Floats:
    n, columns = values.shape
    order, slow, steady = len(a), len(poles), len(weights) - 1
    out = np.empty((n, columns))
    u = np.zeros((order + 1, columns))
    v = np.zeros((slow, columns))
    e, first = np.empty(columns), np.empty(columns)
    for segment in range(len(segments)):
        u[:], v[:] = 0.0, 0.0
        for t in range(segments[segment, 0], segments[segment, 1]):
            at = min(t - segments[segment, 0], steady)
            k, weight = gains[at], weights[at]
            # column after column innermost: loops that the compiler turns into vectors
            for c in range(columns):
                e[c] = values[t, c] - u[0, c]
                first[c] = u[0, c]
            for i in range(slow):
                for c in range(columns):
                    e[c] -= v[i, c]
            for c in range(columns):
                out[t, c] = e[c] * weight
            for j in range(order):
                for c in range(columns):
                    u[j, c] = a[j] * first[c] + u[j + 1, c] + k[j] * e[c]
            for i in range(slow):
                for c in range(columns):
                    v[i, c] = poles[i] * v[i, c] + k[order + i] * e[c]
    return out
