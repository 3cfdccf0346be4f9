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
from gcode2krl.gap.beside.stretches import stretches_of
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.fit.likelihood import Likelihood
from gcode2krl.gap.fit.noise import Noise
from gcode2krl.gap.fit.nuisance import Nuisance
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.choose
_NORMAL_MAD = 1.4826
"""The standard deviation of a normal over its median absolute deviation."""
_LEAST_STRETCHES = 3


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
    def power(self) -> float:
        """Return the power of the gap before the effects over that of the noise."""
        return self.excess_before / max(self.noise, 1e-30)

    @property
    def significant(self) -> bool:
        """Tell whether what is left is more than noise and mismatch."""
        least = max(_LIMITS.significant_sigma * self.deviation, _LIMITS.significant_share * self.noise)
        return self.excess > least

    @property
    def share_left(self) -> float:
        """Return what is left of the structured gap, 0 to 1."""
        return float(np.clip(self.excess / max(self.excess_before, 1e-30), 0.0, 1.0))

    @property
    def shrink(self) -> float:
        """Return the share of the explainable gap that is gone, 0 to 1 (docs/diagnose.md)."""
        gap, left = self.before - self.floor, self.after - self.floor
        return float(np.clip(1.0 - left / gap, 0.0, 1.0)) if gap > 0.0 else 0.0


def pooled(sizes: Sequence[Size]) -> Size:
    """Return the mean over splits, each by its rows."""
    rows = sum(size.rows for size in sizes)

    def mean(values: Sequence[float]) -> float:
        return sum(value * size.rows for value, size in zip(values, sizes, strict=True)) / rows

    return Size(
        rows=rows,
        before=mean([size.before for size in sizes]),
        after=mean([size.after for size in sizes]),
        floor=mean([size.floor for size in sizes]),
        noise=mean([size.noise for size in sizes]),
        excess=mean([size.excess for size in sizes]),
        excess_before=mean([size.excess_before for size in sizes]),
        deviation=mean([size.deviation for size in sizes]) / len(sizes) ** 0.5,
        largest_before=max(size.largest_before for size in sizes),
        largest_after=max(size.largest_after for size in sizes),
    )


def size_of_gap(
    traces: Sequence[Trace],
    nuisance: Sequence[Sequence[Nuisance]],
    noise: Sequence[Noise],
    applied: Sequence[Applied],
    usual: Sequence[Applied] = (),
) -> Size:
    """Return the size of the gap of some traces with and without effects; ``usual`` are normal mismatch."""
    left = [trace.measured - trace.sample([*usual, *applied]) for trace in traces]
    gap = [trace.measured - trace.sample(usual) for trace in traces]
    own, shared = _mismatch(Likelihood(traces, nuisance, noise), left)
    # clocks, frames and zeros within normal mismatch are taken out of the data, before and after alike
    after, before = _less(left, own), _less(gap, own)
    sigma2 = sum(each.sigma**2 for each in noise)
    structured = _less(after, shared)
    return Size(
        rows=sum(len(each) for each in after),
        before=_mean_square(before),
        after=_mean_square(after),
        floor=sigma2 + _mean_square(shared),
        noise=sigma2,
        excess=_mean_square(structured) - sigma2,
        excess_before=_mean_square(_less(before, shared)) - sigma2,
        deviation=_deviation(traces, [_squares(each) for each in structured], sigma2),
        largest_before=_largest(before),
        largest_after=_largest(after),
    )


def _less(values: Sequence[Floats], others: Sequence[Floats]) -> list[Floats]:
    return [value - other for value, other in zip(values, others, strict=True)]


def _squares(values: Floats) -> Floats:
    """Return the squared lengths (n,) of rows."""
    squares: Floats = np.sum(values**2, axis=1)
    return squares


def _mean_square(values: Sequence[Floats]) -> float:
    return float(np.mean(np.concatenate([_squares(each) for each in values])))


def _largest(values: Sequence[Floats]) -> float:
    return max(float(np.sqrt(_squares(each)).max()) for each in values)


def _mismatch(likelihood: Likelihood, residuals: Sequence[Floats]) -> tuple[list[Floats], list[Floats]]:
    """Return what nuisance adds to each trace (n, k): that of its own run, and that of all runs.

    No coefficient leaves its bounds: what is beyond them is a gap.
    """
    design = likelihood.design
    b = likelihood.nuisance_of(likelihood.whiten(residuals))
    is_shared = np.arange(design.width) < design.shared
    own, shared = (
        [
            design.effect(number, trace, np.where(chosen, b, 0.0))
            for number, trace in enumerate(likelihood.traces)
        ]
        for chosen in (~is_shared, is_shared)
    )
    return own, shared


def _deviation(traces: Sequence[Trace], squares: Sequence[Floats], sigma2: float) -> float:
    """Return the standard deviation of the mean square, from its spread over stretches of time."""
    stretches = [_stretch_means(trace, values) for trace, values in zip(traces, squares, strict=True)]
    means, counts = (np.concatenate(each) for each in zip(*stretches, strict=True))
    if len(means) < _LEAST_STRETCHES:
        return sigma2
    mean = float(np.average(means, weights=counts))
    # robust, since a gap in a few stretches must not hide itself
    spread = _NORMAL_MAD * float(np.median(np.abs(means - np.median(means))))
    least = _LIMITS.least_spread * abs(mean) / np.sqrt(len(means))
    return float(max(spread, least) / np.sqrt(len(means)))


def _stretch_means(trace: Trace, values: Floats) -> tuple[Floats, Floats]:
    """Return the means (g,) of values (n,) over the stretches of a trace, and their counts."""
    number = stretches_of(trace)
    number = number - number.min()
    count = np.bincount(number)
    sums = np.bincount(number, weights=values)
    return sums[count > 0] / count[count > 0], count[count > 0].astype(np.float64)
