"""Overlap of the stretches of time that an answer names with those of the label."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

EVERYWHERE = frozenset(
    {
        "mastering",
        "link_length",
        "base_frame",
        "tool_frame",
        "thermal",
        "gravity",
        "load",
        "wrist_coupling",
        "force_offset",
        "force_drift",
        "tool_weight",
        "hose_pack",
        "tool_number",
        "base_number",
        "absolute_accuracy",
        "unit",
        "swapped_tool",
        "other_program",
    }
)
"""Effects that act all the time: their place in time is not scored."""
OWN, NOISE = "where", "above_noise"
"""Label: where the effect, smoothed, exceeds its own RMS; and where it exceeds the noise."""
ALMOST = 0.99
"""Intervals that are all alike are all the worst."""

Span = dict[str, Any]
"""``run``, ``t_start_s``, ``t_end_s``; of an answer also ``signal``."""


def overlap(entry: dict[str, Any], intervals: Sequence[Span], definition: str = OWN) -> float | None:
    """Return intersection over union on the time axis, all runs together; None where the label has no place.

    Where the answer gives intervals of the signal that the label is judged in, those alone count.
    """
    true = entry.get(definition) or ()
    if entry["effect"] in EVERYWHERE or not true:
        return None
    said = [each for each in intervals if each["signal"] == entry["main_signal"]] or list(intervals)
    both = either = 0.0
    for run in {each["run"] for each in [*true, *said]}:
        one, two = _spans(true, run), _spans(said, run)
        edges = np.unique([time for span in (*one, *two) for time in span])
        middle, width = (edges[1:] + edges[:-1]) / 2.0, np.diff(edges)
        a, b = _inside(middle, one), _inside(middle, two)
        both, either = both + float(width[a & b].sum()), either + float(width[a | b].sum())
    return both / either if either > 0.0 else 0.0


def worst_of(intervals: Sequence[Span]) -> list[Span]:
    """Return the intervals whose RMS is at least that of all of them together; all where none states one."""
    if not all("rms" in each for each in intervals) or not intervals:
        return list(intervals)
    rms = np.array([each["rms"] for each in intervals])
    length = np.array([each["t_end_s"] - each["t_start_s"] for each in intervals])
    together = np.sqrt(np.sum(rms**2 * length) / max(float(length.sum()), 1e-9))
    return [each for each, own in zip(intervals, rms, strict=True) if own >= ALMOST * together]


def _spans(intervals: Iterable[Span], run: str) -> list[tuple[float, float]]:
    return [(each["t_start_s"], each["t_end_s"]) for each in intervals if each["run"] == run]


def _inside(times: np.ndarray, spans: Iterable[tuple[float, float]]) -> np.ndarray:
    found = np.zeros(len(times), dtype=bool)
    for start, end in spans:
        found |= (times >= start) & (times <= end)
    return found
