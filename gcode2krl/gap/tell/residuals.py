"""What is left of every run of a judged link, before and after its named causes; of what the gap is made."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.choose.gap_size import fitted_mismatch
from gcode2krl.gap.choose.judged import Judgement
from gcode2krl.gap.fit.design import nuisance_for
from gcode2krl.gap.fit.likelihood import Likelihood
from gcode2krl.gap.thresholds import THRESHOLDS


@dataclass(frozen=True, kw_only=True, eq=False)
class Residual:
    """One run beside its model, (n, k) in the link's inner unit; its clock, frame and zeros are taken out."""

    trace: Trace
    before: Floats
    after: Floats
    """With the named causes in the model."""
    shape: Floats
    """What the gap is made of: what the named causes do and, where more is left, the smoothed rest."""
    noise: Floats
    """(k,) standard deviation of each component."""


def residuals_of(judgement: Judgement) -> list[Residual]:
    """Return the residuals of all runs of a link, the held-out ones included.

    The named causes have the numbers that were fitted to the runs that explain.
    """
    traces = judgement.every or judgement.traces
    found = judgement.examination
    with_named = [*judgement.usual, *judgement.applied]
    likelihood = Likelihood(traces, nuisance_for(traces, found.question, found.data.known), found.noise)
    left = [trace.measured - trace.sample(with_named) for trace in traces]
    own, shared = fitted_mismatch(likelihood, left)
    noise = np.array([each.sigma for each in found.noise])
    has_rest = not judgement.applied or judgement.told.significant
    residuals = []
    for trace, rest, of_run, of_machine in zip(traces, left, own, shared, strict=True):
        doing = trace.sample(with_named) - trace.sample(judgement.usual)
        structured = smoothed(trace.time_s, rest - of_run - of_machine, THRESHOLDS.tell.rest_smooth_s)
        shape = doing + structured if has_rest else doing
        after = rest - of_run
        residuals.append(Residual(trace=trace, before=after + doing, after=after, shape=shape, noise=noise))
    return residuals


def smoothed(time_s: Floats, values: Floats, over_s: float = THRESHOLDS.tell.smooth_s) -> Floats:
    """Return the mean of values (n,) or (n, k) over a time, that of fewer samples at the ends."""
    if values.ndim == 2:
        return np.stack([smoothed(time_s, column, over_s) for column in values.T], axis=1)
    step_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else over_s
    kernel = np.ones(min(max(1, round(over_s / step_s)), len(values)))
    sums: Floats = np.convolve(values, kernel, mode="same")
    return sums / np.convolve(np.ones(len(values)), kernel, mode="same")


def rms_length(shapes: Sequence[Floats]) -> float:
    """Return the rms length of the rows of arrays (n, k)."""
    return float(np.sqrt(np.mean(np.concatenate([np.sum(shape**2, axis=1) for shape in shapes]))))
