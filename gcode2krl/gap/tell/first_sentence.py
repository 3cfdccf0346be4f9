"""The first sentence, in a person's words: how far the part is off, where most of it is, and why."""

import math
from collections.abc import Sequence

from gcode2krl.gap.tell.events import IMPULSE
from gcode2krl.gap.tell.result import (
    AtPart,
    CauseResult,
    EventResult,
    Gap,
    IntervalResult,
    MomentResult,
    PhaseResult,
)
from gcode2krl.gap.tell.words import describe, listed, named, number, rounded, unit_of, what_there_is
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.tell
_OFF = {
    "tip": "The tip is off by {size} RMS",
    "part": "The part is off by {size} RMS",
    "force": "The measured force is off by {size} RMS",
    "joints": "The joints are off by {size} RMS",
}
_PHASES = {
    "corner": "at corners",
    "reversal": "after reversals",
    "entry": "where the cutter enters",
    "exit": "where it leaves",
    "cruise": "while cutting",
    "air": "in air",
}
_SHARES = {0.9: "nearly all of it", 0.75: "four fifths of it", 0.6: "two thirds of it", 0.0: "half of it"}
"""Least share -> words for it."""


def headline(gap: Gap) -> str:
    """Return the first sentences: the size at the part and its causes, then what is left with them."""
    slip = next((cause for cause in gap.named_causes if cause.words is not None), None)
    if slip is not None:
        return f"Set-up slip: {slip.words}."
    if gap.verdict == "no_gap":
        return _no_gap(gap)
    hit = _hit(gap)
    if hit and not gap.causes and all(each.form == IMPULSE for each in gap.unexplained.depends_on):
        return f"{hit}. What else the runs differ by, noise and normal mismatch explain."
    usual = " ".join(filter(None, (f"{_off(gap)}{_mostly(gap)}: {_why(gap)}.", _left(gap))))
    return f"{hit}. {usual}" if hit else usual


def _hit(gap: Gap) -> str:
    """Return what happened in a moment, and what it left behind; nothing where nothing did.

    What a force sensor and the tip, or a joint from then on, show at once was a blow; one reading alone may
    be one of its instrument.
    """
    impulses = [each for each in gap.events if each.what == IMPULSE]
    event = max(impulses, key=lambda each: (each.link == "force", each.size), default=None)
    if event is None:
        return ""
    step = next((cause for cause in gap.named_causes if _is_at(cause.moment, event)), None)
    at = f"at {event.t_s:.2f} s of {event.run}, line {event.line}"
    others = [each for each in gap.events if each.what != "burst" and each.link != event.link]
    together = [each for each in others if each.run == event.run and _is_near(each.t_s, event.t_s)]
    if event.link == "force" and (step or together):
        said = f"The tool hit something {at}: {_force(event.size)}"
    else:
        where = "force" if event.link == "force" else f"{event.link} signal"
        size = _force(event.size) if event.unit == "N" else amount(event.size, event.unit)
        said = f"The {where} jumps {at}, for {amount(max(event.lasts_s, 1e-3), 's')}: {size}"
    if step is None:
        return said
    name = next((name for name in step.parameters if name.startswith("size_")), None)
    if name is None:
        return said
    off = f"{number(abs(step.parameters[name].value))} {unit_of(name)[1]}"
    return f"{said}; since then {'the tip' if step.target == 'tip' else step.target} is off by {off}"


def _is_at(moment: MomentResult | None, event: EventResult) -> bool:
    return moment is not None and moment.run == event.run and _is_near(moment.t_s, event.t_s)


def _is_near(one_s: float, other_s: float) -> bool:
    return abs(one_s - other_s) < _LIMITS.same_moment_s


def _force(size_N: float) -> str:
    return f"{rounded(size_N / 1000.0)} kN" if size_N >= 1000.0 else f"{rounded(size_N)} N"


def _no_gap(gap: Gap) -> str:
    tip = next((link for link in gap.links if link.link == "mechanics"), None)
    if tip is not None:
        what = f"the tip is off by {amount(tip.rms_before, tip.unit)} RMS"
        if tip.noise is not None and tip.noise.is_a_guess:
            return (
                f"No gap is named, but the noise is unknown: {what}, noise or a gap that no effect explains."
            )
        return f"No gap: {what}, which noise and normal mismatch explain."
    size = gap.gap
    if size.rms_before is None:
        return "Nothing was compared: see what is not examined."
    return f"No gap: {amount(size.rms_before, size.unit)} RMS are what noise and normal mismatch explain."


def amount(value: float, unit: str) -> str:
    """Return a size in a unit that a person would use: seconds below 0.1 as milliseconds."""
    if unit == "s" and value < _LIMITS.in_ms_below_s:
        return f"{rounded(1000.0 * value)} ms"
    return f"{rounded(value)} {unit}"


