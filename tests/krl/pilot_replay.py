"""Triggers of a written program, carried out by `brute_replay`, and what stands between blended motions."""

import math
import re
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tests.krl.brute_replay import Law, replay
from tests.krl.replay import read_program

STOPS_NOTHING = re.compile(r"TRIGGER |\$(VEL|APO)\.")


@dataclass(frozen=True)
class Fired:
    """A row per trigger, in the order of the text."""

    motion: np.ndarray
    """Number of the motion that carries it."""
    time_s: np.ndarray
    end_s: np.ndarray
    """Where the motion that carries it enters the corner at its end."""
    variable: tuple[str, ...]
    numbers: tuple[tuple[float, ...], ...]


def fire(path, targets, cell):
    """Return the triggers of a program made from ``targets`` (before motions were cut).

    How long a way to HOME takes is not in the text: the replay ends before one.
    """
    controller = cell.controller
    advance = math.inf if controller.advance == "unlimited" else controller.advance
    first = int(np.flatnonzero(targets.move >= 0)[0])
    last = int(np.flatnonzero((targets.move >= 0) & ~targets.ptp)[-1])
    assert not targets.ptp[first + 1 : last].any()
    more = len(read_program(path).motions) - len(targets)  # pieces lie between the two ends
    fired = replay(path, first, last + more, Law(controller.k_s, advance)).fired
    return Fired(
        motion=np.array([one.line for one in fired], dtype=int),
        time_s=np.array([one.time_s for one in fired]),
        end_s=np.array([one.end_s for one in fired]),
        variable=tuple(one.name for one in fired),
        numbers=tuple(tuple(one.numbers) for one in fired),
    )


def most_waiting(motion, in_view, halts=()):
    """Largest number of triggers in so many motions that follow each other.

    Nothing behind a wait or halt is read before it is over: it stands before the motions ``halts``.
    """
    count = np.bincount(motion, minlength=1)
    ends = [*sorted(halts), len(count)]
    until = [min(row + in_view, next(end for end in ends if end > row)) for row in range(len(count))]
    return max(count[row:end].sum() for row, end in enumerate(until))


def halts_of(path):
    """Motions before which the advance run waits."""
    motions = read_program(path).motions
    return [row for row, m in enumerate(motions) if any(re.match("WAIT|HALT", s) for s in m.before)]


def breaks_of_blending(path):
    """Statements between a blended motion and the next that are not known to leave the advance run alone."""
    motions = read_program(path).motions
    return [
        statement
        for before, motion in pairwise(motions)
        if before.blend
        for statement in motion.before
        if not STOPS_NOTHING.match(statement)
    ]
