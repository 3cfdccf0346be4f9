"""What is known of a link after it was judged: its verdict, its causes and the size of its gap."""

from dataclasses import dataclass, field, replace
from typing import Self

from gcode2krl.arrays import Floats
from gcode2krl.effects import Applied
from gcode2krl.gap.beside.links.base import Link
from gcode2krl.gap.beside.trace import Event, Trace, Whose
from gcode2krl.gap.choose.calibrated import probabilities_table
from gcode2krl.gap.choose.constancy import Constancy
from gcode2krl.gap.choose.examination import Examination
from gcode2krl.gap.choose.family_tests import FamilyTests, Rest
from gcode2krl.gap.choose.features import Features
from gcode2krl.gap.choose.fitted_joints import fitted_signal
from gcode2krl.gap.choose.gap_size import Size
from gcode2krl.gap.choose.intervals import Interval
from gcode2krl.gap.choose.rivals import Rival
from gcode2krl.gap.thresholds import THRESHOLDS

NAMED = THRESHOLDS.choose.named
"""A cause counts as named from this probability on."""


@dataclass(frozen=True)
class Cause:
    """One effect at one target."""

    applied: Applied
    link: str
    probability: float
    parameters: dict[str, Interval]
    shrink: float | None
    """Share of the explainable gap that it takes on held-out data, on top of those above it."""
    rms_after: float | None
    rivals: tuple[tuple[Rival, float], ...] | None = ()
    """None where no other effect was compared with it."""
    constant: Constancy | None = None
    tests: FamilyTests | None = None
    """What families say of it; None where they were not asked."""
    features: Features | None = None
    """The results of all tests; None where none was made."""
    family_probability: float | None = None
    """That place and family are right; None where they were not asked."""
    unknown_probability: float | None = None
    """That the library lacks what is at work; None where that was not asked."""


@dataclass(frozen=True, kw_only=True)
class Judged:
    """What every judgement of a link says; sizes are in the link's inner unit."""

    link: Link
    verdict: str
    causes: tuple[Cause, ...]
    size: Size
    held_out: bool
    factor: float
    """From the inner unit to that of the report."""
    nearly_all: bool = False
    """What is left of the gap is more than noise, but a small share of it."""
    size_with_named: Size | None = None
    """The size with the named causes alone in the model; None where that is ``size``."""

    @property
    def told(self) -> Size:
        """Return the size that the answer states: a cause without a name takes nothing of the gap."""
        return self.size if self.size_with_named is None else self.size_with_named

    @property
    def unknown(self) -> float | None:
        """Return the probability that the library lacks what is at work; None without a gap, or not asked."""
        if self.verdict == "no_gap":
            return None
        if not self.causes:
            return probabilities_table().unknown_without_cause
        return max(self.causes, key=lambda cause: cause.probability).unknown_probability

    @property
    def applied(self) -> tuple[Applied, ...]:
        """Return the named causes."""
        return tuple(cause.applied for cause in self.causes if cause.probability >= NAMED)

    @property
    def shrink(self) -> float | None:
        """Return the share of the explainable gap that is gone on held-out data; None without a name."""
        return self.told.shrink if self.applied and self.held_out else None

    @property
    def reported(self) -> tuple[Cause, ...]:
        """Return the causes that the answer lists: those of a gap."""
        return self.causes if self.verdict != "no_gap" else ()

    def without(self, applied: Applied) -> Self:
        """Return the judgement without a cause that a later link has shown to be elsewhere."""
        return replace(self, causes=tuple(cause for cause in self.causes if cause.applied != applied))


@dataclass(frozen=True, kw_only=True)
class Judgement(Judged):
    """The judgement of a link whose signal is one in time."""

    traces: tuple[Trace, ...]
    examination: Examination
    usual: tuple[Applied, ...] = field(default=())
    """Accepted effects that are within normal mismatch."""
    every: tuple[Trace, ...] = field(default=())
    """The traces with the held-out ones."""
    rest: Rest | None = None
    """On what depends what is left beside the named causes; None where it was not asked."""

    @property
    def events(self) -> tuple[Event, ...]:
        """Return the events of all runs, in the order of the runs."""
        return tuple(event for trace in self.every or self.traces for event in trace.events)

    @property
    def impulses(self) -> tuple[Event, ...]:
        """Return the events that are a gap by themselves: something hit or was hit."""
        return tuple(event for event in self.events if event.whose is Whose.IMPULSE)

    @property
    def slips(self) -> tuple[Event, ...]:
        """Return the changes of the level that another table shows too: they are of the machine."""
        return tuple(event for event in self.events if event.whose is Whose.SLIP and event.is_shared)

    def fitted(self, trace: Trace, stamps_s: Floats) -> Floats:
        """Return what the fitted model says of a trace's run at some stamps (n,), as (n, k).

        Without what only its instrument shows.
        """
        return fitted_signal(trace, self.examination, stamps_s)
