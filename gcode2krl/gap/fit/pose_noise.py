"""The noise of static poses: white, since each pose is measured by itself."""

from collections.abc import Sequence

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.fit.noise import Noise, white
from gcode2krl.gap.fit.nuisance import Nuisance

_LEAST_RMS = 1e-9
_RANK = 1e-6
"""Singular values below this share of the largest add nothing to what columns span."""


def noise_of_poses(
    traces: Sequence[Trace], signatures: Sequence[Floats], nuisance: Sequence[Sequence[Nuisance]]
) -> list[Noise]:
    """Return the noise of each component: what ``run.toml`` states, else what no candidate explains.

    From the residual is taken what all signatures and nuisance together span; its power is divided by the
    degrees of freedom that are left. With fewer than a third of them left the residual itself is the noise:
    so few poses show an effect only beside stated noise.
    """
    stated = [trace.declared_sigma for trace in traces if trace.declared_sigma is not None]
    components = traces[0].shape[1]
    if stated:
        return [white(max(stated))] * components
    values = sum(trace.measured.size for trace in traces)
    power, spanned = 0.0, 0
    for trace, own, others in zip(traces, signatures, nuisance, strict=True):
        columns = np.concatenate([own, *(each.columns for each in others)], axis=2)
        basis = _basis(columns.reshape(-1, columns.shape[2]))
        rest = trace.residual.T.reshape(-1)
        rest = rest - basis @ (basis.T @ rest)
        power, spanned = power + float(rest @ rest), spanned + basis.shape[1]
    if 3 * (values - spanned) < values:
        power, spanned = sum(float(np.sum(trace.residual**2)) for trace in traces), 0
    return [white(max(float(np.sqrt(power / (values - spanned))), _LEAST_RMS))] * components


def _basis(columns: Floats) -> Floats:
    """Return an orthonormal basis (v, r) of what columns (v, c) span."""
    scale = np.linalg.norm(columns, axis=0)
    left, singular, _ = np.linalg.svd(columns[:, scale > 0.0] / scale[scale > 0.0], full_matrices=False)
    basis: Floats = left[:, singular > _RANK * singular.max(initial=0.0)]
    return basis
