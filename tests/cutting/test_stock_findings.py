"""Findings from the stated stock, the reach of the tools and the rapid moves."""

import io

import numpy as np
import pytest

from gcode2krl import cut, plan_motion
from gcode2krl.cell.sections import Tool
from gcode2krl.cutting.cutter import outline
from gcode2krl.cutting.height_field import HeightField
from gcode2krl.cutting.stock_checks import Footprint, standing_mm
from gcode2krl.gcode import read_stream
from tests.cells import over_demonstration

HEAD = "G21 G90 G17\nT1 M6\nS9000 M3\nG0 G43 H1 Z30\n"
SLOT = "G0 X0 Y0\nG0 Z2\nG1 Z-5 F600\nG1 X60\nG0 Z30\n"


def run(body, data=None, head=HEAD):
    cell = over_demonstration(data)
    text = head + body + "M5\nM30\n"
    toolpath = read_stream(io.BytesIO(text.encode()), "part.nc", cell)
    return cut(toolpath, plan_motion(toolpath, cell), cell)


def stock(low, high, **more):
    return {"stock": {"box_mm": [low, high], "resolution_mm": 0.5, **more}}


def found(forces, code):
    return [(issue.severity, issue.line, issue.remedy) for issue in forces.issues if issue.code == code]


def test_stock_that_no_feed_move_touches_is_an_error():
    ((severity, line, remedy),) = found(run(SLOT, stock([200, 0, -20], [300, 80, 0])), "stock-untouched")
    assert (severity, line) == ("error", 7)
    assert "G54" in remedy
    assert not found(run(SLOT, stock([-20, -20, -20], [80, 20, 0])), "stock-untouched")
    assert not found(run(SLOT), "stock-untouched")


def test_a_cut_through_the_underside_needs_its_key():
    thin = [-20, -20, -4.5], [80, 20, 0]
    ((severity, line, remedy),) = found(run(SLOT, stock(*thin)), "stock-underside")
    assert (severity, line) == ("error", 7)
    assert "through_mm = 0.5" in remedy
    assert not found(run(SLOT, stock(*thin, through_mm=0.5)), "stock-underside")
    assert found(run(SLOT, stock(*thin, through_mm=0.4)), "stock-underside")


def test_going_below_the_underside_beside_the_stock_is_no_cut_through_it():
    assert not found(run(SLOT, stock([-20, 8.1, -4.5], [80, 60, 0])), "stock-underside")
    assert found(run(SLOT, stock([-20, 7.0, -4.5], [80, 60, 0])), "stock-underside")


@pytest.mark.parametrize(
    ("tool", "what"),
    [
        ({"length_mm": 30.0, "stick_out_mm": 12.0}, "the holder of T1 goes 8.00 mm"),
        ({"length_mm": 15.0}, "the spindle nose of T1 goes 5.00 mm"),
    ],
)
def test_a_holder_below_the_top_whose_width_is_unknown_is_said(tool, what):
    body = SLOT.replace("Z-5", "Z-20")
    own = {"tool": {"1": {"diameter_mm": 16.0, "teeth": 3, "flute_length_mm": 11.0, **tool}}}
    forces = run(body, {**own, **stock([-20, -20, -30], [80, 20, 0])})
    (message,) = [issue.message for issue in forces.issues if issue.code == "holder-below-top"]
    assert what in message
    assert not found(run(body, {**own, **stock([-20, 9, -30], [80, 40, 0])}), "holder-below-top")
    assert [severity for severity, *_ in found(run(body, own), "holder-below-top")] == ["warning"]


def test_a_wide_mill_that_plunges_is_doubted_unless_the_cell_says_that_it_can():
    wide = {"diameter_mm": 80.0, "teeth": 6, "length_mm": 60.0, "flute_length_mm": 12.0}
    head = HEAD.replace("T1", "T30").replace("H1", "H30")
    ((severity, line, remedy),) = found(run(SLOT, {"tool": {"30": wide}}, head), "plunge-wide")
    assert (severity, line) == ("warning", 7)
    assert "centre_cutting" in remedy
    sure = {**wide, "centre_cutting": True}
    assert not found(run(SLOT, {"tool": {"30": sure}}, head), "plunge-wide")
    narrow = {**wide, "diameter_mm": 25.0}
    assert not found(run(SLOT, {"tool": {"30": narrow}}, head), "plunge-wide")
    assert not found(run(SLOT), "plunge-wide")


def test_a_rapid_through_material_is_no_cut():
    body = "G0 X0 Y0\nG0 Z2\nG1 Z-5 F600\nG1 X60\nG0 X0 Y60\nG0 Z30\n"
    forces = run(body)
    slot = run(SLOT)
    assert found(forces, "rapid-in-stock")
    largest = [np.linalg.norm(one.force_base_N, axis=1).max() for one in (forces, slot)]
    assert largest[0] == pytest.approx(largest[1], rel=0.01)


def test_a_footprint_agrees_with_distances():
    rng = np.random.default_rng(5)
    height = np.full((60, 80), -1.0, np.float32)
    height[rng.random(height.shape) < 0.01] = 3.0
    field = HeightField(height, np.array([-4.0, 2.0]), np.array([0.5, 0.5]), -1.0)
    rows, columns = np.nonzero(height > 0)
    cells = np.stack([columns, rows], axis=1) * 0.5 + [-3.75, 2.25]
    position = np.column_stack([rng.uniform(-8, 40, 2000), rng.uniform(-2, 36, 2000), np.zeros(2000)])
    nearest = np.linalg.norm(cells[None] - position[:, None, :2], axis=2).min(axis=1)
    seen = Footprint(field, height > 0).below(position, 2.0)
    assert not seen[nearest > 2.0].any()
    assert seen[nearest < 1.4].all()  # rectangles in the circle reach 0.9 of its radius, less half a cell
    assert 0 < seen.sum() < len(seen)


@pytest.mark.parametrize(
    "tool",
    [Tool(diameter_mm=6, teeth=2), Tool(kind="ball", diameter_mm=6, teeth=2, corner_radius_mm=3)],
)
def test_how_far_a_standing_tool_is_in_the_material(tool):
    x = np.linspace(-9.95, 9.95, 200)
    height = (0.1 * x[:, None] - 0.05 * x[None, :]).astype(np.float32)
    field = HeightField(height, np.array([-10.0, -10.0]), np.array([0.1, 0.1]), -5.0)
    radii, heights = outline(tool)
    tip = np.array([1.0, 2.0, -0.4])
    r = np.hypot(x[None, :] - 1.0, x[:, None] - 2.0)
    inside = r < 3.0
    wanted = (height - (-0.4) - np.interp(r, radii, heights))[inside].max()
    assert standing_mm(field, tip, tool) == pytest.approx(wanted, abs=1e-6)
    assert standing_mm(field, np.array([1.0, 2.0, 9.0]), tool) == 0.0
    assert standing_mm(field, np.array([50.0, 2.0, -4.0]), tool) == 0.0