def _off(gap: Gap) -> str:
    at = gap.at_part
    if at is None:
        size = gap.gap
        return "The runs differ" if size.rms_before is None else f"{rounded(size.rms_before)} {size.unit} RMS"
    size_text, worst = amount(at.rms_before, at.unit), _worst_run(at)
    if at.what != "time":
        return _OFF[at.what].format(size=size_text) + worst
    if at.link == "timing":
        return f"The robot is {size_text} RMS early or late on its path{worst}"
    return f"Time stamps are off by {size_text}"


def _worst_run(at: AtPart) -> str:
    """Return the size of the gap in the run that is off most, where it is off by much more than all are."""
    worst = max(at.per_run, key=lambda each: each.rms_before, default=None)
    if worst is None or worst.rms_before < _LIMITS.worst_run * at.rms_before:
        return ""
    return f", {amount(worst.rms_before, at.unit)} in {worst.run}"


def _mostly(gap: Gap) -> str:
    """Return in which phase most of a gap is, as the end of a clause; nothing where that says nothing.

    A phase is named where the gap is larger than elsewhere, not where the robot merely is most of the time:
    a constant offset has its power wherever the time is spent.
    """
    phases, joints, at = gap.where.phases, gap.where.joints, gap.at_part
    if not phases or phases[0].share < _LIMITS.phase_named_share:
        return ""
    if at is not None and at.what == "time":
        return ""
    first = phases[0]
    if first.rms < _LIMITS.phase_over_rest * _rms_of(phases[1:]):
        return ""
    share = next(words for least, words in _SHARES.items() if first.share >= least)
    if at is not None and _worst_run(at):
        share = share.replace("of it", "of the gap")  # "it" would be that run's
    joint = f" of axis {joints[0].joint[1:]}" if first.phase == "reversal" and joints else ""
    return f", {share} {_PHASES[first.phase]}{joint}"


def _rms_of(phases: Sequence[PhaseResult]) -> float:
    """Return the rms of a gap in several phases together; infinite where there is none to compare with."""
    if not phases:
        return math.inf
    power = sum(phase.share for phase in phases)
    time = sum(phase.share / phase.rms**2 for phase in phases if phase.rms > 0.0)
    return math.sqrt(power / time) if time > 0.0 else 0.0


def _why(gap: Gap) -> str:
    causes = gap.named_causes[: _LIMITS.headline_causes]
    if causes:
        return listed([describe(cause, _LIMITS.headline_numbers) for cause in causes])
    words = "no effect of the library explains it"
    if gap.unexplained.depends_on:
        words += f"; it is {what_there_is(gap.unexplained.depends_on[0])}"
    unsure = [cause for cause in gap.causes if cause.probability >= _LIMITS.worth_a_word]
    if unsure:
        words += f"; perhaps {listed([_perhaps(cause) for cause in unsure], 'or')}"
    return words


def _perhaps(cause: CauseResult) -> str:
    return f"{named(cause.effect, cause.target)} ({cause.probability:.2f})"


def _left(gap: Gap) -> str:
    """Return what is left with the named causes in the model; nothing without one."""
    number = len(gap.named_causes)
    if number == 0:
        return ""
    model = f"With {'it' if number == 1 else 'them'} in the model"
    held = " on data not used" if gap.gap.held_out else ""
    at = gap.at_part
    if at is None or at.rms_after is None or at.noise is None:
        if gap.gap.shrink is None:
            return ""
        return f"{model} {gap.gap.shrink:.0%} of the gap is gone{held}{_rest(gap)}."
    left = amount(at.rms_after, at.unit)
    before = at.held_out_before
    if held and before is not None and not _is_about(before, at.rms_before):
        left += f" of {amount(before, at.unit)}"
    return f"{model} {left} are left{held}{_beside(at)}{_rest(gap)}."


def _is_about(size: float, other: float) -> bool:
    """Tell whether two sizes are so near that one cannot be mistaken for another share of a gap."""
    return max(size, other) < _LIMITS.worst_run * min(size, other)


def _beside(at: AtPart) -> str:
    return "" if at.noise is None else f", the noise is {amount(at.noise, at.unit)}"


def _rest(gap: Gap) -> str:
    """Return that more is left than noise explains, and on what that depends; nothing where it is not."""
    if not gap.unexplained.significant:
        return ""
    on = gap.unexplained.depends_on
    return "; more is left than noise explains" + (f": {what_there_is(on[0])}" if on else "")


def stretch(interval: IntervalResult) -> str:
    """Return where a stretch is: run, times and G-code lines."""
    lines = f", lines {interval.lines[0]}-{interval.lines[1]}" if interval.lines else ""
    first_s = max(interval.t_start_s, 0.0)
    return f"{interval.run}: {first_s:.2f}-{interval.t_end_s:.2f} s{lines}"
