"""Knots of predicted forces to the triggers that announce them, and the motions that carry these."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from gcode2krl import krc4
from gcode2krl.arrays import Bools, Floats, Rows
from gcode2krl.cell import Cell
from gcode2krl.compiled.core import FLOATS, INT, INTS, OUT_FLOATS, core_function
from gcode2krl.errors import Issue, input_error
from gcode2krl.krc4 import Chain
from gcode2krl.krl.advance import most_active, view
from gcode2krl.krl.pieces import Pieces, split
from gcode2krl.krl.pilot_check import PilotCase
from gcode2krl.krl.pilot_text import PilotText
from gcode2krl.krl.triggers import Triggers, place_triggers
from gcode2krl.krl.windows import Windows, windows_of
from gcode2krl.pilot import Knots, PilotHeader, knots_of
from gcode2krl.pilot.knots import LEAD_DECIMALS
from gcode2krl.prediction.forecast import Forecast
from gcode2krl.tables import Joints, Motion, PilotForce, Targets
from gcode2krl.units import MM_PER_M, RAD_PER_DEG

# Where long motions are cut so that few triggers wait at a time, without slowing the robot down.
#
# Triggers wait from when the advance run has read them until they act: those of a few motions in a row.
# More motions in the same way let fewer wait. Cuts keep away from each other and from the ends of their
# motion by as much as the look-ahead needs to see in order not to brake.

_CDIS_MM = 0.1
"""Approximation where pieces meet, in a cell that has none of its own."""
_CDIS_STEP_MM = 1e-3
_LEAST_PIECE_MM = 0.02
_ROOM = 1.25
"""Length of a piece over what a change of speed at its end needs."""
_EARLIER_S = 0.8
"""How long before the instant of a trigger a motion is still cut for it."""

_cut = core_function(
    "krl_cut",
    *(INTS, FLOATS, FLOATS, INTS, FLOATS, FLOATS, FLOATS, FLOATS, INT, INT, OUT_FLOATS),
    returns=INT,
)


def cut_for(
    triggers: Triggers,
    windows: Windows,
    chain: Chain,
    targets: Targets,
    motion: Motion | PilotForce,
    cell: Cell,
) -> Pieces | None:
    """Return cuts that bring the number of waiting triggers towards ``[pilot] max_active``.

    Of as many triggers as may wait and the next, the first and the last must be as many motions apart as are
    in view. Motions between the two are cut; where they are too short, those shortly before, so that the
    first can be announced earlier. None without any cut, as where the controller stops at every end.
    """
    if cell.controller.advance == 0:
        return None
    low, high, apart = _zones(windows, chain, cell)
    fire_s = triggers.fire_s
    before_mm, here_mm = np.interp([fire_s - _EARLIER_S, fire_s], motion.time_s, motion.path_mm)
    room = np.floor(np.maximum(high - low, 0.0) / apart).sum() + len(low)
    cuts = np.empty(int(min(room, len(fire_s) * view(cell))) + 1)
    count = _cut(
        triggers.order,
        here_mm,
        before_mm,
        np.searchsorted(windows.row, triggers.row),
        windows.begin_mm,
        low,
        high,
        apart,
        cell.pilot.max_active,
        view(cell),
        cuts,
    )
    return _pieces(cuts[:count], windows, targets, cell) if count else None


def _zones(windows: Windows, chain: Chain, cell: Cell) -> tuple[Floats, Floats, Floats]:
    """Return the path (w,) from which and up to which a motion may be cut, and how far apart cuts must be.

    By the model of `krc4`, a stop must be possible in view of a vertex, v·(v/a + k)/2, also of the vertices
    before; and a change of speed at a vertex reaches v·k/2 into the motion, which needs a piece that is
    longer by a quarter. A corner at an end keeps twice its distance. So speeds and corners stay as they are.
    """
    controller = cell.controller
    at = windows.row - chain.first - 1
    speed = chain.speed_mm_s * chain.scale
    need = speed * (speed / (controller.acc_cp_m_s2 * MM_PER_M) + controller.k_s) / 2.0
    smear = speed[at] * controller.k_s / 2.0
    after_stop = np.concatenate([[True], chain.stop])[at]
    if controller.advance == "unlimited":
        least, seen = np.full(len(at), _LEAST_PIECE_MM), need
    else:
        least = np.maximum(need[at] / controller.advance, _LEAST_PIECE_MM)
        seen = _largest_before(need, chain.stop, int(controller.advance))
    head = np.where(after_stop, least, np.maximum(seen[at], _ROOM * (windows.head_mm + smear)))
    tail = np.maximum(need[at], _ROOM * (windows.tail_mm + smear))
    head, tail = np.maximum(head, windows.head_mm), np.maximum(tail, windows.tail_mm)
    return windows.begin_mm + head, windows.end_mm - tail, least


def _largest_before(values: Floats, stop: Bools, count: int) -> Floats:
    """Return the largest value (n,) of each motion and so many before it, back to the last stop."""
    largest = values.copy()
    for _ in range(count):
        before = np.where(stop[:-1], 0.0, largest[:-1])
        largest[1:] = np.maximum(largest[1:], before)
    return largest


def _pieces(cuts_mm: Floats, windows: Windows, targets: Targets, cell: Cell) -> Pieces:
    """Return cuts at paths as pieces; their approximation stays within a quarter of a piece."""
    at = np.searchsorted(windows.begin_mm, cuts_mm, side="right") - 1
    row = windows.row[at]
    length_mm = windows.head_mm[at] + windows.end_mm[at] - windows.begin_mm[at] + windows.tail_mm[at]
    share = (windows.head_mm[at] + cuts_mm - windows.begin_mm[at]) / length_mm
    ends_mm = np.minimum(cuts_mm - windows.begin_mm[at], windows.end_mm[at] - cuts_mm)
    close_mm = np.minimum(np.diff(cuts_mm, prepend=-np.inf), np.diff(cuts_mm, append=np.inf))
    quarter_mm = np.minimum(ends_mm, close_mm) / 4.0
    at_target, before = targets.cdis_mm[row], targets.cdis_mm[np.maximum(row - 1, 0)]
    cdis_mm = np.where(
        at_target > 0, at_target, np.where(before > 0, before, cell.controller.cdis_mm or _CDIS_MM)
    )
    narrow_mm = np.maximum(np.floor(quarter_mm / _CDIS_STEP_MM) * _CDIS_STEP_MM, _CDIS_STEP_MM)
    return Pieces(row, share, np.minimum(cdis_mm, narrow_mm))


Form = Literal["index", "values"]
_SHARP = np.sin(30.0 * RAD_PER_DEG / 2.0)
"""cos(alpha/2) from which a corner is a change of direction: it turns by 30° or more. Our choice; what turns
less is left to the tolerance of the knots."""
_LITTLE_SOONER_S, _MOST_SOONER_S = 0.2, 1.0
"""A knot may be announced earlier than needed: by the first before motions are cut, by the second at most."""
_SAFE_S = 0.002
"""Added to the lead: the error of an instant that is read from the samples of a Motion."""
_TRIALS = 4
"""Attempts to leave out pieces that slow the program down."""
_SAME_TIME = 0.5
"""Pieces may change the time of a program by this share of a cycle."""


@dataclass(frozen=True)
class PilotPlan:
    """The pilot force of a program, and the program with the motions it needs."""

    text: PilotText
    targets: Targets
    joints: Joints
    case: PilotCase
    """What the program is checked against once it is written."""
    issues: tuple[Issue, ...]


def pilot_force(source: Forecast) -> PilotForce:
    """Return the samples that a pilot force is made from.

    Raises `NotUnderstoodError` for a forecast without forces.
    """
    force = source.pilot
    if force is None:
        sentence = "the prediction has no forces to pilot with"
        raise input_error("option-value", sentence, "predict with a material and stock, or --pilot none")
    return force


class TimedMotions(NamedTuple):
    """The motions of a program and when they run."""

    windows: Windows
    targets: Targets
    joints: Joints


class Planner:
    """A program and its predicted forces; announces sets of knots in it."""

    def __init__(self, source: Forecast, joints: Joints, form: Form, sidecar: bool) -> None:
        self.targets, self.joints, self.cell = source.targets, joints, source.cell
        self.form, self.sidecar = form, sidecar
        self.motion = pilot_force(source)
        self.chain = krc4.build_chain(self.targets, self.cell)
        self.windows = windows_of(self.targets, self.chain, self.motion, self.cell)

    def knots(self, tolerance_N: float | None) -> Knots:
        """Return the knots of a tolerance."""
        return knots_of(
            self.motion.time_s,
            self.motion.path_mm,
            self.motion.force_N,
            self.motion.deflection_mm,
            _direction_changes(self.chain, self.windows, self.motion),
            line=self.motion.line,
            tolerance_N=tolerance_N,
            cycle_s=self.cell.controller.cycle_s,
        )

    @cached_property
    def whole(self) -> TimedMotions:
        """The program as it is, no motion cut."""
        return TimedMotions(self.windows, self.targets, self.joints)

    def announce(self, knots: Knots) -> PilotPlan | Issue:
        """Return the plan that announces the knots, or why there is none.

        Where too many triggers would wait at the same time, knots are announced a little earlier; where that
        is not enough, long motions are cut; and what is then left is announced still earlier.
        """
        triggers, _ = self._place(knots, self.windows)
        if not self._too_many(triggers):
            return self._planned(knots, triggers, self.whole)
        outcome = self._earlier(knots, _LITTLE_SOONER_S, self.whole)
        if isinstance(outcome, Issue):
            pieces = self._pieces(knots)
            if pieces is not None:
                layout, slow, later_s = self._cut(pieces)
                free = slow is None
                outcome = self._earlier(knots, _MOST_SOONER_S, layout) if free else self._slower(later_s)
        if isinstance(outcome, Issue):
            other = self._earlier(knots, _MOST_SOONER_S, self.whole)
            outcome = outcome if isinstance(other, Issue) else other
        return outcome

    def layouts(self, knots: Knots) -> Iterator[TimedMotions]:
        """Yield the program as it is, and with its first motions cut, up to where that would cost time."""
        yield self.whole
        pieces = self._pieces(knots)
        for _ in range(_TRIALS):
            if pieces is None or not len(pieces):
                return
            layout, slow, _ = self._cut(pieces)
            if slow is None:
                yield layout
                return
            pieces = pieces.before(slow - view(self.cell))

    def all_in_time(self, knots: Knots, layout: TimedMotions) -> bool:
        """Tell whether all these knots can be announced in time, and none too early."""
        triggers, sooner_s = self._place(knots, layout.windows, spread=True)
        in_time = (triggers.row >= 0) & (triggers.fire_s <= knots.time_s) & (sooner_s <= _MOST_SOONER_S)
        return bool(in_time.all()) and not self._too_many(triggers)

    def announce_ending(self, knots: Knots, end_line: int, layout: TimedMotions) -> PilotPlan | Issue:
        """Announce knots and, a lead before the last one, that none follows."""
        triggers, sooner_s = self._place(knots, layout.windows, spread=True, ends=True)
        if sooner_s.max(initial=0.0) > _MOST_SOONER_S or self._too_many(triggers):
            return self._too_dense(knots)
        return self._planned(knots, triggers, layout, end_line)

    def _pieces(self, knots: Knots) -> Pieces | None:
        triggers, _ = self._place(knots, self.windows)
        return cut_for(triggers, self.windows, self.chain, self.targets, self.motion, self.cell)

    def _cut(self, pieces: Pieces) -> tuple[TimedMotions, int | None, Floats]:
        """Return the program with pieces, the row of Targets from which on they cost time, and how much (n,).

        By the controller's model; more than half a cycle counts.
        """
        targets, joints, parts = split(self.targets, self.joints, pieces, self.cell)
        chain = krc4.build_chain(targets, self.cell)
        first, count = self.chain.first, len(self.chain.length_mm)
        rows = parts[first + 1 : first + 1 + count] - first - 1
        later_s = lasting(krc4.plan(chain, self.cell).move_end_s[rows] - self._move_end_s)
        slow = np.flatnonzero(later_s > _SAME_TIME * self.cell.controller.cycle_s)
        windows = windows_of(targets, chain, self.motion, self.cell)
        row = first + 1 + int(slow[0]) if len(slow) else None
        return TimedMotions(windows, targets, joints), row, later_s

    def _earlier(self, knots: Knots, most_s: float, layout: TimedMotions) -> PilotPlan | Issue:
        """Announce knots by triggers that are moved to earlier motions where too many would wait."""
        triggers, sooner_s = self._place(knots, layout.windows, spread=True)
        if sooner_s.max(initial=0.0) > most_s or self._too_many(triggers):
            return self._too_dense(knots)
        return self._planned(knots, triggers, layout)

    def _planned(
        self, knots: Knots, triggers: Triggers, layout: TimedMotions, end_line: int | None = None
    ) -> PilotPlan | Issue:
        count = len(knots)
        late = np.flatnonzero((triggers.row[:count] < 0) | (triggers.fire_s[:count] > knots.time_s))
        if len(late) or (triggers.row < 0).any():
            line = int(knots.line[late[0]]) if len(late) else int(knots.line[-1])
            return _refusal("pilot-late", line, "no motion is left to announce it in")
        lead_s = np.round(knots.time_s - triggers.fire_s[:count], LEAD_DECIMALS)
        announced = replace(knots, lead_s=lead_s)
        text = PilotText(
            announced,
            self._header(),
            self.cell.pilot.hash_variable,
            triggers,
            self.sidecar,
            end_line=end_line,
        )
        case = PilotCase(text, self.motion, self.motion.force_N, layout.windows)
        issues = (*knots.issues, *_short_leads(announced, self.cell))
        return PilotPlan(text, layout.targets, layout.joints, case, issues)

    def _place(
        self, knots: Knots, windows: Windows, spread: bool = False, ends: bool = False
    ) -> tuple[Triggers, Floats]:
        """Return the trigger of each knot, and (k,) the time in s by which it is earlier than needed.

        Dwells do not count: no trigger can act while the program waits, and their length is known.

        A receiver of values ramps towards the knot it has been told, so it must hear of it before the knot
        before; one that has the sidecar need not. ``ends`` adds one that acts the lead ahead of the last
        knot, so that no receiver runs beyond it.
        """
        earliest_s = windows.earliest_s(knots.time_s)
        told_s = knots.time_s.copy()
        if self.form == "values":
            same = earliest_s[1:] == earliest_s[:-1]
            told_s[1:] = np.where(same, knots.time_s[:-1], knots.time_s[1:])
        deadline_s = told_s - self.cell.pilot.lead_s - _SAFE_S
        if ends:
            end_s = knots.time_s[-1] - self.cell.pilot.lead_s - _SAFE_S
            deadline_s, earliest_s = np.append(deadline_s, end_s), np.append(earliest_s, earliest_s[-1])
        triggers = place_triggers(deadline_s, earliest_s, windows, self.cell, spread=spread)
        sooner_s = deadline_s - triggers.fire_s
        dwelt_s = windows.dwelt_s(deadline_s) - windows.dwelt_s(triggers.fire_s)
        return triggers, np.nan_to_num(sooner_s - dwelt_s)

    def _waiting(self, triggers: Triggers) -> Rows:
        """Return how many triggers (k,) wait from each on."""
        order = triggers.order
        return np.searchsorted(order, order + view(self.cell)) - np.arange(len(order))

    def _too_many(self, triggers: Triggers) -> bool:
        return most_active(triggers.order, view(self.cell)) > self.cell.pilot.max_active

    def _header(self) -> PilotHeader:
        pilot = self.cell.pilot
        variable = pilot.index_variable if self.form == "index" else pilot.value_variable
        return PilotHeader(pilot.frame, self.form, variable, pilot.lead_s)

    @cached_property
    def _move_end_s(self) -> Floats:
        return krc4.plan(self.chain, self.cell).move_end_s

    def _slower(self, later_s: Floats) -> Issue:
        """Return where pieces cost most time."""
        worst = int(np.argmax(np.abs(np.diff(later_s, prepend=0.0))))
        sentence = (
            f"knots so close that the motions between them are too short for the look-ahead cost "
            f"{np.abs(later_s).max():.2f} s, most at this line"
        )
        return _refusal("pilot-slows", int(self.chain.source_line[worst]), sentence)

    def _too_dense(self, knots: Knots) -> Issue:
        """Return where most knots come together, without being announced early."""
        triggers, _ = self._place(knots, self.windows)
        waiting = self._waiting(triggers)
        worst = int(np.argmax(waiting))
        sentence = (
            f"{waiting[worst]} knots of the pilot force would wait to be announced at the same time, "
            f"{self.cell.pilot.max_active} can, and the motions are too short to be cut"
        )
        return _refusal("pilot-dense", int(knots.line[worst]), sentence)


def lasting(later_s: Floats) -> Floats:
    """Return by how much (n,) the ends of motions are moved for good, from how they are moved (n,).

    A motion that ends where the robot rests ends when it comes to rest or when it is left: the same instants
    for the motions after it. Such an end alone is no time lost.
    """
    moved_s = np.abs(later_s)
    result: Floats = np.minimum(moved_s, np.append(moved_s[1:], moved_s[-1:]))
    return result


def _refusal(code: str, line: int, sentence: str) -> Issue:
    return Issue("error", code, line, sentence, "raise [pilot] tolerance_N, or --pilot none")


def _direction_changes(chain: Chain, windows: Windows, motion: PilotForce) -> Rows:
    """Return the samples in the middle of the corners that turn sharply."""
    sharp = chain.first + 1 + np.flatnonzero(chain.cos_half >= _SHARP)
    at = np.flatnonzero(np.isin(windows.row[:-1], sharp) & (np.diff(windows.row) == 1))
    middle_s = (windows.end_s[at] + windows.begin_s[at + 1]) / 2.0
    return np.minimum(np.searchsorted(motion.time_s, middle_s), len(motion) - 1).astype(np.int64)


def _short_leads(knots: Knots, cell: Cell) -> list[Issue]:
    """Return what there is to say of knots that a section begins with."""
    short = np.flatnonzero(knots.lead_s < cell.pilot.lead_s)
    if len(short) == 0:
        return []
    worst = int(short[np.argmin(knots.lead_s[short])])
    sentence = (
        f"{len(short)} knots of the pilot force are announced less than {cell.pilot.lead_s:.3f} s ahead, "
        f"this one {knots.lead_s[worst]:.3f} s: the robot starts here"
    )
    remedy = "begin the cut with a way in air; the sidecar has each knot's lead"
    return [Issue("warning", "pilot-lead", int(knots.line[worst]), sentence, remedy)]
