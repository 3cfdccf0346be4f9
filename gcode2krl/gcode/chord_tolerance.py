"""How far chords may be from their arc: which tolerances are plausible, doubtful or refused."""

from collections.abc import Iterator

from gcode2krl.errors import Issue, input_error

WIDE_MM = 1.0
"""Assumed: facets this deep are visible on any part."""
MOST_MM = 10.0
"""Assumed: arcs of most parts would be one chord."""


def chord_tolerance_issues(chord_tolerance_mm: float, source: str) -> Iterator[Issue]:
    """Yield what is doubtful about a chord tolerance; raise an input error where it is too large."""
    if chord_tolerance_mm > MOST_MM:
        raise input_error(
            "option-value",
            f"chord tolerance {chord_tolerance_mm:g} mm is more than {MOST_MM:g} mm: arcs would be lost",
            "0.01 is usual (--chord-tolerance)",
            source=source,
        )
    if chord_tolerance_mm > WIDE_MM:
        yield Issue(
            "warning",
            "chord-tolerance",
            0,
            f"chords may be {chord_tolerance_mm:g} mm off their arc",
            "0.01 is usual (--chord-tolerance)",
        )
