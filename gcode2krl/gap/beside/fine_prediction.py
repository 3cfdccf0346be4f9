"""A prediction on a grid fine enough for what lies between its samples.

A blended corner of a rapid lasts some 5 ms; samples 12 ms apart cut it by tenths of a millimetre, which is
no gap.
"""

from dataclasses import replace

import numpy as np

from gcode2krl.blockwise import plan_course
from gcode2krl.errors import Gcode2KrlError
from gcode2krl.gap.beside.interpolation import cubic
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.prediction import Prediction

LIMITS = THRESHOLDS.beside


def refined_prediction(prediction: Prediction) -> Prediction:
    """Return the prediction sampled every 4 ms, the material removed again; as it is where finer."""
    motion = prediction.motion
    if motion is None or len(motion) < 3 or prediction.joints is None:
        return prediction
    if float(np.median(np.diff(motion.time_s))) <= LIMITS.fine_step_s * 1.01:
        return prediction
    try:
        targets, cell = prediction.targets, prediction.cell
        kept = plan_course(targets, cell, LIMITS.fine_step_s, keeps=True, watches=False).samples()
        fine = kept.motion
        again = cubic(motion.time_s, fine.time_s, fine.position_mm)
        apart = np.linalg.norm(again - motion.position_mm, axis=1)
        if float(np.sqrt(np.mean(apart**2))) > LIMITS.fine_same_mm:
            return prediction
        joints = kept.joints(cell)
        forces = None
        if prediction.forces is not None:
            from gcode2krl.cutting import cut

            forces = cut(prediction.toolpath, fine, cell)
    except Gcode2KrlError:
        return prediction
    inputs = {**prediction.inputs, "dt_s": LIMITS.fine_step_s}
    return replace(
        prediction, motion=fine, joints=joints, forces=forces, deflection=None, inputs=inputs, clearance=None
    )
