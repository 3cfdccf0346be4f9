"""Monotone logistic models fitted to rows, their errors with whole effects left out, conformal thresholds.

The weights w >= 0 and the bias b are the most probable ones under a prior of conditional means (Bedrick,
Christensen & Johnson 1996): as if a few cases had been seen in which one test alone is as bad as can be. It
speaks for tests that hardly ever fail in the cases there are, and becomes small beside some hundred of them.
Scores are then stretched so that they are right of effects that the model was not fitted to.
Effect-free cases and those whose cause the library lacks count together as much as all others.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from gap_calibrate_rows import OUTSIDE, Behind, Row

from gcode2krl.arrays import Floats
from gcode2krl.gap.posterior.calibrated import (
    DEPENDENCE,
    MOST_UNNAMED,
    NAME,
    UNKNOWN,
    Head,
    probability_of,
    terms_of,
)
from gcode2krl.gap.thresholds import THRESHOLDS

ALL_BEST, ALL_BEST_CASES = 0.97, 10.0
"""Prior: how probable what is asked for is where every test is at its best, and what that counts as."""
ONE_WORST = {
    "surprise": 0.3,
    "size": 0.5,
    "family": 0.2,
    "form": 0.2,
    "alone": 0.2,
    "constant": 0.3,
    "shape": 0.5,
    "folds": 0.2,
    "shrink": 0.05,
    "together": 0.3,
    "beside": 0.2,
    "left": 0.1,
    "rest": 0.2,
    "rival": 0.7,
    "alike": 0.7,
    "few": 0.2,
    "links": 0.8,
    "gap": 0.3,
    "conditions": 0.1,
    "lead": 0.1,
    "share": 0.3,
    "chance": 0.3,
    "largest": 0.2,
    "first": 0.3,
}
"""Prior: the same where one test is at its worst and all others at their best."""
PRIOR_CASES = 1.0
"""What each of these counts as."""
_SPREAD = 10.0
"""Standard deviation of a weight in a flat prior, which keeps the search finite."""
_STRETCH = np.array([0.2, 0.5])
"""Standard deviations of slope and shift before any scores were seen: few rows hardly move them."""
_LEAST_SLOPE = 0.5
"""However wrong some unseen effects are, all tests keep half of their say."""
COVERAGE = 0.95
_BINS = 10
Weigh = Callable[[Sequence[Row]], Floats]


def weights_of(rows: Sequence[Row]) -> Floats:
    """Return the weight (n,) of each row; families of one case, which may be many, share one."""
    families = Counter(row.case for row in rows if DEPENDENCE in row.right)
    weights = np.array([1.0 / max(families[row.case], 1) for row in rows])
    foreign = np.array([row.kind in OUTSIDE or row.kind.startswith("null") for row in rows])
    if foreign.all() or not foreign.any():
        return weights
    half = 0.5 * weights.sum()
    return np.where(foreign, half / weights[foreign].sum(), half / weights[~foreign].sum()) * weights


def missing_of(rows: Sequence[Row], terms: int) -> tuple[float, ...]:
    """Return the mean of each term over the rows that have it; 1 where none has."""
    known = [[row.u[term] for row in rows if row.u[term] is not None] for term in range(terms)]
    return tuple(round(float(np.mean(each)), 3) if each else 1.0 for each in known)


def fitted(rows: Sequence[Row], head: str, without: int | None = None) -> Head:
    """Return the model of one probability; ``without`` is a term that is left out."""
    terms, falls = list(terms_of(head)), head == UNKNOWN
    missing = missing_of(rows, len(terms))
    prior_u, prior_y, prior_weight = _prior(terms)
    u = np.vstack([_filled(rows, missing), prior_u])
    best = _logistic(
        np.column_stack([np.ones(len(u)), u]),
        np.concatenate([_good(rows, head), prior_y]),
        np.concatenate([weights_of(rows), prior_weight]),
        centre=np.zeros(len(terms) + 1),
        spread=np.array([np.inf, *[_SPREAD] * len(terms)]),
        bounds=[(None, None), *((0.0, 0.0 if term == without else None) for term in range(len(terms)))],
    )
    return Head(round(float(best[0]), 4), tuple(np.round(best[1:], 4).tolist()), missing, falls)


def _good(rows: Sequence[Row], head: str) -> Floats:
    """Return of each row (n,) whether better tests speak for what it was."""
    return np.array([row.right[head] != (head == UNKNOWN) for row in rows], dtype=float)


def _logistic(
    x: Floats,
    y: Floats,
    weight: Floats,
    *,
    centre: Floats,
    spread: Floats,
    bounds: Sequence[tuple[float | None, float | None]],
) -> Floats:
    """Return the coefficients (p,) of a logistic model, normal about ``centre`` before the rows were seen."""
    from scipy import special
    from scipy.optimize import minimize

    def cost(b: Floats) -> tuple[float, Floats]:
        score, away = x @ b, (b - centre) / spread**2
        loss = float(weight @ (np.logaddexp(0.0, score) - y * score)) + 0.5 * float(away @ (b - centre))
        return loss, x.T @ (weight * (special.expit(score) - y)) + away

    best: Floats = minimize(cost, centre, jac=True, bounds=bounds, method="L-BFGS-B").x
    return best


def _prior(terms: Sequence[str]) -> tuple[Floats, Floats, Floats]:
    """Return the tests (t + 1, t) of the prior's cases, how probable it is (t + 1,) and their weights."""
    tests = np.vstack([1.0 - np.eye(len(terms)), np.ones(len(terms))])
    probable = np.array([*(ONE_WORST[term] for term in terms), ALL_BEST])
    return tests, probable, np.array([*[PRIOR_CASES] * len(terms), ALL_BEST_CASES])


