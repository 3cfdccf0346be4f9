"""Deflection of the tool tip, samples per second, beside numpy in the same run.

The peers compute the same thing, eq. 1-9 with the finite product, displacement and rotation vector:

- a loop over samples with 4 x 4 matrices, as the equations stand (on a few samples only);
- the same on stacks of matrices, (n, 4, 4), in chunks;
- columns instead of matrices, rotations as quaternions, everything that is zero left out, in chunks that
  stay in the cache: as quick as we could make numpy.

Every result is compared with the others before anything is printed. Figures are the best of the rounds:
other work on the machine only adds.

    python benchmarks/compliance.py                     a million samples, 3 rounds
    python benchmarks/compliance.py --samples 20000     small
"""

import argparse
import os
import time

import numpy as np

from gcode2krl import load_cell
from gcode2krl.cell.sections import VIRTUAL_JOINTS
from gcode2krl.compliance import displace

LOOP_SAMPLES = 1000
MATRIX_CHUNK, COLUMN_CHUNK = 2000, 5000

CELL = load_cell()
G, H_MM = CELL.robot.geometry, CELL.compliance.sensor_height_mm / 2
# quarter turns about x, a, d, axis (-1 = none), its sign, its zero
FRAMES = [
    (0, 0.0, G.c1_mm, 0, -1, 0.0),
    (-1, G.a1_mm, 0.0, 1, 1, 0.0),
    (0, G.c2_mm / 2, 0.0, -1, 0, 0.0),
    (0, G.c2_mm / 2, 0.0, 2, 1, -np.pi / 2),
    (-1, -G.a2_mm, G.c3_mm / 2, -1, 0, 0.0),
    (0, 0.0, G.c3_mm / 2, 3, -1, 0.0),
    (1, 0.0, 0.0, 4, 1, 0.0),
    (-1, 0.0, G.c4_mm, 5, -1, np.pi),
    (0, 0.0, H_MM, -1, 0, 0.0),
    (0, 0.0, H_MM, -1, 0, 0.0),
]
SOFTNESS = 1.0 / np.array([list(dict(CELL.compliance.virtual_joints[j]).values()) for j in VIRTUAL_JOINTS])
TIP_MM = CELL.tool_matrix(1)[:3, 3] - [0.0, 0.0, 2 * H_MM]


# --- matrices --------------------------------------------------------------------------------------


def frame_matrix(frame, q):
    """Return T_i (..., 4, 4), eq. 1."""
    quarter, a_mm, d_mm, axis, sign, zero = frame
    theta = sign * q[..., axis] + zero if axis >= 0 else np.zeros(q.shape[:-1])
    ca, sa = (1.0, 0.0) if quarter == 0 else (0.0, float(quarter))
    c, s = np.cos(theta), np.sin(theta)
    matrix = np.zeros((*q.shape[:-1], 4, 4))
    matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 0, 3] = c, -s, a_mm
    matrix[..., 1, 0], matrix[..., 1, 1] = ca * s, ca * c
    matrix[..., 1, 2], matrix[..., 1, 3] = -sa, -sa * d_mm
    matrix[..., 2, 0], matrix[..., 2, 1] = sa * s, sa * c
    matrix[..., 2, 2], matrix[..., 2, 3] = ca, ca * d_mm
    matrix[..., 3, 3] = 1.0
    return matrix


def elastic_matrix(angles):
    """Return R* (..., 4, 4), eq. 4."""
    (ca, cb, cg), (sa, sb, sg) = np.moveaxis(np.cos(angles), -1, 0), np.moveaxis(np.sin(angles), -1, 0)
    matrix = np.zeros((*angles.shape[:-1], 4, 4))
    matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 0, 2] = (
        cb * cg,
        sa * sb * cg - ca * sg,
        ca * sb * cg + sa * sg,
    )
    matrix[..., 1, 0], matrix[..., 1, 1], matrix[..., 1, 2] = (
        cb * sg,
        sa * sb * sg + ca * cg,
        ca * sb * sg - sa * cg,
    )
    matrix[..., 2, 0], matrix[..., 2, 1], matrix[..., 2, 2] = -sb, sa * cb, ca * cb
    matrix[..., 3, 3] = 1.0
    return matrix


def with_matrices(q, force, moment):
    """Return displacement and rotation vector (..., 3) for one sample or a stack of them."""
    tool = np.eye(4)
    tool[:3, 3] = TIP_MM
    transforms = [frame_matrix(frame, q) for frame in FRAMES]
    outside = [np.broadcast_to(tool, (*q.shape[:-1], 4, 4))]  # from frame i to the tip, i = 10 … 0
    for transform in reversed(transforms):
        outside.append(transform @ outside[-1])
    rigid = outside[-1]
    to_tip = np.swapaxes(rigid[..., :3, :3], -1, -2)
    force_tip, moment_tip = ((to_tip @ load[..., None])[..., 0] for load in (force, moment))
    bent = outside[0]
    for i in range(9, -1, -1):
        seen = outside[9 - i]
        force_i = (seen[..., :3, :3] @ force_tip[..., None])[..., 0]  # eq. 5
        moment_i = (seen[..., :3, :3] @ moment_tip[..., None])[..., 0]
        angles = (np.cross(seen[..., :3, 3], force_i) + moment_i) * SOFTNESS[i]  # eq. 6, 7
        bent = transforms[i] @ (elastic_matrix(angles) @ bent)  # eq. 3, 8
    turn = bent[..., :3, :3] @ to_tip
    vector = np.stack(
        [
            turn[..., 2, 1] - turn[..., 1, 2],
            turn[..., 0, 2] - turn[..., 2, 0],
            turn[..., 1, 0] - turn[..., 0, 1],
        ],
        axis=-1,
    )
    sine = np.linalg.norm(vector, axis=-1, keepdims=True) / 2
    cosine = (np.trace(turn, axis1=-2, axis2=-1)[..., None] - 1) / 2
    return bent[..., :3, 3] - rigid[..., :3, 3], vector * np.arctan2(sine, cosine) / (2 * sine)  # eq. 9


