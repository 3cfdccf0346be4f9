"""The evidence of a family: how much better functions of an input explain what is left than nothing does."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.dependence import Dependence
from gcode2krl.gap.families.columns import Beside, Columns
from gcode2krl.gap.families.grid import Place
from gcode2krl.gap.families.view import View
from gcode2krl.gap.fit.clusters import gain_inflation
from gcode2krl.gap.thresholds import THRESHOLDS

AMPLITUDES = np.array(THRESHOLDS.families.amplitudes)
_RANK = 1e-9
"""Eigenvalues below this share of the largest hold rounding errors only."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """What a family says of a view."""

    place: Place
    on: Dependence
    nats: float
    """Log of its evidence over that of nothing, for independent rows."""
    gain: float
    """Fall of chi2 at the best amplitude."""
    inflation: float
    """By how much a gain varies more than white noise lets it."""
    flipped: Floats
    """(flips,) its log evidence where the signs of stretches are random, and ``unbounded`` with their own."""
    unbounded: float
    signal: tuple[Floats, ...]
    """(n, k) what it says of each trace; k = 1 where it is of one component alone."""
    at: tuple[int, float] | None = None
    """Run number and time of a step, or -1 and the frequency in Hz of a tone."""
    stays: bool = True
    """A step is in later runs, too."""
    in_one: float = 0.0
    """Of its gain, the share of one stretch of time at most: a sample at a sharp corner may have it all."""

    @property
    def key(self) -> tuple[str, Dependence]:
        """Return where and on what."""
        return self.place.name, self.on


def evidence_of(
    view: View,
    place: Place,
    on: Dependence,
    raw: Sequence[Floats],
    columns: Columns,
    roots: Sequence[Floats],
    signs: Floats,
    at: tuple[int, float] | None = None,
    cost: float = 0.0,
) -> Evidence | None:
    """Return the evidence of columns with one of some covariances; None where nothing is observable.

    ``raw`` (k, n, c) of each trace are the same columns before they were whitened.
    ``signs`` (flips, g) of stretches; ``cost`` of the search for ``at``, in nats.
    """
    beside = Beside(view, columns)
    gram, score, scores = beside.gram, beside.score, beside.scores
    best: tuple[float, int, Floats, Floats] | None = None
    flips, owns = [], []
    for values, turned in _along_roots(gram, roots):
        own = log_evidence(values, turned.T @ score)
        flips.append(log_mean(log_evidence(values, signs @ (scores @ turned))))
        owns.append(log_mean(own))
        top = int(np.argmax(own))
        if best is None or own[top] > best[0]:
            best = (float(own[top]), top, values, turned)
    if best is None:
        return None
    _, top, values, turned = best
    own_weights = turned.T @ score / (values + AMPLITUDES[top] ** -2)
    explained = beside.explained(turned @ own_weights)
    left = beside.scores_without(explained) @ turned
    fit = _bounded(beside, turned, values, top)
    inverse = np.diag(1.0 / (values + fit.amplitude**-2))
    return Evidence(
        place=place,
        on=on,
        nats=fit.nats - float(np.log(len(roots))) - cost,
        gain=max(fit.gain, 0.0),
        inflation=gain_inflation(inverse, left, fitted=0),
        flipped=log_mean(np.array(flips).T) - cost,
        unbounded=float(log_mean(np.array(owns))) - cost,
        signal=tuple((own @ (turned @ fit.weights)).T for own in raw),
        at=at,
        in_one=_in_one(view, explained),
    )


def _along_roots(gram: Floats, roots: Sequence[Floats]) -> Iterator[tuple[Floats, Floats]]:
    """Yield for each root what of it can be observed: eigenvalues (c',) and directions (c, c')."""
    for root in roots:
        values, vectors = np.linalg.eigh(root.T @ gram @ root)
        used = values > _RANK * max(float(values[-1]), 1e-30) if len(values) else values > 0
        if used.any() and values[-1] > 1e-9:
            yield values[used], root @ vectors[:, used]


def moved_evidence(view: View, columns: Columns, roots: Sequence[Floats]) -> Floats:
    """Return the log evidence (moves,) of columns where each run's residual is moved in time."""
    beside = Beside(view, columns)
    scores = beside.moved_scores
    found = [
        log_mean(log_evidence(values, scores @ turned)) for values, turned in _along_roots(beside.gram, roots)
    ]
    return log_mean(np.array(found).T) if found else np.full(len(scores), -np.inf)


def _in_one(view: View, explained: Floats) -> float:
    """Return the largest share of a stretch of time in the fall of chi2 by what is explained (v,)."""
    falls = view.members @ (explained * (2.0 * view.projected - explained))
    return float(np.clip(falls.max() / max(float(falls.sum()), 1e-30), 0.0, 1.0))


class _Fit(NamedTuple):
    """Columns at their best, nuisance within its bounds."""

    nats: float
    gain: float
    amplitude: float
    weights: Floats


def _bounded(beside: Beside, turned: Floats, values: Floats, top: int) -> _Fit:
    """Return the fit of columns, turned by (c, c'), whose inner products then have these eigenvalues (c',).

    The amplitude is searched upwards from that which is best with unbounded nuisance, which explains more.
    """
    view = beside.view
    gram, fixed = turned.T @ beside.columns.gram @ turned, turned.T @ beside.fixed
    score = turned.T @ beside.on_residual
    best = _Fit(-np.inf, 0.0, 1.0, np.zeros(len(values)))
    for a in AMPLITUDES[top:]:
        chi2, weights = view.bounded(a * a * gram, a * fixed, a * score)
        fall = view.chi2 - chi2
        nats = 0.5 * fall - 0.5 * float(np.sum(np.log1p(a * a * values)))
        if nats < best.nats:
            break
        best = _Fit(nats, fall, float(a), a * weights)
    return best._replace(nats=best.nats - float(np.log(len(AMPLITUDES))))


def log_evidence(values: Floats, scores: Floats) -> Floats:
    """Return the log evidence (…, a) of each amplitude from eigenvalues (c,) and scores (…, c) along them."""
    grown = AMPLITUDES[:, None] ** 2 * values
    fall = scores**2 @ (AMPLITUDES[:, None] ** 2 / (1.0 + grown)).T
    evidence: Floats = 0.5 * fall - 0.5 * np.log1p(grown).sum(axis=-1)
    return evidence


def log_mean(values: Floats) -> Floats:
    """Return the log of the mean of exp over the last axis."""
    most = values.max(axis=-1, keepdims=True)
    mean: Floats = most[..., 0] + np.log(np.mean(np.exp(values - most), axis=-1))
    return mean
