"""Figures by class of decidability: what the data can decide, can narrow down, and cannot decide.

A case's class is that of the least decidable of its effects. A miss counts where the gap itself is plain: at
least ten nats beside mismatch alone.
"""

from collections.abc import Callable, Sequence

from gap_blind_figures import Rate, rate
from gap_blind_score import Judged

CLASSES = ("decidable", "open", "undecidable", "not known")
PLAIN = 10.0
"""Nats beside mismatch from which on a gap is plainly there."""
UNKNOWN = ("open", "deleted")
KNOWN = ("single", "missing", "confounded")

Flag = Callable[[Judged], bool]
Line = tuple[str, Flag, Flag, bool]
"""Metric, which cases it counts, what it counts, and whether much of it is good."""

LINES: tuple[Line, ...] = (
    ("said no gap, gap >= 10 nats", lambda e: e.is_plain, lambda e: e.verdict == "no_gap", False),
    ("one effect: something else named", lambda e: e.kind in KNOWN, lambda e: e.is_wrongly_named, False),
    ("  exact", lambda e: e.kind in KNOWN, lambda e: e.exact, True),
    ("  declared set", lambda e: e.kind in KNOWN, lambda e: e.declared, True),
    ("  set holds truth", lambda e: e.kind in KNOWN, lambda e: e.in_a_set, True),
    ("  family and place, or declared", lambda e: e.kind in KNOWN, lambda e: e.family_or_name, True),
    ("unknown: wrongly named", lambda e: e.kind in UNKNOWN, lambda e: bool(e.named), False),
    ("  flagged", lambda e: e.kind in UNKNOWN, lambda e: e.flagged, True),
    ("  set holds an unknown", lambda e: e.kind in UNKNOWN, lambda e: e.in_a_set or e.flagged, True),
    ("  place", lambda e: e.kind in UNKNOWN, lambda e: e.told is not None and e.told.place, True),
    ("  family and place", lambda e: e.kind in UNKNOWN, lambda e: e.told is not None and e.told.family, True),
    ("pair: both exact", lambda e: e.kind == "pair", lambda e: e.exact, True),
    ("  both located", lambda e: e.kind == "pair", lambda e: e.located, True),
    ("event: flagged or named", lambda e: e.kind == "story", lambda e: e.alarms, True),
    ("  moment within 20 ms", lambda e: e.moment is not None, lambda e: bool(e.moment), True),
)


def class_rows(cases: Sequence[Judged]) -> list[tuple[str, ...]]:
    """Return a row for each metric: its rate with a one-sided 95 % bound in each class."""
    rows = [("cases with an effect", *(str(sum(e.decidability == c for e in cases)) for c in CLASSES))]
    for metric, counts, flag, high in LINES:
        of_class = [[e for e in cases if e.decidability == c and counts(e)] for c in CLASSES]
        if any(of_class):
            rows.append((metric, *(_text(rate(flag(e) for e in some), high) for some in of_class)))
    return rows


def _text(one: Rate, high: bool) -> str:
    if not one.of:
        return "-"
    bound = f">= {one.lower:.3f}" if high else f"<= {one.upper:.3f}"
    return f"{one.value:.3f} ({bound}, n {one.of})"
