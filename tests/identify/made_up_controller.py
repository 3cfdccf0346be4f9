"""Traces of the program of `make-test controller`, made by brute force.

A numerical moving average at 0.1 ms and the parabola by its own formula, without the planner and the reader
of the package; a trace has a noise, a rounding and a start of its own.
"""

import re
from dataclasses import dataclass

import numpy as np

CYCLE_S = 0.012
ACC_MM_S2 = 2000.0
FINE_S = 1e-4
RAPID_MM_S = 200.0


@dataclass(frozen=True)
class Controller:
    """The truth of a draw."""

    k_s: float = 0.168
    cdis_mm: float = 5.0
    law: str = "averages"


@dataclass(frozen=True)
class Leg:
    """One or two lines from rest to rest, then a dwell."""

    points_mm: np.ndarray
    speeds_mm_s: tuple[float, ...]
    dwell_s: float
    acc_mm_s2: float = ACC_MM_S2


def turning_leg(start_mm, end_mm, angle_deg, vel_ori_deg_s, acc_ori_deg_s2, speed_mm_s, dwell_s) -> Leg:
    """A line on which the tool turns: angle and path progress by the same fraction."""
    points = np.array([start_mm, end_mm], dtype=float)
    mm_per_deg = np.linalg.norm(points[1] - points[0]) / angle_deg
    speed = min(speed_mm_s, vel_ori_deg_s * mm_per_deg)
    return Leg(points, (speed,), dwell_s, min(ACC_MM_S2, acc_ori_deg_s2 * mm_per_deg))


def legs_of(text: str, start_mm=(100.0, 0.0, 100.0)) -> list[Leg]:
    """Read the few words that the test program uses."""
    legs, here = [], np.array(start_mm)
    points, speeds, feed, blended = [here], [], 0.0, False

    def close(dwell_s: float) -> None:
        nonlocal points, speeds
        if speeds:
            legs.append(Leg(np.array(points), tuple(speeds), dwell_s))
        points, speeds = [here], []

    for line in text.splitlines():
        words = dict(re.findall(r"([A-Z])(-?[0-9.]+)", re.sub(r"\(.*\)", "", line)))
        if line.startswith(("G0", "G1")):
            here = np.array([float(words.get(axis, old)) for axis, old in zip("XYZ", here, strict=True)])
            feed = float(words["F"]) / 60.0 if "F" in words else feed
            speed = RAPID_MM_S if line.startswith("G0") else feed
            points.append(here)
            speeds.append(speed)
            if not blended:
                close(0.0 if legs else 0.5)
        elif line.startswith("G64"):
            blended = True
        elif line.startswith("G61"):
            blended = False
        elif line.startswith("G4"):
            last = legs.pop()
            legs.append(Leg(last.points_mm, last.speeds_mm_s, last.dwell_s + float(words["P"])))
    return [leg for leg in legs if np.linalg.norm(leg.points_mm[-1] - leg.points_mm[0]) > 0]


def averaged(t: np.ndarray, values: np.ndarray, width_s: float) -> np.ndarray:
    """Moving average over the past ``width_s``; before the grid the values are 0."""
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(t))])
    return (integral - np.interp(t - width_s, t, integral, left=0.0)) / width_s


def path_of(leg: Leg, controller: Controller) -> tuple[np.ndarray, np.ndarray]:
    """Return fine times and the way along the lines, from rest to rest."""
    lengths = np.linalg.norm(np.diff(leg.points_mm, axis=0), axis=1)
    v = leg.speeds_mm_s
    if v[0] > v[-1]:
        reverse = Leg(leg.points_mm[::-1], v[::-1], 0.0)
        t, way = path_of(reverse, controller)
        return t[-1] - t[::-1], lengths.sum() - way[::-1]
    d = min(controller.cdis_mm, *(lengths / 2)) if len(v) == 2 else 0.0
    if v[0] < v[-1]:
        before = lengths[0] + d + v[0] * controller.k_s / 2.0
        knots = speed_knots(before, lengths.sum() - before, *v)
        t, speed = ramps(knots, controller)
        way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(t))])
    elif controller.law == "averages":
        total = lengths.sum()
        t = grid(total / v[0] + v[0] / leg.acc_mm_s2 + controller.k_s)
        way = averaged(t, np.minimum(v[0] * t, total), v[0] / leg.acc_mm_s2)
    else:
        total = lengths.sum()
        top = min(v[0], np.sqrt(leg.acc_mm_s2 * total))
        rise = top / leg.acc_mm_s2
        level = (total - top * rise) / top
        t, speed = ramps([(0, 0), (rise, top), (rise + level, top), (2 * rise + level, 0)], controller)
        way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(t))])
    return t, averaged(t, way, controller.k_s)


