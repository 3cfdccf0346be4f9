"""The next run as the answer states it: the program, what it parts, and what it shows in either case."""

from collections.abc import Iterator, Sequence

from gcode2krl.canned.draft import REFERENCE_DWELL_S
from gcode2krl.gap.beside.context import Context
from gcode2krl.gap.choose.judged import Judgement
from gcode2krl.gap.choose.next_run import Again, Choice, Family, Parting, choose_next_run
from gcode2krl.gap.choose.separation import Apart
from gcode2krl.gap.tell.result import DependsOnResult, Expectation, NextRun, Separates
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.units import S_PER_MIN

_SIGNALS = {
    "tcp": "at the tip",
    "force": "of force",
    "joint_actual": "of servo error",
    "joint_load": "behind the gear",
    "joint_commanded": "off the commanded path",
}
_LIMITS = THRESHOLDS.tell


def next_run_of(
    context: Context, judgements: Sequence[Judgement], depends_on: Sequence[DependsOnResult] = ()
) -> NextRun | None:
    """Return the run that parts best what is left open; None where nothing is."""
    families = [Family(each.link, each.at, each.on, each.form, each.probability) for each in depends_on]
    choice = choose_next_run(context, judgements, families)
    return None if choice is None else told(choice)


def told(choice: Choice) -> NextRun:
    """Return a choice in words."""
    if choice.again is not None:
        return _told_again(choice, choice.again)
    return NextRun(
        program=choice.program,
        minutes=round(choice.minutes, 1),
        separates=tuple(
            Separates(
                first=parting.pair.first.label,
                second=parting.pair.second.label,
                odds=float(f"{parting.odds:.3g}"),
            )
            for parting in choice.partings
        ),
        expect=tuple(_expected(choice.partings)),
    )


def _told_again(choice: Choice, again: Again) -> NextRun:
    """Return a repetition in words."""
    back, once = "it comes back", "it happened once"
    place = _SIGNALS.get(again.signal, again.signal)
    return NextRun(
        program=choice.program,
        minutes=round(choice.minutes, 1),
        separates=(Separates(first=back, second=once, odds=float(f"{again.odds:.3g}")),),
        expect=(
            Expectation(answer=back, shows=f"{again.rms:.2g} {again.unit} {place} again, at the same places"),
            Expectation(answer=once, shows="nothing above the noise"),
        ),
    )


def _expected(partings: Sequence[Parting]) -> Iterator[Expectation]:
    """Yield what each answer shows, by the pair in which the program parts it best from another."""
    told_of: set[str] = set()
    for parting in sorted(partings, key=lambda parting: -parting.odds):
        apart, first, second = parting.apart, parting.pair.first.label, parting.pair.second.label
        for label, other, value in ((first, second, apart.first), (second, first, apart.second)):
            if label not in told_of:
                told_of.add(label)
                same = f"the same as if {other}: no program parts them"
                told = same if parting.odds < _LIMITS.parted_odds else shown(apart, value)
                yield Expectation(answer=label, shows=told)


def shown(apart: Apart, value: float) -> str:
    """Return what a value at the moment at which two answers are farthest apart looks like."""
    after = _after(apart.time_s)
    if abs(value) < _LIMITS.seen_sigma * apart.noise / _values_at_a_point() ** 0.5:
        return f"nothing above the noise after {after}"
    place = _SIGNALS.get(apart.signal, apart.signal)
    since = " since the start" if apart.is_change else ""
    return f"{value:+.2g} {apart.unit} in {apart.component} {place} after {after}{since}"


def _values_at_a_point() -> float:
    """Return how many independent values a reference point gives."""
    return REFERENCE_DWELL_S / THRESHOLDS.choose.trial_step_s


def _after(time_s: float) -> str:
    return f"{time_s:.0f} s" if time_s < _LIMITS.minutes_from_s else f"{time_s / S_PER_MIN:.0f} min"
