"""Where a link's noise is learnt: repeats of one program, or what is left of a run beside everything slow."""

from collections.abc import Sequence

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.effects import Applied
from gcode2krl.gap.beside.decimals import resolution
from gcode2krl.gap.beside.interpolation import nearest_rows
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.fit.noise import Noise, at_most, drawn_noise, fit, unbiased
from gcode2krl.gap.fit.nuisance import Nuisance

_SLOW_S = 0.5
_RIDGE = 1e-6
_TRUST = 0.9
"""Noise is never taken below this share of what run.toml states."""
_MOST_STATED = 1.4
"""Nor above this: what is more than that is structure."""


def noise_of(
    traces: Sequence[Trace], signatures: Sequence[Floats], nuisance: Sequence[Sequence[Nuisance]],
    applied: Sequence[Applied] = (),
) -> list[Noise]:  # fmt: skip
    """Return the noise of each component, beside effects that are known.

    From every run is taken what any effect or nuisance could explain of that run alone. If the runs repeat
    one program, what differs between them is noise, whatever its colour; else everything slower than half a
    second is taken out too, since it may be structure. What this takes of the noise itself is found by doing
    the same to drawn noise of the model (Efron's bootstrap bias).
    """
    taken = [
        _Taken(trace, columns, own) for trace, columns, own in zip(traces, signatures, nuisance, strict=True)
    ]
    repeats = _repeats(traces)

    def fits(values: Sequence[Floats], floors: Floats) -> list[Noise]:
        rests = [each.off(value) for each, value in zip(taken, values, strict=True)]
        if repeats is None:
            rests = [each.fast(rest) for each, rest in zip(taken, rests, strict=True)]
        found = []
        for j in range(traces[0].shape[1]):
            mine = [(rest[:, j], trace.segments) for rest, trace in zip(rests, traces, strict=True)]
            found.append(fit(mine if repeats is None else _apart(mine, traces, repeats), float(floors[j])))
        return found

    floors = np.array([_floor(traces, j) for j in range(traces[0].shape[1])])
    first = fits([trace.measured - trace.sample(applied) for trace in traces], floors)
    generator = np.random.default_rng(0)
    drawn = [
        np.stack([drawn_noise(noise, len(trace.time_s), generator) for noise in first], axis=1)
        for trace in traces
    ]
    again = fits(drawn, np.full(len(first), 1e-12))
    most = _MOST_STATED * min(_stated(traces), default=np.inf)
    return [
        at_most(unbiased(one, other, float(floor)), most)
        for one, other, floor in zip(first, again, floors, strict=True)
    ]


def _stated(traces: Sequence[Trace]) -> list[float]:
    return [trace.declared_sigma for trace in traces if trace.declared_sigma is not None]


def _floor(traces: Sequence[Trace], component: int) -> float:
    """Return the least rms: the last decimal's, and what run.toml states."""
    floor = max(resolution(trace.measured[:, component]) for trace in traces)
    return max(floor, _TRUST * max(_stated(traces), default=0.0), 1e-9)


class _Taken:
    """What is taken out of one trace before its noise is looked at."""

    def __init__(self, trace: Trace, signatures: Floats, nuisance: Sequence[Nuisance]) -> None:
        columns = np.concatenate([signatures, *(each.columns for each in nuisance)], axis=2)
        k, n, c = columns.shape
        flat = columns.reshape(k * n, c)
        scale = np.sqrt(np.sum(flat**2, axis=0))
        self.flat = flat[:, scale > 0.0] / scale[scale > 0.0]
        gram = self.flat.T @ self.flat
        gram[np.diag_indices_from(gram)] += _RIDGE
        self.gram = gram
        t = trace.time_s
        count = max(2, round((t[-1] - t[0]) / _SLOW_S) + 1)
        knots = np.linspace(t[0], t[-1], count)
        self.hats = np.maximum(0.0, 1.0 - np.abs(t[:, None] - knots) / (knots[1] - knots[0]))
        self.hats_gram = self.hats.T @ self.hats + 1e-9 * len(t) * np.eye(count)

    def off(self, values: Floats) -> Floats:
        """Return values (n, k) without what effects and nuisance explain."""
        if self.flat.shape[1] == 0:
            return values
        y = values.T.reshape(-1)
        rest = y - self.flat @ np.linalg.solve(self.gram, self.flat.T @ y)
        found: Floats = rest.reshape(values.shape[1], -1).T
        return found

    def fast(self, values: Floats) -> Floats:
        """Return values (n, k) without what is slower than half a second."""
        found: Floats = values - self.hats @ np.linalg.solve(self.hats_gram, self.hats.T @ values)
        return found


def _repeats(traces: Sequence[Trace]) -> list[Ints] | None:
    """Return for each trace the rows that belong to the first one's; None where they are no repeats."""
    first = traces[0]
    if len(traces) < 2:
        return None
    for trace in traces[1:]:
        same = len(trace.inputs) == len(first.inputs) and np.allclose(
            trace.inputs.position_mm, first.inputs.position_mm, atol=1e-3
        )
        if not same or trace.shape[1] != first.shape[1]:
            return None
    return [nearest_rows(trace.time_s, first.time_s) for trace in traces]


def _apart(
    mine: list[tuple[Floats, Ints]], traces: Sequence[Trace], rows: list[Ints]
) -> list[tuple[Floats, Ints]]:
    """Return by how much runs differ from their mean, with the variance that one of them has."""
    values = np.stack([rest[row] for (rest, _), row in zip(mine, rows, strict=True)])
    apart = (values - values.mean(axis=0)) * np.sqrt(len(traces) / (len(traces) - 1.0))
    return [(each, traces[0].segments) for each in apart]
