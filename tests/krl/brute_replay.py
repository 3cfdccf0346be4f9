"""A program's triggers carried out from its ``.src`` alone, by a time law of its own.

Nothing of the package is used; the text is read by `replay.read_program`. The time law is the one of the
controller's specification, by numbers on a fine grid: the programmed speeds pass an average of length dv/a,
whose ramps are drawn here, and then one of length k, which is a difference of running sums. Real time differs
from that of the prediction by the standstills whose length nobody knows (HALT, WAIT FOR, outputs, PTP): each
lasts `UNKNOWN_S` here, so that an announcement on the wrong side of one cannot look right.
"""

import itertools
import math
import re
from dataclasses import dataclass

import numpy as np

from tests.krl.replay import Motion, read_program

GRID_S = 0.00025
UNKNOWN_S = 100.0
ROOM = 0.8
"""A move that is held back over more than this share of its length runs at the slower speed as a whole."""
ALIKE = 0.99
"""So does one shorter than 4 times that reach, where the speeds differ by less than this."""
_DWELL = re.compile(r"WAIT SEC ([\d.]+) ; dwell")
_LASTS_NO_TIME = re.compile(r"TRIGGER |(REAL|INT|BOOL)\b|WAIT SEC [\d.]+ ; dwell$")


def stands_before(motions: tuple[Motion, ...], row: int) -> tuple[float, bool]:
    """Return the stated dwell in s before a motion, and whether it is preceded by what lasts unknown time."""
    motion, before = motions[row], motions[row - 1]
    dwells = [_DWELL.fullmatch(text) for text in motion.before]
    changed = motion.tool is not before.tool or motion.base is not before.base
    unknown = changed or not all(_LASTS_NO_TIME.match(text) for text in motion.before)
    return sum(float(dwell[1]) for dwell in dwells if dwell), unknown or "PTP" in (motion.kind, before.kind)


# --- the time law -----------------------------------------------------------------------------------------


@dataclass
class Move:
    """A straight way at a programmed speed; what happens at its end."""

    start: np.ndarray
    way: np.ndarray
    length: float
    speed: float
    acceleration: float
    cdis: float = 0.0
    scale: float = 1.0
    legs: tuple = (0.0, 0.0)
    """Distances before and behind the corner at its end, in mm."""
    plans_as_corner: bool = False


@dataclass
class Law:
    """The law's settings that no program states."""

    k_s: float = 0.168
    advance: float = 3
    """math.inf = unlimited."""


def chain_law(moves, law):
    """Return (instants of leaving each move's start and of reaching its end, duration, place at instants).

    ``moves`` go from rest to rest; instants count from the start of the first.
    """
    _corners(moves, law)
    length = np.array([m.length / m.scale for m in moves])
    speed = np.array([m.speed / m.scale for m in moves])
    a = np.array([m.acceleration / m.scale for m in moves])
    blend = np.array([m.legs[0] / m.scale if m.plans_as_corner else 0.0 for m in moves])
    bound = _bounds(length, speed, a, law)
    runs = _runs(length, speed, a, blend, bound, law.k_s)
    time, path, end_s = _drawn(runs, law.k_s)
    border = np.concatenate([[0.0], np.cumsum(length)])
    begins, ends = [], []
    for i, move in enumerate(moves):
        before = moves[i - 1].legs[1] / move.scale if i else 0.0
        leaves, enters = border[i] + before, border[i + 1] - move.legs[0] / move.scale
        begins.append(0.0 if i == 0 else _when(time, path, leaves))
        ends.append(end_s if i == len(moves) - 1 else _when(time, path, enters))
    return begins, ends, end_s, lambda t: _place(moves, border, float(np.interp(t, time, path)))


def _when(time, path, reach):
    """Return when a path is reached, between two points of the grid."""
    k = int(np.searchsorted(path, reach))
    if k == 0:
        return time[0]
    if k == len(path):
        return time[-1]
    return time[k - 1] + GRID_S * (reach - path[k - 1]) / (path[k] - path[k - 1])


def _corners(moves, law):
    """Set the distances at corners: equal ones, or, where the change of speed fits in, in their ratio."""
    for i, (move, after) in enumerate(itertools.pairwise(moves)):
        after.scale = move.scale
        cos_turn = float(np.clip(move.way @ after.way, -1.0, 1.0))
        cos_half = math.sqrt((1.0 - cos_turn) / 2.0)
        d = min(move.cdis, move.length / 2, after.length / 2)
        straight = cos_half < 1e-7 or (cos_half < 0.01 and d * cos_half < 1e-3)  # less than the text can say
        move.legs, move.plans_as_corner = (d, d), not straight
        ratio = after.speed / move.speed
        if straight or ratio == 1.0:
            continue
        d1 = min(move.cdis / max(1.0, ratio), move.length / 2, after.length / 2 / ratio)
        a = min(move.acceleration, after.acceleration)
        fastest = max(move.speed, after.speed)
        seen = moves[i + 1 :] if law.advance == math.inf else moves[i + 1 : i + 1 + int(law.advance)]
        fits = abs(after.speed - move.speed) / a + law.k_s <= 2.0 * d1 / move.speed
        if fits and fastest * (fastest / a + law.k_s) / 2 <= sum(m.length for m in seen):
            after.scale, move.legs = move.scale * ratio, (d1, d1 * ratio)


