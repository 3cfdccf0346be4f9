"""Regenerative chatter of a tool whose modes a tap test has found: how deep a cut is stable at a speed.

Zeroth-order solution of Altintas & Budak 1995 (Analytical prediction of stability lobes in milling, CIRP
Annals 44): the directional factors are averaged over the arc, and at a chatter frequency w the depth

    a = -(2·pi·L_R/(N·K_t))·(1 + (L_I/L_R)²),    L = -1/eigenvalue of [alpha]·[G(iw)]

is on the border at the spindle speeds whose tooth period is (pi - 2·atan(L_I/L_R) + 2·pi·j)/w. Holds for arcs
that are not short (low immersion has lobes of period doubling too), constant coefficients, no wear.
"""

from collections.abc import Sequence

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell.sections import TapMode
from gcode2krl.units import RAD_PER_REV

_LOBES = 60
_FREQUENCIES = 2000


def depth_limit(
    modes: Sequence[TapMode],
    feed_base: Floats,
    phi_rad: tuple[float, float],
    teeth: int,
    spindle_rad_s: float,
    tangential_N_mm2: float,
    radial_ratio: float,
) -> float:
    """Return the largest stable depth of cut in mm; infinite where no lobe reaches the spindle's speed.

    Parameters
    ----------
    modes : of one tool, along x and y of ``$BASE``.
    feed_base : (2,) direction of the feed in the plane of both.
    phi_rad : entry and exit from the feed normal.
    tangential_N_mm2, radial_ratio : K_tc, and K_rc over it.
    """
    hz = np.array([mode.frequency_hz for mode in modes])
    w = np.linspace(0.5 * hz.min(), 2.0 * hz.max(), _FREQUENCIES) * RAD_PER_REV
    along = np.asarray(feed_base) / np.linalg.norm(feed_base)
    turned = np.array([along, [-along[1], along[0]]])  # rows: feed and its normal to the left
    flexible = np.zeros((len(w), 2, 2), dtype=complex)
    for mode in modes:
        axis = turned[:, "xy".index(mode.direction)]
        ratio = w / (mode.frequency_hz * RAD_PER_REV)
        swing = 1.0 / (mode.stiffness_N_mm * (1.0 - ratio**2 + 2j * mode.damping * ratio))
        flexible += swing[:, None, None] * np.outer(axis, axis)
    values = np.linalg.eigvals(_directional(phi_rad, radial_ratio) @ flexible)
    limit_mm = np.inf
    for value in values.T:
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = -1.0 / value
            kappa = inverse.imag / inverse.real
            depth = -RAD_PER_REV * inverse.real / (teeth * tangential_N_mm2) * (1.0 + kappa**2)
        period = (np.pi - 2.0 * np.arctan(kappa) + RAD_PER_REV * np.arange(_LOBES)[:, None]) / w
        off = RAD_PER_REV / (teeth * period) - spindle_rad_s
        crosses = (off[:, 1:] * off[:, :-1] <= 0.0) & (depth[1:] > 0.0) & (depth[:-1] > 0.0)
        near = (
            np.abs(np.diff(kappa)) < 1.0
        )  # not across a jump from one branch of the arc tangent to the next
        lobe, at = np.nonzero(crosses & near)
        if len(at):
            share = off[lobe, at] / np.where(
                off[lobe, at] == off[lobe, at + 1], 1.0, off[lobe, at] - off[lobe, at + 1]
            )
            limit_mm = min(limit_mm, float(np.min(depth[at] + share * (depth[at + 1] - depth[at]))))
    return limit_mm


def _directional(phi_rad: tuple[float, float], radial_ratio: float) -> Floats:
    """Return [alpha] (2, 2) of Altintas & Budak 1995: feed and normal, averaged over the arc."""

    def at(phi: float) -> Floats:
        s, c, r = np.sin(2.0 * phi), np.cos(2.0 * phi), radial_ratio
        return 0.5 * np.array(
            [
                [c - 2.0 * r * phi + r * s, -s - 2.0 * phi + r * c],
                [-s + 2.0 * phi + r * c, -c - 2.0 * r * phi - r * s],
            ]
        )

    return at(phi_rad[1]) - at(phi_rad[0])
