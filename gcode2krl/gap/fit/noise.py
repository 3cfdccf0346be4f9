"""Coloured noise: an autoregressive model, the filter that whitens, and where the model comes from.

Data and signatures go through the same filter, which starts anew at each gap; raw data are never differenced.
The model is that of short memory: what an instrument does over a second and longer is told from the part's
structure only by comparing runs of one program.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.fit
_SETTLED = 500
"""Rows after which nothing is left of a start, with the largest pole allowed."""


@dataclass(frozen=True)
class Noise:
    """x[t] = sum of a[i]·x[t-1-i] + e[t], e white with ``scale``; ``sigma`` is the rms of x."""

    a: Floats
    scale: float
    sigma: float

    def whiten(self, values: Floats, segments: Ints) -> Floats:
        """Return (n, c) filtered to white noise of unit variance, each segment by itself.

        The first rows of a segment are scaled by the rms alone, as what was before them is not known.
        """
        out = values / self.scale
        for lag, a in enumerate(self.a, start=1):
            out[lag:] -= (a / self.scale) * values[:-lag]
        for first, last in segments:
            head = slice(first, min(first + len(self.a), last))
            out[head] = values[head] / max(self.sigma, self.scale)
        return out


def white(sigma: float) -> Noise:
    """Return noise without memory."""
    return Noise(np.zeros(0), sigma, sigma)


def fit(residuals: Sequence[tuple[Floats, Ints]], floor: float, order: int = _LIMITS.noise_order) -> Noise:
    """Return the model of some residuals (n,) with their segments, by least squares over all of them.

    ``floor``: smallest rms, from the last decimal of the data; noise is never taken to be less.
    """
    past, now = [], []
    for values, segments in residuals:
        for first, last in segments:
            x = values[first:last]
            if len(x) > order + 1:
                past.append(np.stack([x[order - i - 1 : len(x) - i - 1] for i in range(order)], axis=1))
                now.append(x[order:])
    everything = np.concatenate([values for values, _ in residuals]) if residuals else np.zeros(1)
    rms = max(float(np.sqrt(np.mean(everything**2))), floor)
    if sum(len(each) for each in now) < _LIMITS.noise_least_rows:
        return white(rms)
    x, y = np.concatenate(past), np.concatenate(now)
    # a tenth of the floor's power: colour is not learnt from the rounding of decimals
    ridge = 1e-6 * float(np.sum(x**2)) + len(y) * floor**2 * 0.1 + 1e-30
    a = _stable(np.asarray(np.linalg.solve(x.T @ x + ridge * np.eye(order), x.T @ y), dtype=np.float64))
    scale = max(float(np.sqrt(np.mean((y - x @ a) ** 2))), _LIMITS.noise_least_scale * floor)
    return Noise(a, scale, max(rms, scale))


def drawn_noise(noise: Noise, count: int, generator: np.random.Generator) -> Floats:
    """Return noise (count,) of a model, in its steady state."""
    from scipy.signal import lfilter

    white_ = noise.scale * generator.standard_normal(count + _SETTLED)
    drawn: Floats = lfilter([1.0], np.concatenate([[1.0], -noise.a]), white_)[_SETTLED:]
    return drawn


def at_most(noise: Noise, sigma: float) -> Noise:
    """Return a model of no more than this rms, white where it was larger: the rest is structure."""
    return noise if noise.sigma <= sigma else white(sigma)


def unbiased(noise: Noise, of_drawn: Noise, floor: float) -> Noise:
    """Return a model, corrected by the model that noise drawn from it came out as."""
    if len(noise.a) != len(of_drawn.a) or len(noise.a) == 0:
        return noise
    a = _stable(2.0 * noise.a - of_drawn.a)
    scale = max(noise.scale**2 / of_drawn.scale, _LIMITS.noise_least_scale * floor)
    steady = _gain(noise.a) * noise.scale
    sigma = max(noise.sigma * steady / of_drawn.sigma, floor, scale)
    return Noise(a, scale, sigma)


def _gain(a: Floats) -> float:
    """Return the rms of x for white e of unit variance, by its impulse response."""
    from scipy.signal import lfilter

    pulse = np.zeros(_SETTLED)
    pulse[0] = 1.0
    return float(np.sqrt(np.sum(lfilter([1.0], np.concatenate([[1.0], -a]), pulse) ** 2)))


def _stable(a: Floats) -> Floats:
    """Return the coefficients with all poles within the largest that is allowed."""
    companion = np.zeros((len(a), len(a)))
    companion[0] = a
    companion[1:, :-1] = np.eye(len(a) - 1)
    largest = float(np.abs(np.linalg.eigvals(companion)).max())
    most = _LIMITS.noise_largest_pole
    if largest <= most:
        return a
    shrunk: Floats = a * (most / largest) ** np.arange(1, len(a) + 1)
    return shrunk
