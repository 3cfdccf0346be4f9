"""``index.html``: a row a part, in one file without network; sorted and filtered by its own script."""

import json
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from gcode2krl.batch import VERDICTS
from gcode2krl.batch.written.changes import Change, Difference, difference
from gcode2krl.batch.written.part import PartResult, Record, parts_of, told_of
from gcode2krl.batch.written.sarif import quoted
from gcode2krl.batch.written.words import (
    deflection,
    demonstration,
    difference_rows,
    difference_sentence,
    facts,
    force,
    headline,
    one_line,
    printable,
    share,
    time,
)
from gcode2krl.report.page.one_file import base_css, environment
from gcode2krl.version import __version__

_HERE = Path(__file__).parent
_MOST_FINDINGS = 2
"""Findings shown in a row; the report page and junit.xml have all."""
_MOST_CHANGES = 500
_MOST_SENTENCE = 400
_LARGEST = 1e12
"""What a change between written and not written is sorted by, longer than any program (s)."""
_ERROR = 1_000_000
"""An error counts more than all the warnings of a part."""
_DIGITS = re.compile(r"(\d{1,18})")


@dataclass(frozen=True, slots=True)
class Column:
    """A column that rows can be sorted by."""

    name: str
    label: str
    is_number: bool = False


@dataclass(frozen=True, slots=True)
class FindingOnPage:
    """A finding that kept a part from being written, or its first warning."""

    place: str
    message: str
    code: str
    remedy: str


@dataclass(frozen=True, slots=True)
class Row:
    """A part as texts."""

    name: str
    verdict: str
    link: str
    drawn: str
    time: str
    force: str
    deflection: str
    change: str
    findings: tuple[FindingOnPage, ...]
    others: str


@dataclass(frozen=True, slots=True)
class _Changed:
    """What became of a part since the last run, and what that is sorted by."""

    words: str
    key: float | None


def index_html(records: Iterable[Record], before: Iterable[Record] | None = None) -> str:
    """Return the page; ``before`` are the records of the last run, None where there was none.

    What was not written stands first, then parts by name with numbers in them in their order.
    """
    records = list(records)
    parts = sorted(parts_of(records), key=lambda part: (part.is_written, _natural(part.name)))
    changed = difference(records, before) if before is not None else None
    changes = _changes(changed, parts) if changed is not None else {}
    return (
        environment()
        .from_string(_text("index.html.j2"))
        .render(
            headline=headline(parts),
            demonstration=demonstration(parts),
            facts=facts(parts),
            sentence=difference_sentence(changed) if changed is not None else "",
            changes=list(difference_rows(changed))[:_MOST_CHANGES] if changed is not None else [],
            columns=[column for column in _COLUMNS if column.name != "change" or changed is not None],
            rows=[_row(part, changes.get(part.name)) for part in parts],
            keys=json.dumps(_keys(parts, changes), separators=(",", ":")),
            width=WIDTH,
            height=HEIGHT,
            base_css=base_css(),
            index_css=_text("index.css"),
            script=_text("index.js"),
            version=__version__,
        )
    )


_COLUMNS = (
    Column("part", "part"),
    Column("verdict", "verdict"),
    Column("time", "time", is_number=True),
    Column("force", "force", is_number=True),
    Column("deflection", "deflection", is_number=True),
    Column("change", "last run"),
    Column("findings", "findings"),
)


def _keys(parts: Sequence[PartResult], changes: dict[str, "_Changed"]) -> dict[str, list[float | int | None]]:
    """Return what each column is sorted by, a number a row; None is not known."""
    names = sorted((part.name for part in parts), key=_natural)
    place = {name: number for number, name in enumerate(names)}
    return {
        "part": [place[part.name] for part in parts],
        "verdict": [-VERDICTS.index(part.verdict) for part in parts],
        "time": [part.time_s for part in parts],
        "force": [part.force_N for part in parts],
        "deflection": [part.deflection_mm for part in parts],
        "change": [changes[part.name].key if part.name in changes else None for part in parts],
        "findings": [part.count("error") * _ERROR + part.count("warning") for part in parts],
    }


