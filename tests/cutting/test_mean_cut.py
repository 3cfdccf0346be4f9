"""A cut for its mean forces has the same ones as a whole cut; findings and peaks it has not."""

import io

import numpy as np

from gcode2krl import cut, plan_motion
from gcode2krl.cell import resolve_cell
from gcode2krl.cutting import mean_cut
from gcode2krl.gcode import read_stream

SLOT = "G21 G90 G17\nT1 M6\nS9000 M3\nG0 G43 H1 Z30\nG0 X0 Y0\nG0 Z2\nG1 Z-5 F600\nG1 X40\nM5\nM30\n"
STOCK = {"box_mm": [[-20, -20, -4.5], [80, 20, 0]], "resolution_mm": 0.5}


def test_forces_are_those_of_a_whole_cut():
    cell = resolve_cell({"based_on": "demonstration", "stock": STOCK})
    toolpath = read_stream(io.BytesIO(SLOT.encode()), "part.nc", cell)
    motion = plan_motion(toolpath, cell)
    whole, mean = cut(toolpath, motion, cell), mean_cut(toolpath, motion, cell)
    for name in ("force_base_N", "moment_base_Nmm", "torque_Nmm", "a_p_mm", "a_e_mm", "phi_rad", "tool"):
        np.testing.assert_array_equal(getattr(mean, name), getattr(whole, name))
    assert whole.issues
    assert not mean.issues
    cuts = np.linalg.norm(whole.force_base_N, axis=1) > 1.0
    assert np.all(mean.peak_N[cuts] <= whole.peak_N[cuts])
    all_around = (
        whole.phi_rad[:, 1] - whole.phi_rad[:, 0] > 6.28
    )  # what does not change in a turn has no peak
    assert np.sum(cuts & ~all_around) > 50
    assert np.all(mean.peak_N[cuts & ~all_around] < whole.peak_N[cuts & ~all_around])
