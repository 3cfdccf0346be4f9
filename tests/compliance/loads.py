"""Random loads, and a second cell that shares nothing with the default one, for the tests of this folder."""

import functools
import math

import numpy as np
from hypothesis import strategies as st

from gcode2krl.cell import resolve_cell
from tests.compliance import independent

HOME = np.radians([[0.0, -90.0, 90.0, 0.0, 0.0, 0.0]])
NONE = np.zeros(3)

# Of a robot whose forearm lies above axis 3
OTHER_GEOMETRY = (330.0, -115.0, 645.0, 1150.0, 1220.0, 215.0)
OTHER_STIFFNESS = {
    name: tuple(k * factor for k, factor in zip(values, (0.7 + 0.05 * i, 1.3, 0.9), strict=True))
    for i, (name, values) in enumerate(independent.PAPER_STIFFNESS.items())
}
poses = st.lists(st.floats(-6.25, 6.25, width=32), min_size=6, max_size=6)
vectors = st.lists(st.floats(-1.0, 1.0, width=32), min_size=3, max_size=3)


@functools.cache
def other_cell():
    return resolve_cell(
        {
            "robot": {"model": "KR 210 R2700-2"},
            "frames": {
                "base": {
                    "x_mm": 900.0,
                    "y_mm": -300.0,
                    "z_mm": 500.0,
                    "a_deg": 35.0,
                    "b_deg": -20.0,
                    "c_deg": 75.0,
                },
                "tool": {
                    "x_mm": -80.0,
                    "y_mm": 130.0,
                    "z_mm": 310.0,
                    "a_deg": 10.0,
                    "b_deg": 25.0,
                    "c_deg": -40.0,
                },
            },
            "compliance": {
                "sensor_height_mm": 90.0,
                "virtual_joints": {
                    name: dict(zip(("k_c", "k_b", "k_a"), values, strict=True))
                    for name, values in OTHER_STIFFNESS.items()
                },
            },
        }
    )


def random_load(count, seed, force_N=1000.0, moment_Nmm=50_000.0):
    random = np.random.default_rng(seed)
    q = random.uniform(-math.pi, math.pi, (count, 6)) * [1, 1, 1, 2, 1, 2]
    force = random.uniform(-force_N, force_N, (count, 3))
    return q, force, random.uniform(-moment_Nmm, moment_Nmm, (count, 3))
