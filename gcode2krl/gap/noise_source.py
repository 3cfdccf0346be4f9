"""Where a link's noise is learnt: repeats of one program, or what is left of a run beside everything slow."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gcode2krl.gap.noise import Noise, fit, resolution
from gcode2krl.gap.nuisance import Nuisance
from gcode2krl.gap.part import Part, nearest_rows

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
_SLOW_S = 0.5
_RIDGE = 1e-6
_TRUST = 0.7
"""Noise is never taken below this share of what run.toml states."""


def noise_of(
    parts: Sequence[Part], signatures: Sequence[Floats], nuisance: Sequence[Sequence[Nuisance]]
) -> list[Noise]:
    """Return the noise of each component.

    From every run is taken what any effect or nuisance could explain of that run alone. If the runs repeat
    one program, what differs between them is noise, whatever its colour; else everything slower than half a
    second is taken out too, since it may be structure.
    """
    rests, shares = [], []
    for part, columns, own in zip(parts, signatures, nuisance, strict=True):
        rest, share = _rest(part, columns, own)
        rests.append(rest)
        shares.append(share)
    k = parts[0].shape[1]
    repeats = _repeats(parts)
    found = []
    for j in range(k):
        mine = [(rest[:, j], part.segments) for rest, part in zip(rests, parts, strict=True)]
        if repeats is not None:
            mine = _apart(mine, parts, repeats)
            dof = float(np.mean([share[j] for share in shares]))
        else:
            mine, slow = _fast(mine, parts)
            dof = float(np.mean([share[j] for share in shares])) - slow
        floor = max(resolution(part.measured[:, j]) for part in parts)
        stated = [part.declared_sigma for part in parts if part.declared_sigma is not None]
        floor = max(floor, _TRUST * max(stated)) if stated else floor
        found.append(fit(mine, max(floor, 1e-9), dof=max(dof, 0.3)))
    return found


def _rest(part: Part, signatures: Floats, nuisance: Sequence[Nuisance]) -> tuple[Floats, Floats]:
    """Return what no effect explains (n, k), and the share (k,) of each component's values that is left."""
    columns = np.concatenate([signatures, *(each.columns for each in nuisance)], axis=2)
    k, n, c = columns.shape
    flat = columns.reshape(k * n, c)
    y = part.residual.T.reshape(k * n)
    scale = np.sqrt(np.sum(flat**2, axis=0))
    flat = flat[:, scale > 0.0] / scale[scale > 0.0]
    if flat.shape[1] == 0:
        return part.residual, np.ones(k)
    gram = flat.T @ flat
    gram[np.diag_indices_from(gram)] += _RIDGE
    rest = y - flat @ np.linalg.solve(gram, flat.T @ y)
    return rest.reshape(k, n).T, np.full(k, 1.0 - min(flat.shape[1] / (k * n), 0.5))


def _repeats(parts: Sequence[Part]) -> list[Ints] | None:
    """Return for each part the rows that belong to the first one's; None where they are no repeats."""
    first = parts[0]
    if len(parts) < 2:
        return None
    for part in parts[1:]:
        same = len(part.inputs) == len(first.inputs) and np.allclose(
            part.inputs.position_mm, first.inputs.position_mm, atol=1e-3
        )
        if not same or part.shape[1] != first.shape[1]:
            return None
    return [nearest_rows(part.time_s, first.time_s) for part in parts]


def _apart(
    mine: list[tuple[Floats, Ints]], parts: Sequence[Part], rows: list[Ints]
) -> list[tuple[Floats, Ints]]:
    """Return by how much runs differ from their mean, with the variance that one of them has."""
    values = np.stack([rest[row] for (rest, _), row in zip(mine, rows, strict=True)])
    apart = (values - values.mean(axis=0)) * np.sqrt(len(parts) / (len(parts) - 1.0))
    return [(each, parts[0].segments) for each in apart]


def _fast(mine: list[tuple[Floats, Ints]], parts: Sequence[Part]) -> tuple[list[tuple[Floats, Ints]], float]:
    """Return the values less all that is slower than half a second, and the share of them that this takes."""
    out, used, total = [], 0, 0
    for (rest, segments), part in zip(mine, parts, strict=True):
        t = part.time_s
        count = max(2, round((t[-1] - t[0]) / _SLOW_S) + 1)
        knots = np.linspace(t[0], t[-1], count)
        hats = np.maximum(0.0, 1.0 - np.abs(t[:, None] - knots) / (knots[1] - knots[0]))
        gram = hats.T @ hats + 1e-9 * len(t) * np.eye(count)
        out.append((rest - hats @ np.linalg.solve(gram, hats.T @ rest), segments))
        used, total = used + count, total + len(t)
    return out, used / total
