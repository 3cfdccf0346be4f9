"""The diagnosis in words: a first sentence that anyone understands, then links, places, causes, limits."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np

from gcode2krl.effects.dependence import Dependence
from gcode2krl.exchange.findings import findings_block
from gcode2krl.exchange.html import beside, block, line_picture, paragraph, text_table
from gcode2krl.gap.answer.result import (
    AtPart,
    CauseResult,
    DependsOnResult,
    EffectAt,
    EventResult,
    Gap,
    GapSize,
    IntervalResult,
    LinkResult,
    MomentResult,
    NextRun,
    PhaseResult,
    UnknownAt,
)
from gcode2krl.gap.compare.trace import Event, Whose
from gcode2krl.gap.posterior.cause_tests import Interval
from gcode2krl.gap.posterior.judgement import Judgement
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.answer
AXES, FORCE_AXES = ("x", "y", "z"), ("fx", "fy", "fz")
_UNITS = {
    name: name
    for name in ("mm", "deg", "rad", "mrad", "N", "Nm", "kNm", "kg", "s", "ms", "h", "m", "cm", "K")
} | {"um": "µm", "hz": "Hz", "s2": "s²", "s3": "s³", "krpm": "1000/min", "percent": "%"}
"""Words at the end of a parameter's name that are units -> how they are written."""
_TARGETS = {
    "tracker": "the tracker",
    "force": "the force sensor",
    "controller": "the controller's log",
    "q_cmd": "the commanded joints",
    "q_load": "the load encoders",
    "all": "all axes",
}
_EVENTS = {
    "impulse": "an impulse of {size} in {link}",
    "slip": "a slip of {size} in {link}, which stays",
    "burst": "a burst of {size} in {link}, its instrument's: left out",
}
_FORMS = {
    "drift": "a drift with {on}",
    "periodic": "periodic in {on}",
    "loop": "a loop with {on}",
    "smooth": "a smooth function of {on}",
}


def number(value: float | None) -> str:
    """Return a number with three significant digits, ``-`` for None."""
    return "-" if value is None else f"{value:.3g}"


def rounded(value: float) -> str:
    """Return a number with two significant digits, written out."""
    if abs(value) < 1e-9:  # what is left of two equal numbers
        return "0"
    if not math.isfinite(value):
        return f"{value:g}"
    decimals = max(0, 1 - math.floor(math.log10(abs(value))))
    return f"{value:.{decimals}f}"


def measured(interval: Interval, unit: str) -> str:
    """Return a value and half of its interval, ``0.0212 deg ± 0.0020``: two digits of what is uncertain."""
    half = (interval.high - interval.low) / 2.0
    unit = f" {unit}" if unit else ""
    if not math.isfinite(half) or half <= 0.0:
        return f"{number(interval.value)}{unit}"
    if abs(math.log10(half)) > 4.0:
        return f"{interval.value:.3g}{unit} ± {half:.2g}"
    first = math.floor(math.log10(half))
    decimals = max(0, (1 if round(half / 10.0**first, 6) < 2.0 else 0) - first)
    return f"{interval.value:.{decimals}f}{unit} ± {half:.{decimals}f}"


def unit_of(name: str) -> tuple[str, str]:
    """Return a parameter's name without its unit, and the unit: ``gap_deg`` is gap, in deg.

    Units that follow each other, with or without ``per``, are divided: ``N_per_deg`` is in N/deg.
    """
    words = name.split("_")
    units: list[str] = []
    while words and len(units) < 2 and words[-1] in _UNITS:
        units.insert(0, _UNITS[words.pop()])
        divides = bool(words) and words[-1] == "per"
        if divides:
            words.pop()
        if divides and (not words or words[-1] not in _UNITS):
            units.insert(0, "1")
            break
    return " ".join(words), "/".join(units)


def named(effect: str, target: str | None) -> str:
    """Return an effect and where it is, ``backlash of A2``."""
    name = effect.replace("_", " ")
    return name if target is None else f"{name} of {_TARGETS.get(target, target.replace('_', ' '))}"


