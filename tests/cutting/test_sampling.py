"""The force at a moment does not depend on how densely the samples beside it lie."""

import io
import math

import numpy as np
import pytest

from gcode2krl.cell import resolve_cell
from gcode2krl.cutting import cut
from gcode2krl.cutting.milling import shaped
from gcode2krl.gcode import read_stream
from gcode2krl.pipeline import plan_motion

HEAD = "G21 G90 G17 G40 G49 G80 G94\nT1 M6\nS13000 M3\nG0 Z20\nG0 X{x} Y0\n"
PASSES = {
    "plunge and level": (-12, "G1 Z-4 F400\nG1 X40 F1500\nG1 Z5 F600\n"),
    "ramps": (5, "G1 Z0.5 F900\nG1 X35 Z-3 F1500\nG1 X5 Z-4\nG1 X35\nG1 X45 Z2\n"),
    "plunge and ramp": (10, "G1 Z-2 F500\nG1 X40 Z-4 F1500\nG1 Y12\nG1 X10 Z-1\n"),
    "pecks": (20, "G1 Z-2 F300\nG0 Z1\nG1 Z-4 F300\nG0 Z1\n"),
    "corners": (-12, "G1 Z-3 F900\nG1 X25 F1500\nG1 Y15\nG1 X-5\nG1 Y3\n"),
}
TOOLS = {"flat": {"kind": "flat", "centre_cutting": True}, "ball": {"kind": "ball"}}
CELLS = {"flat": 4.0, "ball": 8.0}
"""Both ends of an arc are known to two cells; on a ball to a band of its edge, which is four cells wide."""
CELL_MM = 0.1  # D/160
STAMP_S = 0.012


def cell_with(tool):
    mill = {"diameter_mm": 16.0, "teeth": 3, "length_mm": 100.0, "flute_length_mm": 40.0, **tool}
    stock = {"box_mm": [[0, -20, -20], [50, 30, 0]], "resolution_mm": CELL_MM}
    return resolve_cell({"based_on": "demonstration", "tool": {"1": mill}, "stock": stock})


def forces_every(dt_s, cell, text):
    toolpath = read_stream(io.BytesIO(text.encode()), "passes", cell)
    motion = plan_motion(toolpath, cell, dt_s)
    return motion, cut(toolpath, motion, cell)


def force_of_cells(cell, cells, depth_mm, f_z_mm):
    """The mean force of an arc some cells long at the widest chip: what cells cannot resolve."""
    edge, tool = cell.material.linear_edge, cell.tool[1]
    arc_rad = cells * CELL_MM / (tool.diameter_mm / 2.0)
    return tool.teeth * depth_mm / (2.0 * math.pi) * (edge.Ktc * f_z_mm + edge.Kte) * arc_rad


@pytest.mark.parametrize("kind", TOOLS)
@pytest.mark.parametrize("name", PASSES)
def test_the_force_at_common_stamps_is_the_same_at_12_4_and_2_ms(kind, name):
    cell, (x, text) = cell_with(TOOLS[kind]), PASSES[name]
    motion, coarse = forces_every(STAMP_S, cell, HEAD.format(x=x) + text + "M30\n")
    assert np.linalg.norm(coarse.force_base_N, axis=1).max() > 100.0
    allowed_N = force_of_cells(cell, CELLS[kind], 4.0, 25.0 / (13000.0 / 60.0 * 3.0))
    for dt_s in (0.004, 0.002):
        every = round(STAMP_S / dt_s)
        fine_motion, fine = forces_every(dt_s, cell, HEAD.format(x=x) + text + "M30\n")
        stamps = min(len(motion), (len(fine_motion) - 1) // every + 1)
        np.testing.assert_array_equal(
            fine_motion.position_mm[: stamps * every : every], motion.position_mm[:stamps]
        )
        apart_N = np.linalg.norm(
            fine.force_base_N[: stamps * every : every] - coarse.force_base_N[:stamps], axis=1
        )
        assert apart_N.max() < allowed_N
        assert np.sqrt(np.mean(apart_N**2)) < 0.1 * allowed_N


@pytest.mark.parametrize(
    ("text", "least"),
    [("G1 X40 Y10\nG1 X20 Y30 Z-5\nG1 X10 Y0\n", 10), ("G61\nG1 X40\nG1 Y20 Z-4\nG1 Y0\n", 2)],
)
def test_points_between_samples_lie_on_the_path_of_a_denser_motion(text, least):
    cell = cell_with(TOOLS["flat"])
    toolpath = read_stream(io.BytesIO((HEAD.format(x=0) + "F1500\n" + text + "M30\n").encode()), "path", cell)
    motion, dense = plan_motion(toolpath, cell, 0.05), plan_motion(toolpath, cell, 2e-5)
    way = shaped(motion.position_mm, motion.direction, motion.path_mm, np.arange(len(motion)) > 0)
    added = way.position_mm[~way.read]
    assert len(added) >= least
    off_mm = [np.linalg.norm(dense.position_mm - point, axis=1).min() for point in added]
    assert max(off_mm) < 0.01
    np.testing.assert_array_equal(way.position_mm[way.read], motion.position_mm)


def test_the_direction_of_a_motion_is_that_of_its_path():
    cell = cell_with(TOOLS["ball"])
    text = HEAD.format(x=0) + "G1 X30 Z5 F1500\nG2 X30 Y20 J10\nG1 X0 Z2\nM30\n"
    motion = plan_motion(read_stream(io.BytesIO(text.encode()), "path", cell), cell, 1e-4)
    chords = np.diff(motion.position_mm, axis=0)
    length_mm = np.linalg.norm(chords, axis=1)
    moving = length_mm > 1e-4
    middle = motion.direction[1:] + motion.direction[:-1]
    middle /= np.maximum(np.linalg.norm(middle, axis=1, keepdims=True), 1e-9)
    cosine = (middle * chords).sum(axis=1)[moving] / length_mm[moving]
    assert np.quantile(cosine, 0.001) > 1.0 - 1e-6


def test_values_on_the_way_are_gathered_at_the_sample_they_lead_to():
    position = np.array([[0.0, 0, 0], [1, 0, 0], [1.5, 0.5, 0], [1.5, 2, 0]])
    direction = np.array([[1.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0]])
    way = shaped(position, direction, np.array([0.0, 1.0, 2.0, 3.5]), np.arange(4) > 0)
    assert way.read.sum() == 4
    assert (~way.read).sum() == 1  # the corner is sharp: path length over the vertex
    np.testing.assert_allclose(way.position_mm[~way.read], [[1.5, 0, 0]], atol=1e-9)
    values = np.zeros((5, 2))
    values[2] = 7.0
    np.testing.assert_array_equal(way.gathered(values)[:, 0], [0, 0, 7, 0])
