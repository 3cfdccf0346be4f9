"""Offline compensation of short programs whose forces are a function of the intended position."""

import io

import numpy as np

from gcode2krl import compliance, robot
from gcode2krl.compensation.iteration import compensate
from gcode2krl.gcode import read_stream
from gcode2krl.pipeline import plan_motion, set_targets
from gcode2krl.tables import Forces

HEAD = "G21 G90 G17 G40 G49 G80 G94\nG54\nT1 M6\nS8000 M3\nG0 G43 H1 {above}\nG0 X0 Y0\nG0 Z2\n"
TAIL = "G0 Z20\nM5\nM30\n"


def read(body, cell):
    """Return the toolpath and the targets of a cut that begins above X0 Y0 with an upright tool."""
    text = HEAD.format(above="Z60 A0 C0" if cell.machine else "Z20") + body + TAIL
    toolpath = read_stream(io.BytesIO(text.encode()), "part.nc", cell)
    return toolpath, set_targets(toolpath, cell)


def below(motion):
    return (motion.position_mm[:, 2] < 0.0)[:, None]


def corrected(body, cell, law, band=0.3, **options):
    """Return the compensation of a cut under the forces of a law."""
    toolpath, targets = read(body, cell)
    motion, forces, _ = stages(targets, cell, law, band)
    return compensate(toolpath, targets, cell, motion, forces, **options)


def stages(targets, cell, law, band=0.3):
    """The stages behind the targets, with forces that are a function of the commanded position."""
    motion = plan_motion(targets, cell)
    joints = robot.follow_motion(motion, cell)
    rows = len(motion)
    nothing = np.zeros(rows)
    forces = Forces(
        force_base_N=law(motion),
        moment_base_Nmm=np.zeros((rows, 3)),
        peak_N=nothing,
        torque_Nmm=nothing,
        a_p_mm=nothing,
        a_e_mm=nothing,
        phi_rad=np.zeros((rows, 2)),
        tool=motion.tool,
        relative_band=band,
    )
    return motion, forces, compliance.deflect(joints, forces, cell)
