"""Two runs for the effects: joints that swing freely under a made-up load, and a small milled part."""

import io
from functools import partial

import numpy as np
import pytest

from gcode2krl import load_cell, plan_motion, robot
from gcode2krl.cell.sections import Stock
from gcode2krl.effects import Inputs, inputs_of
from gcode2krl.gcode import read_stream
from gcode2krl.pipeline import predict_toolpath

PART = """G21 G90 G17 G94
T1 M6
S13000 M3
G0 X-20 Y0 Z20
Z-3
G1 X60 F1500
G2 X60 Y40 J20
G1 X0
Y10
X30 Y25
G0 Z20
M5
M30
"""
SAMPLES = 1500
DT_S = 0.012


@pytest.fixture(scope="session")
def swinging(cell):
    """Six joints in sines of their own, the tool turning with them, a force that comes and goes."""
    t = np.arange(SAMPLES) * DT_S
    centre = np.radians([5.0, -95.0, 100.0, 10.0, -80.0, -5.0])
    swing = np.radians([6.0, 4.0, 5.0, 8.0, 6.0, 9.0])
    hz = np.array([0.21, 0.17, 0.26, 0.13, 0.19, 0.23])
    q = centre + swing * np.sin(2.0 * np.pi * hz * t[:, None] + np.arange(6))
    position, rotation = robot.forward(q, cell)
    bursts = np.clip(np.sin(2.0 * np.pi * 0.31 * t), 0.0, None)
    force = bursts[:, None] * np.stack([300.0 + 0 * t, 200.0 * np.sin(t), -100.0 * np.cos(2.0 * t)], axis=1)
    moment = bursts[:, None] * np.array([1000.0, -2000.0, 4000.0])
    steps = np.linalg.norm(np.diff(position, axis=0, prepend=position[:1]), axis=1)
    return Inputs(
        cell=cell,
        time_s=t,
        move=np.arange(SAMPLES, dtype=np.int32) // 100,
        source_line=np.arange(SAMPLES, dtype=np.int32) // 100 + 7,
        path_mm=np.cumsum(steps),
        tool=np.ones(SAMPLES, dtype=np.int32),
        spindle_rad_s=np.full(SAMPLES, 1000.0),
        q_cmd_rad=q,
        position_mm=position,
        rotation=rotation,
        force_base_N=force,
        moment_base_Nmm=moment,
    )


@pytest.fixture(scope="session")
def part():
    """A small part's prediction with forces and deflection, its block stated."""
    cell = load_cell()
    block = Stock(box_mm=((0.0, -2.0, -20.0), (90.0, 42.0, 0.0)), resolution_mm=0.25)
    cell = cell.model_copy(update={"stock": block})
    toolpath = read_stream(io.BytesIO(PART.encode("ascii")), "part.nc", cell)
    return predict_toolpath(toolpath, cell)


@pytest.fixture(scope="session")
def milling(part):
    """The inputs of that part, planned by the whole pipeline."""
    return inputs_of(part, plan=partial(plan_motion, dt_s=DT_S))
