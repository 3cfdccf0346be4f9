"""Noise of an instrument: a short part, autoregressive, and a slow part that forgets within seconds.

    x_t = u_t + Σ_i v_i,t,    u_t = Σ_j a_j·u_{t-1-j} + s·w_t,    v_i,t = φ_i·v_i,t-1 + σ_i·√(1 - φ_i²)·w'_i,t

v_i is an Ornstein-Uhlenbeck process sampled once a row, of variance σ_i²; its time constant τ is -Δt/log φ_i.
The sum is whitened by its innovations, begun anew in the stationary state at each gap. Data and signatures go
through the same filter; raw data are never differenced.

**Whitening.** The Kalman filter, begun in the stationary state, gives the innovations e_t = x_t - E[x_t | x_0
… x_{t-1}] and their variance S_t; e_t/√S_t are white with unit variance from the first row on, and Σ log S_t
is the log determinant of the covariance (Schweppe 1965; Harvey 1989, ch. 3).

**Narrow lines** of a spectrum are looked for as effects before they count as noise. A line is taken off where
the periodogram stands out of its surroundings by more than noise does in a thousand signals; then the next
strongest, until none is left (the CLEAN of Roberts, Lehár & Dreher 1987, with the exact frequency of each
line).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_discrete_lyapunov

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.compiled.core import FLOATS, INT, INTS, OUT_FLOATS, core_function
from gcode2krl.gap.compare.interpolation import rms
from gcode2krl.gap.thresholds import THRESHOLDS

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
    driven = np.zeros_like(transition)
    driven[0, 0] = scale**2
    short = slice(order), slice(order)
    variance[short] = solve_discrete_lyapunov(transition[short], driven[short], method="direct")
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


_LIMITS = THRESHOLDS.noise
_SETTLED = 500
"""Rows after which nothing is left of a start, with the largest pole allowed."""
_MOST_SETTLING = 4000
"""Rows within which the filter of a slow part is steady."""
_LEAST_LEFT = 0.05
"""Of the power of the lags, along each direction: what the slow part leaves of it to the short part."""
_SHARES = (1.0, 0.8, 0.6, 0.4, 0.2)
"""Of the slow part that is taken off the lags, the largest first that leaves a short part."""
_WINDOW = 20
"""Rows over which powers are compared: a spike of some rows spoils one or two windows."""
_LEAST_WINDOWS = 8
"""Fewer have no median to speak of."""
_LOUD = 1.0 + 5.0 * (2.0 / _WINDOW) ** 0.5
"""Times the median power, five deviations of white noise: a louder window is an event, not the noise."""
_FAR = 9.0
"""The same of values that have a memory, whose power scatters more."""
_ROUNDS = 3
"""In which calm rows and the memory that tells them are found from each other."""


class Slow(NamedTuple):
    """A part of the noise with v[t] = pole·v[t-1] + …, whose rms is ``sigma``."""

    pole: float
    sigma: float


@dataclass(frozen=True)
class Noise:
    """The short part u[t] = sum of a[i]·u[t-1-i] + e[t], e white with ``scale``, and slow parts on top.

    ``a`` (p,); ``short_sigma`` is the rms of the short part.
    """

    a: Floats
    scale: float
    short_sigma: float
    slow: tuple[Slow, ...] = ()
    beyond: float = 0.0
    """What of the short part's rms is beyond what is stated, and not in it."""

    @property
    def sigma(self) -> float:
        """Return the rms of all parts together."""
        return float(np.sqrt(self.short_sigma**2 + sum(each.sigma**2 for each in self.slow)))

    @cached_property
    def _gains(self) -> tuple[Floats, Floats]:
        return innovation_gains(self.a, self.scale, self.slow, _MOST_SETTLING)

    def whiten(self, values: Floats, segments: Ints) -> Floats:
        """Return (n, c) filtered to white noise of unit variance, each segment by itself."""
        gains, variances = self._gains
        return innovations(values, segments, self.a, self.slow, gains, variances)

    def calm_rows(self, values: Floats, segments: Ints) -> Bools:
        """Return which rows (n,) of values (n,) are, whitened, about as loud as the median window."""
        white_, calm = self.whiten(values[:, None], segments)[:, 0], np.ones(len(values), dtype=np.bool_)
        lengths = segments[:, 1] - segments[:, 0]
        windows = np.concatenate([np.arange(count) // _WINDOW for count in lengths])
        firsts = np.repeat(np.cumsum([0, *(-(-lengths[:-1] // _WINDOW))]), lengths)
        rows = np.concatenate([np.arange(first, last) for first, last in segments])
        calm[rows] = _calm(white_[rows], windows + firsts, _LOUD, 0.0)
        return calm

    def autocovariance(self, count: int) -> Floats:
        """Return E[x[t]·x[t+k]] for k = 0 … count - 1, the short part scaled to its rms."""
        short = _short_autocovariance(self.a, count)
        covariance: Floats = self.short_sigma**2 * short / short[0]
        lags = np.arange(count)
        for part in self.slow:
            covariance = covariance + part.sigma**2 * part.pole**lags
        return covariance


def white(sigma: float) -> Noise:
    """Return noise without memory."""
    return Noise(np.zeros(0), sigma, sigma)


def fit(
    residuals: Sequence[tuple[Floats, Ints]],
    floor: float,
    slow: Sequence[tuple[Floats, Ints]] = (),
    order: int = _LIMITS.noise_order,
    *,
    every_row: bool = False,
) -> Noise:
    """Return the short part of some residuals (n,) with their segments, by least squares over calm rows.

    Windows of rows that are far louder than the median one are events and take no part (`calm_rows`), but
    where ``every_row`` counts.
    ``floor``: smallest rms, from the last decimal of the data; noise is never taken to be less. ``slow``:
    draws of the slow part; the power of their lags is taken off that of the residuals.
    """
    lagged, windows = _lagged(residuals, order)
    if len(lagged) < _LIMITS.noise_least_rows:
        values = np.concatenate([values for values, _ in residuals]) if residuals else np.zeros(1)
        return white(max(rms(values), floor))
    if not every_row:
        lagged = lagged[calm_rows(lagged, windows, floor)]
    products = lagged.T @ lagged / len(lagged)
    if slow:
        drawn, _ = _lagged(slow, order)
        products = products - _share_off(products, drawn) * (drawn.T @ drawn) / len(drawn)
    power = float(products[0, 0])
    sigma = max(float(np.sqrt(power)), floor)
    # a tenth of the floor's power: colour is not learnt from the rounding of decimals
    x, y = products[1:, 1:], products[1:, 0]
    ridge = 1e-6 * float(np.trace(x)) + floor**2 * 0.1 + 1e-30
    a = _stable(np.asarray(np.linalg.solve(x + ridge * np.eye(order), y), dtype=np.float64))
    power_left = float(products[0, 0] - 2.0 * a @ y + a @ x @ a)
    scale = max(float(np.sqrt(max(power_left, 0.0))), _LIMITS.noise_least_scale * floor)
    return Noise(a, scale, max(sigma, scale))


def _lagged(residuals: Sequence[tuple[Floats, Ints]], order: int) -> tuple[Floats, Ints]:
    """Return rows (m, 1 + order) of each value and those before it, and the number (m,) of their window."""
    rows, windows, count = [np.zeros((0, 1 + order))], [np.zeros(0, dtype=np.int64)], 0
    for values, segments in residuals:
        for first, last in segments:
            x = values[first:last]
            if len(x) > order + 1:
                rows.append(np.stack([x[order - i : len(x) - i] for i in range(order + 1)], axis=1))
                windows.append(count + np.arange(len(x) - order) // _WINDOW)
                count = int(windows[-1][-1]) + 1
    return np.concatenate(rows), np.concatenate(windows)


def calm_rows(lagged: Floats, windows: Ints, floor: float = 0.0) -> Bools:
    """Return which rows (m,) of values and those before them are in windows about as loud as the median one.

    Compared are the differences of neighbours, then what the memory of the calm rows leaves: both are nearly
    white, so that no slow part hides a spike or is taken for one.
    """
    differences = lagged[:, 0] - lagged[:, 1]
    near = _calm(lagged[:, 0], windows, _FAR, floor)
    calm = near & _calm(differences, windows, _LOUD, floor)
    for _ in range(_ROUNDS):
        x, y = lagged[calm, 1:], lagged[calm, 0]
        gram = x.T @ x
        ridge = 1e-6 * float(np.trace(gram)) + 1e-30
        a = np.linalg.solve(gram + ridge * np.eye(x.shape[1]), x.T @ y)
        calm = near & _calm(lagged[:, 0] - lagged[:, 1:] @ a, windows, _LOUD, floor)
    return calm if np.count_nonzero(calm) >= _LIMITS.noise_least_rows else np.ones_like(calm)


def _calm(values: Floats, windows: Ints, most: float, floor: float) -> Bools:
    """Return which rows (m,) are in windows of at most so many times the median mean square."""
    counts = np.bincount(windows)
    if len(counts) < _LEAST_WINDOWS:
        return np.ones(len(values), dtype=np.bool_)
    powers = np.bincount(windows, weights=values**2) / counts
    scatter = np.maximum(_WINDOW / counts, 1.0)  # windows of few rows scatter more
    return (powers <= most * scatter * max(float(np.median(powers)), floor**2))[windows]


def _share_off(products: Floats, drawn: Floats) -> float:
    """Return how much of the slow part's lags may be taken off so that a short part is left."""
    off = drawn.T @ drawn / max(len(drawn), 1)
    differences = np.eye(len(products))[:-1] - np.eye(len(products))[1:]
    for share in _SHARES:
        cleaned = products - share * off
        # what the slow part hardly has is left whole: the differences of neighbours
        least = _LEAST_LEFT * np.trace(differences @ products @ differences.T) / (2.0 * len(differences))
        if np.linalg.eigvalsh(cleaned)[0] > 0.0 and cleaned[0, 0] > least:
            return share
    return 0.0


def drawn_noise(noise: Noise, count: int, generator: np.random.Generator) -> Floats:
    """Return noise (count,) of a model, in its steady state."""
    from scipy.signal import lfilter

    white_ = noise.scale * generator.standard_normal(count + _SETTLED)
    drawn: Floats = lfilter([1.0], np.concatenate([[1.0], -noise.a]), white_)[_SETTLED:]
    for part in noise.slow:
        drawn = drawn + drawn_slow(part, count, generator)
    return drawn


def drawn_slow(slow: Slow, count: int, generator: np.random.Generator) -> Floats:
    """Return a slow part (count,), in its steady state."""
    from scipy.signal import lfilter

    w = generator.standard_normal(count)
    w[1:] *= np.sqrt(1.0 - slow.pole**2)
    drawn: Floats = lfilter([1.0], [1.0, -slow.pole], slow.sigma * w)
    return drawn


def at_most(noise: Noise, sigma: float) -> Noise:
    """Return a model whose short part has no more than this rms, white where it was larger.

    The rest may be structure, which families find; its size alone is a noisy instrument (`Noise.beyond`).
    What an instrument states is its short noise: the slow part has a bound of its own.
    """
    short = noise
    if noise.short_sigma > sigma:
        beyond = float(np.sqrt(noise.short_sigma**2 - sigma**2))
        short = replace(white(sigma), slow=noise.slow, beyond=beyond)
    most = _LIMITS.noise_most_slow * short.short_sigma
    return replace(short, slow=tuple(Slow(pole, min(sigma, most)) for pole, sigma in short.slow))


def unbiased(noise: Noise, of_drawn: Noise, floor: float) -> Noise:
    """Return a model, its short part corrected by the model that noise drawn from it came out as."""
    if len(noise.a) != len(of_drawn.a) or len(noise.a) == 0:
        return noise
    a = _stable(2.0 * noise.a - of_drawn.a)
    scale = max(noise.scale**2 / of_drawn.scale, _LIMITS.noise_least_scale * floor)
    steady = float(np.sqrt(_short_autocovariance(noise.a, 1)[0])) * noise.scale
    sigma = max(noise.short_sigma * steady / of_drawn.short_sigma, floor, scale)
    return Noise(a, scale, sigma, noise.slow)


def _short_autocovariance(a: Floats, count: int) -> Floats:
    """Return the autocovariance (count,) of the short part for white e of unit variance.

    By its pulse response, of which nothing is left after `_SETTLED` rows.
    """
    from scipy.signal import lfilter

    pulse = np.zeros(2 * _SETTLED)
    pulse[0] = 1.0
    h = lfilter([1.0], np.concatenate([[1.0], -a]), pulse)
    covariance = np.zeros(count)
    for k in range(min(count, _SETTLED)):
        covariance[k] = h[: len(h) - k] @ h[k:]
    return covariance


def _stable(a: Floats) -> Floats:
    """Return the coefficients with all poles within the largest that is allowed."""
    largest = float(np.abs(np.roots(np.append(1.0, -a))).max(initial=0.0))
    most = _LIMITS.noise_largest_pole
    if largest <= most:
        return a
    return a * (most / largest) ** np.arange(1, len(a) + 1)


_PADDED = 4
_AROUND = 60
"""Bins on either side whose median is the level of the noise."""
_LEAST_ROWS = 256


def without_lines(values: Floats) -> Floats:
    """Return values (n,) at equal times less the tones in them."""
    if len(values) < _LEAST_ROWS:
        return values
    for _ in range(_LIMITS.noise_most_lines):
        turns = _strongest_line(values)
        if turns is None:
            break
        angle = 2.0 * np.pi * turns * np.arange(len(values))
        tone = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        values = values - tone @ np.linalg.lstsq(tone, values, rcond=None)[0]
    return values


def _strongest_line(values: Floats) -> float | None:
    """Return the frequency, in turns a row, of the line that stands out most; None where none does."""
    from scipy.ndimage import median_filter

    count = len(values)
    power = np.abs(np.fft.rfft(values)) ** 2
    # a median of exponentially distributed power is log 2 of its mean
    level = median_filter(power, size=2 * _AROUND + 1, mode="reflect") / np.log(2.0)
    above = power / np.maximum(level, 1e-300)
    strongest = int(np.argmax(above[1:-1])) + 1
    if above[strongest] < np.log(len(power) / _LIMITS.noise_false_lines):
        return None
    # between the bins, by the zero-padded spectrum
    fine = np.abs(np.fft.rfft(values, _PADDED * count)) ** 2
    near = slice(max(_PADDED * (strongest - 1), 1), _PADDED * (strongest + 1) + 1)
    peak = near.start + int(np.argmax(fine[near]))
    before, middle, right = fine[peak - 1], fine[peak], fine[min(peak + 1, len(fine) - 1)]
    bend = before - 2.0 * middle + right
    off = 0.5 * (before - right) / bend if bend < 0.0 else 0.0
    return float((peak + np.clip(off, -0.5, 0.5)) / (_PADDED * count))
