"""Force of one tooth while it sweeps an arc, per mm of engaged edge: the integral behind all means.

The angle phi runs from the feed normal in the sense of rotation of a right-hand cutter (clockwise seen from
the holder): the tooth stands at (sin phi, cos phi) in (feed, normal). The edge angle kappa is 90° on a
cylinder and 0 on a flat bottom; gamma is the angle of descent. The chip is the feed seen along the outward
normal of the edge, h = f_z·(sin phi·sin kappa·cos gamma + cos kappa·sin gamma), cut at 0. After Altintas,
Manufacturing Automation, 2nd ed. 2012, ch. 2 (linear edge forces), with the edge angle as in Engin and
Altintas 2001 (general end mills).
"""

import math

import numpy as np
from numba import njit

LINEAR_EDGE = 0.0
KIENZLE = 1.0
NOT_ENGAGED = 1e-6
"""A chip below this fraction of the feed per tooth is rounding of a direction: the edge only slides along."""
_TURN = 2.0 * math.pi
_SHARP_RAD = 1e-3  # a straight edge is spread over this angle, so that one rule applies to all
_CORNER_EDGES = 4  # a peak is for warnings: four edges on a corner are within 1 %
_EDGES = _CORNER_EDGES + 3
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)


@njit(cache=True, nogil=True, error_model="numpy")
def arc_force(phi_a, phi_b, sin_kappa, cos_kappa, f_z_mm, sin_gamma, cos_gamma, law, out):
    """Add to ``out[0:4]`` the integral over phi of the force on one tooth, per mm of edge contact width.

    Parameters
    ----------
    phi_a, phi_b : float
        Arc in rad, phi_a <= phi_b, at most one turn; an empty or NaN arc adds nothing.
    sin_kappa, cos_kappa : float
        Edge angle; the contact width is db = dz/sin kappa.
    f_z_mm : float
        Feed per tooth along the velocity in mm.
    sin_gamma, cos_gamma : float
        Descent angle, -90° to 90°; cos_gamma >= 0.
    law : ndarray (8,)
        ``[0, Ktc, Krc, Kac, Kte, Kre, Kae, 0]`` or ``[1, kc11, mc, radial ratio, axial ratio, 0, 0, 0]``.
    out : ndarray (4,)
        Feed, normal and axial force (holder to tip) and tangential force, N·rad/mm. The mean over a
        revolution is teeth/(2·pi)·db times this.
    """
    if not (phi_b > phi_a and f_z_mm > 0.0):
        return
    swing, offset = sin_kappa * cos_gamma, cos_kappa * sin_gamma  # h = f_z·(swing·sin phi + offset)
    if swing < NOT_ENGAGED:
        if offset > NOT_ENGAGED:
            _add(phi_a, phi_b, sin_kappa, cos_kappa, 0.0, f_z_mm * offset, law, out)
        return
    if offset <= -swing:
        return
    in_front = offset >= 0.0 and phi_a >= 0.0 and phi_b <= math.pi
    if in_front or offset >= swing:
        _add(phi_a, phi_b, sin_kappa, cos_kappa, f_z_mm * swing, f_z_mm * offset, law, out)
        return
    start = -math.asin(offset / swing)  # a chip from here to pi - start, every turn
    stop = math.pi - start
    turn = math.floor((phi_a - stop) / _TURN) * _TURN + _TURN
    while start + turn < phi_b:
        a, b = max(phi_a, start + turn), min(phi_b, stop + turn)
        if b > a:
            _add(a, b, sin_kappa, cos_kappa, f_z_mm * swing, f_z_mm * offset, law, out)
        turn += _TURN


@njit(cache=True, nogil=True, error_model="numpy")
def _add(a, b, sin_kappa, cos_kappa, swing_mm, offset_mm, law, out):
    """Add the integral over an arc on which h = swing·sin phi + offset is not negative."""
    if law[0] == LINEAR_EDGE:
        _linear_edge(a, b, sin_kappa, cos_kappa, swing_mm, offset_mm, law, out)
    else:
        _kienzle(a, b, sin_kappa, cos_kappa, swing_mm, offset_mm, law, out)


@njit(cache=True, nogil=True, error_model="numpy")
def _linear_edge(a, b, sin_kappa, cos_kappa, swing_mm, offset_mm, law, out):
    """Closed form: dF_q = (K_qc·h + K_qe)·db."""
    sin_a, cos_a, sin_b, cos_b = math.sin(a), math.cos(a), math.sin(b), math.cos(b)
    one, sin, cos = b - a, cos_a - cos_b, sin_b - sin_a  # integrals of 1, sin phi, cos phi
    sin_sin = 0.5 * (one - sin_b * cos_b + sin_a * cos_a)
    sin_cos = 0.5 * (sin_b * sin_b - sin_a * sin_a)
    h = swing_mm * sin + offset_mm * one
    h_sin = swing_mm * sin_sin + offset_mm * sin
    h_cos = swing_mm * sin_cos + offset_mm * cos
    radial_c = sin_kappa * law[2] + cos_kappa * law[3]
    radial_e = sin_kappa * law[5] + cos_kappa * law[6]
    axial_c = sin_kappa * law[3] - cos_kappa * law[2]
    axial_e = sin_kappa * law[6] - cos_kappa * law[5]
    out[0] -= law[1] * h_cos + law[4] * cos + radial_c * h_sin + radial_e * sin
    out[1] += law[1] * h_sin + law[4] * sin - radial_c * h_cos - radial_e * cos
    out[2] += axial_c * h + axial_e * one
    out[3] += law[1] * h + law[4] * one


