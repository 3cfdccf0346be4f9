"""Synthetic forces along a Motion, as a prediction would have them."""

from dataclasses import MISSING, fields, replace

import numpy as np

from gcode2krl import plan_motion, set_targets
from gcode2krl.prediction import Prediction
from gcode2krl.tables import Deflection, Forces


def moved(toolpath, cell, dt_s=0.012):
    """Return a prediction of the motion alone."""
    targets = set_targets(toolpath, cell)
    return Prediction(toolpath, targets, cell, plan_motion(targets, cell, dt_s))


def table(kind, rows, **columns):
    """Return a table of zeros with the given columns."""
    for spec in fields(kind):
        if "tail" in spec.metadata and spec.name not in columns and spec.default is MISSING:
            tail = [2 if size is None else size for size in spec.metadata["tail"]]
            columns[spec.name] = np.zeros((rows, *tail), dtype=spec.metadata["dtype"])
    return kind(**columns)


def with_forces(prediction, force_base_N, deflection_base_mm=None):
    """Return a prediction with forces (m, 3), and a deflection where it is given."""
    rows = len(prediction.motion)
    forces = table(Forces, rows, force_base_N=force_base_N)
    deflection = None
    if deflection_base_mm is not None:
        deflection = table(
            Deflection, rows, deflection_base_mm=deflection_base_mm, correction_base_mm=-deflection_base_mm
        )
    return replace(prediction, forces=forces, deflection=deflection)


def cutting_below(prediction, z_mm=0.0, force_N=500.0, ramp_s=0.3):
    """Return forces (m, 3) as of a cut below z: along the feed and to its left, rising like a square root."""
    motion = prediction.motion
    velocity = np.gradient(motion.position_mm, motion.time_s, axis=0)
    speed = np.linalg.norm(velocity, axis=1)
    feed = np.divide(velocity, speed[:, None], where=speed[:, None] > 1e-9, out=np.zeros_like(velocity))
    deep = (motion.position_mm[:, 2] < z_mm) & (speed > 1e-6)
    since = np.zeros(len(motion))
    start = 0.0
    for row in range(len(motion)):
        if not deep[row]:
            start = motion.time_s[row]
        since[row] = motion.time_s[row] - start
    size = force_N * np.sqrt(np.minimum(since / ramp_s, 1.0)) if ramp_s > 0 else np.full(len(motion), force_N)
    left = np.column_stack([-feed[:, 1], feed[:, 0], np.zeros(len(motion))])
    force = size[:, None] * (-0.4 * feed + 0.9 * left + np.array([0.0, 0.0, -0.2]))
    force[~deep] = 0.0
    return force
