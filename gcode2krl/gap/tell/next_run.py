"""The next run as the answer states it: the program, what it parts, and what it shows in either case."""

from collections.abc import Iterator, Sequence

from gcode2krl.gap.beside.context import Context
from gcode2krl.gap.choose.judged import Judgement
from gcode2krl.gap.choose.next_run import Choice, Family, Parting, choose_next_run
from gcode2krl.gap.choose.separation import Apart
from gcode2krl.gap.tell.result import DependsOnResult, Expectation, NextRun, Separates
from gcode2krl.units import S_PER_MIN

_SIGNALS = {
    "tcp": "at the tip",
    "force": "of force",
    "joint_actual": "of servo error",
    "joint_load": "behind the gear",
    "joint_commanded": "off the commanded path",
}
_SEEN = 2.0
"""Standard deviations below which a value is nothing."""
_MANY_S = 100.0
"""Times from here on are told in minutes."""


def next_run_of(
    context: Context, judgements: Sequence[Judgement], depends_on: Sequence[DependsOnResult] = ()
) -> NextRun | None:
    """Return the run that parts best what is left open; None where nothing is."""
    families = [Family(each.link, each.at, each.on, each.form, each.probability) for each in depends_on]
    choice = choose_next_run(context, judgements, families)
    return None if choice is None else told(choice)


def told(choice: Choice) -> NextRun:
    """Return a choice in words."""
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


def _expected(partings: Sequence[Parting]) -> Iterator[Expectation]:
    """Yield what each answer shows, by the pair in which the program parts it best from another."""
    told_of: set[str] = set()
    for parting in sorted(partings, key=lambda parting: -parting.odds):
        apart = parting.apart
        for answer, value in ((parting.pair.first, apart.first), (parting.pair.second, apart.second)):
            if answer.label not in told_of:
                told_of.add(answer.label)
                yield Expectation(answer=answer.label, shows=shown(apart, value))


def shown(apart: Apart, value: float) -> str:
    """Return what a value at the moment at which two answers are farthest apart looks like."""
    after = _after(apart.time_s)
    if abs(value) < _SEEN * apart.noise:
        return f"nothing above the noise after {after}"
    place = _SIGNALS.get(apart.signal, apart.signal)
    return f"{value:+.2g} {apart.unit} in {apart.component} {place} after {after}"


def _after(time_s: float) -> str:
    return f"{time_s:.0f} s" if time_s < _MANY_S else f"{time_s / S_PER_MIN:.0f} min"
