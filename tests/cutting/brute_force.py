"""An independent cutting force: every tooth, every bit of its edge, every angle of a revolution, as 3-D
vectors.

Nothing here knows of edge angles or closed forms. The edge is a polyline r, z; a bit of it has a tangent and
an outward normal in space; the chip is the feed vector along that normal; the force is tangential, along the
inward normal and along the edge. x is the feed, y its left seen from above, z from the tip to the holder.
"""

import numpy as np


def flat(diameter, depth, pieces=40):
    """Edge of a flat mill: from the axis along the bottom to the rim, then up."""
    radius = diameter / 2
    bottom = np.column_stack([np.linspace(0, radius, pieces + 1), np.zeros(pieces + 1)])
    side = np.column_stack([np.full(pieces, radius), np.linspace(0, depth, pieces + 1)[1:]])
    return np.vstack([bottom, side])


def bull_nose(diameter, corner, depth, pieces=120):
    """Edge of a bull-nose or (corner = half the diameter) ball mill, its bottom included."""
    inner, angle = diameter / 2 - corner, np.arccos(max(1 - depth / corner, 0.0))
    bend = np.linspace(0, angle, pieces + 1)
    points = np.column_stack([inner + corner * np.sin(bend), corner * (1 - np.cos(bend))])
    if inner > 1e-12:
        points = np.vstack([np.column_stack([np.linspace(0, inner, 21), np.zeros(21)])[:-1], points])
    if depth > corner:
        side = np.linspace(corner, depth, 31)[1:]
        points = np.vstack([points, np.column_stack([np.full(30, diameter / 2), side])])
    return points


def cone(tip_radius, half_angle, depth, pieces=60):
    """Edge of a tapered mill or a drill's point (tip radius 0), bottom included."""
    z = np.linspace(0, depth, pieces + 1)
    points = np.column_stack([tip_radius + z * np.tan(half_angle), z])
    if tip_radius > 0:
        bottom = np.column_stack([np.linspace(0, tip_radius, 21), np.zeros(21)])
        points = np.vstack([bottom[:-1], points])
    return points


def revolution(edge, arcs, f_z, teeth, tangential_radial_axial, gamma=0.0, lag=0.0, angles=7200):
    """Force (angles, 3) feed, normal, axial and torque (angles,) over a turn; mean over the first axis.

    ``tangential_radial_axial(h)`` gives the three forces per mm of contact; ``lag`` in rad per mm of height;
    ``angles`` is a multiple of the teeth.
    """
    step, length = np.diff(edge, axis=0), np.hypot(*np.diff(edge, axis=0).T)
    middle = (edge[:-1] + edge[1:]) / 2
    along_r, along_z = step[:, 0] / length, step[:, 1] / length
    turn = (np.arange(angles) + 0.5) * 2 * np.pi / angles
    phi = turn[:, None] - lag * middle[:, 1]
    sine, cosine = np.sin(phi), np.cos(phi)
    chip = f_z * (along_z * sine * np.cos(gamma) + along_r * np.sin(gamma))  # feed · (dz·u - dr·z)
    folded = np.mod(phi, 2 * np.pi)
    inside = np.zeros(phi.shape, dtype=bool)
    for start, end in arcs:
        inside |= np.mod(folded - start, 2 * np.pi) < end - start
    cutting = inside & (chip > 1e-9 * f_z)
    ft, fr, fa = (np.where(cutting, f, 0.0) * length for f in tangential_radial_axial(np.maximum(chip, 0.0)))
    inward = fr * along_z + fa * along_r
    down = fa * along_z - fr * along_r
    force = np.stack([-ft * cosine - inward * sine, ft * sine - inward * cosine, down], axis=-1).sum(axis=1)
    torque = (ft * middle[:, 0]).sum(axis=1)
    shifts = [tooth * angles // teeth for tooth in range(teeth)]
    return sum(np.roll(force, s, axis=0) for s in shifts), sum(np.roll(torque, s) for s in shifts)


def linear_edge(coefficients):
    """Force per mm of contact of a chip h: K_c·h + K_e."""
    ktc, krc, kac, kte, kre, kae = coefficients
    return lambda h: (ktc * h + kte, krc * h + kre, kac * h + kae)


def kienzle(kc11, mc, radial, axial):
    """Force per mm of contact of a chip h: kc11·h^(1 - mc), and shares of it."""

    def force(h):
        tangential = kc11 * h ** (1 - mc)
        return tangential, radial * tangential, axial * tangential

    return force
