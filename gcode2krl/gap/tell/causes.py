"""Causes as the answer states them: effects that a link was explained by, and set-up slips."""

from collections.abc import Iterator, Sequence

import numpy as np

from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.gap.beside.events import line_at
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.choose.intervals import Interval
from gcode2krl.gap.choose.judged import Cause, Judged
from gcode2krl.gap.choose.probability_table import declared_nats
from gcode2krl.gap.slips.slip import Slip
from gcode2krl.gap.tell.result import CauseResult, EffectAt, MomentResult, RivalResult, UnknownAt
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.units import S_PER_H


def cause_of(cause: Cause, judgement: Judged, link: str, pairs: Sequence[Pair] = ()) -> CauseResult:
    """Return a cause of a judged link; ``link`` is the name of that which it is reported in.

    ``pairs`` are the runs, in which a moment is told.
    """
    compared = cause.rivals or ()
    alike = [rival for rival, _ in compared if rival.alike]
    others = [each for each in compared if not each[0].alike]
    return CauseResult(
        effect=cause.applied.effect.name,
        target=cause.applied.target,
        link=link,
        probability=cause.probability,
        parameters=cause.parameters,
        shrink=cause.shrink,
        rms_after=None if cause.rms_after is None else judgement.factor * cause.rms_after,
        constant=cause.constant,
        indistinguishable_from=(
            *(
                EffectAt(rival.applied.effect.name, rival.applied.target, rival.behind_nats)
                for rival in alike[: THRESHOLDS.tell.most_alike]
            ),
            *_unknown(cause),
        ),
        rivals=None
        if cause.rivals is None
        else tuple(
            RivalResult(
                rival.applied.effect.name, rival.applied.target, probability, behind_nats=rival.behind_nats
            )
            for rival, probability in others
        ),
        family=_family(cause),
        form_fits=None if cause.tests is None else cause.tests.form_ratio,
        family_probability=cause.family_probability,
        tests=None if cause.features is None else cause.features.as_dict(),
        moment=_moment(cause, pairs),
    )


def _moment(cause: Cause, pairs: Sequence[Pair]) -> MomentResult | None:
    """Return the moment at which a cause begins, in the run that it is in; None where it has none."""
    moment = cause.applied.effect.moment
    if moment is None:
        return None
    at_s = cause.applied[moment.name]
    for pair in pairs:
        times_s = pair.inputs.run_hours * S_PER_H
        if times_s[0] <= at_s <= times_s[-1]:
            t_s = float(np.interp(at_s, times_s, pair.inputs.time_s))
            return MomentResult(run=pair.name, t_s=t_s, line=line_at(pair.inputs, t_s))
    return None


def _unknown(cause: Cause) -> Iterator[UnknownAt]:
    """Yield an unknown of a cause's kind, where the data do not tell it from the cause's form."""
    tests = cause.tests
    if tests is None or tests.family is None or tests.family_behind is None:
        return
    if tests.family_behind < declared_nats():
        yield UnknownAt(tests.family.place.name, tests.family.on.value)


def _family(cause: Cause) -> str | None:
    """Return where and on what a cause depends: the best member of its family, ``A2, reversals``."""
    if cause.tests is None or cause.tests.family is None:
        return None
    return f"{cause.tests.family.place.name}, {cause.tests.family.on.value}"


def slip_cause(slip: Slip) -> CauseResult:
    """Return a set-up slip as a cause; one that ends the comparison has no parameters."""
    return CauseResult(
        effect=slip.applied.effect.name,
        target=slip.applied.target,
        link=slip.link.name,
        probability=THRESHOLDS.slips.probability,
        parameters={} if slip.final else _slip_intervals(slip),
        shrink=None,
        rms_after=slip.rms_after,
        words=slip.words,
        indistinguishable_from=tuple(EffectAt(name, target) for name, target in slip.alike),
    )


def _slip_intervals(slip: Slip) -> dict[str, Interval]:
    """Return the values of a slip; what it leaves of the gap says how well they are met."""
    share = (slip.rms_after or 0.0) / slip.rms_before if slip.rms_before > 0.0 else 0.0
    intervals = {}
    for name, value in slip.applied.values.items():
        width = share * abs(value) + (Mismatch.clock_s if name.endswith("_s") else 0.0)
        intervals[name] = Interval(value, value - width, value + width)
    return intervals
