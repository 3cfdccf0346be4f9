"""From predicted forces to the pilot force of a program, coarser or shorter where that is needed."""

from dataclasses import fields, replace

from gcode2krl.errors import Issue, RefusedError
from gcode2krl.krl.announce import Form, PilotPlan, Planner, TimedMotions
from gcode2krl.pilot import Knots
from gcode2krl.prediction.forecast import Forecast
from gcode2krl.tables import Joints

_COARSER = (1.25, 1.6, 2.0, 2.5, 3.2, 4.0, 5.0)
"""What the default tolerance is multiplied by until the knots can be announced; a stated one stays."""
_LEAST_KNOTS = 2
_TRIALS = 8
"""Attempts to shorten a pilot force before it is left out."""


def plan_pilot(
    source: Forecast, joints: Joints, form: Form, sidecar: bool = True, *, asked: bool = True
) -> PilotPlan | Issue:
    """Return the pilot of a forecast with forces, and the targets and joints with the motions it needs.

    Where the knots of the default tolerance cannot be announced in time, the tolerance is raised, with a
    finding. Where that does not help either, or the tolerance is stated in the cell, a pilot that was asked
    for raises `RefusedError`; one that was not ends before that place, with a warning, and where nothing is
    left of it the warning is returned instead.
    """
    outcome: PilotPlan | Issue
    try:
        outcome = _fitting(Planner(source, joints, form, sidecar), asked)
    except RefusedError as error:  # the motion is not that of the targets
        outcome = error.issues[0]
    if not isinstance(outcome, Issue):
        return outcome
    if asked:
        raise RefusedError(outcome)
    return left_out(outcome)


def left_out(reason: Issue) -> Issue:
    """Return the warning that a program has no pilot force."""
    sentence = f"the program carries no pilot force: {reason.message}"
    return replace(reason, severity="warning", code="pilot-left-out", message=sentence)


def _fitting(plan: Planner, asked: bool) -> PilotPlan | Issue:
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
        return outcome if asked else _shortened(plan, knots, outcome)
    for factor in _COARSER[:-1]:
        finer = plan.announce(plan.knots(factor * first_N))
        if isinstance(finer, PilotPlan):
            outcome = finer
            break
    used_N = outcome.text.knots.tolerance_N
    sentence = f"knots were too close to be announced: tolerance {used_N:.1f} N, not {first_N:.1f} N"
    raised = Issue("warning", "pilot-tolerance", 0, sentence, "state [pilot] tolerance_N, or --pilot none")
    return replace(outcome, issues=(raised, *outcome.issues))


def _shortened(plan: Planner, knots: Knots, why: Issue) -> PilotPlan | Issue:
    """Return the plan of as many of the first knots as can be announced; why not where that is none."""
    counted = [(_most_in_time(plan, knots, layout), layout) for layout in plan.layouts(knots)]
    count, layout = max(counted, key=lambda found: found[0])
    count = min(count, len(knots) - 1)
    for fewer in range(_TRIALS):  # the end needs a trigger too
        if count - fewer < _LEAST_KNOTS:
            break
        line = int(knots.line[count - fewer])
        outcome = plan.announce_ending(_first(knots, count - fewer), line, layout)
        if isinstance(outcome, PilotPlan):
            sentence = "the pilot force ends before this line: its knots are too close to be announced"
            ended = Issue("warning", "pilot-left-out", line, sentence, why.remedy)
            return replace(outcome, issues=(ended, *outcome.issues))
    return why


def _most_in_time(plan: Planner, knots: Knots, layout: TimedMotions) -> int:
    """Return how many of the first knots can be announced, by bisection.

    Triggers of later knots push those of earlier ones, so a shorter pilot force is never harder to announce.
    """
    enough, too_many = 0, len(knots) + 1
    while too_many - enough > 1:
        count = (enough + too_many) // 2
        if plan.all_in_time(_first(knots, count), layout):
            enough = count
        else:
            too_many = count
    return enough


def _first(knots: Knots, count: int) -> Knots:
    """Return the first knots."""
    rows = {spec.name: getattr(knots, spec.name)[:count] for spec in fields(knots) if "tail" in spec.metadata}
    return replace(knots, **rows)
