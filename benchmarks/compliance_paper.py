"""The 60 cases of section 3.1 of Haehn & Weigold 2020 on the default cell, beside the paper's figures.

750 N at the tool tip along +x, +y and -z of the robot root, at four positions in five orientations. The paper
gives the means in words, the single values only as a figure; it says nothing of the frames of its end
effector, so ours is printed. Joints: of the inverse solutions within the limits that with |A1| < 90°, A3 > 0
and the smallest |A4| + |A6|.

    python benchmarks/compliance_paper.py
    python benchmarks/compliance_paper.py --cases     every case, and what each virtual joint costs
"""

import argparse

import numpy as np

from gcode2krl import frames as fr
from gcode2krl import load_cell
from gcode2krl.cell.sections import VIRTUAL_JOINTS
from gcode2krl.compliance import displace, joint_shares, tip_position
from gcode2krl.robot import inverse
from gcode2krl.units import RAD_PER_DEG, RAD_PER_REV

FORCE_N = 750.0
DIRECTIONS = {"+x": (1.0, 0.0, 0.0), "+y": (0.0, 1.0, 0.0), "-z": (0.0, 0.0, -1.0)}
POSITIONS_MM = [(2084, -97, 1524), (1091, 454, 1884), (1337, -538, 1098), (1595, -18, 1099)]
ORIENTATIONS_DEG = [(0, 0, 0), (0, 30, 0), (0, -30, 0), (0, 0, 30), (0, 0, -30)]  # A, B, C
PAPER = "paper: calculated 1.72 (measured less 6 %), measured 1.83, largest difference 0.44"


def within_limits(q_rad, cell):
    """Return q in the turn that lies within the limits, NaN rows where there is none."""
    low, high = np.array(cell.robot.limits.q_deg).T * RAD_PER_DEG
    turns = q_rad[:, None] + RAD_PER_REV * np.array([0, -1, 1])[:, None]
    fits = (turns >= low) & (turns <= high)
    nearest = np.where(fits, np.abs(turns), np.inf).argmin(axis=1)
    chosen = np.take_along_axis(turns, nearest[:, None], axis=1)[:, 0]
    chosen[~fits.any(axis=1).all(axis=1)] = np.nan
    return chosen


def joints_at(position_mm, abc_deg, cell):
    """Return the angles (6,) with which the tip stands at a position in an orientation of the root."""
    rotation = fr.rotation_from_abc(np.array(abc_deg) * RAD_PER_DEG)
    pose = fr.invert(cell.base_matrix()) @ fr.transform(position_mm, rotation)
    every = inverse(pose[:3, 3], fr.quaternion_from_rotation(pose[:3, :3]), cell)[0]
    q = within_limits(every, cell)
    q = q[(np.abs(q[:, 0]) < np.pi / 2) & (q[:, 2] > 0)]  # NaN is neither
    return q[np.argmin(np.abs(q[:, 3]) + np.abs(q[:, 5]))]


def cases(cell):
    """Return direction, position and orientation (60, 3) as indices, joints (60, 6) and forces (60, 3)."""
    index = np.array([(d, p, o) for d in range(3) for p in range(4) for o in range(5)])
    poses = [[joints_at(position, abc, cell) for abc in ORIENTATIONS_DEG] for position in POSITIONS_MM]
    q = np.array([poses[p][o] for _, p, o in index])
    return index, q, FORCE_N * np.array(list(DIRECTIONS.values()))[index[:, 0]]


def print_end_effector(cell):
    frame, height = cell.frames.tool, cell.compliance.sensor_height_mm
    angles = f"A {frame.a_deg:g} B {frame.b_deg:g} C {frame.c_deg:g}"
    print(f"end effector: $TOOL X {frame.x_mm:g} Y {frame.y_mm:g} Z {frame.z_mm:g} {angles}, tool")
    print(f"  {cell.frames.tool_length_mm:g} mm long; sensor {height:g} mm high; k_C, k_B, k_A in N·mm/rad")
    for name in ("sensor", "spindle"):
        k = cell.compliance.virtual_joints[name]
        print(f"  {name:8s} {k.k_c:.2g} {k.k_b:.2g} {k.k_a:.2g}")
    print(f"  {cell.frames.source}\n")


def print_cases(index, magnitude, shares):
    print(
        "direction position orientation   |Δr|   share of "
        + " ".join(f"{name:>10s}" for name in VIRTUAL_JOINTS)
    )
    names = list(DIRECTIONS)
    for (d, p, o), total, row in zip(index, magnitude, shares, strict=True):
        a, b, c = ORIENTATIONS_DEG[o]
        parts = " ".join(f"{value:10.3f}" for value in np.linalg.norm(row, axis=1))
        print(f"{names[d]:>9s} {p + 1:8d}   {f'A{a} B{b} C{c}':10s} {total:7.3f}            {parts}")
    print()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", action="store_true", help="print every case")
    options = parser.parse_args()
    cell = load_cell()
    index, q, force = cases(cell)
    wanted = np.array(POSITIONS_MM, dtype=float)[index[:, 1]]
    off_mm = np.abs(tip_position(q, cell) - wanted).max()
    magnitude = np.linalg.norm(displace(q, force, np.zeros(3), cell)[0], axis=1)
    shares = joint_shares(q, force, np.zeros(3), cell)

    print_end_effector(cell)
    print(f"{len(q)} cases, tip at the paper's positions to {off_mm:.0e} mm")
    if options.cases:
        print_cases(index, magnitude, shares)
    print(f"mean {magnitude.mean():.4f} mm, smallest {magnitude.min():.3f}, largest {magnitude.max():.3f}")
    print(f"  {PAPER}")
    for name, column, labels in (("direction", 0, DIRECTIONS), ("position", 1, ("1", "2", "3", "4"))):
        means = (f"{label} {magnitude[index[:, column] == k].mean():.3f}" for k, label in enumerate(labels))
        print(f"by {name}: {', '.join(means)}")
    # a joint counts by what it adds along the deflection
    along = np.einsum("nkj,nj->nk", shares, shares.sum(axis=1))
    part = (along / along.sum(axis=1, keepdims=True)).mean(axis=0)
    print(
        "mean share:",
        ", ".join(f"{name} {value:.0%}" for name, value in zip(VIRTUAL_JOINTS, part, strict=True)),
    )


if __name__ == "__main__":
    main()
