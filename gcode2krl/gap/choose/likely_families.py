"""How probable it is that a rest depends on each family: of one signal one family is the right one."""

from dataclasses import dataclass, replace

import numpy as np

from gcode2krl.gap.choose.calibrated import probabilities_table
from gcode2krl.gap.choose.family_tests import Rest
from gcode2krl.gap.choose.features import FamilyFeatures, family_features
from gcode2krl.gap.families.evidence import Evidence
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.choose


@dataclass(frozen=True, eq=False)
class FamilyProbability:
    """A family of a rest, what is known of it, and how probable it is that it is the right one."""

    evidence: Evidence
    features: FamilyFeatures
    probability: float


def family_probabilities(rest: Rest, larger_links: int = 0) -> list[FamilyProbability]:
    """Return the families of a rest with their probabilities, the most probable first.

    That of the family with the most evidence in a signal is calibrated. Of what it leaves, the others of that
    signal, and none of them, have shares by evidence, over the temperature as no model is exact.
    ``larger_links`` have a larger gap that has no name.
    """
    components = {each.place.component for each in rest.study.evidences}
    found = {component: _of_signal(rest, component, larger_links) for component in components}
    whole = found.get(None)
    every = [each for own in found.values() for each in own]
    if whole is not None:
        # what moves all components together is not told of each of them once more
        every = [_beside(each, whole[0]) for each in every]
    return sorted(every, key=lambda each: -each.probability)


def _beside(told: FamilyProbability, whole: FamilyProbability) -> FamilyProbability:
    """Return a family of one component beside that of all, which is it where it has more evidence."""
    if told.evidence.place.component is None or told.evidence.nats > whole.evidence.nats:
        return told
    return replace(told, probability=min(told.probability, 1.0 - whole.probability))


def _of_signal(rest: Rest, component: int | None, larger_links: int) -> list[FamilyProbability]:
    """Return the families of one signal, in the order of the study."""
    first, *others = [each for each in rest.study.evidences if each.place.component == component]
    features = family_features(rest, first, larger_links)
    own = probabilities_table().dependence(features)
    behind = np.array([max(first.nats - each.nats, 0.0) / first.inflation for each in others])
    weights = np.exp(-behind / _LIMITS.temperature)
    shares = np.minimum((1.0 - own) * weights / (1.0 + weights.sum()), own)
    return [
        FamilyProbability(first, features, own),
        *(
            FamilyProbability(each, family_features(rest, each, larger_links), float(share))
            for each, share in zip(others, shares, strict=True)
        ),
    ]
