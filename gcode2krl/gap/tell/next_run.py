"""The next run as the answer states it: the program, what it parts, and what it shows in either case."""

from collections.abc import Iterator, Sequence
from itertools import pairwise

from gcode2krl.canned.draft import REFERENCE_DWELL_S
from gcode2krl.gap.beside.context import Context
from gcode2krl.gap.choose.judged import Judgement
from gcode2krl.gap.choose.next_run import (
    ALWAYS,
    BACK,
    CUT,
    MOTION,
    ONCE,
    Bare,
    Choice,
    Family,
    OpenPair,
    Parting,
    choose_next_run,
)
from gcode2krl.gap.choose.separation import Apart
from gcode2krl.gap.families.evidence import Evidence
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
    context: Context,
    judgements: Sequence[Judgement],
    depends_on: Sequence[tuple[DependsOnResult, Evidence | None]] = (),
) -> NextRun | None:
    """Return the run that parts best what is left open; None where nothing is."""
    families = [
        Family(each.link, each.at, each.on, each.form, each.probability, evidence)
        for each, evidence in depends_on
    ]
    choice = choose_next_run(context, judgements, families)
    return None if choice is None else told(choice)


def told(choice: Choice) -> NextRun:
    """Return a choice in words."""
    if choice.bare is not None:
        return _told_bare(choice, choice.bare)
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


def _told_bare(choice: Choice, bare: Bare) -> NextRun:
    """Return the first question that is asked of a gap."""
    place = _SIGNALS.get(bare.signal, bare.signal)
    size = f"{bare.rms:.2g} {bare.unit} RMS {place}"
    shows = {
        BACK: f"{size} again, at the same places",
        ONCE: "nothing above the noise",
        CUT: "nothing above the noise: the program is in air",
        MOTION: f"about {size} while it moves, nothing at the reference points",
        ALWAYS: f"about {size}, at the reference points too",
    }
    odds = float(f"{bare.odds:.3g}")
    return NextRun(
        program=choice.program,
        minutes=round(choice.minutes, 1),
        separates=tuple(
            Separates(first=first, second=second, odds=odds) for first, second in pairwise(bare.asks)
        ),
        expect=tuple(Expectation(answer=each, shows=shows[each]) for each in bare.asks),
    )


def _expected(partings: Sequence[Parting]) -> Iterator[Expectation]:
    """Yield what each answer shows, by the pair in which the program parts it best from another."""
    told_of: set[str] = set()
    for parting in sorted(partings, key=lambda parting: -parting.odds):
        pair, apart = parting.pair, parting.apart
        words = _in_words(pair, apart)
        for answer, other, said in ((pair.first, pair.second, words[0]), (pair.second, pair.first, words[1])):
            if answer.label not in told_of:
                told_of.add(answer.label)
                same = f"the same as if {other.label}: no program parts them"
                is_same = parting.odds < _LIMITS.parted_odds or words[0] == words[1]
                yield Expectation(answer=answer.label, shows=same if is_same else said)


def _in_words(pair: OpenPair, apart: Apart) -> tuple[str, str]:
    """Return what both answers show; of what nobody can simulate, that it is something else."""
    first = shown(apart, apart.first, apart.is_open[0])
    if pair.second.applied is None and pair.second.evidence is None:
        return first, f"anything but {first}"
    return first, shown(apart, apart.second, apart.is_open[1])


def shown(apart: Apart, value: float, is_open: bool = False) -> str:
    """Return what a value at the moment at which two answers are farthest apart looks like.

    ``is_open``: the runs do not say which way it goes.
    """
    after = _after(apart.time_s)
    if abs(value) < _LIMITS.seen_sigma * apart.noise / _values_at_a_point() ** 0.5:
        return f"nothing above the noise after {after}"
    place = _SIGNALS.get(apart.signal, apart.signal)
    since = " since the start" if apart.is_change else ""
    size = f"up to {value:.2g} {apart.unit} either way" if is_open else f"{value:+.2g} {apart.unit}"
    return f"{size} in {apart.component} {place} after {after}{since}"


def _values_at_a_point() -> float:
    """Return how many independent values a reference point gives."""
    return REFERENCE_DWELL_S / THRESHOLDS.choose.trial_step_s


def _after(time_s: float) -> str:
    return f"{time_s:.0f} s" if time_s < _LIMITS.minutes_from_s else f"{time_s / S_PER_MIN:.0f} min"
