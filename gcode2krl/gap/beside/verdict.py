"""What the judgement of a link says to the links after it."""

from typing import Protocol

from gcode2krl.arrays import Floats
from gcode2krl.effects import Applied
from gcode2krl.gap.beside.trace import Trace


class JudgedLink(Protocol):
    """What is asked of a link that was judged."""

    name: str
    tells_time: bool


class Verdict(Protocol):
    """What the judgement of a link says to all that comes later."""

    @property
    def link(self) -> "JudgedLink":
        """Return the judged link."""

    @property
    def verdict(self) -> str:
        """Return no_gap, explained, partly_explained or unexplained."""

    @property
    def nearly_all(self) -> bool:
        """Tell whether what is left is more than noise, but a small share of the gap."""

    @property
    def applied(self) -> tuple[Applied, ...]:
        """Return the named causes."""

    def without(self, applied: Applied) -> "Verdict":
        """Return the judgement without a cause."""


class FittedVerdict(Verdict, Protocol):
    """What later links may learn from the judgement of a signal."""

    @property
    def every(self) -> tuple[Trace, ...]:
        """Return all traces of the link, held-out ones included."""

    def fitted(self, trace: Trace, stamps_s: Floats) -> Floats:
        """Return what the fitted model says of a trace's run at some stamps (n,), as (n, k)."""


def is_lost(judged: Verdict | None) -> bool:
    """Tell whether the model of a link does not hold, not even with the causes that were named."""
    if judged is None or judged.nearly_all:
        return False
    return judged.verdict in ("unexplained", "partly_explained")
