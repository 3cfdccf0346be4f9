"""The elastic chain as a product of exponentials: an oracle that shares nothing with the package.

Every motor and every virtual joint is a screw with a fixed axis in space, taken at all angles zero (arm
stretched forward), so there are no frames and no walk from one to the next: the tip is
exp(S_1·theta_1) … exp(S_36·theta_36)·tip_0 (Brockett 1984; Lynch & Park 2017, ch. 4). The elastic angle of a
virtual joint is the power that the load does on its screw, S_k in the undeformed pose dotted with the wrench,
over its stiffness (virtual work), not a lever arm times a force. Directions are those of Haehn & Weigold's
fig. 1 as described in words: x, y, z of each virtual joint along the robot root's axes at zero.
"""

import numpy as np
from scipy.spatial.transform import Rotation

X, Y, Z = np.eye(3)

# Table 1 of the paper, N·mm/rad: k_C about x, k_B about y, k_A about z
PAPER_STIFFNESS = {
    "A1": (1.2e10, 1.2e10, 7.5e9),
    "A2": (6.1e9, 6.1e9, 5.4e9),
    "linked_arm": (1.2e10, 3.8e9, 1.0e10),
    "A3": (6.2e9, 6.2e9, 4.3e9),
    "arm": (6.1e9, 1.3e10, 3.0e9),
    "A4": (3.0e9, 3.0e9, 9.0e8),
    "A5": (2.5e9, 2.5e9, 8.0e8),
    "A6": (6.7e8, 6.7e8, 4.9e8),
    "sensor": (3.3e9, 3.3e9, 5.2e9),
    "spindle": (1.9e8, 6.7e7, 9.1e7),
}
PAPER_GEOMETRY = (350.0, 41.0, 675.0, 1150.0, 1000.0, 240.0)  # a1, a2, c1, c2, c3, c4
PAPER_TOOL = (250.0, 0.0, 250.0)
PAPER_SENSOR_MM = 56.0


def joints(geometry=PAPER_GEOMETRY, sensor_mm=PAPER_SENSOR_MM):
    """Return name: (point, x, y, z of the virtual joint, motor axis or None), all with the arm stretched."""
    a1, a2, c1, c2, c3, c4 = geometry
    shoulder = np.array([a1, 0.0, c1])
    elbow = shoulder + c2 * X
    wrist = elbow + c3 * X - a2 * Z
    flange = wrist + c4 * X
    return {
        "A1": (c1 * Z, X, Y, Z, -Z),
        "A2": (shoulder, X, -Z, Y, Y),  # x along the link, z along the axis; A2 > 0 is downwards
        "linked_arm": (shoulder + c2 / 2 * X, X, -Z, Y, None),
        "A3": (elbow, Z, X, Y, Y),  # y along the forearm
        "arm": (wrist - c3 / 2 * X, Z, -Y, X, None),  # z along the forearm, x in the arm's plane
        "A4": (wrist, Z, -Y, X, -X),
        "A5": (wrist, Z, X, Y, Y),
        "A6": (flange, -Z, Y, X, -X),  # the flange's axes, z pointing out
        "sensor": (flange + sensor_mm / 2 * X, -Z, Y, X, None),
        "spindle": (flange + sensor_mm * X, -Z, Y, X, None),
    }


def stretched_tip(tool, geometry=PAPER_GEOMETRY):
    """Return the tip with all angles zero; ``tool`` is the tip in the flange."""
    a1, a2, c1, c2, c3, c4 = geometry
    x, y, z = tool
    return np.array([a1 + c2 + c3 + c4 + z, y, c1 - a2 - x])


def turns(point, axis, angle):
    """Return the rotations (n, 4, 4) by ``angle`` (n,) about a line in space, Rodrigues' formula."""
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    rotation = (
        np.eye(3)
        + np.sin(angle)[:, None, None] * cross
        + 2 * np.sin(angle / 2)[:, None, None] ** 2 * (cross @ cross)
    )
    matrix = np.zeros((len(angle), 4, 4))
    matrix[:, :3, :3], matrix[:, 3, 3] = rotation, 1.0
    matrix[:, :3, 3] = point - rotation @ point
    return matrix


def displaced(
    q,
    force,
    moment,
    stiffness=PAPER_STIFFNESS,
    geometry=PAPER_GEOMETRY,
    tool=PAPER_TOOL,
    sensor_mm=PAPER_SENSOR_MM,
):
    """Return tip (n, 3), displacement (n, 3) and rotation vector (n, 3) along the root's axes."""
    q, force, moment = (np.asarray(values, dtype=float) for values in (q, force, moment))
    chain = joints(geometry, sensor_mm)
    start = np.append(stretched_tip(tool, geometry), 1.0)

    rigid = np.broadcast_to(np.eye(4), (len(q), 4, 4))
    before, motor_turns, motor = {}, {}, 0
    for name, (point, _, _, _, motor_axis) in chain.items():
        if motor_axis is not None:
            motor_turns[name] = turns(point, motor_axis, q[:, motor])
            rigid = rigid @ motor_turns[name]
            motor += 1
        before[name] = rigid
    tip = (rigid @ start)[:, :3]

    bent = np.broadcast_to(np.eye(4), (len(q), 4, 4))
    for name, (point, x, y, z, _) in chain.items():
        if name in motor_turns:
            bent = bent @ motor_turns[name]
        moved_point = (before[name] @ np.append(point, 1.0))[:, :3]
        for axis, k in zip((z, y, x), reversed(stiffness[name]), strict=True):  # Rz·Ry·Rx
            moved_axis = before[name][:, :3, :3] @ axis
            velocity = np.cross(moved_axis, tip - moved_point)
            power = (velocity * force).sum(axis=1) + (moved_axis * moment).sum(axis=1)
            bent = bent @ turns(point, axis, power / k)
    rotation = bent[:, :3, :3] @ rigid[:, :3, :3].transpose(0, 2, 1)
    return tip, (bent @ start)[:, :3] - tip, Rotation.from_matrix(rotation).as_rotvec()