def _row(part: PartResult, change: "_Changed | None") -> Row:
    shown = part.reasons() or part.of_severity("warning")
    shown_findings = [(file, finding) for file, one in told_of(shown) for finding in one.findings][
        :_MOST_FINDINGS
    ]
    hidden = len(part.of_severity("error", "warning")) - sum(
        len(finding.issues) for _, finding in shown_findings
    )
    return Row(
        name=printable(part.name),
        verdict=part.verdict,
        link=f"./{quoted(part.page)}" if part.page else "",
        drawn=svg_path(part.thumbnail),
        time=time(part.time_s),
        force=force(part.force_N),
        deflection=deflection(part.deflection_mm),
        change=change.words if change is not None else "",
        findings=tuple(
            FindingOnPage(
                _place(file, finding.first.line),
                one_line(finding.first.message, _MOST_SENTENCE),
                one_line(finding.first.code, _MOST_SENTENCE),
                one_line(finding.first.advice(), _MOST_SENTENCE),
            )
            for file, finding in shown_findings
        ),
        others=f"and {hidden:,} more" if hidden > 0 else "",
    )


def _changes(changed: Difference, parts: Iterable[PartResult]) -> dict[str, _Changed]:
    """Return part → what changed; what is not written any more is the largest change."""
    changes = {part.name: _Changed("the same", 0.0) for part in parts}
    changes |= {part.name: _Changed("new", None) for part in changed.new}
    changes |= {one.name: _Changed(f"was {one.before.verdict}", _LARGEST) for one in changed.refused}
    changes |= {one.name: _Changed(f"was {one.before.verdict}", -_LARGEST) for one in changed.mended}
    return changes | {one.name: _Changed(_shares(one), one.time_s) for one in changed.changed}


def _shares(change: Change) -> str:
    """Return how much the figures of a part that was written both times changed."""
    before, after = change.before, change.after
    shares = (
        ("time", share(before.time_s, after.time_s)),
        ("force", share(before.force_N, after.force_N)),
        ("deflection", share(before.deflection_mm, after.deflection_mm)),
    )
    return ", ".join(f"{name} {words}" for name, words in shares if words) or "other figures"


def _place(file: str, line: int) -> str:
    """Return where a finding is, with what separates it from its sentence."""
    place = f"{one_line(file, _MOST_SENTENCE)} " if file else ""
    return f"{place}line {line}: " if line else f"{place.rstrip()}: " if place else ""


def _natural(name: str) -> tuple[tuple[int, int | str], ...]:
    """Return what a name is sorted by, so that part2 stands before part10."""
    return tuple((0, int(piece)) if piece.isdecimal() else (1, piece) for piece in _DIGITS.split(name))


def _text(name: str) -> str:
    return (_HERE / name).read_text(encoding="utf-8")


# the path of a part in a few characters of SVG --------------------------------------------------------------


WIDTH = 384
HEIGHT = 256
"""Steps of the box: four a pixel as it is drawn, finer is not seen."""
_MARGIN = 12


def svg_path(points_mm: Sequence[tuple[float, float]]) -> str:
    """Return the ``d`` of a path that fills a box of `WIDTH` by `HEIGHT` whole steps, y upwards.

    Empty where there is nothing to draw.
    """
    if len(points_mm) < 2:
        return ""
    low = [min(point[k] for point in points_mm) for k in (0, 1)]
    high = [max(point[k] for point in points_mm) for k in (0, 1)]
    size = [high[k] - low[k] for k in (0, 1)]
    room = (WIDTH - 2 * _MARGIN, HEIGHT - 2 * _MARGIN)
    scales = [room[k] / size[k] for k in (0, 1) if size[k] > 0.0]
    if not scales:
        return ""
    scale = min(scales)
    centre = [0.5 * (low[k] + high[k]) for k in (0, 1)]
    placed = [
        (
            round(0.5 * WIDTH + scale * (x - centre[0])),
            round(0.5 * HEIGHT - scale * (y - centre[1])),
        )
        for x, y in points_mm
    ]
    moves = [(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(placed)]
    return f"M{_pair(placed[0])}l" + " ".join(_pair(move) for move in moves if move != (0, 0))


def _pair(steps: tuple[int, int]) -> str:
    return f"{steps[0]},{steps[1]}"
