"""Arcs: centre from I, J, K or R, and the chords that replace them.

Everything is in the arc's own axes: (u, v) span the plane, w is the axis of a helix. The planes are the
right-handed pairs of RS274/NGC: G17 X Y (Z), G18 Z X (Y), G19 Y Z (X).
"""

import math

from numba import njit

from gcode2krl.gcode import findings as f

RADIUS_WARNING_MM = 0.01
"""From this difference of the radii at start and end on a finding tells it: the chord tolerance."""
SPIRAL_MM, SPIRAL_INCH_MM = 0.02 * math.sqrt(2.0), 0.002 * math.sqrt(2.0) * 25.4
"""LinuxCNC's bound under G21 and G20: what two (three) decimals of start, end and centre can amount to."""
SPIRAL_SHARE, SPIRAL_MOST = 0.001, 100.0
"""Beyond the bound LinuxCNC reads up to 0.1 % of the radius, and never more than 100 times the bound."""
FITS, SPIRAL, MISFIT = 0, 1, 2
SMALLEST_RADIUS_MM = 0.00127
"""LinuxCNC's 0.00005 inch: a smaller radius is zero, and R may miss half the chord by as much."""


@njit(cache=True)
def radii_fit(start_mm, end_mm, unit_mm):
    """Tell whether the radii at start and end fit, by the rule of LinuxCNC (``interp_arc.cc``)."""
    difference = abs(start_mm - end_mm)
    if difference <= RADIUS_WARNING_MM:
        return FITS
    bound = SPIRAL_MM if unit_mm == 1.0 else SPIRAL_INCH_MM
    if difference > SPIRAL_MOST * bound:
        return MISFIT
    if difference > bound and difference > SPIRAL_SHARE * max(start_mm, end_mm):
        return MISFIT
    return SPIRAL


@njit(cache=True)
def centre_from_radius(u0, v0, u1, v1, radius, ccw):
    """Return (finding, u, v) of the centre of an arc given by R; a negative R takes the longer way."""
    du, dv = u1 - u0, v1 - v0
    chord = math.hypot(du, dv)
    if chord < 1e-9:
        return f.ARC_R_FULL_CIRCLE, 0.0, 0.0
    r = abs(radius)
    height_squared = r * r - 0.25 * chord * chord
    if height_squared < 0.0:
        if 0.5 * chord - r > SMALLEST_RADIUS_MM:
            return f.ARC_RADIUS_TOO_SMALL, 0.0, 0.0
        height_squared = 0.0
    height = math.sqrt(height_squared)
    if (radius < 0) == ccw:  # centre on the right of the chord for a long ccw or a short cw arc
        height = -height
    return f.OK, 0.5 * (u0 + u1) - height * dv / chord, 0.5 * (v0 + v1) + height * du / chord


@njit(cache=True)
def sweep_angle(u0, v0, u1, v1, cu, cv, ccw, turns):
    """Return (start angle, signed sweep) in rad; equal ends are a full circle, P adds whole turns."""
    start = math.atan2(v0 - cv, u0 - cu)
    end = math.atan2(v1 - cv, u1 - cu)
    sweep = end - start if ccw else start - end
    full = 2.0 * math.pi
    while sweep <= 1e-9:
        sweep += full
    while sweep > full + 1e-9:
        sweep -= full
    sweep += full * (turns - 1)
    return start, (sweep if ccw else -sweep)


@njit(cache=True)
def chord_count(radius, sweep, tolerance_mm):
    """Return how many equal chords keep within ``tolerance_mm`` of an arc: error = r·(1 - cos(step/2))."""
    step = 0.5 * math.pi
    if tolerance_mm < radius:
        step = min(step, 2.0 * math.acos(1.0 - tolerance_mm / radius))
    return max(1, math.ceil(abs(sweep) / step - 1e-9))
