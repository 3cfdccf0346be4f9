"""What of a motion rests on an assumption about corners: how far path and time move under the others.

Bigliardi et al. 2022 measured corners between lines of equal speed, acceleration and CDIS. Where the two
lines differ nothing public says what a KRC4 does (`docs/motion.md`, "Where the paper is silent"). The motion
is planned once more under each other reading; what moves by less than the sizes below is not worth a word.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.cell import Cell
from gcode2krl.errors import Issue
from gcode2krl.krc4.laws import parabola_distance
from gcode2krl.krc4.motion import Chain, plan, with_corners
from gcode2krl.krc4.profile import Profile
from gcode2krl.tables import Targets

PATH_MM = 0.05
"""Change of the distance between a corner and the path from which on a reading is told."""
TIME_SHARE = 0.01
"""Change of the time, as a share of it, from which on a reading is told."""

_WORTH_A_PLAN = 0.3
"""Change of the time without a look-ahead, over what is told, from which on it is planned with one."""


class _Reading(NamedTuple):
    """The motion under another assumption."""

    corners: int
    words: str
    chain: Chain


def corner_issues(
    targets: Targets, chain: Chain, profile: Profile, free: Profile, cell: Cell
) -> tuple[Issue, ...]:
    """Return the one note on corners whose path or time depends on what a KRC4 is assumed to do.

    ``free`` is the profile without the model of ``$ADVANCE``.
    """
    doubts: list[tuple[float, int, str]] = []
    for reading in _readings(targets, chain, cell):
        # a look-ahead costs far more work, and slows both so that corners matter less
        other_free_s = plan(reading.chain, cell, look_ahead=False, pieces=False).total_s
        other_s = other_free_s + profile.total_s - free.total_s
        share = abs(other_s / profile.total_s - 1.0) / TIME_SHARE
        if share > _WORTH_A_PLAN:
            other_s = plan(reading.chain, cell, pieces=False).total_s
            share = abs(other_s / profile.total_s - 1.0) / TIME_SHARE
        far, line, other_mm, error_mm = _furthest(chain, reading.chain)
        off = f"{other_mm:.2f} mm off the corner of line {line} instead of {error_mm:.2f} mm"
        lasts = f"the program lasts {other_s:.1f} s instead of {profile.total_s:.1f} s"
        parts = [words for words, size in ((f"the path is {off}", far), (lasts, share)) if size > 1.0]
        if parts:
            where = "1 corner joins" if reading.corners == 1 else f"{reading.corners} corners join"
            sentence = f"{where} {reading.words}, {' and '.join(parts)}"
            doubts.append((float(max(far, share)), line, sentence))
    if not doubts:
        return ()
    doubts.sort(reverse=True)
    sentence = "; ".join(sentence for _, _, sentence in doubts) + " (unverified)"
    line = next((line for _, line, _ in doubts if line), 0)
    remedy = "`gcode2krl make-test controller`, its trace to `identify controller`: it settles or lists each"
    return (Issue("note", "corner-undecided", line, sentence, remedy),)


def _furthest(chain: Chain, other: Chain) -> tuple[float, int, float, float]:
    """Return the change of the corner that moves most over `PATH_MM`, its line and its errors in mm; or 0."""
    if other.blend_mm is chain.blend_mm:
        return 0.0, 0, 0.0, 0.0
    ours, others = chain.corner_distances_mm(), other.corner_distances_mm()
    longest = np.maximum(np.maximum(*ours), np.maximum(*others))
    changed = (ours[0] != others[0]) | (ours[1] != others[1])
    # no corner is further from its parabola than half the longer distance times cos(alpha/2)
    corners = np.flatnonzero(changed & (longest * chain.cos_half / 2.0 > PATH_MM))
    error_mm, other_mm = (
        parabola_distance(before[corners], after[corners], chain.cos_half[corners])
        for before, after in (ours, others)
    )
    moved = np.abs(other_mm - error_mm) / PATH_MM
    if moved.max(initial=0.0) <= 1.0:
        return 0.0, 0, 0.0, 0.0
    worst = int(np.argmax(moved))
    line = int(chain.source_line[corners[worst]])
    return float(moved[worst]), line, float(other_mm[worst]), float(error_mm[worst])


def _readings(targets: Targets, chain: Chain, cell: Cell) -> Iterator[_Reading]:
    """Yield the other readings of the corners that join unequal lines; none where all are equal."""
    blended = chain.blend_mm[:-1] > 0.0
    cdis = targets.cdis_mm[chain.first + 1 :][: len(chain.blend_mm)]
    speed = chain.speed_mm_s * chain.scale
    unequal = int(np.count_nonzero(blended & (speed[1:] != speed[:-1])))
    if unequal:
        never = with_corners(chain, cdis, cell, "never")
        yield _Reading(unequal, "unequal speeds: if each were at the slower one", never)
        always = with_corners(chain, cdis, cell, "always")
        yield _Reading(unequal, "unequal speeds: if each made the change of speed", always)
    acceleration = chain.acceleration_mm_s2 * chain.scale
    unequal = int(np.count_nonzero(blended & (acceleration[1:] != acceleration[:-1])))
    if unequal:
        lower = replace(chain, acceleration_mm_s2=_lower(acceleration, ~chain.stop[:-1]) / chain.scale)
        yield _Reading(unequal, "unequal accelerations: if the lower one held for both lines", lower)
    smaller = cdis.copy()
    both = np.flatnonzero(blended & (cdis[1:] > 0.0))
    smaller[both] = np.minimum(cdis[both], cdis[both + 1])
    unequal = int(np.count_nonzero(smaller < cdis))
    if unequal:
        yield _Reading(unequal, "unequal CDIS: if the smaller one held", with_corners(chain, smaller, cell))


def _lower(acceleration: Floats, joined: Bools) -> Floats:
    """Return (n,) the lowest acceleration of each move and of those that it is joined to."""
    lowest = acceleration.copy()
    pair = np.where(joined, np.minimum(acceleration[:-1], acceleration[1:]), np.inf)
    lowest[:-1] = np.minimum(lowest[:-1], pair)
    lowest[1:] = np.minimum(lowest[1:], pair)
    return lowest
