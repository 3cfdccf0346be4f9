"""From predicted forces to what a program says of them: knots, their triggers, and the motions they need."""

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gcode2krl import krc4
from gcode2krl.cell import Cell
from gcode2krl.errors import Issue, RefusedError, input_error
from gcode2krl.krc4 import Chain
from gcode2krl.krl.advance import most_active, view
from gcode2krl.krl.cuts import cut_for
from gcode2krl.krl.pieces import Pieces, split
from gcode2krl.krl.pilot_check import PilotCase
from gcode2krl.krl.pilot_text import PilotText
from gcode2krl.krl.triggers import Triggers, place_triggers
from gcode2krl.krl.windows import Windows, windows_of
from gcode2krl.pilot import Knots, PilotHeader, knots_of, to_pilot_frame
from gcode2krl.pilot.knots import LEAD_DECIMALS
from gcode2krl.prediction import Prediction
from gcode2krl.tables import Joints, Motion, Targets
from gcode2krl.units import RAD_PER_DEG

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]
Form = Literal["index", "values"]
_SHARP = np.sin(30.0 * RAD_PER_DEG / 2.0)
"""cos(alpha/2) from which a corner is a change of direction: it turns by 30° or more. Our choice; what turns
less is left to the tolerance of the knots."""
_COARSER = (1.25, 1.6, 2.0, 2.5, 3.2, 4.0, 5.0)
"""What the default tolerance is multiplied by until the knots can be announced; a stated one stays."""
_LITTLE_SOONER_S, _MOST_SOONER_S = 0.2, 1.0
"""How much earlier than needed a knot may be announced, rather than that motions are cut, and at most."""
_SAFE_S = 0.002
"""Added to the lead: what an instant read from the samples of a Motion may be off by."""
_NONE, _ENDS = "the program carries no pilot force", "the pilot force ends before this line"
_LEAST_KNOTS = 2
_TRIALS = 8
"""How often a pilot force is shortened before it is left out."""
_SAME_TIME = 0.5
"""Share of a cycle by which pieces may change the time of a program."""


@dataclass(frozen=True)
class PilotPlan:
    """The pilot force of a program, and the program with the motions it needs."""

    text: PilotText
    targets: Targets
    joints: Joints
    case: PilotCase
    """What the program is checked against once it is written."""
    issues: tuple[Issue, ...]


def plan_pilot(
    prediction: Prediction, joints: Joints, form: Form, sidecar: bool = True, *, asked: bool = True
) -> PilotPlan | Issue:
    """Return the pilot of a prediction with forces, and the targets and joints with the motions it needs.

    Where the knots of the default tolerance cannot be announced in time, the tolerance is raised, with a
    finding. Where that does not help either, or the tolerance is stated in the cell, a pilot that was asked
    for raises `RefusedError`; one that was not ends before that place, with a warning, and where nothing is
    left of it the warning is returned instead.
    """
    try:
        outcome = _fitting(_Plan(prediction, joints, form, sidecar), asked)
    except RefusedError as error:  # the motion is not that of the targets
        outcome = error.issues[0]
    if not isinstance(outcome, Issue):
        return outcome
    if asked:
        raise RefusedError(outcome)
    return left_out(outcome)


def left_out(reason: Issue) -> Issue:
    """Return the warning that a program has no pilot force."""
    return replace(reason, severity="warning", code="pilot-left-out", message=f"{_NONE}: {reason.message}")


