"""Two modes of an arm under a force that follows the engagement, simulated in time; beside it the index.

Drawn: two modes in drawn directions (masses up to 20 % apart, damping of 1 to 4 %, which the index does not
know), a flat mill that cuts up or down beside a wall. The simulation follows the force through every
engagement, lets the tool lose contact, and shares no code with the index.
"""

from typing import NamedTuple

import numpy as np

from gcode2krl.compliance.mode_coupling import coupling_index
from gcode2krl.cutting import mean_force
from gcode2krl.cutting.law import linear_edge_law
from gcode2krl.cutting.stiffness import process_stiffness

CASES, SEED = 200, 46
STEP_S, LONG_S = 2e-3, 6.0
START_MM = 1e-4
ALONG_X, UPRIGHT = np.array([[1.0, 0.0, 0.0]]), np.array([[0.0, 0.0, 0.0, 1.0]])
RIGID = 50.0
"""Stiffness of the third direction, in stiffnesses of the modes."""


class Cases(NamedTuple):
    """Drawn cases (n); directions are along feed, feed normal and axis (towards the holder)."""

    modes: np.ndarray
    """(n, 3, 2) unit directions of the modes, normal to each other."""
    k_N_mm: np.ndarray
    mass_kg: np.ndarray
    damping: np.ndarray
    a_p_mm: np.ndarray
    a_e_mm: np.ndarray
    f_z_mm: np.ndarray
    diameter_mm: np.ndarray
    teeth: np.ndarray
    is_up: np.ndarray
    coefficients: np.ndarray
    """(n, 6) Ktc, Krc, Kac, Kte, Kre, Kae."""


def draw(count=CASES, seed=SEED):
    """Return drawn cases."""
    rng = np.random.default_rng(seed)
    turned = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]
    softer = rng.uniform(100.0, 500.0, count)
    alloy = np.array([796.0, 169.0, 222.0, 27.7, 30.8, 1.4]) * np.exp(rng.uniform(0.5, 2.0, (count, 1)))
    alloy[:, 1] *= rng.uniform(0.7, 2.0, count)
    diameter = rng.choice([8.0, 12.0, 16.0, 20.0, 25.0], count)
    return Cases(
        modes=turned[:, :, :2],
        k_N_mm=np.stack([softer, softer * (1.0 + rng.exponential(0.2, count))], axis=1),
        mass_kg=rng.uniform(80.0, 300.0, (count, 1)) * rng.uniform(0.9, 1.1, (count, 2)),
        damping=rng.uniform(0.01, 0.04, (count, 2)),
        a_p_mm=diameter * rng.uniform(0.2, 1.2, count),
        a_e_mm=diameter * rng.uniform(0.1, 0.9, count),
        f_z_mm=rng.uniform(0.03, 0.15, count),
        diameter_mm=diameter,
        teeth=rng.integers(2, 5, count),
        is_up=rng.random(count) < 0.5,
        coefficients=alloy,
    )


def index_of(cases):
    """Return the index (n,) of the package: linear, equal masses, one damping."""
    index = []
    for case in zip(*cases, strict=True):
        modes, k, _, _, a_p, a_e, f_z, diameter, teeth, is_up, six = case
        arc = np.arccos(1.0 - 2.0 * a_e / diameter)
        phi = np.array([[0.0, arc] if is_up else [np.pi - arc, np.pi]])
        force = mean_force(phi, a_p, f_z, int(teeth), diameter, 0.0, six)[0]
        force[2] *= -1.0  # axial forces count from the holder to the tip
        cut = phi, np.array([a_p]), np.array([f_z]), force[None], ALONG_X, UPRIGHT
        process = process_stiffness(*cut, int(teeth), diameter, linear_edge_law(six))
        third = np.cross(modes[:, 0], modes[:, 1])
        stiffness = modes @ np.diag(k) @ modes.T + RIGID * k.max() * np.outer(third, third)
        index.append(coupling_index(np.linalg.inv(stiffness)[None], process)[0])
    return np.array(index)


def force_N(cases, u_mm):
    """Return the mean force (n, 3) of tools that are displaced by (n, 3): the law integrated over the arc."""
    side = np.where(cases.is_up, 1.0, -1.0)
    width = np.clip(cases.a_e_mm + side * u_mm[:, 1], 0.0, cases.diameter_mm)
    depth = np.maximum(cases.a_p_mm - u_mm[:, 2], 0.0)
    arc = np.arccos(1.0 - 2.0 * width / cases.diameter_mm)
    first, last = np.where(cases.is_up, 0.0, np.pi - arc), np.where(cases.is_up, arc, np.pi)
    cos, sin = np.cos(last) - np.cos(first), np.sin(last) - np.sin(first)
    half_sin2 = (np.sin(last) ** 2 - np.sin(first) ** 2) / 2.0
    sin_sq = (last - first) / 2.0 - (np.sin(2.0 * last) - np.sin(2.0 * first)) / 4.0
    ktc, krc, kac, kte, kre, kae = cases.coefficients.T
    chip = cases.f_z_mm
    feed = -chip * (ktc * half_sin2 + krc * sin_sq) - kte * sin + kre * cos
    normal = chip * (ktc * sin_sq - krc * half_sin2) - kte * cos - kre * sin
    down = -chip * kac * cos + kae * (last - first)
    return (cases.teeth * depth / (2.0 * np.pi))[:, None] * np.stack([feed, normal, -down], axis=1)


def simulate(cases):
    """Return whether each case swings by itself: the swing of its end beside that of its beginning."""
    mass = cases.mass_kg / 1e3  # N s²/mm
    drag = 2.0 * cases.damping * np.sqrt(cases.k_N_mm * mass)
    steady = force_N(cases, np.zeros((len(mass), 3)))

    def slope(q, v):
        force = force_N(cases, np.einsum("nij,nj->ni", cases.modes, q)) - steady
        push = np.einsum("nij,ni->nj", cases.modes, force)
        return v, (push - drag * v - cases.k_N_mm * q) / mass

    q, v = np.full_like(mass, START_MM), np.zeros_like(mass)
    steps = int(LONG_S / STEP_S)
    early, late = np.zeros(len(mass)), np.zeros(len(mass))
    for step in range(steps):
        k1 = slope(q, v)
        k2 = slope(q + STEP_S / 2 * k1[0], v + STEP_S / 2 * k1[1])
        k3 = slope(q + STEP_S / 2 * k2[0], v + STEP_S / 2 * k2[1])
        k4 = slope(q + STEP_S * k3[0], v + STEP_S * k3[1])
        q = q + STEP_S / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0])
        v = v + STEP_S / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
        size = (q**2).sum(axis=1)
        if step < steps // 8:
            early += size
        elif step >= steps - steps // 8:
            late += size
    return late > early
