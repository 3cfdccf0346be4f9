"""A link's data with the candidates for it, and what was accepted of them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.effects import Applied
from gcode2krl.gap.beside.links.base import Link
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.fit.counted_once import once_among
from gcode2krl.gap.fit.design import Candidates, Question
from gcode2krl.gap.fit.fitted import Fitted
from gcode2krl.gap.fit.gram import Gram, SignatureGram
from gcode2krl.gap.fit.likelihood import Likelihood
from gcode2krl.gap.fit.noise import Noise
from gcode2krl.gap.fit.nuisance import Nuisance
from gcode2krl.gap.fit.place_times import PlaceTimes
from gcode2krl.gap.fit.signatures import Signatures

Key = tuple[str, str | None]
"""Name and target of an effect."""

_ACTS = 1e-6
"""Smaller shares of the largest change are rounding errors of a simulation."""


@dataclass(frozen=True, eq=False)
class LinkData:
    """What a selection starts from: a link's traces, the candidates, and the likelihood of both."""

    link: Link
    traces: tuple[Trace, ...]
    question: Question
    known: Signatures
    candidates: Candidates
    likelihood: Likelihood
    signatures: SignatureGram

    @classmethod
    def of(
        cls,
        link: Link,
        traces: Sequence[Trace],
        question: Question,
        known: Signatures,
        candidates: Candidates,
        nuisance: Sequence[Sequence[Nuisance]],
        noise: Sequence[Noise],
    ) -> "LinkData":
        """Return the data with their likelihood under a model of the noise."""
        likelihood = Likelihood(traces, nuisance, noise)
        signatures = likelihood.gram(candidates.signatures)
        bounded = {block.key for block in candidates.blocks if block.effect.usual(question.mismatch, 1.0)}
        once = once_among(likelihood.design, candidates, signatures, bounded)
        likelihood = likelihood.counting(once)
        return cls(link, tuple(traces), question, known, candidates, likelihood, signatures)

    def settled(self) -> "LinkData":
        """Return the data without the columns of candidates, which only a selection needs."""
        self.known.forget()
        candidates = replace(self.candidates, signatures=())
        return replace(self, candidates=candidates, signatures=SignatureGram.none())

    @property
    def values(self) -> int:
        """Return the number of values."""
        return sum(trace.measured.size for trace in self.traces)

    @property
    def times(self) -> int:
        """Return the number of times at which there are values."""
        return sum(len(trace.time_s) for trace in self.traces)

    @cached_property
    def place_times(self) -> PlaceTimes:
        """The times at which the runs are at each place."""
        return PlaceTimes(self.traces)

    def gram(self, fitted: Fitted, without: int | None = None) -> Gram:
        """Return the fast view beside the accepted effects, or all but one of them."""
        others = tuple(each for number, each in enumerate(fitted.applied) if number != without)
        tangents = self.likelihood.tangents(fitted.numbers, fitted.x, without)
        return self.signatures.beside(self.likelihood.data(others, tangents))


@dataclass(frozen=True, eq=False)
class Examination:
    """What is accepted of a link's candidates."""

    data: LinkData
    fitted: Fitted
    surprises: tuple[float, ...] = ()
    """Of each accepted effect: -log of the probability of its gain without it."""
    usual: tuple[bool, ...] = ()
    """Of each accepted effect: it is within normal mismatch, in the model but not reported."""
    rejected: frozenset[Key] = frozenset()
    level: float = 0.0
    """The surprise that the last candidates had to pass."""
    first_level: float = 0.0
    """That of all candidates, before any was accepted."""
    observable: tuple[tuple[float, float], ...] = ()
    """Of each candidate's columns: the share of their power that nuisance leaves, and that power."""

    @property
    def link(self) -> Link:
        """Return the link."""
        return self.data.link

    @property
    def traces(self) -> tuple[Trace, ...]:
        """Return the traces that explain."""
        return self.data.traces

    @property
    def question(self) -> Question:
        """Return what the link is examined for."""
        return self.data.question

    @property
    def likelihood(self) -> Likelihood:
        """Return the likelihood of the link's data."""
        return self.data.likelihood

    @property
    def noise(self) -> list[Noise]:
        """Return the noise of each component."""
        return list(self.likelihood.noise)

    @property
    def applied(self) -> tuple[Applied, ...]:
        """Return the accepted effects, those within normal mismatch included."""
        return self.fitted.applied

    @property
    def causes(self) -> tuple[Applied, ...]:
        """Return the accepted effects that are more than normal mismatch."""
        return tuple(self.applied[number] for number in self.cause_numbers)

    @property
    def cost(self) -> float:
        """Return chi2 and the cost of the numbers."""
        return self.fitted.chi2 + self.fitted.occam

    @property
    def mismatch(self) -> tuple[Applied, ...]:
        """Return the accepted effects that are within normal mismatch."""
        return tuple(each for each, usual in zip(self.applied, self.usual, strict=True) if usual)

    @property
    def cause_numbers(self) -> tuple[int, ...]:
        """Return which of the accepted effects are more than normal mismatch."""
        return tuple(number for number, usual in enumerate(self.usual) if not usual)

    @property
    def accepted_keys(self) -> frozenset[Key]:
        """Return names and targets of the accepted effects."""
        return frozenset((each.effect.name, each.target) for each in self.applied)

    def without(self, number: int) -> tuple[Applied, ...]:
        """Return the accepted effects but one."""
        return tuple(each for i, each in enumerate(self.applied) if i != number)

    def dropping(self, number: int, refitted: Fitted) -> "Examination":
        """Return the examination without one of the accepted effects, the others refitted."""
        return replace(
            self,
            fitted=refitted,
            surprises=(*self.surprises[:number], *self.surprises[number + 1 :]),
            usual=(*self.usual[:number], *self.usual[number + 1 :]),
        )

    def rejecting(self, key: Key) -> "Examination":
        """Return the examination with a candidate that is not tried again."""
        return replace(self, rejected=self.rejected | {key})

    def rows_changed(self, number: int) -> Bools:
        """Return which of the data (v,) an accepted effect changes at all."""
        rest = self.without(number)
        change: Floats = self.likelihood.whiten(
            [trace.sample(self.applied) - trace.sample(rest) for trace in self.traces]
        )
        changed: Bools = np.abs(change) > _ACTS * np.abs(change).max(initial=0.0)
        return changed
