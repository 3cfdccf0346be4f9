"""The diagnosis in words: one sentence a process engineer understands, then links, places, causes, limits."""

from collections.abc import Iterable, Iterator

from gcode2krl.gap.tell.result import CauseResult, Gap, GapSize, IntervalResult, LinkResult
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.tell
_SIGNALS = {
    "tcp": "at the tool tip",
    "force": "of force",
    "joint_actual": "of servo error",
    "joint_load": "behind the gears",
    "joint_commanded": "off the commanded path",
    "timing": "off in time",
    "scan": "on the part",
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


def text_report(gap: Gap) -> str:
    """Return the report as text."""
    return "\n".join(_lines(gap))


def _lines(gap: Gap) -> Iterator[str]:
    yield headline(gap)
    if gap.links:
        yield from ("", "link        before      after       noise       verdict")
        yield from (_link(link) for link in gap.links)
    intervals = gap.where.intervals
    yield from _section("where", (_interval(each) for each in intervals[: _LIMITS.report_lines]))
    if len(intervals) > _LIMITS.report_lines:
        yield f"  … and {len(intervals) - _LIMITS.report_lines} more"
    yield from _section("causes", (_cause(cause) for cause in gap.causes[: _LIMITS.report_lines]))
    yield from _section("not examined", (f"{each.link}: needs {each.needs}" for each in gap.not_examined))
    yield from (f"note: {note}" for note in gap.notes)


def _section(title: str, lines: Iterable[str]) -> Iterator[str]:
    """Yield a title and indented lines; nothing without lines."""
    for number, line in enumerate(lines):
        if number == 0:
            yield from ("", title)
        yield f"  {line}"


def headline(gap: Gap) -> str:
    """Return the first sentence."""
    size, named = gap.gap, gap.named_causes
    slip = next((cause for cause in named if cause.words is not None), None)
    if slip is not None:
        return f"Set-up slip: {slip.words}."
    if gap.verdict == "no_gap":
        return f"No gap: {_with_unit(size.rms_before, size)} RMS are what noise and normal mismatch explain."
    floor = f"noise floor {_with_unit(size.noise_floor, size)}"
    first = f"{_with_unit(size.rms_before, size)} RMS {_SIGNALS.get(size.signal, '')}{_mostly(gap)}"
    if not named:
        return f"{first}: no effect of the library explains it; {floor}."
    causes = " and ".join(describe(cause) for cause in named[: _LIMITS.headline_causes])
    left = "more remain than noise explains: " if gap.unexplained.significant else ""
    return (
        f"{first}: {causes}; with {'it' if len(named) == 1 else 'them'} in the model {left}"
        f"{_with_unit(size.rms_after, size)} on data not used; {floor}."
    )


def describe(cause: CauseResult) -> str:
    """Return a cause with its parameters, ``backlash of A2, gap 0.021 deg ± 0.002 deg``."""
    name = cause.effect.replace("_", " ")
    texts = [f"{name} of {cause.target}" if cause.target else name]
    for key, interval in cause.parameters.items():
        stem, _, unit = key.rpartition("_")
        half = (interval.high - interval.low) / 2.0
        name, unit = ((stem or key).replace("_", " "), unit if stem else "")
        texts.append(f"{name} {number(interval.value)} ± {half:.2g} {unit}".rstrip())
    return ", ".join(texts)


def number(value: float | None) -> str:
    """Return a number with three significant digits."""
    return "-" if value is None else f"{value:.3g}"


def _with_unit(value: float | None, size: GapSize) -> str:
    return f"{number(value)} {size.unit}"


def _mostly(gap: Gap) -> str:
    """Return in which phase most of a gap is, as the end of a clause; nothing where that is none."""
    phases, joints = gap.where.phases, gap.where.joints
    if not phases or phases[0].share < _LIMITS.phase_named_share:
        return ""
    first = phases[0]
    share = next(words for least, words in _SHARES.items() if first.share >= least)
    joint = f" of axis {joints[0].joint[1:]}" if first.phase == "reversal" and joints else ""
    return f", {share} {_PHASES[first.phase]}{joint}"


def _link(link: LinkResult) -> str:
    return (
        f"{link.link:<11} {number(link.rms_before):<11} {number(link.rms_after):<11} "
        f"{number(link.noise):<11} {link.verdict} ({link.unit})"
    )


def _interval(interval: IntervalResult) -> str:
    lines = f", lines {interval.lines[0]}-{interval.lines[1]}" if interval.lines else ""
    return (
        f"{interval.run}: {interval.t_start_s:.2f}-{interval.t_end_s:.2f} s{lines}: "
        f"{number(interval.rms)} ({interval.what})"
    )


def _cause(cause: CauseResult) -> str:
    mark = "" if cause.is_named else " (not named)"
    shrink = "" if cause.shrink is None else f", takes {cause.shrink:.0%} of the gap on data not used"
    return f"{cause.probability:.2f} {describe(cause)}{shrink}{mark}"
