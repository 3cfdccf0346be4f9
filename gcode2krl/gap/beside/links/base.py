"""What a link of the measuring chain is: one measured signal beside what the signal before it predicts.

The measured signal before a link is the input of its model, so that an error upstream is not blamed twice.
"""

from collections.abc import Iterable, Sequence

from gcode2krl.effects import Applied
from gcode2krl.gap.beside.context import Context
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.beside.trace import Signal, Trace
from gcode2krl.gap.beside.verdict import FittedVerdict, is_lost
from gcode2krl.gap.thresholds import THRESHOLDS

LIMITS = THRESHOLDS.beside


class Link(Signal):
    """One link: its names, how its trace is made, what its clocks are, what later links learn from it."""

    def trace(self, pair: Pair, base: Sequence[Applied] = ()) -> Trace | None:
        """Return the measured signal of a run, None where it has none; ``base`` belongs to its model."""
        return None

    def traces(self, pairs: Iterable[Pair], base: Sequence[Applied] = ()) -> list[Trace]:
        """Return the measured signals, one a run that has it and is long enough to be judged."""
        traces = [self.trace(pair, base) for pair in pairs]
        return [
            trace for trace in traces if trace is not None and len(trace.time_s) >= LIMITS.trace_least_rows
        ]

    def base(self, context: Context) -> tuple[Applied, ...]:
        """Return the effects that are part of its model from the start."""
        return context.slips

    def clocks(self, context: Context) -> int:
        """Return how many clocks of their own the compared signals have.

        Where the run's own timing replaced the plan's, an instrument's clock is known four times worse.
        """
        path = context.timing
        if is_lost(path):
            return LIMITS.clocks_lost
        return 1 if path is None or path.verdict == "no_gap" else 2

    def clock_share(self, context: Context) -> float:
        """Return the share of its clocks' normal mismatch that is left after they were set."""
        return 1.0

    def learn(self, context: Context, judged: FittedVerdict) -> Context:
        """Return what is known to later links after this one was judged."""
        return context
