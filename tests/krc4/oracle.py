"""Brute force for the time law: the programmed speed passes two moving averages, sampled at 0.1 ms.

Written from the specification and the paper alone. Each step of the programmed speed passes an average of
length |dv|/a and one of length k; the averages are differences of running sums, the position is the sum of
the speed. Nothing here knows a closed form of the profile.
"""

import itertools
from dataclasses import dataclass

import numpy as np

STEP_S = 1e-4


@dataclass(frozen=True)
class Profile:
    """Position along the path, speed, acceleration and jerk over time."""

    time_s: np.ndarray
    position_mm: np.ndarray
    speed_mm_s: np.ndarray
    acceleration_mm_s2: np.ndarray
    jerk_mm_s3: np.ndarray
    duration_s: float

    def position(self, time_s):
        return np.interp(time_s, self.time_s, self.position_mm)

    def speed(self, time_s):
        return np.interp(time_s, self.time_s, self.speed_mm_s)

    def acceleration(self, time_s):
        return np.interp(time_s, self.time_s, self.acceleration_mm_s2)


def integral(values):
    """Return the running integral by the trapezoidal rule."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * STEP_S)])


def pulses(steps, k_s, end_s, speed_mm_s=0.0):
    """Filter a pulse train: ``steps`` are (time, change of speed, length of its own average)."""
    time = np.arange(0.0, end_s + 50 * STEP_S, STEP_S)
    ramp, slope = np.full(len(time), float(speed_mm_s)), np.zeros(len(time))
    for start, change, length in steps:
        if change == 0:
            continue
        # the programmed position of a step is max(0, t - start): its difference over the window is the
        # first average, so that neither a step nor a window is rounded to the grid
        inside = (np.maximum(time - start, 0) - np.maximum(time - start - length, 0)) / length
        ramp += change * inside
        slope += change * ((time >= start) & (time < start + length)) / length
    if k_s > 0:
        delayed = time - k_s
        total = integral(ramp)
        before = np.where(delayed < 0, speed_mm_s * delayed, np.interp(delayed, time, total))
        speed = (total - before) / k_s
        acceleration = (ramp - np.interp(delayed, time, ramp, left=speed_mm_s)) / k_s
        jerk = (slope - np.interp(delayed, time, slope, left=0.0)) / k_s
    else:
        speed, acceleration, jerk = ramp, slope, np.full(len(time), np.nan)
    return Profile(time, integral(speed), speed, acceleration, jerk, end_s)


def chain(lines, a_mm_s2, k_s):
    """Return the profile of collinear (length, speed) without a stop between them.

    Slowing ends at the vertex, speeding up begins there; one line alone may be of any length, of several
    each must be long enough for the changes of speed on it.
    """
    first = lines[0][1]
    steps = [(0.0, first, first / a_mm_s2)]
    free_s = first / a_mm_s2 + k_s  # when the last change is over, and where
    free_mm = 0.5 * first * free_s
    vertex_mm = 0.0
    for (length, speed), (_, after) in itertools.pairwise([*lines, (0.0, 0.0)]):
        vertex_mm += length
        if after == speed:
            continue
        takes_s = abs(after - speed) / a_mm_s2 + k_s
        covers_mm = 0.5 * (speed + after) * takes_s
        begin_mm = vertex_mm - covers_mm if after < speed else vertex_mm
        start_s = free_s + (begin_mm - free_mm) / speed
        assert len(lines) == 1 or start_s >= free_s - 1e-12, "line too short for this oracle"
        steps.append((start_s, after - speed, abs(after - speed) / a_mm_s2))
        free_s, free_mm = start_s + takes_s, begin_mm + covers_mm
    return pulses(steps, k_s, free_s)


def line(length_mm, speed_mm_s, a_mm_s2, k_s, law="averages"):
    """Return the profile of one line from rest to rest."""
    if law == "trapezoid":  # acceleration a up and down, a triangle where v is not reached
        speed_mm_s = min(speed_mm_s, np.sqrt(a_mm_s2 * length_mm))
    return chain([(length_mm, speed_mm_s)], a_mm_s2, k_s)


def with_stops(lines, a_mm_s2, k_s, law="averages"):
    """Return the profile of (length, speed, dwell) with an exact stop after each: one after the other."""
    columns = [[] for _ in range(5)]
    start_s, start_mm = 0.0, 0.0
    for length, speed, dwell_s in lines:
        one = line(length, speed, a_mm_s2, k_s, law)
        keep = one.time_s <= one.duration_s
        parts = (
            one.time_s[keep] + start_s,
            one.position_mm[keep] + start_mm,
            one.speed_mm_s[keep],
            one.acceleration_mm_s2[keep],
            one.jerk_mm_s3[keep],
        )
        end = (start_s + one.duration_s, start_mm + length, 0.0, 0.0, 0.0)
        for column, part, last in zip(columns, parts, end, strict=True):
            column.append(np.append(part, last))
        start_s, start_mm = start_s + one.duration_s + dwell_s, start_mm + length
    return Profile(*(np.concatenate(column) for column in columns), duration_s=start_s)


def parabola(p1_mm, p2_mm, p3_mm, d_mm, count=20001):
    """Return points of an approximated corner by the paper's eq. 1-3: y = a·x² + b·x from C1 to C2."""
    p1, p2, p3 = (np.asarray(p, dtype=float) for p in (p1_mm, p2_mm, p3_mm))
    u1 = (p2 - p1) / np.linalg.norm(p2 - p1)
    u2 = (p3 - p2) / np.linalg.norm(p3 - p2)
    c1, c2 = p2 - d_mm * u1, p2 + d_mm * u2
    alpha = np.arccos(np.clip(-u1 @ u2, -1, 1))
    sine, cosine = np.sin(alpha / 2), np.cos(alpha / 2)
    x = np.linspace(0, 2 * d_mm * sine, count)
    y = -cosine / (2 * d_mm * sine**2) * x**2 + cosine / sine * x
    along = (c2 - c1) / np.linalg.norm(c2 - c1)
    to_corner = p2 - 0.5 * (c1 + c2)
    to_corner /= np.linalg.norm(to_corner)
    return c1 + x[:, None] * along + y[:, None] * to_corner
