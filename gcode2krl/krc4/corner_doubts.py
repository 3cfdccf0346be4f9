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
from gcode2krl.krc4.motion import Chain, build_chain, plan
from gcode2krl.krc4.profile import Profile
from gcode2krl.tables import Targets

PATH_MM = 0.05
"""Change of the distance between a corner and the path from which on a reading is told."""
TIME_SHARE = 0.01
"""Change of the time, as a share of it, from which on a reading is told."""


class _Reading(NamedTuple):
    """The motion under another assumption."""

    corners: int
    words: str
    chain: Chain


def corner_issues(targets: Targets, chain: Chain, profile: Profile, cell: Cell) -> tuple[Issue, ...]:
    """Return the one note on corners whose path or time depends on what a KRC4 is assumed to do."""
    doubts: list[tuple[float, int, str]] = []
    error_mm = chain.corner_error_mm()
    for reading in _readings(targets, chain, cell):
        other_mm, other_s = reading.chain.corner_error_mm(), plan(reading.chain, cell).total_s
        moved_mm = np.abs(other_mm - error_mm)
        worst = int(np.argmax(moved_mm))
        far, share = moved_mm[worst] / PATH_MM, abs(other_s / profile.total_s - 1.0) / TIME_SHARE
        line = int(chain.source_line[worst]) if far > 1.0 else 0
        off = f"{other_mm[worst]:.2f} mm off the corner of line {line} instead of {error_mm[worst]:.2f} mm"
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


def _readings(targets: Targets, chain: Chain, cell: Cell) -> Iterator[_Reading]:
    """Yield the other readings of the corners that join unequal lines; none where all are equal."""
    blended = chain.blend_mm[:-1] > 0.0
    speed = chain.speed_mm_s * chain.scale
    unequal = int(np.count_nonzero(blended & (speed[1:] != speed[:-1])))
    if unequal:
        never = build_chain(targets, cell, "never")
        yield _Reading(unequal, "unequal speeds: if each were at the slower one", never)
        always = build_chain(targets, cell, "always")
        yield _Reading(unequal, "unequal speeds: if each made the change of speed", always)
    acceleration = chain.acceleration_mm_s2 * chain.scale
    unequal = int(np.count_nonzero(blended & (acceleration[1:] != acceleration[:-1])))
    if unequal:
        lower = replace(chain, acceleration_mm_s2=_lower(acceleration, ~chain.stop[:-1]) / chain.scale)
        yield _Reading(unequal, "unequal accelerations: if the lower one held for both lines", lower)
    cdis = targets.cdis_mm
    smaller = np.where((cdis[:-1] > 0.0) & (cdis[1:] > 0.0), np.minimum(cdis[:-1], cdis[1:]), cdis[:-1])
    ends = slice(chain.first + 1, chain.first + len(chain.blend_mm))
    unequal = int(np.count_nonzero(blended & (smaller[ends] < cdis[ends])))
    if unequal:
        least = replace(targets, cdis_mm=np.append(smaller, cdis[-1:]))
        yield _Reading(unequal, "unequal CDIS: if the smaller one held", build_chain(least, cell))


def _lower(acceleration: Floats, joined: Bools) -> Floats:
    """Return (n,) the lowest acceleration of each move and of those that it is joined to."""
    lowest = acceleration.copy()
    pair = np.where(joined, np.minimum(acceleration[:-1], acceleration[1:]), np.inf)
    lowest[:-1] = np.minimum(lowest[:-1], pair)
    lowest[1:] = np.minimum(lowest[1:], pair)
    return lowest
