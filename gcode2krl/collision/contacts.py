"""Where something hits or comes near, gathered along all ways, and the findings that come of it."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from gcode2krl.arrays import Floats, Ints32
from gcode2krl.collision.along import Clearances
from gcode2krl.errors import MOST_PLACES, Issue


@dataclass
class Touch:
    """The least gap of two things in a line of the G-code, or along an added motion."""

    gap_mm: float
    line: int
    base_mm: Floats
    way: str = ""
    remedy: str = "move part or fixture, turn the tool by [frames] spin, or use a longer tool"


@dataclass
class _Pair:
    """What is kept of two things: it does not grow with the lines, but for the first of the collisions."""

    nearest: Touch | None = None
    first_line: int = 0
    last_line: int = 0
    hits: dict[tuple[int, str], Touch] = field(default_factory=dict)

    def take(self, touch: Touch) -> None:
        """Note a place; of the hits the deepest of each line and way, the first `MOST_PLACES` of them."""
        if self.nearest is None or touch.gap_mm < self.nearest.gap_mm:
            self.nearest = touch
        if touch.gap_mm > 0:
            return
        key = (touch.line, touch.way)
        is_worse = key in self.hits and touch.gap_mm < self.hits[key].gap_mm
        if is_worse or (key not in self.hits and len(self.hits) < MOST_PLACES):
            self.hits[key] = touch

    def spans(self, first_line: int, last_line: int) -> None:
        """Note the lines between which the two come near."""
        self.first_line = min(self.first_line or first_line, first_line)
        self.last_line = max(self.last_line, last_line)


@dataclass
class Contacts:
    """Gaps below the clearance, by who and what."""

    clearance_mm: float
    only_hits: str = ""
    """What the others are meant to come near."""
    only_near: str = ""
    """Who is an estimate, so that a hit is a warning."""
    pairs: dict[tuple[str, str], _Pair] = field(default_factory=dict)

    def take(
        self,
        clearances: Clearances,
        names: list[tuple[str, str]],
        line: Ints32,
        to_base: Floats,
        way: str = "",
    ) -> None:
        """Add what was noted along rows (n): ``names`` of each pair, ``line`` (n,) of the G-code."""
        base_mm = clearances.place_mm @ to_base[:3, :3].T + to_base[:3, 3]
        lines, gap_mm = line[clearances.row], clearances.note_gap_mm

        for number in np.unique(clearances.note_pair).tolist():
            notes = np.flatnonzero(clearances.note_pair == number)
            pair = self.pairs.setdefault(names[number], _Pair())
            deepest = notes[np.lexsort((gap_mm[notes], lines[notes]))]
            _, first = np.unique(lines[deepest], return_index=True)
            of_lines = deepest[first]
            hits = of_lines[gap_mm[of_lines] <= 0][:MOST_PLACES]
            nearest = notes[np.argmin(gap_mm[notes])]
            for note in [int(nearest), *hits.tolist()]:
                pair.take(Touch(float(gap_mm[note]), int(lines[note]), base_mm[note], way))
            pair.spans(int(lines[notes].min()), int(lines[notes].max()))

    def note(self, who: str, what: str, touch: Touch) -> None:
        """Add a single place."""
        pair = self.pairs.setdefault((who, what), _Pair())
        pair.take(touch)
        pair.spans(touch.line, touch.line)

    def advise(self, line: int, way: str, remedy: str) -> None:
        """Say what helps against the hits of a line and a way."""
        for pair in self.pairs.values():
            if (line, way) in pair.hits:
                pair.hits[line, way].remedy = remedy

    def issues(self) -> Iterator[Issue]:
        """Yield a collision for each line and pair, and one word for each pair that comes near only."""
        count = 0
        for (who, what), pair in self.pairs.items():
            is_certain = who != self.only_near
            for _, place in sorted(pair.hits.items(), key=lambda hit: hit[0]):
                count += is_certain
                if is_certain and count <= MOST_PLACES:
                    yield _collision(who, what, place)
            is_hit = bool(pair.hits) and is_certain
            is_meant = what == self.only_hits and not pair.hits
            if not is_hit and pair.nearest is not None and not is_meant:
                yield self._near(who, what, pair, pair.nearest)

    def _near(self, who: str, what: str, pair: _Pair, place: Touch) -> Issue:
        span = f"; near from line {pair.first_line} to {pair.last_line}"
        others = span if pair.first_line != pair.last_line else ""
        nearness = f"comes within {place.gap_mm:.1f} mm of" if place.gap_mm > 0.05 else "may touch"
        less = f": less than {self.clearance_mm:g} mm{others}"
        sentence = f"{who} {nearness} {what}{place.way}{_at(place)}{less}"
        remedy = "move part or fixture, or lower [collision] clearance_mm if both are known well enough"
        return Issue("warning", "near", place.line, sentence, remedy)


def _collision(who: str, what: str, place: Touch) -> Issue:
    deep = f"by {-place.gap_mm:.1f} mm or more" if place.gap_mm < -0.05 else "just so"
    return Issue(
        "error", "collision", place.line, f"{who} hits {what}{place.way}, {deep}{_at(place)}", place.remedy
    )


def _at(place: Touch) -> str:
    if not np.isfinite(place.base_mm).all():
        return ", from its inside"
    x, y, z = place.base_mm
    return f", at X {x:.1f} Y {y:.1f} Z {z:.1f} in $BASE"
