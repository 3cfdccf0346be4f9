"""Readings of a dial and a balance for pulls at the flange, by a chain of rotations of this file alone."""

import numpy as np

from gcode2krl.identify import pulls as asked

SIGNS = (-1, 1, 1, -1, 1, -1)
TURNS = "zyyxyx"


def turn(axis: str, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = c
    matrix[i, j], matrix[j, i] = -s, s
    return matrix


def point_and_axes(q, lengths, point) -> tuple[np.ndarray, list, list]:
    """Return the point in the root, and direction and place of each axis, positive as the display counts."""
    a1, a2, c1, c2, c3, c4 = lengths
    before = ((0, 0, 0), (a1, 0, c1), (c2, 0, 0), (c3, 0, -a2), (0, 0, 0), (0, 0, 0))
    rotation, place, axes, places = np.eye(3), np.zeros(3), [], []
    for k in range(6):
        place = place + rotation @ np.array(before[k], float)
        axes.append(SIGNS[k] * rotation[:, "xyz".index(TURNS[k])])
        places.append(place)
        rotation = rotation @ turn(TURNS[k], SIGNS[k] * q[k])
    flange = rotation @ turn("y", np.pi / 2)
    return place + rotation @ np.array([c4, 0, 0.0]) + flange @ point, axes, places


def moved(pulls, row, lengths, k) -> float:
    """Return how far the point moves along the dial, with springs k (6,) in N·mm/rad on the axes."""
    q, point = pulls.q_rad[row], pulls.point_mm[row]
    at, axes, places = point_and_axes(q, lengths, point)
    torque = [
        axis @ np.cross(at - place, pulls.force_N[row]) for axis, place in zip(axes, places, strict=True)
    ]
    bent, _, _ = point_and_axes(q + np.array(torque) / k, lengths, point)
    return float(pulls.dial[row] @ (bent - at))


def filled(pulls, truth_mm, rng, balance: float) -> str:
    """Return the form with readings; the balance shows a force that is off by its share."""
    lines = asked.form(pulls).splitlines()
    done = [lines[0]]
    for row, line in enumerate(lines[1:]):
        words = line.split(",")
        words[-3] = repr(float(words[-3]) * (1 + balance * rng.normal()))
        zero = rng.uniform(0, 5)
        for column, value in ((-2, zero), (-1, zero + truth_mm[row])):
            words[column] = f"{np.round(value + rng.normal(0, asked.DIAL_SIGMA_MM), 2):.2f}"
        done.append(",".join(words))
    return "\n".join(done) + "\n"
