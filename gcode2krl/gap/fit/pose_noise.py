"""The noise of static poses: white, since each pose is measured by itself."""

from collections.abc import Iterator, Sequence

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.fit.noise import Noise, white
from gcode2krl.gap.fit.nuisance import Nuisance
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.fit
_LEAST_RMS = 1e-9
_RANK = 1e-6
"""Singular values below this share of the largest add nothing to what columns span."""
_SAME_RAD = 1e-4
"""Joints of one pose when the robot comes back to it."""
_SIGMAS = np.geomspace(1e-3, 1.0, 61)
"""Of the noise over the rms of the residual, at which the likelihood is looked at."""


def noise_of_poses(
    traces: Sequence[Trace], signatures: Sequence[Floats], nuisance: Sequence[Sequence[Nuisance]]
) -> list[Noise]:
    """Return the noise of each component: what ``run.toml`` states, else what poses visited again differ by.

    Else what no candidate explains: from the residual is taken what all signatures and nuisance together
    span, and its power is divided by the degrees of freedom that are left. With fewer than a third of them
    left, only what single signatures explain beyond chance is taken (`_few`).
    """
    stated = [trace.declared_sigma for trace in traces if trace.declared_sigma is not None]
    sigma = max(stated, default=0.0) or max(_learnt(traces, signatures, nuisance), _LEAST_RMS)
    return [white(sigma)] * traces[0].shape[1]


def revisits(traces: Sequence[Trace]) -> Floats:
    """Return by how much poses that the robot came back to differ from their mean (m, k).

    With the variance that one of them has. Of readings in a row, at which it stood, the first counts.
    """
    differences = [np.zeros((0, traces[0].shape[1]))]
    for trace in traces:
        q = trace.inputs.q_cmd_rad
        apart = np.abs(q[:, None] - q).max(axis=2) > _SAME_RAD
        came = np.append(True, apart[np.arange(1, len(q)), np.arange(len(q) - 1)])
        number = np.argmin(apart, axis=0)  # the first row of the same pose
        for pose in np.unique(number):
            own = trace.residual[came & (number == pose)]
            if len(own) > 1:
                differences.append((own - own.mean(axis=0)) * np.sqrt(len(own) / (len(own) - 1.0)))
    return np.concatenate(differences)


def is_revisited(traces: Sequence[Trace]) -> bool:
    """Tell whether the robot came back to so many poses that their noise is known."""
    return len(revisits(traces)) >= _LIMITS.poses_least_again


def _learnt(
    traces: Sequence[Trace], signatures: Sequence[Floats], nuisance: Sequence[Sequence[Nuisance]]
) -> float:
    if is_revisited(traces):
        return _rms(revisits(traces))
    values = sum(trace.measured.size for trace in traces)
    rests, spanned = [], 0
    for trace, own, others in zip(traces, signatures, nuisance, strict=True):
        basis = _basis(_flat([own, *(each.columns for each in others)]))
        rest = trace.residual.T.reshape(-1)
        rests.append(rest - basis @ (basis.T @ rest))
        spanned += basis.shape[1]
    if 3 * (values - spanned) < values:
        return _few(traces, signatures, nuisance)
    return _rms(np.concatenate(rests)) * float(np.sqrt(values / (values - spanned)))


def _few(
    traces: Sequence[Trace], signatures: Sequence[Floats], nuisance: Sequence[Sequence[Nuisance]]
) -> float:
    """Return the noise beside nuisance at its usual size and signatures taken one at a time.

    One is taken where it passes an F-test with the number of all of them as its price (Bonferroni).
    """
    from scipy.special import fdtrc

    turned, variances = (
        np.concatenate(each) for each in zip(*_turned(traces, signatures, nuisance), strict=True)
    )
    sigmas = _rms(turned[:, -1]) * _SIGMAS
    count, taken = len(turned), list[int]()
    while True:
        whole, beside = _costs(turned, variances, sigmas, taken)
        best, column = float(whole.min()), int(np.argmin(beside.min(axis=0)))
        freedom = count - len(taken) - 1
        f = freedom * np.expm1(max(best - float(beside[:, column].min()), 0.0) / count)
        if 3 * freedom < count or fdtrc(1, freedom, f) * beside.shape[1] > _LIMITS.poses_chance:
            return float(sigmas[int(np.argmin(whole))]) * float(np.sqrt(count / (freedom + 1)))
        taken.append(column)


def _turned(
    traces: Sequence[Trace], signatures: Sequence[Floats], nuisance: Sequence[Sequence[Nuisance]]
) -> Iterator[tuple[Floats, Floats]]:
    """Yield of each trace columns (v, c + 1), the residual last, along nuisance's axes, and its variances."""
    for trace, own, others in zip(traces, signatures, nuisance, strict=True):
        usual = _flat([np.zeros((*own.shape[:2], 0)), *(each.columns for each in others)])
        variances, axes = np.linalg.eigh(usual @ usual.T)
        yield (
            axes.T @ np.column_stack([_flat([own]), trace.residual.T.reshape(-1)]),
            np.maximum(variances, 0.0),
        )


def _costs(turned: Floats, variances: Floats, sigmas: Floats, taken: Sequence[int]) -> tuple[Floats, Floats]:
    """Return -2 log likelihood at some noises (s,), beside taken columns, and with one more each (s, c)."""
    whole, beside = [], []
    for sigma in sigmas:
        total = sigma**2 + variances
        white_ = turned / np.sqrt(total)[:, None]
        basis = _basis(white_[:, taken])
        white_ = white_ - basis @ (basis.T @ white_)
        columns, rest = white_[:, :-1], white_[:, -1]
        power = np.sum(columns**2, axis=0)
        gain = (columns.T @ rest) ** 2 / np.maximum(power, 1e-300)
        gain[power <= _RANK * np.sum((turned[:, :-1] ** 2) / total[:, None], axis=0)] = 0.0
        whole.append(float(np.sum(np.log(total)) + rest @ rest))
        beside.append(whole[-1] - gain)
    return np.array(whole), np.array(beside)


def _flat(columns: Sequence[Floats]) -> Floats:
    """Return columns (k, n, c) side by side, as (k·n, c)."""
    joined = np.concatenate(columns, axis=2)
    return joined.reshape(joined.shape[0] * joined.shape[1], joined.shape[2])


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _basis(columns: Floats) -> Floats:
    """Return an orthonormal basis (v, r) of what columns (v, c) span."""
    scale = np.linalg.norm(columns, axis=0)
    left, singular, _ = np.linalg.svd(columns[:, scale > 0.0] / scale[scale > 0.0], full_matrices=False)
    basis: Floats = left[:, singular > _RANK * singular.max(initial=0.0)]
    return basis