def _bounds(length, speed, a, law):
    """Return the largest speed at each vertex: both moves' own, and a stop must be possible in view."""
    bound = np.zeros(len(length) + 1)
    for i in range(1, len(length)):
        bound[i] = min(speed[i - 1], speed[i])
        if law.advance != math.inf:
            seen = length[i : i + int(law.advance)].sum()
            # v·(v/a + k)/2 = seen
            p, q = a[i - 1] * law.k_s, 2.0 * a[i - 1] * seen
            bound[i] = min(bound[i], -p / 2 + math.sqrt(p * p / 4 + q))
    return bound


def _runs(length, speed, a, blend, bound, k_s):
    """Return runs (length, top, u0, u1, a, head, tail) of moves that nothing between them holds back."""
    groups, first = [], 0
    for i in range(len(length)):
        last = i == len(length) - 1
        if last or bound[i + 1] < speed[i] or speed[i + 1] != speed[i] or a[i + 1] != a[i]:
            groups.append((first, i))
            first = i + 1
    count = len(groups)
    size = [length[f : e + 1].sum() for f, e in groups]
    top = [speed[f] for f, _ in groups]
    slope = [a[f] for f, _ in groups]
    corner = [blend[e] for _, e in groups]
    u = [0.0, *(bound[e + 1] for _, e in groups)]
    at = list(u)
    head, tail = [0.0] * count, [0.0] * count
    for i in range(1, count):  # a slow vertex j holds the speed down for its corner and half the average
        way = 0.0
        for j in range(i, 0, -1):
            reach = corner[j - 1] + at[j] * k_s / 2 - way
            if at[j] < top[i] and reach > 0:
                if reach > ROOM * size[i] or (at[j] > ALIKE * top[i] and size[i] < 4 * reach):
                    top[i] = at[j]
                else:
                    head[i] = max(head[i], reach)
                if reach >= size[i]:
                    u[i + 1] = min(u[i + 1], at[j])
            way += size[j - 1]
            if way > corner[j - 1] + top[i] * k_s / 2:
                break
    for i in range(count - 2, -1, -1):
        way = 0.0
        for j in range(i, count - 1):
            reach = corner[j] + at[j + 1] * k_s / 2 - way
            if at[j + 1] < top[i] and reach > 0:
                nearly = at[j + 1] > ALIKE * top[i] and size[i] < 4 * reach
                if reach + head[i] > ROOM * size[i] or nearly:
                    top[i] = at[j + 1]
                else:
                    tail[i] = max(tail[i], reach)
                if reach >= size[i]:
                    u[i] = min(u[i], at[j + 1])
            way += size[j + 1]
            if way > corner[j] + top[i] * k_s / 2:
                break
    for i in range(count):
        head[i] = 0.0 if top[i] <= u[i] else head[i]
        tail[i] = 0.0 if top[i] <= u[i + 1] else tail[i]
        if head[i] + tail[i] > ROOM * size[i]:
            head[i] = tail[i] = 0.0
        u[i], u[i + 1] = min(u[i], top[i]), min(u[i + 1], top[i])
    main = [max(s - h - t, 0.0) for s, h, t in zip(size, head, tail, strict=True)]
    for i in range(count - 1, -1, -1):
        u[i] = min(u[i], math.sqrt(u[i + 1] ** 2 + 2 * slope[i] * main[i]))
    for i in range(count):
        u[i + 1] = min(u[i + 1], math.sqrt(u[i] ** 2 + 2 * slope[i] * main[i]))
    return [(main[i], top[i], u[i], u[i + 1], slope[i], head[i], tail[i]) for i in range(count)]


def _drawn(runs, k_s):
    """Return time and path on the grid, and the end: ramps of the first average, then running sums."""
    points = [(0.0, 0.0)]  # (time, speed) between which the speed is linear

    def go(duration, speed):
        points.append((points[-1][0] + duration, speed))

    for main, top, u0, u1, a, head, tail in runs:
        if head > 0:
            go(head / u0, u0)
        up, down = (top - u0) / a, (top - u1) / a
        total = (main + (top - u0) * up / 2 + (top - u1) * down / 2) / top
        if main > 0 and total >= max(up, down):  # the rectangle's edges, each smeared over its own average
            begin, edges = points[-1][0], sorted({0.0, up, total - down, total})
            for t in edges[1:]:
                rise = a * min(t, up)
                fall = a * max(t - (total - down), 0.0)
                go(begin + t - points[-1][0], u0 + rise - fall)
        elif main > 0:
            peak = max(min(top, math.sqrt((2 * a * main + u0**2 + u1**2) / 2)), u0, u1)
            level = main - (2 * peak**2 - u0**2 - u1**2) / (2 * a)
            go((peak - u0) / a, peak)
            go(max(level, 0.0) / peak, peak)
            go((peak - u1) / a, u1)
        if tail > 0:
            go(tail / u1, u1)
    node_s, node_v = np.array(points).T
    end_s = node_s[-1] + k_s
    time = np.arange(0.0, end_s + GRID_S, GRID_S)
    speed = np.interp(time, node_s, node_v)
    asked = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * GRID_S)])
    if k_s > 0:
        area = np.concatenate([[0.0], np.cumsum((asked[1:] + asked[:-1]) / 2 * GRID_S)])
        delayed = time - k_s
        path = (area - np.where(delayed > 0, np.interp(delayed, time, area), 0.0)) / k_s
    else:
        path = asked
    total = sum(run[0] + run[5] + run[6] for run in runs)
    path = np.maximum.accumulate(path * total / path[-1])  # the grid's rest, some µm
    return time, path, end_s