def _filled(rows: Sequence[Row], missing: Sequence[float]) -> Floats:
    return np.array(
        [[m if u is None else u for u, m in zip(row.u, missing, strict=True)] for row in rows], dtype=float
    ).reshape(len(rows), len(missing))


def unseen_scores(rows: Sequence[Row], head: str, without: int | None = None) -> Floats:
    """Return the score (n,) of each row by a model of the rows that share no true effect with it."""
    scores = np.zeros(len(rows))
    for group in {row.group for row in rows}:
        model = fitted([row for row in rows if not row.group & group], head, without)
        for i, row in enumerate(rows):
            if row.group == group:
                scores[i] = model.score(row.u)
    return scores


@dataclass(frozen=True)
class Stretch:
    """slope·score + shift: what makes scores of unseen effects right (Platt 1999); monotone, two numbers."""

    slope: float
    shift: float

    @classmethod
    def of(cls, rows: Sequence[Row], scores: Floats, head: str) -> "Stretch":
        """Return the stretch of scores (n,) that were made without each row's effects; 1 and 0 for none."""
        found = _logistic(
            np.column_stack([scores, np.ones(len(rows))]),
            _good(rows, head),
            weights_of(rows),
            centre=np.array([1.0, 0.0]),
            spread=_STRETCH,
            bounds=[(_LEAST_SLOPE, None), (None, None)],
        )
        return cls(*found.tolist())

    def stretched(self, model: Head) -> Head:
        """Return a model whose scores are stretched."""
        weights = tuple(round(self.slope * weight, 4) for weight in model.weights)
        return replace(model, bias=round(self.slope * model.bias + self.shift, 4), weights=weights)


def calibrated(rows: Sequence[Row], head: str, scores: Floats) -> Head:
    """Return the model of all rows, stretched by their scores when their effects are left out."""
    return Stretch.of(rows, scores, head).stretched(fitted(rows, head))


def left_out(rows: Sequence[Row], head: str, scores: Floats) -> Floats:
    """Return the probability (n,) of each row from its unseen score, stretched by those of other effects."""
    p = np.zeros(len(rows))
    for group in {row.group for row in rows}:
        others = np.array([not row.group & group for row in rows])
        kept = [row for row, other in zip(rows, others, strict=True) if other]
        stretch = Stretch.of(kept, scores[others], head)
        for i, row in enumerate(rows):
            if row.group == group:
                good = probability_of(stretch.slope * float(scores[i]) + stretch.shift)
                p[i] = stated(1.0 - good if head == UNKNOWN else good, row, head)
    return p


def stated(p: float, row: Row, head: str) -> float:
    """Return the probability that an answer states: a cause that fails a condition is not named."""
    return min(p, MOST_UNNAMED) if head == NAME and row.conditions_failed else p


@dataclass(frozen=True)
class Scores:
    """Errors of probabilities; weighted as in the fit."""

    rows: int
    ece: float
    brier: float
    log: float
    sure: int
    """Rows with p >= 0.9."""
    sure_right: int
    named: int
    named_wrong: int

    def __str__(self) -> str:
        precision = f"{self.sure_right}/{self.sure}"
        wrong = f"{self.named_wrong}/{self.named}"
        return f"| {self.ece:.3f} | {self.brier:.3f} | {self.log:.3f} | {precision} | {wrong} |"


def scores_of(rows: Sequence[Row], p: Floats, head: str) -> Scores:
    """Return the scores of probabilities (n,); the expected calibration error in ten bins."""
    right, weight = np.array([row.right[head] for row in rows], dtype=bool), weights_of(rows)
    place = np.minimum((p * _BINS).astype(int), _BINS - 1)
    off = [abs(float(weight[place == b] @ (p - right)[place == b])) for b in np.unique(place)]
    sure, named = p >= 0.9, p >= THRESHOLDS.posterior.named
    return Scores(
        rows=len(p),
        ece=sum(off) / float(weight.sum()),
        brier=float(np.average((p - right) ** 2, weights=weight)),
        log=float(-np.average(np.log(np.where(right, p, 1.0 - p).clip(1e-3)), weights=weight)),
        sure=int(sure.sum()),
        sure_right=int((sure & right).sum()),
        named=int(named.sum()),
        named_wrong=int((named & ~right).sum()),
    )


def conformal_nats(behind: Iterable[Behind]) -> float:
    """Return the threshold that 95 % of the compared truths are within (Vovk et al. 2005); inf if few."""
    scores = sorted(each.nats for each in behind if each.nats is not None)
    rank = math.ceil(COVERAGE * (len(scores) + 1))
    return scores[rank - 1] if rank <= len(scores) else math.inf


def covered(behind: Sequence[Behind], least_nats: float = 0.0) -> tuple[int, int]:
    """Return how many compared truths are within the threshold of the other effects, and of how many."""
    count = of = 0
    for group in {each.group for each in behind}:
        threshold = max(conformal_nats(each for each in behind if not each.group & group), least_nats)
        own = [each.nats for each in behind if each.group == group and each.nats is not None]
        count, of = count + sum(nats <= threshold for nats in own), of + len(own)
    return count, of
