"""Where something hits or comes near, gathered along all ways, and the findings that come of it."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from gcode2krl.arrays import Floats, Ints32
from gcode2krl.collision.along import Clearances
from gcode2krl.errors import MOST_PLACES, Issue


@dataclass
class _Place:
    """The least gap of two things in a line of the G-code, or along an added motion."""

    gap_mm: float
    line: int
    base_mm: Floats
    way: str
    is_ptp: bool


@dataclass
class _Pair:
    """What is kept of two things: it does not grow with the lines, but for the first of the collisions."""

    nearest: _Place | None = None
    first_line: int = 0
    last_line: int = 0
    hits: dict[tuple[int, str], _Place] = field(default_factory=dict)


@dataclass
class Contacts:
    """Gaps below the clearance, by who and what."""

    clearance_mm: float
    pairs: dict[tuple[str, str], _Pair] = field(default_factory=dict)

    def take(
        self,
        found: Clearances,
        names: list[tuple[str, str]],
        line: Ints32,
        to_base: Floats,
        way: str = "",
        *,
        is_ptp: bool = False,
    ) -> None:
        """Add what was noted along rows (n): ``names`` of each pair, ``line`` (n,) of the G-code."""
        base_mm = found.place_mm @ to_base[:3, :3].T + to_base[:3, 3]
        lines, gap_mm = line[found.row], found.note_gap_mm

        def place(note: int) -> _Place:
            return _Place(float(gap_mm[note]), int(lines[note]), base_mm[note], way, is_ptp)

        for number in np.unique(found.note_pair).tolist():
            notes = np.flatnonzero(found.note_pair == number)
            pair = self.pairs.setdefault(names[number], _Pair())
            nearest = int(notes[np.argmin(gap_mm[notes])])
            if pair.nearest is None or gap_mm[nearest] < pair.nearest.gap_mm:
                pair.nearest = place(nearest)
            low, high = int(lines[notes].min()), int(lines[notes].max())
            pair.first_line = min(pair.first_line or low, low)
            pair.last_line = max(pair.last_line, high)
            deepest = notes[np.lexsort((gap_mm[notes], lines[notes]))]
            _, first = np.unique(lines[deepest], return_index=True)
            for note in deepest[first][gap_mm[deepest[first]] <= 0][:MOST_PLACES].tolist():
                key = (int(lines[note]), way)
                is_worse = key in pair.hits and gap_mm[note] < pair.hits[key].gap_mm
                if is_worse or (key not in pair.hits and len(pair.hits) < MOST_PLACES):
                    pair.hits[key] = place(note)

    def issues(self) -> Iterator[Issue]:
        """Yield a collision for each line and pair, and one word for each pair that comes near only."""
        count = 0
        for (who, what), pair in self.pairs.items():
            for _, place in sorted(pair.hits.items(), key=lambda hit: hit[0]):
                count += 1
                if count <= MOST_PLACES:
                    yield _collision(who, what, place)
            if not pair.hits and pair.nearest is not None:
                yield self._near(who, what, pair, pair.nearest)

    def _near(self, who: str, what: str, pair: _Pair, place: _Place) -> Issue:
        span = f"; near from line {pair.first_line} to {pair.last_line}"
        others = span if pair.first_line != pair.last_line else ""
        sentence = (
            f"{who} comes within {place.gap_mm:.1f} mm of {what}{place.way}{_at(place)}: less than "
            f"{self.clearance_mm:g} mm{others}"
        )
        remedy = "move part or fixture, or lower [collision] clearance_mm if both are known well enough"
        return Issue("warning", "near", place.line, sentence, remedy)


def _collision(who: str, what: str, place: _Place) -> Issue:
    deep = f"by {-place.gap_mm:.1f} mm or more" if place.gap_mm < -0.05 else "just so"
    remedy = (
        "set [clearance] z_mm higher or HOME elsewhere, so that the straight way of the joints is free"
        if place.is_ptp
        else "move part or fixture, turn the tool by [frames] spin, or use a longer tool"
    )
    return Issue(
        "error", "collision", place.line, f"{who} hits {what}{place.way}, {deep}{_at(place)}", remedy
    )


def _at(place: _Place) -> str:
    if not np.isfinite(place.base_mm).all():
        return ", from its inside"
    x, y, z = place.base_mm
    return f", at X {x:.1f} Y {y:.1f} Z {z:.1f} in $BASE"
