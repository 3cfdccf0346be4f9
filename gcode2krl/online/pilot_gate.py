"""The pilot force as the program announces it, and whether it may be used.

The robot's program writes the number of each knot some time before it; the knots themselves come from the
sidecar. They are used only if the program's checksum is the sidecar's, the knots count up by one from the
program's start, the override is 100 %, the mode is not T1, and the robot moves as fast as predicted. Any
mismatch closes the gate until the program starts again. The first knots of a program only prove the speed.
"""

import enum
from typing import NamedTuple

import numba
import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.cell.sections.online import Online
from gcode2krl.compiled.inputs import read_only
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
_STARTED, _NEXT, _PROVEN, _REASON, _SYNCED, _OFFSET, _REAL, _PLANNED, _STILL = range(9)
_POSITION = 9


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


_OPEN, _CHECKSUM, _OVERRIDE, _MODE = int(Gate.OPEN), int(Gate.CHECKSUM), int(Gate.OVERRIDE), int(Gate.MODE)
_ORDER, _SPEED, _UNPROVEN, _STANDS = int(Gate.ORDER), int(Gate.SPEED), int(Gate.UNPROVEN), int(Gate.STANDS)


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
    state[_REASON] = Gate.NOT_STARTED
    state[_POSITION:] = np.nan
    return GateState(state)


def estimate(
    state: GateState,
    time_s: Floats,
    position_mm: Floats,
    told: Announced,
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
            read_only("time_s", time_s, count),
            read_only("position_mm", position_mm, count, 3),
            read_only("knot", told.knot, count),
            read_only("checksum", told.checksum, count),
            read_only("override_percent", told.override_percent, count),
            read_only("t1", told.t1, count),
            read_only("time_s", table.time_s, -1),
            read_only("lead_s", table.lead_s, -1),
            read_only("force_N", table.force_N, -1, 3),
            float(table.checksum),
            settings.pilot_lead_s,
            after.values,
            force,
            known,
            reason,
        )
    return after, force, known, reason


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _track(
    time: Floats,
    position: Floats,
    knot: Floats,
    checksum: Floats,
    override: Floats,
    t1: Floats,
    knot_time: Floats,
    knot_lead: Floats,
    knot_force: Floats,
    wanted: float,
    lead: float,
    state: Floats,
    force: Floats,
    known: Bools,
    reason: Ints,
) -> None:
    for i in range(len(time)):
        _watch_rest(position[i], time[i], state)
        wrong = 0
        if checksum[i] != wanted:  # a NaN too
            wrong = _CHECKSUM
        elif override[i] != 100.0:
            wrong = _OVERRIDE
        elif t1[i] != 0.0:
            wrong = _MODE
        if wrong > 0:
            state[_REASON], state[_STARTED] = wrong, 0.0
        elif knot[i] == NO_KNOT_YET:
            state[_STARTED], state[_NEXT], state[_PROVEN], state[_SYNCED] = 1.0, 0.0, 0.0, 0.0
            state[_REASON] = _UNPROVEN
        elif state[_STARTED] > 0.0 and knot[i] != state[_NEXT] - 1.0:
            _announce(time[i], knot[i], knot_time, knot_lead, state)
        if state[_STARTED] == 0.0 or state[_PROVEN] == 0.0:
            reason[i] = int(state[_REASON])
        elif state[_SYNCED] == 0.0:
            reason[i] = _STANDS
        else:
            reason[i], known[i] = _OPEN, True
            following = min(int(state[_NEXT]), len(knot_time) - 1)
            _force_at(
                min(time[i] + lead - state[_OFFSET], knot_time[following]), knot_time, knot_force, force[i]
            )


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _announce(now: float, knot: float, knot_time: Floats, knot_lead: Floats, state: Floats) -> None:
    """Take the next knot; close the gate if it is another one or comes at another time."""
    k = int(state[_NEXT])
    if knot != state[_NEXT] or k >= len(knot_time):  # a NaN too
        state[_STARTED], state[_REASON] = 0.0, _ORDER
        return
    planned = knot_time[k] - knot_lead[k]
    if state[_SYNCED] == 0.0:
        state[_REAL], state[_PLANNED] = now, planned
    took, expected = now - state[_REAL], planned - state[_PLANNED]
    if abs(took - expected) > SPEED_SHARE * expected + JITTER_S:
        state[_STARTED], state[_REASON] = 0.0, _SPEED
        return
    if expected >= PROOF_S:
        state[_PROVEN] = 1.0
        state[_REAL], state[_PLANNED] = now, planned
    state[_SYNCED], state[_OFFSET] = 1.0, now + knot_lead[k] - knot_time[k]
    state[_NEXT] += 1.0


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _watch_rest(position: Floats, now: float, state: Floats) -> None:
    """Forget the place in the program once the robot has stood still: pauses are not predicted."""
    moved = 0.0
    for c in range(3):
        moved += (position[c] - state[_POSITION + c]) ** 2
        state[_POSITION + c] = position[c]
    if moved > REST_MM * REST_MM:
        state[_STILL] = now
    if now - state[_STILL] > REST_S:
        state[_SYNCED] = 0.0


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _force_at(now: float, time: Floats, values: Floats, out: Floats) -> None:
    """Write the polyline at a time: linear between knots, zero before the first and after the last."""
    k = np.searchsorted(time, now, side="right")
    if k == 0 or k == len(time):
        out[:] = 0.0
        return
    share = (now - time[k - 1]) / (time[k] - time[k - 1])
    for c in range(3):
        out[c] = values[k - 1, c] + share * (values[k, c] - values[k - 1, c])
