"""Rails and tables under robot and part, beside the transformations of another library.

``python benchmarks/external_kinematics.py`` draws joints and external axes of a cell with two rails, a tilt
and a turntable, all askew, and prints how far the tool in ``$BASE`` and the joints are from those that
`trimesh.transformations` makes of them.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from gcode2krl.cell.carried import at_rest, from_rest
from gcode2krl.frames import quaternion_from_rotation, rotation_from_quaternion
from gcode2krl.robot import forward, inverse
from tests.robot.test_carried import CELL, drawn


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--poses", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=7)
    options = parser.parse_args()
    q_rad, external, wanted = drawn(options.poses, options.seed)
    position, rotation = from_rest(*forward(q_rad, CELL), external, CELL)
    turned = rotation_from_quaternion(rotation)
    rotation = quaternion_from_rotation(wanted[:, :3, :3])
    found = inverse(*at_rest(wanted[:, :3, 3], rotation, external, CELL), CELL)
    apart = np.nanmin(np.abs((found - q_rad[:, None] + np.pi) % (2.0 * np.pi) - np.pi).max(axis=2), axis=1)
    away = np.abs(np.sin(q_rad[:, 4])) > 1e-2  # at the wrist's singularity A4 and A6 are not unique
    print(f"{options.poses:,} poses of two rails, a tilt and a turntable, beside trimesh.transformations")
    for what, off, unit in (
        ("tool in $BASE, position", np.abs(position - wanted[:, :3, 3]).max(), " mm"),
        ("tool in $BASE, orientation", np.abs(turned - wanted[:, :3, :3]).max(), ""),
        ("joints from the pose", apart[away].max(), " rad"),
    ):
        print(f"  {what:<34} off by at most {off:.1e}{unit}")


if __name__ == "__main__":
    main()
