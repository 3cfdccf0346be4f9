"""Twins of an effect: candidates that do the same while it is small, whatever they do at its size.

A signature is that of a small effect. Of one that is not proportional to its size the linear gain falls as
the effect grows: of a force that is 45 ms late to a quarter, and then it compares nothing. So twins are
looked for where signatures hold, with the effect at a tenth of its size, and refitted whatever their gain.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects import Applied, Inputs
from gcode2krl.gap.choose.examination import Examination, Key
from gcode2krl.gap.fit.design import Column
from gcode2krl.gap.fit.gram import solve
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.choose
_SMALL = 0.1
"""Of its size: there effects are nearly proportional to it."""


@dataclass(frozen=True, eq=False)
class Twin:
    """A candidate that does what an effect does while that is small."""

    column: Column
    start: Applied
    """At the size at which it would do the same."""
    share: float
    """Of the power of the small effect, what its signature takes."""


def twins_of(
    found: Examination, applied: Applied, others: Sequence[Applied], tried: Collection[Key]
) -> list[Twin]:
    """Return the nearest twins of an effect beside others, one of each effect and target that was not tried.

    None of two effects that are proportional to their sizes: those their gain compares.
    """
    best: dict[Key, Twin] = {}
    for twin in _alike(found, applied, others, tried):
        if twin.share > best.setdefault(_key(twin), twin).share:
            best[_key(twin)] = twin
    return sorted(best.values(), key=lambda twin: -twin.share)[: _LIMITS.most_twins]


def _key(twin: Twin) -> Key:
    return twin.start.effect.name, twin.start.target


def _alike(
    found: Examination, applied: Applied, others: Sequence[Applied], tried: Collection[Key]
) -> Iterator[Twin]:
    """Yield the columns of candidates that take nearly all of what a small effect does."""
    candidates, signatures = found.data.candidates, found.data.signatures
    allowed = [
        column
        for column in candidates.columns
        if candidates.block(column).key not in {*tried, (applied.effect.name, applied.target)}
        and not candidates.block(column).effect.plans_anew
        and (column.bent or not applied.effect.is_linear)
    ]
    if not allowed:
        return
    less = _smaller(applied, found.traces[0].inputs)
    changes = [trace.sample((*others, less)) - trace.sample(others) for trace in found.traces]
    ends = np.cumsum([change.size for change in changes])[:-1]
    small = np.split(found.likelihood.whiten(changes)[:, None], ends)
    gram = signatures.beside(small).total
    for column in allowed:
        at = 1 + column.index
        weights = solve(gram[np.ix_(at, at)], gram[at, :1])[:, 0]
        share = float(weights @ gram[at, 0]) / max(float(gram[0, 0]), 1e-300)
        if share >= _LIMITS.twin_share:
            yield Twin(column, _start(found, column, weights / _SMALL), share)


def _start(found: Examination, column: Column, weights: Floats) -> Applied:
    within = np.clip(weights, column.low, column.high)
    return found.data.candidates.block(column).applied(within, found.traces[0])


def _smaller(applied: Applied, inputs: Inputs) -> Applied:
    """Return an effect at a tenth of its size."""
    nominal = applied.effect.nominal(inputs, applied.target)
    names = [p.name for p in applied.effect.sizes]
    less = {name: nominal[name] + _SMALL * (applied[name] - nominal[name]) for name in names}
    return replace(applied, values={**applied.values, **less})
