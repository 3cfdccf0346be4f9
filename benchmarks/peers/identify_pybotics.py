"""Fit an arm to poses with pybotics as its own example does; print the error at places left out, in mm.

python identify_pybotics.py poses.npz   with mdh (6, 4), q_rad (n, 6), seen_mm (n, 3), place (n,), counts (n,)
                                        world (6,), tool (6,)
"""

import sys

import numpy as np
from pybotics.geometry import vector_2_matrix
from pybotics.optimization import OptimizationHandler, compute_absolute_errors, optimize_accuracy
from pybotics.robot import Robot
from scipy.optimize import least_squares

data = np.load(sys.argv[1])
q, seen, place, counts = data["q_rad"], data["seen_mm"], data["place"], data["counts"]
off = np.zeros(len(q))
for fold in np.unique(place):
    inside = place != fold
    robot = Robot.from_parameters(data["mdh"])
    robot.world_frame, robot.tool.matrix = vector_2_matrix(data["world"]), vector_2_matrix(data["tool"])
    handler = OptimizationHandler(robot, True, [True] * 3 + [False] * 3, True)
    start = handler.generate_optimization_vector()
    least_squares(optimize_accuracy, start, x_scale="jac", args=(handler, q[inside], seen[inside]))
    off[~inside] = compute_absolute_errors(q[~inside], seen[~inside], handler.robot)
print(np.sqrt(np.mean(off[counts] ** 2)))
