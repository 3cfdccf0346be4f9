"""Orientation of the tool along waypoints: one turn between two exact stops, even over the distance."""

import numpy as np
from scipy.spatial.transform import Rotation

from tests.plant import path
from tests.plant.scene import euler
from tests.plant.waypoints import Waypoints


def axes_at(way: Waypoints, links: list, t_s: np.ndarray) -> np.ndarray:
    """Tool axes in `$BASE` at times, (n, 3, 3); a turn in place takes the row's hold."""
    turns = np.zeros((len(way), 3)) if way.turns_deg is None else way.turns_deg
    out = np.empty((len(t_s), 3, 3))
    out[:] = euler(*turns[0])
    now_s, first, chains = 0.0, 0, list(links)
    for i in np.flatnonzero(way.cdis_mm[1:] <= 0.0) + 1:
        legs = np.linalg.norm(np.diff(way.position_mm[first : i + 1], axis=0), axis=1)
        if legs.max() > path.MATCH:
            chain = chains.pop(0)
            share, end_s = path.distance(chain, t_s) / chain.knots_mm[-1], chain.end_s + way.hold_s[i]
        else:
            end_s = now_s + way.hold_s[i]
            share = _smooth((t_s - now_s) / max(end_s - now_s, 1e-9))
        if np.any(turns[i] != turns[first]):
            if end_s - now_s < 1e-6:
                raise ValueError(f"row {i} turns in place and needs a hold_s for it")
            later = t_s > now_s
            out[later] = _between(euler(*turns[first]), euler(*turns[i]), share[later])
        now_s, first = end_s, i
    return out


def _smooth(u: np.ndarray) -> np.ndarray:
    """From 0 to 1 with still ends of speed and acceleration."""
    u = np.clip(u, 0.0, 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)


def _between(one: np.ndarray, two: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Rotations on the shortest way from one to two."""
    vector = Rotation.from_matrix(one.T @ two).as_rotvec()
    return one @ Rotation.from_rotvec(share[:, None] * vector).as_matrix()
