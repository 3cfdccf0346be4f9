"""Probabilities from the results of the tests, by a model that separate cases have calibrated.

`Features` gathers the results of all tests of a cause: what its probability is made of, and what the JSON
shows. Each term maps one or two of these numbers to a goodness u in 0 … 1, the same for every effect. Then

    P = 1 / (1 + exp(-b - Σ w·u)),   w >= 0

is monotone in every test, also for effects and set-ups that the table has not seen: a better test never
lowers a probability. It stays within 0.02 … 0.98. ``b`` and ``w`` stand in ``gap/probabilities.json``, which
``benchmarks/blind/calibrate.py`` writes from cases of the independent plant with whole effects left out.

A name also needs the conditions of `FamilyTests` (its family is the best, its form fits, no other family
takes a share beside it) and that its size is one number (`Constancy`). Where one of them fails the cause is
not named, whatever the model says. Of the families of one signal one is the right one.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cache
from typing import Any, Self

import numpy as np

from gcode2krl.effects import Role
from gcode2krl.gap.posterior.cause_tests import Constancy, FamilyTests, Interval, Rest
from gcode2krl.gap.posterior.examination import Examination
from gcode2krl.gap.posterior.families import Evidence
from gcode2krl.gap.thresholds import THRESHOLDS, declared_nats, stated_table

_LIMITS = THRESHOLDS.posterior
MOST_NATS = 1000.0
"""Evidence beyond it says no more; also where there is nothing to compare with."""
_DIGITS = 4


class _Numbered:
    """Numbers with names."""

    def as_dict(self: Any) -> dict[str, float | None]:
        """Return name -> number, rounded."""
        numbers = {entry.name: getattr(self, entry.name) for entry in fields(self)}
        return {
            k: None if number is None else float(f"{number:.{_DIGITS}g}") for k, number in numbers.items()
        }


@dataclass(frozen=True, kw_only=True)
class Features(_Numbered):
    """What the tests say of a cause, numbers only; None where a test could not be made."""

    surprise: float
    """-log of the probability of its gain without it, beyond what the search finds by chance, in nats."""
    size_over_noise: float
    """RMS of what it takes of the whitened data."""
    margin: float
    """Evidence of its family over that of the best other one, in nats (`FamilyTests`)."""
    form_ratio: float
    """Of what its family takes, the share that its form takes."""
    other_share: float
    """Of the gap's power, what the best other family takes beside it."""
    other_power: float
    """That family's share of the power of both in the signal."""
    inconstancy: float | None
    """Spread of its size over parts of the data beyond noise, over the size."""
    constant_p: float | None
    """Of at least that spread where the size is one number."""
    shape_interval: float
    """Widest 90 % interval of its shapes over their ranges; 1 where one was not found, 0 without shapes."""
    fold_agreement: float | None
    """Share of the splits in which the other data alone choose the same effect at the same target."""
    shrink_of_rest: float | None
    """Of what the causes above it, or the others of its set, leave on held-out data, the share it takes."""
    shrink_where_others: float | None
    """Of the gap on held-out data, the share that it takes where causes above it act too; 1 if none does."""
    shrink_together: float | None
    """Of the gap on held-out data, the share that all causes of the link take."""
    share_left: float
    """Of the gap, what all causes leave on held-out data and on those that explain; 0 if insignificant."""
    causes: int
    """Number of causes that were accepted in the link and are not far smaller; those of a set-up are one."""
    gap_p: float
    """Of the best family's evidence by chance, the cause taken out."""
    conditions_failed: int
    """How many of the conditions of a name fail: family best, form fits, no other beside it, one size."""


NAMES = tuple(entry.name for entry in fields(Features))


@dataclass(frozen=True, kw_only=True)
class FamilyFeatures(_Numbered):
    """What is known of a family that the rest of a gap depends on."""

    lead_nats: float
    """Its evidence over that of the best other family of its signal or of none, over the inflation."""
    share: float
    """Of the gap's power, what it takes."""
    p: float
    """Of its evidence by chance."""
    of_largest: float
    """Its evidence over that of the best family of all signals of its link."""
    larger_links: int
    """Links with a larger gap that has no name, or not all of one: what they leave may show here too."""