def _fitting(plan: "_Plan", asked: bool) -> PilotPlan | Issue:
    """Return the plan with the finest tolerance that can be announced."""
    stated = plan.cell.pilot.tolerance_N
    knots = plan.knots(stated)
    first_N = knots.tolerance_N
    outcome = plan.announce(knots)
    if isinstance(outcome, PilotPlan):
        return outcome
    if stated is None:
        knots = plan.knots(_COARSER[-1] * first_N)
        outcome = plan.announce(knots)
    if isinstance(outcome, Issue):
        return outcome if asked else plan.up_to(knots, outcome)
    for factor in _COARSER[:-1]:
        finer = plan.announce(plan.knots(factor * first_N))
        if isinstance(finer, PilotPlan):
            outcome = finer
            break
    used_N = outcome.text.knots.tolerance_N
    sentence = f"knots were too close to be announced: tolerance {used_N:.1f} N, not {first_N:.1f} N"
    raised = Issue("warning", "pilot-tolerance", 0, sentence, "state [pilot] tolerance_N, or --pilot none")
    return replace(outcome, issues=(raised, *outcome.issues))


def pilot_forces(prediction: Prediction) -> tuple[Motion, Floats, Floats | None]:
    """Return the Motion, and forces and deflection (m, 3) in the pilot frame, None where not predicted.

    Raises `NotUnderstoodError` for a prediction without forces.
    """
    motion, forces, deflection = prediction.motion, prediction.forces, prediction.deflection
    if motion is None or forces is None:
        sentence = "the prediction has no forces to pilot with"
        raise input_error("option-value", sentence, "predict with a material and stock, or --pilot none")

    def turned(vector: Floats) -> Floats:
        return to_pilot_frame(vector, motion.rotation, motion.tool, prediction.cell)

    bent = turned(deflection.deflection_base_mm) if deflection is not None else None
    return motion, turned(forces.force_base_N), bent


