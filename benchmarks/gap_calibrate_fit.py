"""Monotone logistic models fitted to rows, their errors with whole effects left out, conformal thresholds.

The weights w >= 0 and the bias b are the most probable ones under a prior of conditional means (Bedrick,
Christensen & Johnson 1996): as if a few cases had been seen in which one test alone is as bad as can be. It
speaks for tests that hardly ever fail in the cases there are, and becomes small beside some hundred of them.
Effect-free cases and those whose cause the library lacks count together as much as all others.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from gap_calibrate_rows import OUTSIDE, Behind, Row

from gcode2krl.arrays import Floats
from gcode2krl.gap.choose.calibrated import MOST_UNNAMED, NAME, UNKNOWN, Head, terms_of
from gcode2krl.gap.thresholds import THRESHOLDS

ALL_BEST, ALL_BEST_CASES = 0.97, 6.0
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
}
"""Prior: the same where one test is at its worst and all others at their best."""
PRIOR_CASES = 0.5
"""What each of these counts as."""
_SPREAD = 10.0
"""Standard deviation of a weight in a flat prior, which keeps the search finite."""
COVERAGE = 0.95
_BINS = 10
Weigh = Callable[[Sequence[Row]], Floats]


def weights_of(rows: Sequence[Row]) -> Floats:
    """Return the weight (n,) of each row; they add up to n."""
    foreign = np.array([row.kind in OUTSIDE or row.kind.startswith("null") for row in rows])
    n, m = len(rows), int(foreign.sum())
    if m in (0, n):
        return np.ones(n)
    weights: Floats = np.where(foreign, n / (2.0 * m), n / (2.0 * (n - m)))
    return weights


def missing_of(rows: Sequence[Row], terms: int) -> tuple[float, ...]:
    """Return the mean of each term over the rows that have it; 1 where none has."""
    known = [[row.u[term] for row in rows if row.u[term] is not None] for term in range(terms)]
    return tuple(round(float(np.mean(each)), 3) if each else 1.0 for each in known)


def fitted(rows: Sequence[Row], head: str, without: int | None = None) -> Head:
    """Return the model of one probability; ``without`` is a term that is left out."""
    from scipy import special
    from scipy.optimize import minimize

    terms, falls = list(terms_of(head)), head == UNKNOWN
    missing = missing_of(rows, len(terms))
    prior_u, prior_y, prior_weight = _prior(terms)
    u = np.vstack([_filled(rows, missing), prior_u])
    x = np.column_stack([np.ones(len(u)), u])
    y = np.concatenate([[row.right[head] != falls for row in rows], prior_y])
    weight = np.concatenate([weights_of(rows), prior_weight])

    def cost(b: Floats) -> tuple[float, Floats]:
        score = x @ b
        loss = float(weight @ (np.logaddexp(0.0, score) - y * score))
        slope: Floats = x.T @ (weight * (special.expit(score) - y))
        flat = np.array([0.0, *b[1:]]) / _SPREAD**2
        return loss + 0.5 * float(flat @ b), slope + flat

    bounds = [(None, None), *((0.0, 0.0) if term == without else (0.0, None) for term in range(len(terms)))]
    best = minimize(cost, np.zeros(x.shape[1]), jac=True, bounds=bounds, method="L-BFGS-B").x
    return Head(round(float(best[0]), 4), tuple(np.round(best[1:], 4).tolist()), missing, falls)


def _prior(terms: Sequence[str]) -> tuple[Floats, Floats, Floats]:
    """Return the tests (t + 1, t) of the prior's cases, how probable it is (t + 1,) and their weights."""
    tests = np.vstack([1.0 - np.eye(len(terms)), np.ones(len(terms))])
    probable = np.array([*(ONE_WORST[term] for term in terms), ALL_BEST])
    return tests, probable, np.array([*[PRIOR_CASES] * len(terms), ALL_BEST_CASES])


def _filled(rows: Sequence[Row], missing: Sequence[float]) -> Floats:
    return np.array(
        [[m if u is None else u for u, m in zip(row.u, missing, strict=True)] for row in rows], dtype=float
    ).reshape(len(rows), len(missing))


def left_out(rows: Sequence[Row], head: str, without: int | None = None) -> Floats:
    """Return the probability (n,) of each row by a model of the rows that share no true effect with it."""
    p = np.full(len(rows), np.nan)
    for group in {row.group for row in rows}:
        others = [row for row in rows if not row.group & group]
        model = fitted(others, head, without)
        for i, row in enumerate(rows):
            if row.group == group:
                p[i] = stated(model.probability(row.u), row, head)
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
    known = np.isfinite(p)
    right = np.array([row.right[head] for row in rows], dtype=bool)[known]
    weight, p = weights_of(rows)[known], p[known]
    place = np.minimum((p * _BINS).astype(int), _BINS - 1)
    off = [abs(float(weight[place == b] @ (p - right)[place == b])) for b in np.unique(place)]
    sure, named = p >= 0.9, p >= THRESHOLDS.choose.named
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