@njit(cache=True, nogil=True, error_model="numpy")
def _kienzle(a, b, sin_kappa, cos_kappa, swing_mm, offset_mm, law, out):
    """Gauss-Legendre quadrature of F_t = kc11·h^(1 - mc)·db; radial and axial are fractions of it."""
    half, middle = 0.5 * (b - a), 0.5 * (b + a)
    one, sin, cos = 0.0, 0.0, 0.0
    for node in range(_NODES.size):
        phi = middle + half * _NODES[node]
        sin_phi = math.sin(phi)
        h = max(swing_mm * sin_phi + offset_mm, 0.0)
        force = _WEIGHTS[node] * h ** (1.0 - law[2])
        one += force
        sin += force * sin_phi
        cos += force * math.cos(phi)
    tangential = half * law[1]
    radial = sin_kappa * law[3] + cos_kappa * law[4]
    axial = sin_kappa * law[4] - cos_kappa * law[3]
    out[0] -= tangential * (cos + radial * sin)
    out[1] += tangential * (sin - radial * cos)
    out[2] += tangential * axial * one
    out[3] += tangential * one


@njit(cache=True, nogil=True, error_model="numpy")
def mean_rows(phi_rad, a_p_mm, f_z_mm, ramp_rad, teeth, shape, law, out):
    """Write the mean feed, normal and axial force in N and the torque in N·mm, ``out`` (n, 4), of n samples.

    ``phi_rad`` (n, 2k) arcs, NaN pairs are none · ``a_p_mm``, ``f_z_mm``, ``ramp_rad`` (n,) · ``shape`` (5,)
    and ``law`` (8,) as of `cutter.Shape.array` and `arc_force`. The arcs apply to every edge below a_p.
    """
    part = np.empty(4)
    for row in range(out.shape[0]):
        total = out[row]
        total[:] = 0.0
        if a_p_mm[row] > 0.0 and f_z_mm[row] > 0.0:
            gamma = ramp_rad[row]
            chip = (f_z_mm[row], math.sin(gamma), math.cos(gamma))
            _mean(phi_rad[row], a_p_mm[row], abs(gamma), chip, shape, law, part, total)
            total *= teeth / _TURN


@njit(cache=True, nogil=True, error_model="numpy")
def _mean(arcs, a_p_mm, tilt, chip, shape, law, part, total):
    """Add the integral over a turn of one tooth: bottom, corner arc, side and cylinder below a_p."""
    bottom, corner, kappa, side, flute = shape
    depth = min(a_p_mm, flute)
    if bottom > 0.0 and chip[1] > 0.0:
        _edge(arcs, 0.0, 1.0, bottom, 0.5 * bottom, chip, law, part, total)
    arc_top = corner * (1.0 - math.cos(kappa))
    if corner > 0.0:
        reach = kappa if depth >= arc_top else math.acos(1.0 - depth / corner)
        begin = min(tilt, reach)  # below it a ramp's chip is of one sign all round, above it only in front
        _corner(arcs, 0.0, begin, bottom, corner, chip, law, part, total)
        _corner(arcs, begin, reach, bottom, corner, chip, law, part, total)
    top = min(depth, side)
    if top > arc_top:
        widening = math.cos(kappa) / math.sin(kappa)
        radius = bottom + corner * math.sin(kappa) + 0.5 * (top - arc_top) * widening
        width = (top - arc_top) / math.sin(kappa)
        _edge(arcs, math.sin(kappa), math.cos(kappa), width, radius, chip, law, part, total)
    if depth > side:
        radius = bottom + corner * math.sin(kappa) + (side - arc_top) * math.cos(kappa) / math.sin(kappa)
        _edge(arcs, 1.0, 0.0, depth - side, radius, chip, law, part, total)


@njit(cache=True, nogil=True, error_model="numpy")
def _corner(arcs, kappa_a, kappa_b, bottom, corner, chip, law, part, total):
    """Add the corner arc between two edge angles, by Gauss-Legendre quadrature over the edge angle."""
    half, middle = 0.5 * (kappa_b - kappa_a), 0.5 * (kappa_b + kappa_a)
    if half <= 0.0:
        return
    for node in range(_NODES.size):
        kappa = middle + half * _NODES[node]
        sin_kappa = math.sin(kappa)
        width = half * _WEIGHTS[node] * corner
        radius = bottom + corner * sin_kappa
        _edge(arcs, sin_kappa, math.cos(kappa), width, radius, chip, law, part, total)


