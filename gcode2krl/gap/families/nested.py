"""Families that contain others: a smooth function can be a constant, what each run does over time anything.

The larger one is ahead where the least rest follows it. It is told before the smaller one only where its
evidence is larger by a share worth naming; what each run does over time is the last resort.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from types import MappingProxyType

from gcode2krl.effects.dependence import Dependence
from gcode2krl.gap.families.evidence import Evidence
from gcode2krl.gap.thresholds import THRESHOLDS

_CONSTANT = frozenset({Dependence.CONSTANT})
CONTAINS: Mapping[Dependence, frozenset[Dependence]] = MappingProxyType(
    {
        Dependence.FORCE_BY_PLACE: frozenset({Dependence.FORCE}),
        Dependence.RUN_TIME: frozenset(Dependence) - {Dependence.RUN_TIME, Dependence.TONE},
    }
    | dict.fromkeys(
        (
            Dependence.RUN_TO_RUN,
            Dependence.RUN_START,
            Dependence.TEMPERATURE,
            Dependence.TRAVEL,
            Dependence.OWN_ANGLE,
            Dependence.PLACE,
            Dependence.VELOCITY,
            Dependence.ACCELERATION,
        ),
        _CONSTANT,
    )
)
"""Family -> the smaller ones within it, at the same place. Time in each run has a function for each run."""


def simplest_first(evidences: Iterable[Evidence]) -> tuple[Evidence, ...]:
    """Return families, the most probable first; a smaller one changes evidence with one that contains it.

    Unless that one is ahead by more than `ahead_share` of its own evidence.
    """
    told = sorted(evidences, key=lambda evidence: -evidence.nats)
    moved = True
    while moved:  # a smaller one only ever rises
        moved = False
        for i, larger in enumerate(told):
            j = next((j for j in range(i + 1, len(told)) if _is_within(told[j], larger)), None)
            if j is None or larger.nats - told[j].nats >= _ahead_share(larger) * larger.nats:
                continue
            told[i], told[j] = replace(told[j], nats=larger.nats), replace(larger, nats=told[j].nats)
            moved = True
    return tuple(told)


def _ahead_share(larger: Evidence) -> float:
    """Return the share of its evidence from which on a larger family is ahead of one within it."""
    is_time = larger.on is Dependence.RUN_TIME
    return THRESHOLDS.families.time_ahead_share if is_time else THRESHOLDS.families.ahead_share


def _is_within(smaller: Evidence, larger: Evidence) -> bool:
    return smaller.place.name == larger.place.name and smaller.on in CONTAINS.get(larger.on, ())
