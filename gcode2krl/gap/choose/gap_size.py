"""How large a gap is in the instrument's units, before and after effects, and what of it is noise.

Clocks, frames and zeros of one run are fitted within their bounds and taken out. With b the mismatch of
machine and tool that fits the rest best within its bounds and sigma the noise, the floor is
sqrt(sigma² + |N·b|²).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects import Applied
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.fit.gram import stretches_of
from gcode2krl.gap.fit.likelihood import Likelihood
from gcode2krl.gap.fit.noise import Noise
from gcode2krl.gap.fit.nuisance import Nuisance

SIGNIFICANT_SIGMA = 4.0
"""Excess power over its own standard deviation (by stretches of time): one in 30,000 by chance."""
LEAST_SHARE = 0.1
"""Excess power below this share of the noise's is within what the noise model is sure of."""


@dataclass(frozen=True)
class Size:
    """Mean squares over some rows, in the inner unit."""

    rows: int
    before: float
    after: float
    floor: float
    """Noise and normal mismatch."""
    noise: float
    excess: float
    """What is left beyond noise and mismatch, after the effects."""
    excess_before: float
    deviation: float
    """Standard deviation of the excess."""
    largest_before: float
    largest_after: float

    @property
    def significant(self) -> bool:
        """Tell whether what is left is more than noise and mismatch."""
        return self.excess > max(SIGNIFICANT_SIGMA * self.deviation, LEAST_SHARE * self.noise)

    @property
    def share_left(self) -> float:
        """Return what is left of the structured gap, 0 to 1."""
        return float(np.clip(self.excess / max(self.excess_before, 1e-30), 0.0, 1.0))

    @property
    def shrink(self) -> float:
        """Return the share of the explainable gap that is gone (gap.md)."""
        gap, left = self.before - self.floor, self.after - self.floor
        return float(np.clip(1.0 - left / gap, 0.0, 1.0)) if gap > 0.0 else 0.0


def size_of_gap(
    traces: Sequence[Trace], nuisance: Sequence[Sequence[Nuisance]], noise: Sequence[Noise],
    applied: Sequence[Applied], usual: Sequence[Applied] = (),
) -> Size:  # fmt: skip
    """Return the size of the gap of some traces with and without effects; ``usual`` are normal mismatch."""
    everything = [*usual, *applied]
    with_all = [trace.sample(everything) for trace in traces]
    with_usual = [trace.sample(usual) for trace in traces] if usual else [trace.nominal for trace in traces]
    own, shared = _nuisance(traces, nuisance, noise, [
        trace.measured - model for trace, model in zip(traces, with_all, strict=True)
    ])  # fmt: skip
    # clocks, frames and zeros within normal mismatch are taken out of the data, before and after alike
    after = [trace.measured - m - o for trace, m, o in zip(traces, with_all, own, strict=True)]
    before = [trace.measured - m - o for trace, m, o in zip(traces, with_usual, own, strict=True)]
    rows = sum(len(each) for each in after)
    sigma2 = sum(each.sigma**2 for each in noise)
    squares = [np.sum((a - s) ** 2, axis=1) for a, s in zip(after, shared, strict=True)]
    excess = float(np.mean(np.concatenate(squares))) - sigma2
    floor = sigma2 + _mean_square(shared)
    excess_before = _mean_square([a - s for a, s in zip(before, shared, strict=True)]) - sigma2
    return Size(
        rows=rows,
        before=_mean_square(before),
        after=_mean_square(after),
        floor=floor,
        noise=sigma2,
        excess=excess,
        excess_before=excess_before,
        deviation=_deviation(traces, squares, sigma2),
        largest_before=max(float(np.sqrt(np.sum(each**2, axis=1)).max()) for each in before),
        largest_after=max(float(np.sqrt(np.sum(each**2, axis=1)).max()) for each in after),
    )


def _mean_square(values: Sequence[Floats]) -> float:
    return float(np.mean(np.concatenate([np.sum(each**2, axis=1) for each in values])))


def _nuisance(
    traces: Sequence[Trace], nuisance: Sequence[Sequence[Nuisance]], noise: Sequence[Noise],
    residuals: Sequence[Floats],
) -> tuple[list[Floats], list[Floats]]:  # fmt: skip
    """Return what nuisance adds to each trace (n, k): that of its own run, and that of all runs.

    No coefficient leaves its bounds: what is beyond them is a gap.
    """
    target = Likelihood(traces, nuisance, noise)
    b = target.nuisance_of(target.whiten(residuals))
    width = target.shared_width
    own, shared = [], []
    for trace, wide in zip(traces, target.raw(nuisance), strict=True):
        n, k = trace.shape
        own.append((wide[:, width:] @ b[width:]).reshape(k, n).T)
        shared.append((wide[:, :width] @ b[:width]).reshape(k, n).T)
    return own, shared


def _deviation(traces: Sequence[Trace], squares: Sequence[Floats], sigma2: float) -> float:
    """Return the standard deviation of the mean square, from its spread over stretches of time."""
    means, counts = [], []
    for trace, values in zip(traces, squares, strict=True):
        number = stretches_of(trace)
        number = number - number.min()
        count = np.bincount(number)
        sums = np.bincount(number, weights=values)
        means.append(sums[count > 0] / count[count > 0])
        counts.append(count[count > 0])
    m, c = np.concatenate(means), np.concatenate(counts)
    if len(m) < 3:
        return sigma2
    mean = float(np.average(m, weights=c))
    # robust, since a gap in a few stretches must not hide itself
    spread = 1.4826 * float(np.median(np.abs(m - np.median(m))))
    return float(max(spread, 0.1 * abs(mean) / np.sqrt(len(m))) / np.sqrt(len(m)))