# --- columns ---------------------------------------------------------------------------------------


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def about_z(c, s, v):
    return [c * v[0] - s * v[1], c * v[1] + s * v[0], v[2]]


def about_x(quarter, v):
    return v if quarter == 0 else [v[0], -quarter * v[2], quarter * v[1]]


def with_columns(q, force, moment):
    """Return displacement and rotation vector (n, 3)."""
    q = np.ascontiguousarray(q.T)
    load, loads, turns = (list(force.T.copy()), list(moment.T.copy())), [], []
    for quarter, _, _, axis, sign, zero in FRAMES:
        load = tuple(about_x(-quarter, v) for v in load)
        turns.append((np.cos(sign * q[axis] + zero), np.sin(sign * q[axis] + zero)) if axis >= 0 else None)
        if axis >= 0:
            c, s = turns[-1]
            load = tuple(about_z(c, -s, v) for v in load)
        loads.append(load)
    tip, shift = list(TIP_MM), [0.0, 0.0, 0.0]
    w, v = 1.0, [0.0, 0.0, 0.0]
    for i in range(9, -1, -1):
        quarter, a_mm, d_mm, axis, _, _ = FRAMES[i]
        force_i, moment_i = loads[i]
        half = [0.5 * k * (m + n) for k, m, n in zip(SOFTNESS[i], cross(tip, force_i), moment_i, strict=True)]
        (ca, cb, cg), (sa, sb, sg) = [np.cos(h) for h in half], [np.sin(h) for h in half]
        cc, ss, cs, sc = cb * cg, sb * sg, cb * sg, sb * cg
        e, u = ca * cc + sa * ss, [sa * cc - ca * ss, ca * sc + sa * cs, ca * cs - sa * sc]
        t = [2 * x for x in cross(u, [x + y for x, y in zip(tip, shift, strict=True)])]
        shift = [x + e * y + z for x, y, z in zip(shift, t, cross(u, t), strict=True)]
        w, v = (
            e * w - u[0] * v[0] - u[1] * v[1] - u[2] * v[2],
            [e * x + w * y + z for x, y, z in zip(v, u, cross(u, v), strict=True)],
        )
        if axis >= 0:
            tip, shift, v = (about_z(*turns[i], x) for x in (tip, shift, v))
        tip = [tip[0] + a_mm, tip[1], tip[2] + d_mm]
        tip, shift, v = (about_x(quarter, x) for x in (tip, shift, v))
    sine = np.sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2)
    factor = 2 * np.arctan2(sine, w) / sine
    return np.stack(shift, axis=1), np.stack([factor * x for x in v], axis=1)


# --- the race --------------------------------------------------------------------------------------


def in_chunks(work, size, q, force, moment):
    parts = [work(q[k : k + size], force[k : k + size], moment[k : k + size]) for k in range(0, len(q), size)]
    return tuple(np.concatenate(columns) for columns in zip(*parts, strict=True))


def one_by_one(q, force, moment):
    rows = [with_matrices(*sample) for sample in zip(q, force, moment, strict=True)]
    return tuple(np.array(columns) for columns in zip(*rows, strict=True))


def random_samples(count):
    random = np.random.default_rng(0)
    low, high = np.radians(CELL.robot.limits.q_deg).T
    force = random.normal(0, 300, (count, 3))
    return random.uniform(low, high, (count, 6)), force, random.normal(0, 5000, (count, 3))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    samples = random_samples(options.samples)
    few = tuple(column[:LOOP_SAMPLES] for column in samples)
    cores = os.cpu_count() or 1
    work = {
        "numpy, a loop over samples": lambda: one_by_one(*few),
        "numpy, stacks of matrices in chunks": lambda: in_chunks(with_matrices, MATRIX_CHUNK, *samples),
        "numpy, columns in chunks": lambda: in_chunks(with_columns, COLUMN_CHUNK, *samples),
        "gcode2krl, one thread": lambda: displace(*samples, CELL, threads=1),
        f"gcode2krl, {cores} threads": lambda: displace(*samples, CELL, threads=cores),
    }
    displace(*few, CELL)  # compiles where nothing is cached

    results = {name: run() for name, run in work.items()}
    wanted = list(results.values())[-1]
    difference_mm = max(np.abs(found[0] - wanted[0][: len(found[0])]).max() for found in results.values())
    difference_rad = max(np.abs(found[1] - wanted[1][: len(found[1])]).max() for found in results.values())
    assert difference_mm < 1e-9, difference_mm
    assert difference_rad < 1e-9, difference_rad

    seconds = {name: [] for name in work}
    for _ in range(options.rounds):
        for name, run in work.items():
            start = time.perf_counter()
            run()
            seconds[name].append(time.perf_counter() - start)
    rate = {name: len(results[name][0]) / min(times) / 1e6 for name, times in seconds.items()}
    print(f"{options.samples} samples, {cores} cores, best of {options.rounds} rounds")
    print(f"all agree to {difference_mm:.1e} mm and {difference_rad:.1e} rad\n")
    print(f"{'':37s} million samples/s   1 / stacks   1 / columns")
    stacks, columns = rate["numpy, stacks of matrices in chunks"], rate["numpy, columns in chunks"]
    for name, value in rate.items():
        print(f"{name:37s} {value:17.4f} {value / stacks:12.3g} {value / columns:13.3g}")


if __name__ == "__main__":
    main()
