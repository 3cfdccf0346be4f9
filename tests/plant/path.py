"""The commanded path: programmed speed steps through moving averages, corners of the polyline rounded.

Virtual distance: s counts along the polyline with sharp corners. The controller's law is a programme of
speed steps in s, each step smeared by box filters; the position is the polyline at s, in which the direction
turns linearly from one leg to the next within d of a vertex (a parabola).
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from tests.plant.scene import World
from tests.plant.waypoints import Waypoints

MATCH = 1e-9


@dataclass(frozen=True)
class Chain:
    """Legs driven without a stop."""

    points_mm: np.ndarray  # (n+1, 3)
    speed_mm_s: np.ndarray  # (n,)
    reach_mm: np.ndarray  # (n+1,) where a corner's curve begins before its vertex, 0 at the ends
    first: int  # row of the waypoints that the first leg ends at
    start_s: float
    end_s: float
    steps: list  # (time, change of speed, box lengths)

    @property
    def knots_mm(self) -> np.ndarray:
        """Virtual distance of the points."""
        legs = np.linalg.norm(np.diff(self.points_mm, axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(legs)])


def smeared_ramp(t_s: np.ndarray, boxes_s: tuple) -> np.ndarray:
    """Distance gone when a unit speed step passes moving averages of these lengths.

    The twice integrated step through m boxes is a sum of truncated powers of degree m + 1; after all
    boxes the distance is t minus half of their sum, exactly.
    """
    total = sum(boxes_s)
    inside = np.clip(t_s, 0.0, total)
    boxes = [b for b in boxes_s if b > 0.0]
    degree = len(boxes) + 1
    scale = np.prod(boxes) * np.prod(np.arange(1, degree + 1))
    out = np.zeros_like(inside)
    for count in range(len(boxes) + 1):
        for chosen in combinations(boxes, count):
            out += (-1.0) ** count * np.maximum(inside - sum(chosen), 0.0) ** degree
    return out / scale + np.maximum(t_s - total, 0.0)


def boxes_of(change_mm_s: float, world: World) -> tuple:
    """Lengths of the averages that a step of speed passes."""
    first = abs(change_mm_s) / world.acceleration_mm_s2
    if world.ramp == "three_averages":  # another form: a smoother window of the same length
        return (first, world.k_s / 2.0, world.k_s / 2.0)
    return (first, world.k_s)


def _place(steps: list, at_mm: float, change: float, world: World) -> tuple:
    """A step that ends (slower) or begins (faster) at this distance, after the steps so far."""
    boxes = boxes_of(change, world)
    half = sum(boxes) / 2.0
    speed = sum(step[1] for step in steps)
    gone = sum(step[1] * (step[0] + sum(step[2]) / 2.0) for step in steps)  # distance = speed·t - gone
    if change > 0.0:
        return ((at_mm + gone) / speed, change, boxes)
    end = (at_mm + gone - change * half) / speed  # the step itself has gone change·half by then
    return (end - 2.0 * half, change, boxes)


def _law(knots_mm, speed_mm_s, reach_mm, start_s, world) -> tuple[list, float]:
    """The steps of one chain and when it stands again."""
    steps = [(start_s, speed_mm_s[0], boxes_of(speed_mm_s[0], world))]
    for i in range(1, len(speed_mm_s)):
        change = speed_mm_s[i] - speed_mm_s[i - 1]
        if abs(change) > MATCH:
            edge = knots_mm[i] + np.sign(change) * reach_mm[i]
            steps.append(_place(steps, edge, change, world))
    steps.append(_place(steps, knots_mm[-1], -speed_mm_s[-1], world))
    return steps, steps[-1][0] + sum(steps[-1][2])


def chains(way: Waypoints, world: World) -> list[Chain]:
    """The programme cut at its exact stops, each chain with its time law."""
    out, start_s, first = [], 0.0, 0
    for i in range(1, len(way)):
        if way.cdis_mm[i] > 0.0:
            continue
        points = way.position_mm[first : i + 1]
        legs = np.linalg.norm(np.diff(points, axis=0), axis=1)
        keep = np.concatenate([[True], legs > MATCH])
        points, legs = points[keep], legs[legs > MATCH]
        if len(legs):
            speed = way.speed_mm_s[first + 1 : i + 1][keep[1:]]
            reach = np.zeros(len(points))
            wanted = way.cdis_mm[first : i + 1][keep]
            reach[1:-1] = np.minimum(wanted[1:-1], np.minimum(legs[:-1], legs[1:]) / 2.0)
            knots = np.concatenate([[0.0], np.cumsum(legs)])
            steps, end_s = _law(knots, speed, reach, start_s, world)
            out.append(Chain(points, speed, reach, first + 1, start_s, end_s, steps))
            start_s = end_s
        start_s += way.hold_s[i]
        first = i
    return out


def stands(way: Waypoints, links: list[Chain]) -> np.ndarray:
    """When the hold of each row begins, (n,); of rows passed without a stop it says nothing."""
    begins, now_s, first, coming = np.zeros(len(way)), 0.0, 0, list(links)
    for i in np.flatnonzero(way.cdis_mm[1:] <= 0.0) + 1:
        legs = np.linalg.norm(np.diff(way.position_mm[first : i + 1], axis=0), axis=1)
        if legs.max() > MATCH:
            now_s = coming.pop(0).end_s
        begins[i] = now_s
        now_s, first = now_s + way.hold_s[i], i
    return begins


def _turned(share: np.ndarray, shape: str) -> np.ndarray:
    """Integral from 0 of the share of the turn that is done, over the corner from 0 to 1."""
    if shape == "quartic":  # another form: the turn begins and ends softly, 3u² - 2u³
        return share**3 - share**4 / 2.0
    return share**2 / 2.0


def at_distance(chain: Chain, s_mm: np.ndarray, world: World) -> np.ndarray:
    """Position at virtual distances s, (n, 3)."""
    knots, points = chain.knots_mm, chain.points_mm
    unit = np.diff(points, axis=0) / np.diff(knots)[:, None]
    leg = np.clip(np.searchsorted(knots, s_mm, side="right") - 1, 0, len(unit) - 1)
    out = points[leg] + unit[leg] * (s_mm - knots[leg])[:, None]
    for i in range(1, len(unit)):
        d = chain.reach_mm[i]
        near = np.abs(s_mm - knots[i]) < d
        if d <= 0.0 or not near.any():
            continue
        u = s_mm[near] - (knots[i] - d)
        turned = 2.0 * d * _turned(u / (2.0 * d), world.corner)
        out[near] = points[i] + unit[i - 1] * (u - d)[:, None] + (unit[i] - unit[i - 1]) * turned[:, None]
    return out


def distance(chain: Chain, t_s: np.ndarray) -> np.ndarray:
    """Virtual distance at times."""
    s = sum(change * smeared_ramp(t_s - at, boxes) for at, change, boxes in chain.steps)
    return np.clip(s, 0.0, chain.knots_mm[-1])


def commanded(links: list[Chain], t_s: np.ndarray, world: World) -> np.ndarray:
    """Position at times, (n, 3)."""
    out = np.empty((len(t_s), 3))
    out[t_s <= links[0].start_s] = links[0].points_mm[0]
    for i, chain in enumerate(links):
        until = links[i + 1].start_s if i + 1 < len(links) else np.inf
        now = (t_s >= chain.start_s) & (t_s < until)
        out[now] = at_distance(chain, distance(chain, t_s[now]), world)
    return out
