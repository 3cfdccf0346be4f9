"""Whether a cause's size is one number: in all runs, in both halves of each and, of a clock, in all joints.

With a cause in the model, what is left of a part of the data is fitted by s times what the cause does there.
s is then by which share of it the cause is larger in that part. A cause that is what it is called has the
same size everywhere; a wrong clock is one number in all joints, and that is its proof.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import stats

from gcode2krl.arrays import Bools, Floats
from gcode2krl.effects.mismatch import sigma
from gcode2krl.gap.choose.examination import Examination
from gcode2krl.gap.fit.sensitivity import sensitivity_of
from gcode2krl.gap.fit.split_columns import SplitColumns
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.choose


@dataclass(frozen=True, kw_only=True)
class Constancy:
    """Whether a cause's numbers are the same in all runs, halves of them and joints."""

    inconstancy: float
    """Spread of the size over parts of the data beyond what noise lets it vary, over the size."""
    p: float
    """Probability of at least that spread where the size is one number."""

    @property
    def is_one_number(self) -> bool:
        """Tell whether the size may be one number: it varies little, or no more than chance lets it."""
        return self.inconstancy < _LIMITS.most_inconstant or self.p > _LIMITS.inconstant_p


class Part(NamedTuple):
    """A part of the data: by which share of it a cause is larger there, and the variance of that."""

    share: float
    variance: float


def constancy_of(found: Examination, number: int) -> Constancy | None:
    """Return the constancy of an accepted effect over the division of the data in which it is least.

    p is that of the spread's chi2 (Cochran 1954), times the number of divisions (Bonferroni). None where the
    effect acts in one part of the data only.
    """
    divisions = [each for each in _divisions(found, number) if any(len(group) > 1 for group in each)]
    if not divisions:
        return None
    spreads = [_spread(groups) for groups in divisions]
    worst = min(spreads, key=lambda each: each.p)
    return Constancy(inconstancy=worst.inconstancy, p=min(1.0, len(spreads) * worst.p))


def spread_between_runs(found: Examination, number: int) -> tuple[float, int]:
    """Return the spread of an effect's size between runs beyond noise, as a share, and the count of runs."""
    parts = _by_run(_Residual.of(found, number))
    return (_spread([parts]).inconstancy, len(parts)) if len(parts) > 1 else (0.0, len(parts))


def _divisions(found: Examination, number: int) -> Iterator[list[list[Part]]]:
    """Yield groups of parts whose sizes should be one number within each group."""
    residual = _Residual.of(found, number)
    usual = _usual_share(found, number)
    yield [[Part(part.share, part.variance + usual**2) for part in _by_run(residual)]]
    yield [_halves(residual, run) for run in range(len(found.traces))]
    if found.link.of_joints and found.applied[number].effect.is_clock:
        yield [_by_joint(residual, found.traces[0].shape[1])]


def _usual_share(found: Examination, number: int) -> float:
    """Return how much normal mismatch of its form lets an effect vary from run to run, as a share of it."""
    applied, trace = found.applied[number], found.traces[0]
    if not found.likelihood.own_alike(applied):
        return 0.0
    duration_s = float(trace.time_s[-1] - trace.time_s[0])
    bounds = applied.effect.usual(found.question.mismatch, duration_s, found.question.clocks)
    nominal = applied.effect.nominal(trace.inputs, applied.target)
    largest = max(
        (abs(applied[name] - nominal[name]) / bound for name, bound in bounds.items() if bound > 0.0),
        default=0.0,
    )
    return sigma(1.0 / largest) if largest > 0.0 else 0.0


# Parts