def describe(cause: CauseResult, most: int | None = None) -> str:
    """Return a cause with its numbers, ``backlash of A2, 0.0212 deg ± 0.0020``.

    Components of a vector stand in brackets; where there are more than ``most`` numbers none is given.
    """
    if cause.effect == "geometry":
        count = f"{len(cause.parameters)} small numbers" if cause.parameters else "no number by itself"
        return f"the arm's own geometry, {count}"
    moment = cause.moment
    numbers = _numbers({k: v for k, v in cause.parameters.items() if moment is None or k != "at_s"})
    if moment is not None:
        when = "at" if "at_s" in cause.parameters else "most at"
        numbers.insert(0, f"{when} {moment.t_s:.2f} s of {moment.run}, line {moment.line}")
    if most is not None and len(numbers) > most:
        numbers = []
    return ", ".join([named(cause.effect, cause.target), *numbers])


def _numbers(parameters: Mapping[str, Interval]) -> list[str]:
    """Return the numbers of a cause in words; a single one needs no name."""
    names, numbers = list(parameters), []
    while names:
        vector = _vector(names)
        if vector:
            values = ", ".join(rounded(parameters[name].value) for name in vector)
            numbers.append(f"along ({values})")
            names = [name for name in names if name not in vector]
            continue
        name = names.pop(0)
        stem, unit = unit_of(name)
        interval = parameters[name]
        if unit == "s" and abs(interval.value) < _LIMITS.in_ms_below_s:
            interval, unit = Interval(*(1000.0 * each for each in interval)), "ms"
        value = measured(interval, unit)
        numbers.append(value if len(parameters) == 1 or not stem else f"{stem} {value}")
    return numbers


def _vector(names: Sequence[str]) -> list[str]:
    """Return the three components of a direction, where the first names are one."""
    head = list(names[:3])
    is_direction = [name.rpartition("_")[2] for name in head] == list(AXES) and head[0].startswith(
        "direction"
    )
    return head if is_direction else []


def listed(words: Sequence[str], last: str = "and") -> str:
    """Return words as an English list."""
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} {last} {words[-1]}"


def alike(others: Sequence[EffectAt | UnknownAt]) -> str:
    """Return what a cause cannot be told from."""
    together = [each for each in others if isinstance(each, EffectAt) and each.together]
    words = [_other(each) for each in others if each not in together]
    if together:
        words.insert(0, f"{listed([_other(each) for each in together])} together")
    return listed(words, "or")


def _other(other: EffectAt | UnknownAt) -> str:
    if isinstance(other, UnknownAt):
        return f"something that the library lacks ({other.at}, {other.on})"
    return named(other.effect, other.target)


def happened(event: EventResult) -> str:
    """Return what happened in a moment: when, on which line, what, how large and for how long."""
    line = f", line {event.line}" if event.line else ""
    what = _EVENTS[event.what].format(size=f"{rounded(event.size)} {event.unit}", link=event.link)
    return f"{event.t_s:.2f} s of {event.run}{line}: {what}, for {rounded(1000.0 * event.lasts_s)} ms"


def depends(dependence: DependsOnResult) -> str:
    """Return where a gap is and on what it depends: ``tip, a step from 11.2 s of run-1 on``."""
    words = [_place(dependence), _form(dependence), *_size(dependence), *_most_at(dependence)]
    return ", ".join([*words, *_course(dependence)])


def what_there_is(dependence: DependsOnResult) -> str:
    """Return the same within a sentence: ``a step from 11.2 s of run-1 on at the tip``."""
    place = _place(dependence)
    where = {"tip": "at the tip", "force": "in the force", "timing": "in time"}.get(place, f"in {place}")
    return ", ".join([f"{_form(dependence)} {where}", *_size(dependence)])


def _course(dependence: DependsOnResult) -> list[str]:
    """Return a course by its ends and, where it lies between them, its farthest point from their line."""
    course = dependence.course
    if course is None:
        return []
    (x0, y0), *_, (x1, y1) = course.points

    def bend(point: tuple[float, float]) -> float:
        return abs(point[1] - y0 - (y1 - y0) * (point[0] - x0) / (x1 - x0))

    far = max(course.points, key=bend)
    ends = [(x0, y0), (x1, y1)]
    if bend(far) > max(abs(y1 - y0), max(abs(y) for _, y in course.points)) / 2.0:
        ends.insert(1, far)
    words = [f"{rounded(y)} {course.unit} at {rounded(x)} {course.over_unit}" for x, y in ends]
    run = f" of {course.run}" if course.run else ""
    return [f"over {course.over}{run}: {' to '.join(words)}"]