def grid(duration_s: float) -> np.ndarray:
    return np.arange(int(np.ceil(duration_s / FINE_S)) + 2) * FINE_S


def ramps(knots: list[tuple[float, float]], controller: Controller) -> tuple[np.ndarray, np.ndarray]:
    times, speeds = zip(*knots, strict=True)
    t = np.union1d(grid(times[-1] + controller.k_s), np.array(times))
    return t, np.interp(t, times, speeds)


def speed_knots(before_mm: float, after_mm: float, slow: float, fast: float) -> list[tuple[float, float]]:
    """Run up to ``slow``, keep it for ``before_mm``, then on to ``fast`` and down to rest."""
    knots = [(0.0, 0.0), (slow / ACC_MM_S2, slow)]
    level = (before_mm - slow**2 / (2 * ACC_MM_S2)) / slow
    knots.append((knots[-1][0] + level, slow))
    knots.append((knots[-1][0] + (fast - slow) / ACC_MM_S2, fast))
    level = (after_mm - (2 * fast**2 - slow**2) / (2 * ACC_MM_S2)) / fast
    knots.append((knots[-1][0] + level, fast))
    knots.append((knots[-1][0] + fast / ACC_MM_S2, 0.0))
    return knots


def place(leg: Leg, way: np.ndarray, cdis_mm: float) -> np.ndarray:
    """Return positions on the lines, in the corner on the parabola (C1, P2, C2) as a Bezier curve."""
    points = leg.points_mm
    sizes = np.linalg.norm(np.diff(points, axis=0), axis=1)
    u = np.diff(points, axis=0) / sizes[:, None]
    if len(sizes) == 1:
        return points[0] + way[:, None] * u[0]
    d = min(cdis_mm, *(sizes / 2))
    beyond = way > sizes[0]
    result = np.where(
        beyond[:, None], points[1] + (way - sizes[0])[:, None] * u[1], points[0] + way[:, None] * u[0]
    )
    share = (way - sizes[0] + d) / (2 * d)
    inside = (share > 0) & (share < 1)
    s = share[inside, None]
    c1, c2 = points[1] - d * u[0], points[1] + d * u[1]
    result[inside] = (1 - s) ** 2 * c1 + 2 * s * (1 - s) * points[1] + s**2 * c2
    return result


def simulate(
    legs: list[Leg],
    controller: Controller,
    rng: np.random.Generator,
    *,
    noise_mm: float = 0.0,
    rounding_mm: float = 0.001,
    cycle_s: float = CYCLE_S,
) -> tuple[np.ndarray, np.ndarray]:
    """Return sample times and recorded positions; the first sample falls anywhere in a cycle."""
    times, positions = [np.zeros(1)], [legs[0].points_mm[:1]]
    now = 0.2 + rng.uniform(0.0, cycle_s)
    for leg in legs:
        t, way = path_of(leg, controller)
        times.append(now + t)
        positions.append(place(leg, way, controller.cdis_mm))
        now += t[-1] + leg.dwell_s + FINE_S
    times.append(np.array([now]))
    positions.append(positions[-1][-1:])
    fine_t, fine = np.concatenate(times), np.concatenate(positions)
    t = np.arange(0.0, now, cycle_s)
    position = np.stack([np.interp(t, fine_t, fine[:, axis]) for axis in range(3)], axis=1)
    if noise_mm:
        position = position + rng.normal(0.0, noise_mm, position.shape)
    if rounding_mm:
        position = np.round(position / rounding_mm) * rounding_mm
    return t, position
