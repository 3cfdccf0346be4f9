"""Probabilities from the results of the tests, by a model that separate cases have calibrated.

Each term maps one or two numbers of `Features` to a goodness u in 0 … 1, the same for every effect. Then

    P = 1 / (1 + exp(-b - Σ w·u)),   w >= 0

is monotone in every test, also for effects and set-ups that the table has not seen: a better test never
lowers a probability. It stays within 0.02 … 0.98. ``b`` and ``w`` stand in ``thresholds/probabilities.json``,
which ``benchmarks/gap_calibrate.py`` writes from cases of the independent plant with whole effects left out.

A name also needs the conditions of `FamilyTests` (its family is the best, its form fits, no other family
takes a share beside it) and that its size is one number (`Constancy`). Where one of them fails the cause is
not named, whatever the model says.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Self

from gcode2krl.gap.choose.features import FAMILY_NAMES, NAMES, FamilyFeatures, Features
from gcode2krl.gap.choose.probability_table import stated_table
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.choose
NAME, FAMILY, UNKNOWN, DEPENDENCE = "name", "family", "unknown", "dependence"
"""What a probability is of: the name is right; family and place are; the library lacks the cause; the family
of a rest is right."""
MOST_UNNAMED = 0.9 * _LIMITS.named
"""The most that a cause has which fails a condition of a name."""

Numbers = Mapping[str, float | None]


@dataclass(frozen=True)
class Scale:
    """How a number becomes a goodness: 0 at its worst value and beyond, 1 at its best and beyond."""

    worst: float
    best: float
    by: str = "linear"
    """linear; log; log_rest, of what is left to 1; asinh, linear near 0 and logarithmic beyond."""

    def goodness(self, value: float) -> float:
        """Return the goodness of a number, 0 to 1."""
        worst, best = self._turned(self.worst), self._turned(self.best)
        low, high = sorted((worst, best))
        return (min(max(self._turned(value), low), high) - worst) / (best - worst)

    def _turned(self, value: float) -> float:
        if self.by == "log":
            return math.log(max(value, 1e-9))
        if self.by == "log_rest":
            return math.log(max(1.0 - value, 1e-9))
        return math.asinh(value) if self.by == "asinh" else value


Terms = Mapping[str, Mapping[str, Scale]]
"""Term -> number -> scale; the best of its numbers is what counts."""

TERMS: Terms = {
    "surprise": {"surprise": Scale(0.0, 50.0, "asinh")},
    "size": {"size_over_noise": Scale(0.05, 0.5, "log")},
    "family": {"margin": Scale(-10.0, 30.0, "asinh")},
    "form": {"form_ratio": Scale(0.6, 0.97, "log_rest")},
    "alone": {"other_share": Scale(0.3, 0.02, "log"), "other_power": Scale(0.3, 0.02, "log")},
    "constant": {"inconstancy": Scale(0.5, 0.05, "log"), "constant_p": Scale(1e-4, 0.05, "log")},
    "shape": {"shape_interval": Scale(1.0, 0.3)},
    "folds": {"fold_agreement": Scale(0.0, 1.0)},
    "shrink": {"shrink_of_rest": Scale(0.1, 0.5)},
    "together": {"shrink_together": Scale(0.5, 0.97, "log_rest")},
    "beside": {"shrink_where_others": Scale(0.02, 0.2, "log")},
    "left": {"share_left": Scale(0.5, 0.02, "log")},
    "rest": {"rest_share": Scale(0.5, 0.02, "log")},
    "rival": {"rival_nats": Scale(0.0, 50.0, "asinh")},
    "alike": {"alike": Scale(5.0, 0.0)},
    "few": {"causes": Scale(4.0, 2.0)},
    "links": {"links_missing": Scale(4.0, 0.0)},
    "gap": {"gap_p": Scale(0.1, 0.01, "log"), "surprise": Scale(0.0, 50.0, "asinh")},
    "conditions": {"conditions_failed": Scale(2.0, 0.0)},
}
"""Of `Features`."""

FAMILY_TERMS: Terms = {
    "lead": {"lead_nats": Scale(-10.0, 50.0, "asinh")},
    "share": {"share": Scale(0.01, 0.5, "log")},
    "chance": {"p": Scale(0.1, 0.005, "log")},
    "largest": {"of_largest": Scale(0.05, 1.0, "log")},
    "first": {"larger_links": Scale(2.0, 0.0)},
}
"""Of `FamilyFeatures`."""


def terms_of(head: str) -> Terms:
    """Return the terms that a probability is made of."""
    return FAMILY_TERMS if head == DEPENDENCE else TERMS


def goodnesses(numbers: Numbers, terms: Terms = TERMS) -> list[float | None]:
    """Return the goodness of each term; None where none of its numbers is known."""
    return [_goodness(numbers, term) for term in terms.values()]


def _goodness(numbers: Numbers, term: Mapping[str, Scale]) -> float | None:
    known = [scale.goodness(value) for name, scale in term.items() if (value := numbers[name]) is not None]
    return max(known, default=None)


@dataclass(frozen=True)
class Head:
    """One probability: P = σ(bias + Σ weight·u), or 1 - σ where it falls with better tests."""

    bias: float
    weights: tuple[float, ...]
    missing: tuple[float, ...]
    """What a term counts where its test could not be made: its mean over the calibration cases."""
    falls: bool = False

    def score(self, u: Sequence[float | None]) -> float:
        """Return bias + Σ weight·u."""
        known = [m if each is None else each for each, m in zip(u, self.missing, strict=True)]
        return self.bias + sum(w * each for w, each in zip(self.weights, known, strict=True))

    def probability(self, u: Sequence[float | None]) -> float:
        """Return the probability, clipped."""
        score = self.score(u)
        return probability_of(-score if self.falls else score)


def probability_of(score: float) -> float:
    """Return 1 / (1 + exp(-score)), within what the diagnosis states: nothing is certain."""
    return clipped(0.5 * (1.0 + math.tanh(0.5 * score)))


def clipped(probability: float) -> float:
    """Return a probability within its limits."""
    return min(max(probability, _LIMITS.least_unknown), 1.0 - _LIMITS.least_unknown)


@dataclass(frozen=True)
class Probabilities:
    """The calibrated table."""

    heads: Mapping[str, Head]
    unknown_without_cause: float
    """P that the library lacks the cause of a gap for which no effect was accepted."""
    provenance: Mapping[str, Any]
    """Cases, seeds, kinds, and the scores with whole effects left out."""

    @classmethod
    def of(cls, table: Mapping[str, Any]) -> Self:
        """Return the probabilities of a table; raises ValueError for one of other features or terms."""
        asked = {"features": list(NAMES), "family_features": list(FAMILY_NAMES)}
        for key, names in asked.items():
            if list(table[key]) != names:
                raise ValueError(f"the table of probabilities has other {key}: write it anew")
        return cls(
            {name: _head(name, table["heads"][name]) for name in (NAME, FAMILY, UNKNOWN, DEPENDENCE)},
            float(table["unknown_without_cause"]),
            table["provenance"],
        )

    def name(self, features: Features) -> float:
        """Return the probability that a cause, or one of its declared set, bears the right name."""
        p = self._of(NAME, features)
        return min(p, MOST_UNNAMED) if features.conditions_failed else p

    def family(self, features: Features) -> float:
        """Return the probability that place and family are right; a right name has both."""
        return max(self._of(FAMILY, features), self.name(features))

    def unknown(self, features: Features) -> float:
        """Return the probability that the library lacks the cause; what the name has, it has not."""
        return min(self._of(UNKNOWN, features), 1.0 - self.name(features))

    def dependence(self, features: FamilyFeatures) -> float:
        """Return the probability that the best family of a signal is the right one, with its place."""
        return self.heads[DEPENDENCE].probability(goodnesses(features.as_dict(), FAMILY_TERMS))

    def _of(self, head: str, features: Features) -> float:
        return self.heads[head].probability(goodnesses(features.as_dict()))


def _head(name: str, stated: Mapping[str, Any]) -> Head:
    terms, weights = terms_of(name), stated["weights"]
    if list(weights) != list(terms):
        raise ValueError(f"the table of probabilities has other terms of {name}: write it anew")
    if any(weight < 0.0 for weight in weights.values()):
        raise ValueError(f"a weight of {name} is negative: the probability would not be monotone")
    missing = tuple(float(stated["missing"][term]) for term in terms)
    return Head(
        float(stated["bias"]), tuple(float(weights[term]) for term in terms), missing, falls=name == UNKNOWN
    )


@cache
def probabilities_table() -> Probabilities:
    """Return the table of the package."""
    return Probabilities.of(stated_table())
