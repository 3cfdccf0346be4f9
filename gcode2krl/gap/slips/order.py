"""The order in which slips are tested, before everything else: most real gaps are one of them.

A slip is named where a run's own checks name it, or where the effect of the slip, simulated again, takes nine
tenths of a gap that is far beyond what machines do by themselves.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from gcode2krl.effects import Effect
from gcode2krl.errors import Issue
from gcode2krl.gap.beside.clocks import with_coarse_clocks
from gcode2krl.gap.beside.context import Context
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.slips.air import without_cuts
from gcode2krl.gap.slips.checks import CheckTest, checked
from gcode2krl.gap.slips.clock import ClockTest
from gcode2krl.gap.slips.force_unit import ForceUnitTest
from gcode2krl.gap.slips.frames import FrameTest
from gcode2krl.gap.slips.override import OverrideTest
from gcode2krl.gap.slips.program import ProgramTest
from gcode2krl.gap.slips.slip import Slip, SlipTest
from gcode2krl.gap.slips.stops import unplanned_stops
from gcode2krl.gap.slips.tracker_frame import TrackerFrameTest

TESTS: tuple[SlipTest, ...] = (
    ProgramTest(),  # before the override: none explains another program. Ends the diagnosis
    OverrideTest(),  # before frames, which need the same times
    FrameTest(),
    TrackerFrameTest(),  # behind the joints: the tip follows them
    ForceUnitTest(),
)
"""The first that finds a slip is the only one; behind them come the checks of the runs, which end it too."""


@dataclass(frozen=True)
class SetUp:
    """What is known of the set-up of runs before their links are judged."""

    context: Context
    """With the slips in the plans, and large clock errors taken off the stamps."""
    slips: list[Slip]
    issues: list[Issue]
    """What the checks of the runs say."""

    @property
    def is_final(self) -> bool:
        """Tell whether nothing can be compared beyond one of the slips."""
        return any(slip.final for slip in self.slips)


def examine_set_up(context: Context) -> SetUp:
    """Return the slips that all runs share, and the context with them."""
    # stops first: what a run falls behind at them looks like a wrong clock
    stops, stopped = unplanned_stops(context.pairs, context.offered)
    if stops:
        return SetUp(replace(context.with_pairs(stopped), stopped=True), stops, [])
    pairs, in_air = without_cuts(with_coarse_clocks(pair) for pair in context.pairs)
    context = context.with_pairs(pairs)
    issues = [*in_air, *checked(context.pairs)]
    slips = first_slip(context.pairs, context.offered, issues)
    clocks = ClockTest().find(context.pairs, context.offered)
    if not any(slip.final for slip in slips):
        for slip in slips:
            context = context.with_slip(slip.applied)
    return SetUp(context, [*slips, *clocks], issues)


def first_slip(
    pairs: Sequence[Pair], library: Mapping[str, Effect], issues: Sequence[Issue] = ()
) -> list[Slip]:
    """Return what the first test finds that finds anything; ``issues`` are those of the runs' checks."""
    tests = (*TESTS, CheckTest(tuple(issues)))
    return next((slips for test in tests if (slips := test.find(pairs, library))), [])
