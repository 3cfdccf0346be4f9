"""The controller's laws as closed forms: the corner parabola and the speed step.

Source: Bigliardi et al. 2022, measured on a KR 210 R2700 prime, KSS 8.3.25, lines of 230 mm at 75°,
0.2-0.6 m/s, 2-4 m/s², CDIS 20-200 mm. A speed step passes two moving averages, of length |dv|/a and k;
that reproduces all 15 combinations of the paper's second study. Short moves, unequal speeds and speeds below
0.2 m/s are extrapolated.
"""

import numpy as np
from numpy.typing import ArrayLike

from gcode2krl.arrays import Floats

_REVERSAL_COS = -1.0 + 1e-12
_HALVINGS = 52
"""Bisections that reduce an interval of length 1 to double precision."""


def effective_acceleration(v_mm_s: ArrayLike, a_mm_s2: ArrayLike, k_s: ArrayLike) -> Floats:
    """Return the peak acceleration in mm/s² of a step from rest: v/max(v/a, k)."""
    v, a, k = (np.asarray(x, dtype=float) for x in (v_mm_s, a_mm_s2, k_s))
    return np.asarray(v / np.maximum(v / a, k))


def jerk(a_mm_s2: ArrayLike, k_s: ArrayLike) -> Floats:
    """Return the jerk in mm/s³ of a step: a/k, with the acceleration that was programmed."""
    return np.asarray(np.asarray(a_mm_s2, dtype=float) / np.asarray(k_s, dtype=float))


def corner(
    p1_mm: ArrayLike, p2_mm: ArrayLike, p3_mm: ArrayLike, cdis_mm: ArrayLike, v_mm_s: ArrayLike
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return an approximated corner: distance, error, acceleration, duration.

    Parameters
    ----------
    p1_mm, p2_mm, p3_mm : (n, 3) start, corner and end of two lines.
    cdis_mm : (n,) ``$APO.CDIS``.
    v_mm_s : (n,), or (n, 2) before and after; the corner runs at the slower (an assumption).

    Returns
    -------
    d_mm : (n,) min(CDIS, L1/2, L2/2); 0 where a line has no length or the path reverses.
    error_mm : (n,) distance of the corner to the parabola, d·cos(alpha/2)/2 at its apex (from eq. 1-3).
    a_p_mm_s2 : (n,) v²·cos(alpha/2)/d (eq. 6).
    duration_s : (n,) 2·d/v.
    """
    p1, p2, p3 = (np.atleast_2d(np.asarray(p, dtype=float)) for p in (p1_mm, p2_mm, p3_mm))
    v = np.asarray(v_mm_s, dtype=float)
    v = v.min(axis=-1) if v.ndim == 2 else v
    before, after = p2 - p1, p3 - p2
    l1, l2 = np.linalg.norm(before, axis=-1), np.linalg.norm(after, axis=-1)
    real = (l1 > 0) & (l2 > 0)
    product = np.where(real, l1 * l2, 1.0)
    cos_turn = np.clip(np.sum(before * after, axis=-1) / product, -1.0, 1.0)  # alpha = 180° - turn
    real &= cos_turn > _REVERSAL_COS
    d = np.where(real, np.minimum(np.asarray(cdis_mm, dtype=float), np.minimum(l1, l2) / 2.0), 0.0)
    cos_half = np.sqrt((1.0 - cos_turn) / 2.0)
    positive = d > 0
    a_p = np.where(positive, v**2 * cos_half / np.where(positive, d, 1.0), 0.0)
    duration = np.where(v > 0, 2.0 * d / np.where(v > 0, v, 1.0), 0.0)
    return d, d * cos_half / 2.0, a_p, duration


def parabola_distance(before_mm: Floats, after_mm: Floats, cos_half: Floats) -> Floats:
    """Return the distance (n,) in mm of a corner to its parabola with different distances before and after.

    The parabola t²·q - (1 - t)²·p leaves the line p = ``before_mm`` ahead of the corner and joins the next
    one q = ``after_mm`` behind it (eq. 1-3 with unequal distances); ``cos_half`` = cos(alpha/2). With
    r = t/(1 - t) its nearest point is the one positive root of q²·r³ + p·q·c·r² - p·q·c·r - p², c = cosine
    of the turn; for equal distances it is in the middle.
    """
    p, q, s = before_mm, after_mm, cos_half
    distance = p * s / 2.0
    unequal = np.flatnonzero((p != q) & (p > 0) & (q > 0))
    if len(unequal):
        p, q, s = p[unequal], q[unequal], s[unequal]
        t = _nearest_share(p / q, 1.0 - 2.0 * s**2)
        ahead, behind = (1.0 - t) ** 2 * p, t**2 * q
        distance[unequal] = np.sqrt((ahead - behind) ** 2 + 4.0 * ahead * behind * s**2)
    return distance


def _nearest_share(ratio: Floats, cos_turn: Floats) -> Floats:
    """Return t (n,) of the parabola's point that is nearest to the corner, by bisection.

    ``ratio`` = p/q. The root is the only one in 0 < t < 1 (the cubic's discriminant is negative).
    """
    low, high = np.zeros_like(ratio), np.ones_like(ratio)
    bend = ratio * cos_turn
    for _ in range(_HALVINGS):
        t = (low + high) / 2.0
        remaining = 1.0 - t
        beyond = t**3 - ratio**2 * remaining**3 > bend * t * remaining * (remaining - t)
        low, high = np.where(beyond, low, t), np.where(beyond, t, high)
    return (low + high) / 2.0


def speed_step(
    t_s: ArrayLike, v0_mm_s: float, v1_mm_s: float, a_mm_s2: float, k_s: float
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return position, speed, acceleration and jerk (n,) of a speed step that begins at t = 0.

    The step passes moving averages of |v1 - v0|/a and k; it lasts |v1 - v0|/a + k.
    """
    t = np.asarray(t_s, dtype=float)
    dv = v1_mm_s - v0_mm_s
    ramp_s = abs(dv) / a_mm_s2
    if ramp_s == 0.0:
        return v0_mm_s * t, np.full_like(t, v0_mm_s), np.zeros_like(t), np.zeros_like(t)
    slope = dv / ramp_s

    def average(order: int) -> Floats:
        """The ramp's ``order``-th integral after the average of length k."""
        if k_s == 0.0:
            return slope * (_power(t, order) - _power(t - ramp_s, order))
        higher = order + 1
        corners = _power(t, higher) - _power(t - ramp_s, higher)
        late = _power(t - k_s, higher) - _power(t - k_s - ramp_s, higher)
        return slope / k_s * (corners - late)

    jerk_values = average(-1) if k_s > 0.0 else np.zeros_like(t)
    return v0_mm_s * t + average(2), v0_mm_s + average(1), average(0), jerk_values


def _power(t: Floats, order: int) -> Floats:
    """Return max(t, 0)^n/n!, the n-fold integral of a unit step."""
    factorial = (1.0, 1.0, 2.0, 6.0)[order]
    positive = np.maximum(t, 0.0)
    return np.where(t >= 0, positive**order / factorial, 0.0) if order else (t >= 0).astype(float)