def _place(moves, border, path):
    """Return the point in space at a path, on the parabola within a corner."""
    i = min(max(int(np.searchsorted(border, path, side="right")) - 1, 0), len(moves) - 1)
    inside = (path - border[i]) * moves[i].scale
    for j, along in ((i, inside - moves[i].length), (i - 1, inside)):
        if not 0 <= j < len(moves) - 1 or not moves[j].plans_as_corner or moves[j].legs[0] == 0.0:
            continue
        before, behind = moves[j].legs
        t = (along / (before if along < 0 else behind) + 1.0) / 2.0
        if 0.0 <= t <= 1.0:
            corner = moves[j].start + moves[j].length * moves[j].way
            return corner - (1 - t) ** 2 * before * moves[j].way + t * t * behind * moves[j + 1].way
    return moves[i].start + inside * moves[i].way


# --- the replay -------------------------------------------------------------------------------------------


@dataclass
class Fired:
    """A trigger as it acts, in the time of the prediction and in real time."""

    line: int
    time_s: float
    real_s: float
    end_s: float
    """When the motion that carries it enters the corner at its end."""
    name: str
    numbers: list


@dataclass
class Replay:
    """What a program does."""

    fired: list
    total_s: float
    sections: list
    """(time of the prediction, real time) at which the robot starts anew."""
    chains: list
    """(start, end, place at instants from the start) of each way from rest to rest."""

    def real(self, time_s):
        """Return the real instant of one of the prediction; at a standstill that of the end of it."""
        begins = np.array([begin for begin, _ in self.sections])
        k = max(int(np.searchsorted(begins, time_s + 1e-9, side="right")) - 1, 0)
        return time_s + self.sections[k][1] - self.sections[k][0]

    def place(self, time_s):
        """Return the point at an instant of the prediction."""
        k = max(int(np.searchsorted([c[0] for c in self.chains], time_s, side="right")) - 1, 0)
        begin, end, place = self.chains[k]
        return place(min(time_s, end) - begin)


def replay(path, first, last, law):
    """Carry a program out between the ends of the motions ``first`` and ``last``, where it rests."""
    motions = read_program(path).motions
    fired, sections, chains = [], [(0.0, 0.0)], []
    clock = ahead = 0.0
    row = first + 1
    for motion in motions[: first + 1] + motions[last + 1 :]:
        assert not motion.triggers, "a trigger outside the predicted motion"
    while row <= last:
        wait_s, unknown = stands_before(motions, row)
        clock += wait_s
        if unknown:
            ahead += UNKNOWN_S
            sections.append((clock, clock + ahead))
        rows = [row]
        while motions[rows[-1]].blend and law.advance > 0 and rows[-1] < last:
            assert stands_before(motions, rows[-1] + 1) == (0.0, False)
            rows.append(rows[-1] + 1)
        parts = [_move(motions, k) for k in rows]
        reverse = next(
            (k for k, (m, n) in enumerate(itertools.pairwise(parts)) if m.way @ n.way < -1 + 1e-12),
            None,
        )
        if reverse is not None:  # a reversal is an exact stop whatever the text says
            rows, parts = rows[: reverse + 1], parts[: reverse + 1]
        if parts[0].length < 1e-6 and len(parts) == 1:  # after a tool change the tip may be there already
            assert not motions[row].triggers
            row += 1
            continue
        begins, ends, duration, place = chain_law(parts, law)
        for k, begin, end in zip(rows, begins, ends, strict=True):
            for delay, name, numbers in motions[k].triggers:
                at = clock + begin + delay
                fired.append(Fired(k, at, at + ahead, clock + end, name, numbers))
        chains.append((clock, clock + duration, place))
        clock += duration
        row = rows[-1] + 1
    return Replay(fired, clock, sections, chains)


def _move(motions, k):
    """Return the way of a motion; where the tool changed, another tip begins it."""
    motion, before = motions[k], motions[k - 1]
    start = before.pose
    if motion.tool is not None and before.tool is not None:
        start = start * before.tool.inv() * motion.tool
    way = motion.pose.translation - start.translation
    length = float(np.linalg.norm(way))
    return Move(
        start.translation,
        way / max(length, 1e-300),
        length,
        motion.speed_m_s * 1e3,
        motion.acceleration_m_s2 * 1e3,
        motion.cdis_mm if motion.blend else 0.0,
    )
