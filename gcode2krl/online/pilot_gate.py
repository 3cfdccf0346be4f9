"""The pilot force as the program announces it, and whether it may be used.

The robot's program writes the number of each knot some time before it; the knots themselves come from the
sidecar. They are used only if the program's checksum is the sidecar's, the knots count up by one from the
program's start, the override is 100 %, the mode is not T1, and the robot moves as fast as predicted. Any
mismatch closes the gate until the program starts again. The first knots of a program only prove the speed.
"""

import enum
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.cell.sections.online import Online
from gcode2krl.compiled.core import FLOAT, FLOATS, OUT_BOOLS, OUT_FLOATS, OUT_INTS, core_function
from gcode2krl.compiled.inputs import shaped
from gcode2krl.pilot import Knots, PilotHeader

NO_KNOT_YET = -1
SPEED_SHARE = 0.05
"""Fraction by which the robot's speed may differ from the predicted one."""
PROOF_S = 0.5
"""Predicted time between knots from which their real distance shows the speed."""
JITTER_S = 0.012
"""A knot's lead is accurate to one cycle of the interpolator."""
REST_MM = 0.002
"""The robot stands while it moves less than this from one sample to the next …"""
REST_S = 0.050
"""… for so long. A reversal of direction takes less."""
STARTED, NEXT, PROVEN, REASON, SYNCED, OFFSET, REAL, PLANNED, STILL = range(9)
POSITION = 9

_track = core_function(
    "online_track",
    *(FLOATS,) * 9,
    *(FLOAT, FLOAT),
    *(OUT_FLOATS, OUT_FLOATS, OUT_BOOLS, OUT_INTS),
)


class Gate(enum.IntEnum):
    """Why the pilot is not used; OPEN where it is."""

    OPEN = 0
    NO_PILOT = 1
    NOT_STARTED = 2
    """No program start has been seen: the server started later, or a block was selected."""
    CHECKSUM = 3
    OVERRIDE = 4
    MODE = 5
    ORDER = 6
    SPEED = 7
    UNPROVEN = 8
    """The first knots have yet to prove the speed."""
    STANDS = 9
    """The robot stood still unexpectedly: the next knot tells where the program is."""


class GateState(NamedTuple):
    """State of the gate."""

    values: Floats
    """(12,)"""


class Announced(NamedTuple):
    """What the controller reports of the pilot; NaN = not reported."""

    knot: Floats
    """(n,) number of the knot announced last."""
    checksum: Floats
    override_percent: Floats
    t1: Floats
    """(n,) 1 in the mode T1."""


class PilotTable(NamedTuple):
    """Knots as arrays, and the checksum and lead of their announcement; empty without a pilot."""

    time_s: Floats
    lead_s: Floats
    force_N: Floats
    checksum: int


def pilot_table(knots: Knots | None, header: PilotHeader | None) -> PilotTable:
    """Return the table of a sidecar; an empty one where there is none."""
    if knots is None or header is None:
        return PilotTable(np.zeros(0), np.zeros(0), np.zeros((0, 3)), -1)
    return PilotTable(knots.time_s, knots.lead_s, np.asarray(knots.force_N), header.checksum)


def gate_start() -> GateState:
    """Return the state before the first sample: closed, no program start seen."""
    state = np.zeros(12)
    state[REASON] = Gate.NOT_STARTED
    state[POSITION:] = np.nan
    return GateState(state)


def estimate(
    state: GateState,
    time_s: Floats,
    position_mm: Floats,
    announced: Announced,
    table: PilotTable,
    settings: Online,
) -> tuple[GateState, Floats, Bools, Ints]:
    """Return the pilot force (n, 3) in its own frame, (n,) where it is known, and (n,) the `Gate`.

    Knots are ``lead_s`` after their announcement; the force is read ``pilot_lead_s`` ahead of now, but not
    beyond the next knot to be announced: a robot that is 3 % slow lags by that much after a long cut.
    ``position_mm`` (n, 3) is the commanded tip.
    """
    count = len(time_s)
    force, known = np.zeros((count, 3)), np.zeros(count, dtype=np.bool_)
    reason = np.full(count, int(Gate.NO_PILOT), dtype=np.int64)
    after = GateState(state.values.copy())
    if len(table.time_s):
        _track(
            shaped("time_s", time_s, count),
            shaped("position_mm", position_mm, count, 3),
            shaped("knot", announced.knot, count),
            shaped("checksum", announced.checksum, count),
            shaped("override_percent", announced.override_percent, count),
            shaped("t1", announced.t1, count),
            shaped("time_s", table.time_s, -1),
            shaped("lead_s", table.lead_s, -1),
            shaped("force_N", table.force_N, -1, 3),
            float(table.checksum),
            settings.pilot_lead_s,
            after.values,
            force,
            known,
            reason,
        )
    return after, force, known, reason
