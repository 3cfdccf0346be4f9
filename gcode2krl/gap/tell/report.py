"""The diagnosis in words: a first sentence that anyone understands, then links, places, causes, limits."""

from collections.abc import Iterable, Iterator, Sequence

from gcode2krl.gap.tell.first_sentence import headline, stretch
from gcode2krl.gap.tell.result import CauseResult, Gap, GapSize, IntervalResult, LinkResult
from gcode2krl.gap.tell.words import alike, depends, describe, happened, kind, next_run, number
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.tell


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
    for found in gap.unexplained.depends_on[: _LIMITS.report_lines]:
        yield f"{found.probability:.2f} {depends(found)}; takes {found.share:.0%} of the gap"


def _link(link: LinkResult) -> str:
    return (
        f"{link.link:<11} {number(link.rms_before):<11} {number(link.rms_after):<11} "
        f"{number(link.floor):<11} {link.verdict} ({link.unit})"
    )


def _run_lines(size: GapSize) -> Iterator[str]:
    """Yield the gap of each run, where there are several."""
    for each in size.per_run if len(size.per_run) > 1 else ():
        before, after = number(each.rms_before), number(each.rms_after)
        with_causes = "" if before == after else f", {after} with the named causes"
        held_out = ", held out" if each.held_out else ""
        yield f"{each.run}: {before} {size.unit} RMS{with_causes}{held_out}"


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