class _Plan:
    """What stays the same while knots are tried."""

    def __init__(self, prediction: Prediction, joints: Joints, form: Form, sidecar: bool) -> None:
        self.targets, self.joints, self.cell = prediction.targets, joints, prediction.cell
        self.form, self.sidecar = form, sidecar
        self.motion, self.force_N, self.bent_mm = pilot_forces(prediction)
        self.line = prediction.toolpath.source_line[self.motion.move]
        self.chain = krc4.build_chain(self.targets, self.cell)
        self.windows = windows_of(self.targets, self.chain, self.motion, self.cell)

    def knots(self, tolerance_N: float | None) -> Knots:
        """Return the knots of a tolerance."""
        return knots_of(
            self.motion.time_s,
            self.motion.path_mm,
            self.force_N,
            self.bent_mm,
            _direction_changes(self.chain, self.windows, self.motion),
            line=self.line,
            tolerance_N=tolerance_N,
            cycle_s=self.cell.controller.cycle_s,
        )

    def announce(self, knots: Knots) -> PilotPlan | Issue:
        """Return the plan that announces the knots, or why there is none.

        Where too many triggers would wait at the same time, knots are announced a little earlier; where that
        is not enough, long motions are cut; and what is then left is announced still earlier.
        """
        triggers, _ = self._place(knots, self.windows)
        if not self._too_many(triggers):
            return self._planned(knots, triggers, self.windows, self.targets, self.joints)
        whole = (self.windows, self.targets, self.joints)
        outcome = self._earlier(knots, _LITTLE_SOONER_S, *whole)
        if isinstance(outcome, Issue):
            pieces = cut_for(triggers, self.windows, self.chain, self.targets, self.motion, self.cell)
            if pieces is not None:
                outcome = self._in_pieces(knots, pieces)
        if isinstance(outcome, Issue):
            other = self._earlier(knots, _MOST_SOONER_S, *whole)
            outcome = outcome if isinstance(other, Issue) else other
        return outcome

    def up_to(self, knots: Knots, why: Issue) -> PilotPlan | Issue:
        """Announce the first knots, as many as can be, then that there is no knot any more."""
        count = len(knots)
        for _ in range(_TRIALS):
            count = min(count - 1, self._count_in_time(knots, count))
            if count < _LEAST_KNOTS:
                break
            outcome = self._ending(_first(knots, count), int(knots.line[count]), why)
            if isinstance(outcome, PilotPlan):
                return outcome
        return why

    def _count_in_time(self, knots: Knots, count: int) -> int:
        """Return how many of the first knots can be announced without motions that are cut."""
        tried = _first(knots, count)
        triggers, sooner_s = self._place(tried, self.windows, spread=True)
        fits = (triggers.row >= 0) & (triggers.fire_s <= tried.time_s) & (sooner_s <= _MOST_SOONER_S)
        waiting = self._waiting(triggers) <= self.cell.pilot.max_active
        fits[self.cell.pilot.max_active :] &= waiting[: -self.cell.pilot.max_active]
        return count if fits.all() else int(np.argmin(fits))

    def _ending(self, knots: Knots, end_line: int, why: Issue) -> PilotPlan | Issue:
        """Announce knots and, the lead ahead of the last one, that no knot follows."""
        triggers, sooner_s = self._place(knots, self.windows, spread=True, ends=True)
        if sooner_s.max(initial=0.0) > _MOST_SOONER_S or self._too_many(triggers):
            return self._too_dense(knots)
        outcome = self._planned(knots, triggers, self.windows, self.targets, self.joints, end_line)
        if isinstance(outcome, Issue):
            return outcome
        sentence = f"{_ENDS}: {why.message}"
        ended = Issue("warning", "pilot-left-out", end_line, sentence, why.remedy)
        return replace(outcome, issues=(ended, *outcome.issues))

    def _in_pieces(self, knots: Knots, pieces: Pieces) -> PilotPlan | Issue:
        """Announce knots in a program whose motions are cut."""
        targets, joints, own = split(self.targets, self.joints, pieces, self.cell)
        chain = krc4.build_chain(targets, self.cell)
        slower = self._slower(chain, own)
        if slower is not None:
            return slower
        windows = windows_of(targets, chain, self.motion, self.cell)
        return self._earlier(knots, _MOST_SOONER_S, windows, targets, joints)

    def _earlier(
        self, knots: Knots, most_s: float, windows: Windows, targets: Targets, joints: Joints
    ) -> PilotPlan | Issue:
        """Announce knots by triggers that are moved to earlier motions where too many would wait."""
        triggers, sooner_s = self._place(knots, windows, spread=True)
        if sooner_s.max(initial=0.0) > most_s or self._too_many(triggers):
            return self._too_dense(knots)
        return self._planned(knots, triggers, windows, targets, joints)

    def _planned(
        self, knots: Knots, triggers: Triggers, windows: Windows, targets: Targets, joints: Joints,
        end_line: int | None = None,
    ) -> PilotPlan | Issue:  # fmt: skip
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
        case = PilotCase(text, self.motion, self.force_N, windows)
        issues = (*knots.issues, *_short_leads(announced, self.cell))
        return PilotPlan(text, targets, joints, case, issues)

    def _place(
        self, knots: Knots, windows: Windows, spread: bool = False, ends: bool = False
    ) -> tuple[Triggers, Floats]:
        """Return the trigger of each knot, and (k,) by how much it is earlier than it needs to be.

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
        return triggers, np.nan_to_num(deadline_s - triggers.fire_s)

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

    def _slower(self, chain: Chain, own: Rows) -> Issue | None:
        """Return where the pieces cost time, by the controller's model; ``own`` (p,) are no pieces."""
        first, count = self.chain.first, len(self.chain.length_mm)
        rows = own[first + 1 : first + 1 + count] - chain.first - 1
        later_s = krc4.plan(chain, self.cell).move_end_s[rows] - self._move_end_s
        if np.abs(later_s).max(initial=0.0) <= _SAME_TIME * self.cell.controller.cycle_s:
            return None
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


def _refusal(code: str, line: int, sentence: str) -> Issue:
    return Issue("error", code, line, sentence, "raise [pilot] tolerance_N, or --pilot none")


def _first(knots: Knots, count: int) -> Knots:
    """Return the first knots."""
    rows = {spec.name: getattr(knots, spec.name)[:count] for spec in fields(knots) if "tail" in spec.metadata}
    return replace(knots, **rows)


def _direction_changes(chain: Chain, windows: Windows, motion: Motion) -> Rows:
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
