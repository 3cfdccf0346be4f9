"""Weight and inertia of the arm: a point mass in the middle of each link, and the load at the flange.

Masses of the links as identified for this robot (Weigand et al. 2023), of the load as the cell states it.
"""

import numpy as np

from tests.plant import arm as arms
from tests.plant.robot import SLOW, Run, STEP_s
from tests.plant.scene import GRAVITY_m_s2

LINK_kg = np.array([395.4, 339.12, 105.21, 35.8, 31.46, 17.78])
LOAD_kg = 120.0
LOAD_mm = np.array([100.0, 0.0, 180.0])  # in the flange's axes


def reference_centres(run: Run, body: arms.Arm) -> np.ndarray:
    """Centres of the six links and of the load in the reference pose, (7, 3) mm."""
    flange_axes = body.tcp_axes @ run.believed.tool.axes.T
    flange = body.tcp_mm - flange_axes @ run.believed.tool.origin_mm
    ends = np.vstack([body.points_mm, flange])
    return np.vstack([0.5 * (ends[:-1] + ends[1:]), flange + flange_axes @ LOAD_mm])


def carried(body: arms.Arm, q_rad: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """Centres at angles (n, 6): the load moves with the last link, (n, 7, 3)."""
    out = np.empty((len(q_rad), len(centres), 3))
    for k, centre in enumerate(centres):
        held = q_rad.copy()
        held[:, min(k, 5) + 1 :] = 0.0  # a link is moved by its own joint and those before it
        there = arms.Arm(**{**vars(body), "tcp_mm": centre})
        out[:, k] = arms.pose(there, np.ascontiguousarray(held))[0]
    return out


def pulls(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Centres (n, 7, 3) in the root, mm, and weight with inertia of each mass (n, 7, 3), N, slow samples."""
    body = run.body()
    q = np.ascontiguousarray(run.q_act[::SLOW])
    place = carried(body, q, reference_centres(run, body))
    step_s = SLOW * STEP_s
    speeding = np.gradient(np.gradient(place, step_s, axis=0), step_s, axis=0) / 1000.0
    down = np.array([0.0, 0.0, -GRAVITY_m_s2])
    kg = np.append(LINK_kg, LOAD_kg)
    return place, kg[None, :, None] * (down - speeding)


def joint_moments(run: Run) -> np.ndarray:
    """Moments about the six joints by weight and inertia, the controller's sign, N·mm, (n, 6)."""
    (place, pull), (seats, axes) = pulls(run), hinges(run)
    out = np.zeros((len(place), 6))
    for j in range(6):
        for k in range(j, place.shape[1]):
            out[:, j] += np.sum(np.cross(place[:, k] - seats[:, j], pull[:, k]) * axes[:, j], axis=1)
    return out


def hinges(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """A point of each joint's axis and its direction in the root, (n, 6, 3) each; the controller's sign."""
    body, q = run.body(), np.ascontiguousarray(run.q_act[::SLOW])
    seats, axes = zip(*(_axis(body, q, j) for j in range(6)), strict=True)
    return np.stack(seats, axis=1), np.stack(axes, axis=1)


def _axis(body: arms.Arm, q_rad: np.ndarray, j: int) -> tuple[np.ndarray, np.ndarray]:
    """A point of a joint's axis and its direction in the root, (n, 3) each; the controller's sign."""
    held = q_rad.copy()
    held[:, j:] = 0.0
    there = arms.Arm(**{**vars(body), "tcp_mm": body.points_mm[j]})
    seat, axes = arms.pose(there, np.ascontiguousarray(held))
    turned = axes @ body.tcp_axes.T
    return seat, turned @ body.screws[j]


def moment_about(run: Run, point_mm: np.ndarray) -> np.ndarray:
    """Moment of all weights and inertias about a point in the root, N·mm, (n, 3)."""
    place, pull = pulls(run)
    return np.sum(np.cross(place - point_mm, pull), axis=1)
