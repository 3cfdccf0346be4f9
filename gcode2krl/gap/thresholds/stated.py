"""How a threshold is stated: its value, the reason for it, and what kind of number it is.

A room's thresholds are a frozen dataclass whose fields are made by `physics`, `calibrated` and `convention`.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from enum import Enum
from typing import Any, TypeVar

_Value = TypeVar("_Value")


class Kind(Enum):
    """Where a threshold comes from."""

    PHYSICS = "physics"
    """A law, an instrument, a standard, or the measured accuracy of a model."""
    CALIBRATED = "calibrated"
    """Chosen by what it does on cases of the independent plant."""
    CONVENTION = "convention"
    """An agreed limit or a setting of the computation: another of its order would serve as well."""


DEVELOPMENT = range(10_000)
"""Seeds of the cases that the diagnosis is developed on (docs/diagnose_check.md)."""
WITH_ONCE_SCORED = range(16_000)
"""Those and 10000-15999, which are calibration cases since their errors were looked at."""

ONCE_SCORED = range(290_000, 497_000)
"""Cases that were scored, told with their figures, and looked at since: none is scored again."""


@dataclass(frozen=True)
class Threshold:
    """A threshold as the table in docs/thresholds.md shows it."""

    room: str
    name: str
    value: Any
    kind: Kind
    reason: str
    seeds: range | None


def physics(value: _Value, reason: str) -> _Value:
    """Return a field whose default follows from a law, an instrument or a standard."""
    return _stated(value, Kind.PHYSICS, reason)


def calibrated(value: _Value, seeds: range, reason: str) -> _Value:
    """Return a field whose default was chosen on the calibration cases of these seeds."""
    return _stated(value, Kind.CALIBRATED, reason, seeds)


def convention(value: _Value, reason: str) -> _Value:
    """Return a field whose default is an agreed limit or a setting of the computation."""
    return _stated(value, Kind.CONVENTION, reason)


def _stated(value: _Value, kind: Kind, reason: str, seeds: range | None = None) -> _Value:
    threshold: _Value = field(default=value, metadata={"kind": kind, "reason": reason, "seeds": seeds})
    return threshold


def listed(rooms: Any) -> Iterator[Threshold]:
    """Yield every threshold of a dataclass whose fields are rooms, in their order."""
    for room in fields(rooms):
        thresholds = getattr(rooms, room.name)
        for entry in fields(thresholds):
            yield Threshold(room.name, entry.name, getattr(thresholds, entry.name), **entry.metadata)
