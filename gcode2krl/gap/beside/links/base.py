"""What a link of the measuring chain is: one measured signal beside what the signal before it predicts.

The measured signal before a link is the input of its model, so that an error upstream is not blamed twice.
"""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Protocol

from gcode2krl.arrays import Floats
from gcode2krl.effects import Applied, Inputs, Signals, simulate
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from gcode2krl.gap.beside.context import Context
    from gcode2krl.gap.beside.trace import Trace

LIMITS = THRESHOLDS.beside


class Verdict(Protocol):
    """What later links may ask of the judgement of an earlier one."""

    @property
    def link(self) -> "Link":
        """Return the judged link."""

    @property
    def verdict(self) -> str:
        """Return no_gap, explained, partly_explained or unexplained."""

    @property
    def applied(self) -> tuple[Applied, ...]:
        """Return the named causes."""

    @property
    def every(self) -> "tuple[Trace, ...]":
        """Return all traces of the link, held-out ones included."""

    def without(self, applied: Applied) -> "Verdict":
        """Return the judgement without a cause."""

    def fitted(self, trace: "Trace") -> Floats:
        """Return what the fitted model says of a trace (n, k), without what only its instrument shows."""


def is_lost(judged: Verdict | None) -> bool:
    """Tell whether the model of a link does not hold, not even with the causes that were named."""
    return judged is not None and judged.verdict in ("unexplained", "partly_explained")


class Link:
    """One link: its names, how its trace is made, what its clocks are, what later links learn from it."""

    name: str
    signal: str
    """Name of its signal in the report."""
    unit: str
    """Unit of the report."""
    needs: str
    """What a run must hold for the link to be examined."""
    table: str = "controller"
    """The table of a run whose clock stamps it."""
    of_joints: bool = False
    """Its components are joints."""
    tells_time: bool = False
    """It shows when the robot is where: timing is the part of it along the motion."""
    model_rms: float = 0.0
    """Accuracy of its model in the inner unit where that, not noise, is the limit."""
    least_off: float = 0.0
    """RMS in the inner unit below which the run keeps to the planned times."""
    least_step: float = 0.0
    """Shorter ways along the signal, in the inner unit, are noise of the instrument, not motion."""
    own_clock: bool = False
    """The signal has a clock of its own besides that of its table."""
    sets_clocks: bool = False
    """Clocks are set run by run first, since the signal changes fast all the time."""
    instrument: tuple[str, ...] = ()
    """Names of the nuisance that belongs to the instrument alone: the joints do nothing of it."""

    def __repr__(self) -> str:
        return f"<link {self.name}>"

    def trace(self, pair: Pair, base: Sequence[Applied] = ()) -> "Trace | None":
        """Return the measured signal of a run, None where it has none; ``base`` belongs to its model."""
        return None

    def traces(self, pairs: Iterable[Pair], base: Sequence[Applied] = ()) -> "list[Trace]":
        """Return the measured signals, one a run that has it and is long enough to be judged."""
        traces = [self.trace(pair, base) for pair in pairs]
        return [
            trace for trace in traces if trace is not None and len(trace.time_s) >= LIMITS.trace_least_rows
        ]

    def simulated(self, trace: "Trace", applied: Sequence[Applied]) -> Signals:
        """Return the signals of its model with some effects at work."""
        return simulate(trace.inputs, applied)

    def planned(self, inputs: Inputs) -> Floats:
        """Return the planned signal (m, k) that shows how far a run has come."""
        raise NotImplementedError(f"{self.name} does not show how far a run has come")

    def base(self, context: "Context") -> tuple[Applied, ...]:
        """Return the effects that are part of its model from the start."""
        return context.slips

    def clocks(self, context: "Context") -> int:
        """Return how many clocks of their own the compared signals have.

        Where the run's own timing replaced the plan's, an instrument's clock is known four times worse.
        """
        path = context.timing
        if is_lost(path):
            return LIMITS.clocks_lost
        return 1 if path is None or path.verdict == "no_gap" else 2

    def clock_share(self, context: "Context") -> float:
        """Return the share of its clocks' normal mismatch that is left after they were set."""
        return 1.0

    def learn(self, context: "Context", judged: Verdict) -> "Context":
        """Return what is known to later links after this one was judged."""
        return context
