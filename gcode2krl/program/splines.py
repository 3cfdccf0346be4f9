"""Chains of short moves that a program may write as one SPLINE block, and the stops at their ends.

A SPL goes through its point exactly, on polynomials whose shape between the points KUKA does not publish
(KSS 8, Operating and Programming Instructions for System Integrators: the path depends on the neighbouring
points). So only chains are taken in which every smooth curve through the points stays near the chords: equal
speed, tool and orientation, gentle turns, moves of similar length. Spline motions belong to another planner
than LIN, which does not blend into them: the robot stops where a block begins and ends.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.program.arcs import arcs_of
from gcode2krl.tables import Targets, lengths
from gcode2krl.units import RAD_PER_DEG

FEWEST, MOST = 8, 1000
"""Points of a block; the controller computes a whole block before it moves, a long one for seconds."""
MOST_TURN_RAD = 15.0 * RAD_PER_DEG
"""Turn between two moves above which a chain ends: there the G-code has a corner."""
MOST_RATIO = 3.0
"""Of the lengths of neighbouring moves."""
OFF_MM = 0.02
"""How far a curve through the points may be beside the chords."""


class SplineBlock(NamedTuple):
    """Rows of Targets that become one SPLINE block; it begins where the row before ends, at rest."""

    first: int
    end: int


def with_stops(targets: Targets, is_circ: bool) -> Targets:
    """Return targets that stop where a SPLINE block begins and ends."""
    cdis = np.array(targets.cdis_mm)
    for chain in _chains(targets, is_circ):
        cdis[[chain.first - 1, chain.end]] = 0.0
    return replace(targets, cdis_mm=cdis)


def splines_of(targets: Targets, is_circ: bool) -> list[SplineBlock]:
    """Return the chains between whose ends the robot does not stop, in their order."""
    return [
        chain
        for chain in _chains(targets, is_circ)
        if targets.cdis_mm[chain.first - 1] == 0.0 and targets.cdis_mm[chain.end] == 0.0
    ]


def _chains(targets: Targets, is_circ: bool) -> list[SplineBlock]:
    """Return the runs of moves that are one smooth chain; arcs that become CIRC are left out."""
    smooth = _goes_on(targets)
    if is_circ:
        for arc in arcs_of(targets):
            smooth[arc.first - 1 : arc.end + 1] = False
    border = np.flatnonzero(np.diff(np.concatenate([[0], smooth.astype(np.int8), [0]])))
    return [
        SplineBlock(first, end)
        for first, end in border.reshape(-1, 2).tolist()
        if FEWEST <= end - first + 1 <= MOST and first > 0
    ]


def _goes_on(targets: Targets) -> Bools:
    """Mark the rows (p,) behind which the next move goes on smoothly."""
    move = np.diff(targets.position_mm, axis=0, prepend=targets.position_mm[:1])
    size = lengths(move)
    here, after = slice(0, -1), slice(1, None)
    product = np.maximum(size[here] * size[after], 1e-12)
    turn = np.arccos(np.clip(np.einsum("ni,ni->n", move[here], move[after]) / product, -1.0, 1.0))
    longer, shorter = np.maximum(size[here], size[after]), np.minimum(size[here], size[after])
    plain = ~targets.ptp & (targets.move >= 0)
    same = plain[here] & plain[after] & (turn <= MOST_TURN_RAD) & (longer <= MOST_RATIO * shorter)
    same &= _beside_chord_mm(longer, turn) <= OFF_MM
    same &= (targets.speed_mm_s[here] == targets.speed_mm_s[after]) & (
        targets.tool[here] == targets.tool[after]
    )
    same &= (targets.rotation[here] == targets.rotation[after]).all(axis=1)
    same &= (targets.external[here] == targets.external[after]).all(axis=1)
    same &= (targets.cdis_mm[here] > 0.0) & (targets.wait_s[here] == 0.0)
    stands = [event.row for event in targets.events if event.row < len(same)]
    same[stands] = False
    return np.concatenate([same, [False]])


def _beside_chord_mm(length_mm: Floats, turn_rad: Floats) -> Floats:
    """Return how far a smooth curve is beside a chord (n,) at most.

    An arc through the points that turns by t from chord to chord is ``l/2 tan(t/4)`` beside its chord. A
    curve that takes the turns of both ends in one move is twice as far, and cubic splines through uneven
    points were found up to 2.5 times as far: four times is what counts here.
    """
    return np.asarray(2.0 * length_mm * np.tan(turn_rad / 4.0))
