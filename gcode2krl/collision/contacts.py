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
    base_mm: Floats
    way: str
    is_ptp: bool


@dataclass
class Contacts:
    """Gaps below the clearance: (who, what) → line and way → where."""

    clearance_mm: float
    places: dict[tuple[str, str], dict[tuple[int, str], _Place]] = field(default_factory=dict)

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
        if not len(found.row):
            return
        base_mm = found.place_mm @ to_base[:3, :3].T + to_base[:3, 3]
        lines = line[found.row]
        order = np.lexsort((found.note_gap_mm, lines, found.note_pair))
        keys = np.stack([found.note_pair[order], lines[order]], axis=1)
        least = order[np.flatnonzero(np.diff(keys, axis=0, prepend=-2).any(axis=1))]
        for note in least.tolist():
            gap_mm = float(found.note_gap_mm[note])
            of_pair = self.places.setdefault(names[int(found.note_pair[note])], {})
            key = (int(lines[note]), way)
            if key not in of_pair or gap_mm < of_pair[key].gap_mm:
                of_pair[key] = _Place(gap_mm, base_mm[note], way, is_ptp)

    def issues(self) -> Iterator[Issue]:
        """Yield a collision for each line and pair, and one word for each pair that comes near only."""
        count = 0
        for (who, what), of_pair in self.places.items():
            hits = [(line, place) for (line, _), place in sorted(of_pair.items()) if place.gap_mm <= 0]
            for line, place in hits:
                count += 1
                if count <= MOST_PLACES:
                    yield _collision(who, what, line, place)
            if not hits:
                yield self._near(who, what, of_pair)

    def _near(self, who: str, what: str, of_pair: dict[tuple[int, str], _Place]) -> Issue:
        (line, _), place = min(of_pair.items(), key=lambda each: (each[1].gap_mm, each[0]))
        lines = len({line for line, _ in of_pair})
        others = f", the nearest of {lines} lines" if lines > 1 else ""
        sentence = (
            f"{who} comes within {place.gap_mm:.1f} mm of {what}{place.way}{_at(place)}: less than "
            f"{self.clearance_mm:g} mm{others}"
        )
        remedy = "move part or fixture, or lower [collision] clearance_mm if both are known well enough"
        return Issue("warning", "near", line, sentence, remedy)


def _collision(who: str, what: str, line: int, place: _Place) -> Issue:
    deep = f"by {-place.gap_mm:.1f} mm or more" if place.gap_mm < -0.05 else "just so"
    remedy = (
        "set [clearance] z_mm higher or HOME elsewhere, so that the straight way of the joints is free"
        if place.is_ptp
        else "move part or fixture, turn the tool by [frames] spin, or use a longer tool"
    )
    return Issue("error", "collision", line, f"{who} hits {what}{place.way}, {deep}{_at(place)}", remedy)


def _at(place: _Place) -> str:
    if not np.isfinite(place.base_mm).all():
        return ", from its inside"
    x, y, z = place.base_mm
    return f", at X {x:.1f} Y {y:.1f} Z {z:.1f} in $BASE"
