"""Triggers of a written program, carried out by `brute_replay`, and what stands between blended motions."""

import math
import re
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gcode2krl.pipeline import plan_motion
from tests.krl.brute_replay import Law, replay
from tests.krl.replay import read_program

FINE_S = 0.0005
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

    How long a way over HOME takes is not in the text: there the predicted Motion is followed.
    """
    controller = cell.controller
    advance = math.inf if controller.advance == "unlimited" else controller.advance
    ends = np.flatnonzero(targets.move >= 0)[[0, -1]]
    if targets.ptp[ends[0] + 1 : ends[1] + 1].any():
        return _fire_along_motion(path, targets, cell)
    more = len(read_program(path).motions) - len(targets)  # pieces lie between the two ends
    fired = replay(path, int(ends[0]), int(ends[1]) + more, Law(controller.k_s, advance)).fired
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


def _fire_along_motion(path, targets, cell):
    """The same along a finely sampled Motion: arc length from positions, corners from points on them."""
    motions = read_program(path).motions
    fine = plan_motion(targets, cell, FINE_S)
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(fine.position_mm, axis=0), axis=1))])
    begin, end = _instants(motions, fine, way, targets, cell)
    fired = [(row, *trigger) for row, motion in enumerate(motions) for trigger in motion.triggers]
    rows, delays, variables, numbers = zip(*fired, strict=True) if fired else ((), (), (), ())
    at = np.array(rows, dtype=int)
    return Fired(at, begin[at] + np.array(delays), end[at], variables, tuple(map(tuple, numbers)))


def _instants(motions, fine, way, targets, cell):
    """Return when each motion leaves the corner at its start and enters the one at its end, NaN elsewhere."""
    points = np.array([[m.values.get(key, np.nan) for key in "XYZ"] for m in motions])
    points[np.isnan(points[:, 0])] = targets.position_mm[targets.home]
    lines = [m.kind == "LIN" for m in motions]
    programmed = np.flatnonzero(targets.move >= 0)
    first = int(programmed[0])
    last = len(motions) - (len(targets) - 1 - int(programmed[-1])) - 1
    assert np.linalg.norm(points[first] - fine.position_mm[0]) < 0.002
    begin, end = np.full(len(motions), np.nan), np.full(len(motions), np.nan)
    reach = 0.0
    half_before = 0.0
    for row in range(first + 1, last + 1):
        length = np.linalg.norm(points[row] - points[row - 1])
        half = 0.0
        if motions[row].blend and row < last and lines[row + 1] and cell.controller.advance != 0:
            following = np.linalg.norm(points[row + 1] - points[row])
            half = min(motions[row].cdis_mm, length / 2, following / 2)
        begin[row] = _leaves(reach, half_before == 0.0, fine, way)
        reach += length - half_before - half
        if half == 0.0:  # at rest the two ways to measure agree again
            reach = _rest_near(points[row], reach, fine, way)
        end[row] = _reaches(reach, half == 0.0, fine, way)
        if half > 0.0:
            p = (points[row] - points[row - 1]) / length * half
            q = (points[row + 1] - points[row]) / following * half
            tau = np.linspace(0, 1, 257)[:, None]
            arc = tau**2 * q - (1 - tau) ** 2 * p
            reach += np.linalg.norm(np.diff(arc, axis=0), axis=1).sum()
        half_before = half
    assert abs(reach - way[-1]) < 1e-6, "the program ends elsewhere than its motion"
    return begin, end


def _rest_near(point, reach, fine, way):
    around = slice(*np.searchsorted(way, [reach - 0.5, reach + 0.5]))
    distance = np.linalg.norm(fine.position_mm[around] - point, axis=1)
    assert distance.min() < 0.001
    return way[around][np.argmin(distance)]


def _leaves(reach, resting, fine, way):
    at = int(np.searchsorted(way, reach + 1e-6, side="right"))
    at = min(max(at, 1), len(way) - 1)
    if resting or way[at] == way[at - 1]:
        return fine.time_s[at - 1]
    return fine.time_s[at - 1] + FINE_S * (reach - way[at - 1]) / (way[at] - way[at - 1])


def _reaches(reach, resting, fine, way):
    at = int(np.searchsorted(way, reach - 1e-6, side="left"))
    at = min(max(at, 1), len(way) - 1)
    if resting or way[at] == way[at - 1]:
        return fine.time_s[at]
    return fine.time_s[at - 1] + FINE_S * (reach - way[at - 1]) / (way[at] - way[at - 1])