def _place(dependence: DependsOnResult) -> str:
    """Return the place; the direction says more than the axis of a force."""
    return "force" if dependence.at in FORCE_AXES else dependence.at


def _form(dependence: DependsOnResult) -> str:
    if dependence.form in ("step", "impulse") and dependence.at_time_s is not None:
        line = f", line {dependence.line}" if dependence.line else ""
        at = f"{dependence.at_time_s:.1f} s" + (f" of {dependence.run}{line}" if dependence.run else "")
        gone = ", gone in the next run" if dependence.in_later_runs is False else ""
        return f"a step from {at} on{gone}" if dependence.form == "step" else f"an impulse at {at}"
    if dependence.frequency_hz is not None:
        return f"a tone of {number(dependence.frequency_hz)} Hz"
    return _FORMS.get(dependence.form, "a function of {on}").format(on=dependence.on)


def _most_at(dependence: DependsOnResult) -> list[str]:
    """Return when it is largest, of what is one of moments but no step or impulse."""
    if dependence.form in ("step", IMPULSE) or dependence.at_time_s is None:
        return []
    return [f"most at {dependence.at_time_s:.2f} s of {dependence.run}, line {dependence.line}"]


def _size(dependence: DependsOnResult) -> list[str]:
    if dependence.size is None:
        return []
    size = f"{rounded(dependence.size)} {dependence.unit or ''}".rstrip()
    if dependence.direction is None:
        return [size]
    return [f"{size} along ({', '.join(f'{round(value, 1) + 0.0:.1f}' for value in dependence.direction)})"]


def kind(cause: CauseResult) -> str | None:
    """Return what a reader should know of a cause's family, form and constancy; None where all is well."""
    words = []
    if cause.family is not None:
        words.append(f"of the kind {cause.family}")
    if cause.form_fits is not None and cause.form_fits < _LIMITS.form_fits_well:
        words.append(f"its form takes {cause.form_fits:.0%} of what its kind takes")
    if cause.constant is not None and cause.constant.p < _LIMITS.constant_least_p:
        spread = cause.constant.inconstancy
        words.append(f"its size varies by {spread:.0%} over runs and halves (p = {cause.constant.p:.2g})")
    return "; ".join(words) or None


def next_run(run: NextRun) -> list[str]:
    """Return the next run in lines: the command, what it separates, what is expected in either case."""
    minutes = f"{run.minutes:.0f} minutes" if run.minutes >= 1.5 else "a minute"
    lines = [f"gcode2krl make-test {run.program}, {minutes}"]
    for pair in run.separates:
        first, second = pair.first.replace("_", " "), pair.second.replace("_", " ")
        odds = "over 1000" if pair.odds > 1000.0 else rounded(pair.odds)
        lines.append(f'tells "{first}" from "{second}", odds {odds} to 1')
    lines += [f"if {each.answer.replace('_', ' ')}: {each.shows}" for each in run.expect]
    return lines


IMPULSE = "impulse"
"""The form of what happens in a moment and leaves nothing behind in its signal."""
_WORDS = {Whose.IMPULSE: IMPULSE, Whose.SLIP: "slip", Whose.INSTRUMENT: "burst"}


def events_of(judgement: Judgement) -> Iterator[EventResult]:
    """Yield the events of a link."""
    for event in judgement.events:
        deviation = event.change if event.whose is Whose.SLIP else event.peak
        yield EventResult(
            link=event.link,
            run=event.run,
            t_s=event.at_s,
            line=event.line,
            what=_WORDS[event.whose],
            size=judgement.factor * float(np.linalg.norm(deviation)),
            unit=judgement.link.unit,
            lasts_s=event.span_s[1] - event.span_s[0],
        )


def impulses_of(judgement: Judgement) -> Iterator[DependsOnResult]:
    """Yield the impulses of a link, or the slips that are its gap, the largest first."""
    events = judgement.impulses or (() if judgement.told.significant else judgement.slips)
    impulses = sorted(events, key=lambda event: -event.power)
    power = sum(event.power for event in impulses)
    power += max(judgement.size.excess_before, 0.0) * judgement.size.rows
    for event in impulses[: THRESHOLDS.answer.most_alike]:
        off = event.change if event.whose is Whose.SLIP else event.peak
        length = float(np.linalg.norm(off))
        is_vector = len(event.peak) == 3 and not judgement.link.of_joints
        yield DependsOnResult(
            link=event.link,
            at=_at(event, judgement),
            on=Dependence.RUN_TIME.value,
            form="step" if event.whose is Whose.SLIP else IMPULSE,
            probability=THRESHOLDS.answer.impulse_probability,
            share=event.power / max(power, 1e-300),
            at_time_s=event.at_s,
            run=event.run,
            line=event.line,
            size=judgement.factor * length,
            unit=judgement.link.unit,
            direction=tuple((off / length).tolist()) if is_vector and length > 0.0 else None,
        )