@dataclass(frozen=True, eq=False)
class _Residual:
    """Whitened values (v,): what is left with all effects, what one of them does, and nuisance beside it."""

    left: Floats
    change: Floats
    nuisance: SplitColumns
    """(v, m) each run's own, that of the effect's form left out."""
    run: Floats
    time_s: Floats
    component: Floats
    inflation: float
    set_share: Floats
    """(runs,) of a clock what was taken off the stamps of each run already, as a share of it."""

    @classmethod
    def of(cls, found: Examination, number: int) -> "_Residual":
        """Return the residual beside an accepted effect."""
        likelihood, applied, traces = found.likelihood, found.applied, found.traces
        change = likelihood.whiten(
            [trace.sample(applied) - trace.sample(found.without(number)) for trace in traces]
        )
        left = likelihood.residual(applied)[: len(change)]
        shapes = [trace.shape for trace in traces]
        return cls(
            left,
            change,
            likelihood.own_nuisance(applied[number]),
            np.concatenate([np.full(n * k, run) for run, (n, k) in enumerate(shapes)]),
            np.concatenate([np.tile(trace.time_s, trace.shape[1]) for trace in traces]),
            np.concatenate([np.repeat(np.arange(k), n) for n, k in shapes]),
            sensitivity_of(likelihood, found.fitted, number).inflation(),
            _set_shares(found, number),
        )

    def part(self, rows: Bools) -> Part | None:
        """Return the effect's share in some rows; None where it does next to nothing there."""
        change, left = self.change[rows], self.left[rows]
        whole = float(self.change @ self.change)
        if not rows.any() or float(change @ change) < _LIMITS.least_part * whole:
            return None
        inner = self.nuisance.gram_in(rows) + np.eye(self.nuisance.width)
        on_change, on_left = (np.stack([self.change, self.left]) * rows) @ self.nuisance
        explained = np.linalg.solve(inner, np.column_stack([on_change, on_left]))
        information = float(change @ change - on_change @ explained[:, 0])
        if information < _LIMITS.least_part * float(change @ change):  # the run's own mismatch does the same
            return None
        share = float(change @ left - on_change @ explained[:, 1]) / information
        return Part(share, self.inflation / information)


def _set_shares(found: Examination, number: int) -> Floats:
    """Return by which share of a clock each run's stamps (runs,) were moved before it was fitted."""
    applied = found.applied[number]
    offset_s = applied[applied.effect.sizes[0].name] if applied.effect.is_clock else 0.0
    moved_s = np.array([trace.clock_set_s for trace in found.traces])
    return moved_s / offset_s if offset_s != 0.0 else np.zeros(len(moved_s))


def _kept(parts: Sequence[Part | None]) -> list[Part]:
    return [part for part in parts if part is not None]


def _by_run(residual: _Residual) -> list[Part]:
    parts = [residual.part(residual.run == run) for run in range(len(residual.set_share))]
    moved = zip(parts, residual.set_share.tolist(), strict=True)
    return [Part(part.share + share, part.variance) for part, share in moved if part is not None]


def _halves(residual: _Residual, run: int) -> list[Part]:
    """Return both halves of a run, in which an effect does as much."""
    own = residual.run == run
    order = np.argsort(residual.time_s[own], kind="stable")
    power = np.cumsum(residual.change[own][order] ** 2)
    middle_s = residual.time_s[own][order][int(np.searchsorted(power, power[-1] / 2.0))]
    early = residual.time_s <= middle_s
    return _kept([residual.part(own & early), residual.part(own & ~early)])


def _by_joint(residual: _Residual, joints: int) -> list[Part]:
    return _kept([residual.part(residual.component == joint) for joint in range(joints)])


# Spread


class _Spread(NamedTuple):
    inconstancy: float
    p: float


def _spread(groups: Sequence[Sequence[Part]]) -> _Spread:
    """Return the spread within groups beyond the variances (DerSimonian & Laird 1986), and its p."""
    chi2 = freedom = weight = 0.0
    for group in groups:
        if len(group) < 2:
            continue
        shares, weights = np.array([p.share for p in group]), np.array([1.0 / p.variance for p in group])
        mean = float(weights @ shares / weights.sum())
        chi2 += float(weights @ (shares - mean) ** 2)
        freedom += len(group) - 1
        weight += float(weights.sum() - weights @ weights / weights.sum())
    variance = max(0.0, chi2 - freedom) / weight if weight > 0.0 else 0.0
    return _Spread(variance**0.5, float(stats.chi2.sf(chi2, freedom)) if freedom else 1.0)