FAMILY_NAMES = tuple(entry.name for entry in fields(FamilyFeatures))


def family_features(
    unnamed: Rest, evidence: Evidence, larger_links: int = 0, alike: Sequence[Evidence] = ()
) -> FamilyFeatures:
    """Return the features of a family of a rest, or of the set of it and those that are ``alike``.

    No rivals are the families of other signals, of another joint, and another form of the same input.
    """
    study = unnamed.study
    rivals = [each for each in study.evidences if each.place.component == evidence.place.component]
    in_set = {each.told for each in (evidence, *alike)}
    other = max((each.nats for each in rivals if each.told not in in_set), default=0.0)
    return FamilyFeatures(
        lead_nats=_within((evidence.nats - max(other, 0.0)) / _scatter(rivals[0])),
        share=unnamed.share(evidence),
        p=study.p_of(evidence),
        of_largest=min(max(evidence.nats, 0.0) / max(study.evidences[0].nats, 1.0), 1.0),
        larger_links=larger_links,
    )


def _scatter(first: Evidence) -> float:
    """Return by how much evidence scatters: its inflation, at most what a family is off by.

    What happens in few stretches leaves much in them whatever its family, and inflates it without bound.
    """
    return min(first.inflation, max(1.0, _LIMITS.ahead_share * first.nats))


@dataclass(frozen=True)
class HeldOut:
    """What held-out data say of a cause; None where there are none, or where they were not left out of it."""

    agreement: float | None
    shrink_of_rest: float | None
    shrink_where_others: float | None
    shrink_together: float | None
    share_left: float


def features_of(
    examination: Examination,
    number: int,
    *,
    tests: FamilyTests,
    gap_p: float,
    constant: Constancy | None,
    parameters: dict[str, Interval],
    held_out: HeldOut,
) -> Features:
    """Return the features of an accepted effect."""
    gain = examination.gains[number]
    least, errors = _LIMITS.counted_share * gain, examination.errors_of_set_up
    large = {cause for cause in examination.cause_numbers if examination.gains[cause] >= least}
    return Features(
        surprise=_within(examination.surprises[number] - examination.level),
        size_over_noise=(max(gain, 0.0) / examination.data.values) ** 0.5,
        margin=_within(tests.margin),
        form_ratio=tests.form_ratio,
        other_share=tests.other_share,
        other_power=tests.other_power,
        inconstancy=None if constant is None else constant.inconstancy,
        constant_p=None if constant is None else constant.p,
        shape_interval=_shape_interval(examination, number, parameters),
        fold_agreement=held_out.agreement,
        shrink_of_rest=held_out.shrink_of_rest,
        shrink_where_others=held_out.shrink_where_others,
        shrink_together=held_out.shrink_together,
        share_left=held_out.share_left,
        causes=len(large - errors) + bool(large & errors),
        gap_p=gap_p,
        conditions_failed=[
            tests.is_best,
            tests.form_fits,
            tests.is_alone,
            constant is None or constant.is_one_number,
        ].count(False),
    )


def _within(nats: float) -> float:
    return min(max(nats, -MOST_NATS), MOST_NATS)


def _shape_interval(examination: Examination, number: int, parameters: dict[str, Interval]) -> float:
    """Return the widest interval of an effect's shapes over their ranges."""
    fitted, applied = examination.fitted, examination.applied[number]
    at_end = fitted.numbers.free[number].shapes_at_end(fitted.x[fitted.numbers.slices[number]])
    widths = [0.0]
    for p in applied.effect.parameters:
        if p.role not in (Role.SHAPE, Role.FREQUENCY) or not p.high > p.low:
            continue
        interval = parameters.get(p.name)
        if interval is None or p.name in applied.held or p.name in at_end:
            return 1.0
        widths.append((interval.high - interval.low) / (p.high - p.low))
    return min(max(widths), 1.0)


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
    "constant": {"inconstancy": Scale(0.5, 0.05, "log"), "constant_p": Scale(1e-4, 0.05, "log")},
    "shape": {"shape_interval": Scale(1.0, 0.3)},
    "folds": {"fold_agreement": Scale(0.0, 1.0)},
    "shrink": {"shrink_of_rest": Scale(0.1, 0.5)},
    "together": {"shrink_together": Scale(0.5, 0.97, "log_rest")},
    "beside": {"shrink_where_others": Scale(0.02, 0.2, "log")},
    "left": {"share_left": Scale(0.5, 0.02, "log")},
    "few": {"causes": Scale(4.0, 2.0)},
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


