"""Figures, totals and differences in words, the same in the summary and on the index page."""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

from gcode2krl.batch import VERDICTS
from gcode2krl.batch.written.changes import Change, Difference
from gcode2krl.batch.written.part import PartResult
from gcode2krl.report.page.content import duration

UNKNOWN = "–"
_HARDLY = 0.0005
"""A share below this is printed as none."""


@dataclass(frozen=True, slots=True)
class Fact:
    """A figure of the whole run, and the part that it comes from where it is one part's."""

    name: str
    value: str
    part: str = ""


@dataclass(frozen=True, slots=True)
class DifferenceRow:
    """One part that changed, as texts."""

    part: str
    what: str
    time: str = ""
    force: str = ""
    deflection: str = ""


def time(seconds: float | None) -> str:
    """Return a time as a person reads it, a dash where it is not known."""
    return UNKNOWN if seconds is None else duration(seconds)


def force(value_N: float | None) -> str:
    """Return a force with its unit."""
    return UNKNOWN if value_N is None else f"{value_N:,.0f} N"


def deflection(value_mm: float | None) -> str:
    """Return a deflection with its unit."""
    return UNKNOWN if value_mm is None else f"{value_mm:.3f} mm"


def headline(parts: Sequence[PartResult]) -> str:
    """Return how many parts were written, refused and not understood."""
    verdicts = [part.verdict for part in parts]
    written, *others = [(verdicts.count(verdict), verdict) for verdict in VERDICTS]
    if not parts:
        return "No parts"
    if written[0] == len(parts):
        return "The only part was written" if len(parts) == 1 else f"All {len(parts):,} parts were written"
    named = ", ".join(f"{count:,} {verdict}" for count, verdict in others if count)
    return f"{written[0]:,} of {_counted(len(parts), 'part')} written, {named}"


def demonstration(parts: Sequence[PartResult]) -> str:
    """Return the warning that parts were translated for the demonstration cell, empty where none was."""
    count = sum(part.is_demonstration for part in parts)
    if not count:
        return ""
    which = "Every part" if count == len(parts) else f"{count:,} of {_counted(len(parts), 'part')}"
    return (
        f"{which} was translated for the demonstration cell, as no cell was named: its robot, frames, "
        "tools and outputs are not yours. Name yours with --cell."
    )


def facts(parts: Sequence[PartResult]) -> list[Fact]:
    """Return the figures of a whole run."""
    written = [part for part in parts if part.is_written]
    cached = sum(part.cached for part in parts)
    warnings = sum(part.count("warning") for part in parts)
    facts = [Fact("machining time", duration(sum(part.time_s or 0.0 for part in written)))] if written else []
    facts += _largest("largest force", written, lambda part: part.force_N, force)
    facts += _largest("largest deflection", written, lambda part: part.deflection_mm, deflection)
    facts.append(Fact("computed in", duration(sum(part.seconds or 0.0 for part in parts))))
    facts += [Fact("from the cache", _counted(cached, "part"))] if cached else []
    facts += [Fact("warnings", f"{warnings:,}")] if warnings else []
    return facts


def _largest(
    name: str,
    parts: Iterable[PartResult],
    figure: Callable[[PartResult], float | None],
    words: Callable[[float | None], str],
) -> list[Fact]:
    known = [(value, part.name) for part in parts if (value := figure(part)) is not None]
    return [Fact(name, words(max(known)[0]), printable(max(known)[1]))] if known else []


def difference_sentence(changed: Difference) -> str:
    """Return what changed since the last run in one sentence."""
    if changed.is_none:
        return "Nothing changed since the last run."
    counts = [
        (len(changed.refused), "not written any more"),
        (len(changed.mended), "written now"),
        (len(changed.gone), "gone"),
        (len(changed.new), "new"),
        (len(changed.changed), "with other figures"),
        (changed.same, "the same"),
    ]
    named = ", ".join(f"{count:,} {what}" for count, what in counts if count)
    times = ""
    if changed.changed:
        whole = _from_to(changed.time_before_s, changed.time_after_s, time)
        times = f" The parts that were written both times take {whole}."
    return f"Since the last run: {named}.{times}"


def difference_rows(changed: Difference) -> Iterator[DifferenceRow]:
    """Yield the parts that changed, those that are not written any more first."""
    for change in changed.refused:
        yield DifferenceRow(printable(change.name), f"{change.after.verdict}, was written")
    for change in changed.mended:
        yield DifferenceRow(printable(change.name), f"written, was {change.before.verdict}")
    yield from (DifferenceRow(printable(part.name), "gone") for part in changed.gone)
    yield from (DifferenceRow(printable(part.name), "new") for part in changed.new)
    yield from map(_changed, changed.changed)


def _changed(change: Change) -> DifferenceRow:
    before, after = change.before, change.after
    return DifferenceRow(
        printable(change.name),
        "other figures",
        _from_to(before.time_s, after.time_s, time),
        _from_to(before.force_N, after.force_N, force),
        _from_to(before.deflection_mm, after.deflection_mm, deflection),
    )


def share(before: float | None, after: float | None) -> str:
    """Return a change in percent, empty where there is none worth a word."""
    change = (after - before) / before if before and after is not None else 0.0
    return f"{change:+.1%}".replace("%", "\u00a0%") if abs(change) >= _HARDLY else ""


def _from_to(before: float | None, after: float | None, words: Callable[[float | None], str]) -> str:
    """Return two figures and the change in percent, one figure where they read the same."""
    percent = share(before, after)
    shown = words(after) if words(before) == words(after) else f"{words(before)} → {words(after)}"
    return f"{shown} ({percent})" if percent else shown


def _counted(count: int, noun: str) -> str:
    return f"{count:,} {noun if count == 1 else f'{noun}s'}"


# text from outside, such as names and messages, in files that others read -----------------------------------


_NOT_PRINTED = re.compile(
    "[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff"  # not in XML, or better not
    "\u200e\u200f\u202a-\u202e\u2066-\u2069]"  # turn the direction of writing
)
_IN_MARKDOWN = re.compile(r"[\\`*{}\[\]<>|&~#@!$^]|(?<![A-Za-z0-9])_|_(?![A-Za-z0-9])|(?<=:)//|[\n\r\t]+")
_C0_PICTURES = 0x2400
_FIRST_PRINTED = 0x20
_REPLACEMENT = "\ufffd"


def printable(text: str) -> str:
    """Return a text with a sign for what is not printed.

    These are control characters and halves of surrogates, which XML 1.0 cannot hold, and the marks that turn
    the direction of writing, with which a name can pretend to be another.
    """
    return _NOT_PRINTED.sub(_picture, text)


def _picture(match: re.Match[str]) -> str:
    number = ord(match[0])
    return chr(_C0_PICTURES + number) if number < _FIRST_PRINTED else _REPLACEMENT


def one_line(text: str, most: int) -> str:
    """Return a text on one line, of at most so many characters."""
    line = " ".join(printable(text).split())
    return line if len(line) <= most else f"{line[: most - 1]}…"


def markdown(text: str) -> str:
    """Return a text that Markdown shows as it is, in a cell of a table too.

    What could be markup becomes a character reference, which no parser takes for structure.
    """
    return _IN_MARKDOWN.sub(_references, printable(text))


def _references(match: re.Match[str]) -> str:
    return "".join(" " if character.isspace() else f"&#{ord(character)};" for character in match[0])