@njit(cache=True, nogil=True, error_model="numpy")
def _edge(arcs, sin_kappa, cos_kappa, width, radius, chip, law, part, total):
    """Add an edge of a contact width in mm at a mean radius in mm over all arcs."""
    part[:] = 0.0
    for arc in range(0, arcs.size - 1, 2):
        arc_force(arcs[arc], arcs[arc + 1], sin_kappa, cos_kappa, chip[0], chip[1], chip[2], law, part)
    total[0] += width * part[0]
    total[1] += width * part[1]
    total[2] += width * part[2]
    total[3] += width * radius * part[3]


@njit(cache=True, nogil=True, error_model="numpy")
def peak_rows(phi_rad, a_p_mm, f_z_mm, ramp_rad, teeth, lag_rad_mm, shape, law, out):
    """Write the largest force in N, ``out`` (n,), on all teeth together over a revolution, helix included.

    ``lag_rad_mm``: how much an edge lags behind the tip per mm of height. Sampled every 15° or
    closer, and where a whole tooth is in the cut or begins to leave it, which is where the force jumps.
    """
    edges, force, part = np.empty((_EDGES, 5)), np.empty(3), np.empty(4)
    pitch = _TURN / teeth
    steps = max(4, math.ceil(24 / teeth))
    for row in range(out.shape[0]):
        out[row] = 0.0
        if not (a_p_mm[row] > 0.0 and f_z_mm[row] > 0.0):
            continue
        arcs, gamma = phi_rad[row], ramp_rad[row]
        chip = (f_z_mm[row], math.sin(gamma), math.cos(gamma))
        depth = min(a_p_mm[row], shape[4])
        count = _list_edges(depth, gamma, shape, edges)
        lag = max(lag_rad_mm, _SHARP_RAD / depth)
        largest = 0.0
        for step in range(steps + arcs.size):
            angle = pitch * step / steps
            if step >= steps:  # ends of arcs: whole tooth in, tooth begins to leave
                end = step - steps
                angle = arcs[end] + (lag * depth if end % 2 == 0 else 0.0)
            if not math.isnan(angle):
                _teeth(arcs, angle, pitch, lag, count, edges, chip, law, part, force)
                largest = max(largest, force[0] ** 2 + force[1] ** 2 + force[2] ** 2)
        out[row] = math.sqrt(largest)


@njit(cache=True, nogil=True, error_model="numpy")
def _teeth(arcs, angle, pitch, lag, count, edges, chip, law, part, force):
    """Set the force on all teeth, one tip at an angle, the others a pitch apart; each edge spreads over the
    arc of its lag."""
    force[0], force[1], force[2] = 0.0, 0.0, 0.0
    for edge in range(count):
        high = angle - lag * edges[edge, 3]
        low = min(angle - lag * edges[edge, 4], high - _SHARP_RAD)
        density = edges[edge, 2] / (high - low)
        for arc in range(0, arcs.size - 1, 2):
            start, end = arcs[arc], arcs[arc + 1]
            if not end > start:
                continue
            ahead = math.ceil((low - end) / pitch) * pitch  # of the first tooth that has not left the arc
            while start + ahead < high:
                a, b = max(low - ahead, start), min(high - ahead, end)
                part[0], part[1], part[2], part[3] = 0.0, 0.0, 0.0, 0.0
                arc_force(a, b, edges[edge, 0], edges[edge, 1], chip[0], chip[1], chip[2], law, part)
                force[0] += density * part[0]
                force[1] += density * part[1]
                force[2] += density * part[2]
                ahead += pitch


@njit(cache=True, nogil=True, error_model="numpy")
def _list_edges(depth, gamma, shape, edges):
    """List sin kappa, cos kappa, width, lowest and highest z of the edges below a depth; return how many."""
    bottom, corner, kappa, side, _ = shape
    arc_top = corner * (1.0 - math.cos(kappa))
    count = 0
    if bottom > 0.0 and gamma > 0.0:
        _put(edges, count, 0.0, 1.0, bottom, 0.0, 0.0)
        count += 1
    if corner > 0.0:
        reach = kappa if depth >= arc_top else math.acos(1.0 - depth / corner)
        lowest = min(max(-gamma, 0.0), reach)  # up-hill, edges flatter than the path never cut
        step = (reach - lowest) / _CORNER_EDGES
        for i in range(_CORNER_EDGES):
            begin = lowest + i * step
            low, high = corner * (1.0 - math.cos(begin)), corner * (1.0 - math.cos(begin + step))
            middle = begin + 0.5 * step
            _put(edges, count, math.sin(middle), math.cos(middle), corner * step, low, high)
            count += 1
    top = min(depth, side)
    if top > arc_top:
        _put(edges, count, math.sin(kappa), math.cos(kappa), (top - arc_top) / math.sin(kappa), arc_top, top)
        count += 1
    if depth > side:
        _put(edges, count, 1.0, 0.0, depth - side, side, depth)
        count += 1
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _put(edges, i, sin_kappa, cos_kappa, width, low, high):
    edges[i, 0], edges[i, 1], edges[i, 2], edges[i, 3], edges[i, 4] = sin_kappa, cos_kappa, width, low, high