@dataclass(frozen=True, eq=False)
class FamilyProbability:
    """A family of a rest, what is known of it, and how probable it is that it is the right one."""

    evidence: Evidence
    features: FamilyFeatures
    probability: float
    place_probability: float
    """That its place is right, whatever the gap depends on there; or one of the places of its set."""
    alike: tuple[Evidence, ...] = ()
    """Families that the data do not tell from it."""
    set_probability: float = 0.0
    """That it or one of these is the right one; 0 of all but the first."""


def family_probabilities(unnamed: Rest, larger_links: int = 0) -> list[FamilyProbability]:
    """Return the families of a rest with their probabilities, the most probable first.

    That of the family with the most evidence in a signal is calibrated. Of what it leaves, the others of that
    signal, and none of them, have shares by evidence, over the temperature as no model is exact.
    ``larger_links`` have a larger gap that has no name.
    """
    components = {each.place.component for each in unnamed.study.evidences}
    of_signals = {component: _of_signal(unnamed, component, larger_links) for component in components}
    families = [family for of_signal in of_signals.values() for family in of_signal]
    if None in of_signals:
        # what moves all components together is not told of each of them once more
        families = [_less_than(of_signals[None][0], family) for family in families]
    return sorted(families, key=lambda family: -family.probability)


def _less_than(whole: FamilyProbability, family: FamilyProbability) -> FamilyProbability:
    """Return a family of one component beside that of all, which is it where it has more evidence."""
    if family.evidence.place.component is None or family.evidence.nats > whole.evidence.nats:
        return family
    return replace(
        family,
        probability=min(family.probability, 1.0 - whole.probability),
        set_probability=min(family.set_probability, 1.0 - whole.set_probability),
        place_probability=min(family.place_probability, 1.0 - whole.place_probability),
    )


def _of_signal(unnamed: Rest, component: int | None, larger_links: int) -> list[FamilyProbability]:
    """Return the families of one signal, in the order of the study."""
    first, *others = [each for each in unnamed.study.evidences if each.place.component == component]
    features = family_features(unnamed, first, larger_links)
    p = probabilities_table().dependence(features)
    behind = np.array([max(first.nats - each.nats, 0.0) / _scatter(first) for each in others])
    weights = np.exp(-behind / _LIMITS.temperature)
    shares = np.minimum((1.0 - p) * weights / (1.0 + weights.sum()), p)
    near: dict[object, Evidence] = {}
    for evidence, nats in zip(others, behind, strict=True):
        if nats < declared_nats() and evidence.told != first.told:
            near.setdefault(evidence.told, evidence)
    alike = tuple(near.values())[: _LIMITS.most_alike_families]
    of_set = max(p, probabilities_table().dependence(family_features(unnamed, first, larger_links, alike)))
    is_there = [evidence.place.name == first.place.name for evidence in others]
    # one input at a place excludes another
    at_first = max(
        _of_place(p), clipped(p + sum(q for q, there in zip(shares, is_there, strict=True) if there))
    )
    return [
        FamilyProbability(first, features, p, max(at_first, _of_place(of_set)), alike, of_set),
        *(
            FamilyProbability(
                evidence,
                family_features(unnamed, evidence, larger_links),
                float(q),
                at_first if there else min(_of_place(float(q)), 1.0 - at_first),
            )
            for evidence, q, there in zip(others, shares, is_there, strict=True)
        ),
    ]


def _of_place(probability: float) -> float:
    """Return the probability that a family's place is right: inputs at one place imitate each other."""
    odds = _LIMITS.place_odds * probability / (1.0 - probability)
    return clipped(odds / (1.0 + odds))