def _at(event: Event, judgement: Judgement) -> str:
    """Return the place: the joint or the axis of the force that is off by most, or the tip."""
    if judgement.link.of_tip:
        return "tip"
    name = judgement.traces[0].components[int(np.argmax(np.abs(event.peak)))]
    return name if judgement.link.of_joints else f"f{name}"


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

    What a force sensor and the tip, or a joint from then on, named or not, show at once was a blow; one
    reading alone may be one of its instrument.
    """
    impulses = [each for each in gap.events if each.what == IMPULSE]
    event = max(impulses, key=lambda each: (each.link == "force", each.size), default=None)
    if event is None:
        return ""
    step = next((cause for cause in gap.named_causes if _is_at(cause.moment, event)), None)
    at = f"at {event.t_s:.2f} s of {event.run}, line {event.line}"
    others = [each for each in gap.events if each.what != "burst" and each.link != event.link]
    together = [each for each in others if each.run == event.run and _is_near(each.t_s, event.t_s)]
    stays = any(
        family.form == "step" and family.run == event.run and _is_near(family.at_time_s or 0.0, event.t_s)
        for family in gap.unexplained.depends_on
    )
    if event.link == "force" and (step or together or stays):
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
        perhaps = [f"{named(cause.effect, cause.target)} ({cause.probability:.2f})" for cause in unsure]
        words += f"; perhaps {listed(perhaps, 'or')}"
    return words


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
    words = amount(at.rms_after, at.unit)
    before = at.held_out_before
    if held and before is not None and not _is_about(before, at.rms_before):
        words += f" of {amount(before, at.unit)}"
    return f"{model} {words} are left{held}{_beside(at)}{_rest(gap)}."


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


def text_report(gap: Gap) -> str:
    """Return the report as text."""
    return "\n".join(_lines(gap))


def _lines(gap: Gap) -> Iterator[str]:
    yield headline(gap)
    if gap.links:
        yield from ("", "link        before      after       noise       verdict")
        yield from (_link(link) for link in gap.links)
    aside = "; the table above is of data not used" if gap.gap.held_out else ""
    yield from _section(f"run by run, those that explain included{aside}", _run_lines(gap.gap))
    yield from _section("what happened", (happened(each) for each in gap.events[: _LIMITS.report_lines]))
    yield from _section("where", where_lines(gap))
    yield from _section(
        "causes", (line for cause in gap.causes[: _LIMITS.report_lines] for line in _cause(cause))
    )
    yield from _section("what is left depends on", left_lines(gap))
    yield from _section("next run", [] if gap.next_run is None else next_run(gap.next_run))
    yield from _section("not examined", (f"{each.link}: needs {each.needs}" for each in gap.not_examined))
    yield from (f"note: {note}" for note in gap.notes)


def _section(title: str, lines: Iterable[str]) -> Iterator[str]:
    """Yield a title and indented lines; nothing without lines."""
    for order, line in enumerate(lines):
        if order == 0:
            yield from ("", title)
        yield f"  {line}"


def worst(intervals: Sequence[IntervalResult]) -> tuple[int, float]:
    """Return how many of the stretches, worst first, hold four fifths of the gap, and the share they hold.

    At most as many as the report prints; fewer where all together hold less.
    """
    held = 0.0
    for count, interval in enumerate(intervals[: _LIMITS.report_lines], start=1):
        held += interval.share or 0.0
        if held >= _LIMITS.most_of_a_gap:
            return count, held
    return min(len(intervals), _LIMITS.report_lines), held


def where_words(intervals: Sequence[IntervalResult]) -> str:
    """Return how much of the gap the worst stretches hold."""
    count, held = worst(intervals)
    if len(intervals) == 1:
        return f"this stretch holds {held:.0%} of the gap"
    if count == 1:
        return f"the first of {len(intervals)} stretches holds {held:.0%} of the gap"
    which = f"these {count} of {len(intervals)}" if count < len(intervals) else f"these {count}"
    return f"{which} stretches hold {held:.0%} of the gap"


def where_lines(gap: Gap) -> Iterator[str]:
    """Yield the worst stretches, worst first; nothing without one."""
    intervals = gap.where.intervals
    if not intervals:
        return
    yield f"{where_words(intervals)}; in them it exceeds the noise"
    for interval in intervals[: worst(intervals)[0]]:
        share = "" if interval.share is None else f", {interval.share:.0%} of the gap"
        yield f"{stretch(interval)}: {number(interval.rms)} {gap.gap.unit} ({interval.what}){share}"


def left_lines(gap: Gap) -> Iterator[str]:
    """Yield on what depends what no named cause explains, the most probable first."""
    for dependence in gap.unexplained.depends_on[: _LIMITS.report_lines]:
        place = dependence.place_probability
        aside = "" if place is None else f", the place alone {place:.2f}"
        share = f"takes {dependence.share:.0%} of the gap"
        yield f"{dependence.probability:.2f}{aside} {depends(dependence)}; {share}"
        if dependence.indistinguishable_from:
            others = listed([f"{each.at}, {each.on}" for each in dependence.indistinguishable_from], "or")
            of_set = dependence.set_probability or dependence.probability
            yield f"     {of_set:.2f} that or what these data cannot tell from it: {others}"


def _link(link: LinkResult) -> str:
    return (
        f"{link.link:<11} {number(link.rms_before):<11} {number(link.rms_after):<11} "
        f"{number(link.floor):<11} {link.verdict} ({link.unit})"
    )


def _run_lines(size: GapSize) -> Iterator[str]:
    """Yield the gap of each run, where there are several."""
    for run in size.per_run if len(size.per_run) > 1 else ():
        before, after = number(run.rms_before), number(run.rms_after)
        with_causes = "" if before == after else f", {after} with the named causes"
        held_out = ", held out" if run.held_out else ""
        yield f"{run.run}: {before} {size.unit} RMS{with_causes}{held_out}"


def _cause(cause: CauseResult) -> Iterator[str]:
    yield f"{cause.probability:.2f} {describe(cause)}{_taken(cause)}"
    if cause.indistinguishable_from:
        yield f"     these data cannot tell it from {alike(cause.indistinguishable_from)}"
    of_kind = kind(cause)
    if of_kind is not None:
        yield f"     {of_kind}"


def _taken(cause: CauseResult) -> str:
    if cause.is_named:
        return "" if cause.shrink is None else f", takes {cause.shrink:.0%} of the gap on data not used"
    would = "" if cause.shrink is None else f", would take {cause.shrink:.0%} of the gap"
    return f"{would} (not named)"


def gap_words(gap: Gap) -> str:
    """Return the verdict and the first sentence, cut where it is long."""
    sentence = headline(gap)
    short = sentence if len(sentence) <= _LIMITS.most_letters else f"{sentence[: _LIMITS.most_letters - 1]}…"
    return f"{gap.verdict}: {short}"


def gap_html(gap: Gap) -> str:
    """Return the first sentence, the links, the causes, the residual over time and the findings as HTML."""
    links = text_table(
        ("link", "before", "after", "noise", "unit", "verdict"),
        [
            (
                link.link,
                number(link.rms_before),
                number(link.rms_after),
                number(link.floor),
                link.unit,
                link.verdict,
            )
            for link in gap.links
        ],
    )
    causes = text_table(
        ("cause", "probability"),
        [(describe(cause), f"{cause.probability:.0%}") for cause in gap.causes[: _LIMITS.most_shown]],
    )
    head = paragraph(headline(gap))
    pictures = "".join(_pictures(gap))
    return block(f"Gap({gap.verdict})", head, beside(links, causes, pictures), findings_block(gap.issues))


def _pictures(gap: Gap) -> Iterator[str]:
    """Yield the residual of the first run over time, before and with the named causes."""
    evidence = gap.evidence
    if evidence is None or not evidence.runs:
        return
    run = evidence.runs[0]
    yield paragraph(
        f"{run.run}: {evidence.signal}, {evidence.component} ({evidence.unit}), before and with causes"
    )
    yield line_picture(run.time_s, [run.before, run.after])
