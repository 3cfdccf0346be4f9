"""``summary.md`` for ``$GITHUB_STEP_SUMMARY``: totals, refused parts first, longest parts, what changed.

GitHub takes at most 1 MiB; the tables are bounded, and results.jsonl has the rest.
"""

from collections.abc import Iterable, Iterator, Sequence

from gcode2krl.batch import VERDICTS
from gcode2krl.batch.written.changes import difference
from gcode2krl.batch.written.part import PartResult, Record, parts_of, told_of
from gcode2krl.batch.written.words import (
    deflection,
    demonstration,
    difference_rows,
    difference_sentence,
    facts,
    force,
    headline,
    markdown,
    one_line,
    time,
)

MOST_BYTES = 1 << 20
_MOST_REFUSED = 100
_MOST_LONGEST = 10
_MOST_CHANGED = 100
_MOST_NAME = 150
_MOST_SENTENCE = 400
"""Characters; escaped, one is at most eight bytes, so that all tables together stay below `MOST_BYTES`."""


def summary_md(records: Iterable[Record], before: Iterable[Record] | None = None) -> str:
    """Return the summary; ``before`` are the records of the last run, None where there was none."""
    records = list(records)
    parts = parts_of(records)
    lines = [f"# {headline(parts)}", ""]
    if warning := demonstration(parts):
        lines += [f"> **{markdown(warning)}**", ""]
    notes = [(fact, f" ({_name(fact.part)})" if fact.part else "") for fact in facts(parts)]
    lines += [f"- {fact.name}: {fact.value}{where}" for fact, where in notes]
    lines += _refused([part for part in parts if not part.is_written])
    if before is not None:
        lines += _changes(records, before)
    lines += _longest([part for part in parts if part.time_s is not None])
    return "\n".join(lines) + "\n"


def _refused(parts: Sequence[PartResult]) -> Iterator[str]:
    if not parts:
        return
    yield from ("", "## Not written", "")
    yield from _head("part", "", "line", "first finding", "what to do")
    for part in sorted(parts, key=lambda part: (VERDICTS.index(part.verdict), part.name))[:_MOST_REFUSED]:
        yield _row(_name(part.name), part.verdict, *_first_finding(part))
    yield from _more(len(parts) - _MOST_REFUSED)


def _first_finding(part: PartResult) -> tuple[str, str, str]:
    """Return line, sentence and remedy of what kept a part from being written."""
    findings = [(file, finding) for file, told in told_of(part.reasons()) for finding in told.findings]
    if not findings:
        return "", "", ""
    file, finding = findings[0]
    first, more = finding.first, len(part.reasons()) - len(finding.issues)
    place = ":".join([*([_name(file)] if file else []), *([str(first.line)] if first.line else [])])
    others = f" (and {more:,} more)" if more else ""
    message, remedy = (markdown(one_line(text, _MOST_SENTENCE)) for text in (first.message, first.advice()))
    return place, f"{message} [{_name(first.code)}]{others}", remedy


def _changes(records: Iterable[Record], before: Iterable[Record]) -> Iterator[str]:
    changes = difference(records, before)
    yield from ("", "## Against the last run", "", difference_sentence(changes))
    rows = list(difference_rows(changes))
    if rows:
        yield ""
        yield from _head("part", "", "time", "largest force", "largest deflection")
    for row in rows[:_MOST_CHANGED]:
        yield _row(_name(row.part), row.what, row.time, row.force, row.deflection)
    yield from _more(len(rows) - _MOST_CHANGED)


def _longest(parts: Sequence[PartResult]) -> Iterator[str]:
    if not parts:
        return
    yield from ("", "## Longest", "")
    yield from _head("part", "time", "largest force", "largest deflection", "warnings")
    for part in sorted(parts, key=lambda part: (-(part.time_s or 0.0), part.name))[:_MOST_LONGEST]:
        figures = (time(part.time_s), force(part.force_N), deflection(part.deflection_mm))
        yield _row(_name(part.name), *figures, str(part.count("warning") or ""))


def _name(name: str) -> str:
    return markdown(one_line(name, _MOST_NAME))


def _head(*names: str) -> Iterator[str]:
    yield _row(*names)
    yield _row(*("---" for _ in names))


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


def _more(count: int) -> Iterator[str]:
    if count > 0:
        yield from ("", f"… and {count:,} more, in results.jsonl.")
