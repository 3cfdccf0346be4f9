import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

from gcode2krl.cell.library import names, read_model
from gcode2krl.cell.sections import Tool
from gcode2krl.cutting.cutter import bottom_of, outline, shape_of, slices_of
from gcode2krl.cutting.force import cutting_load
from gcode2krl.cutting.law import linear_edge_law
from gcode2krl.cutting.slices import arc_force

LAW = linear_edge_law([796.1, 168.8, 222.0, 27.7, 30.8, 1.4])
FLAT = Tool(diameter_mm=16, teeth=3, flute_length_mm=40)
BULL = Tool(kind="bull-nose", diameter_mm=16, corner_radius_mm=3, teeth=3, flute_length_mm=40)
BALL = Tool(kind="ball", diameter_mm=16, corner_radius_mm=8, teeth=2, flute_length_mm=40)
TAPERED = Tool(kind="tapered", diameter_mm=3, taper_deg=5, teeth=3, flute_length_mm=20)
TAPERED_BALL = Tool(
    kind="tapered", diameter_mm=3, corner_radius_mm=1.5, taper_deg=3, teeth=2, flute_length_mm=25
)
DRILL = Tool(kind="drill", diameter_mm=8, point_deg=118, teeth=2, flute_length_mm=75)
ALL = {
    "flat": FLAT,
    "bull-nose": BULL,
    "ball": BALL,
    "tapered": TAPERED,
    "tapered ball": TAPERED_BALL,
    "drill": DRILL,
}


def height(tool, r):
    """The outline in closed form."""
    r = np.asarray(r, dtype=float)
    if tool is FLAT:
        return np.zeros_like(r)
    if tool is BULL:
        return np.where(r > 5, 3 - np.sqrt(np.maximum(9 - np.maximum(r - 5, 0) ** 2, 0)), 0.0)
    if tool is BALL:
        return 8 - np.sqrt(64 - r**2)
    if tool is TAPERED:
        return np.maximum(r - 1.5, 0) / math.tan(math.radians(5))
    if tool is TAPERED_BALL:  # ball of 1.5 mm, tangent to a cone of 3°
        taper = math.radians(3)
        touch = 1.5 * math.cos(taper)
        ball = 1.5 - np.sqrt(2.25 - np.minimum(r, touch) ** 2)
        return ball + np.maximum(r - touch, 0) / math.tan(taper)
    return r / math.tan(math.radians(59))


@pytest.mark.parametrize("name", ALL)
def test_outline_is_that_of_the_tool(name):
    tool = ALL[name]
    r, z = outline(tool)
    assert r[0] == 0
    assert z[0] == 0
    assert (np.diff(r) > 0).all()
    assert (np.diff(z) >= 0).all()
    exact = r[-1] * (1 - np.linspace(0, 1, 40_000) ** 2)  # close where a flank stands upright
    exact = np.column_stack([exact, height(tool, exact)])
    share = np.linspace(0, len(r) - 1, 700)  # along the polyline
    on_it = np.column_stack([np.interp(share, np.arange(len(r)), x) for x in (r, z)])
    distance, _ = cKDTree(exact).query(on_it)
    assert distance.max() < 1e-3


@pytest.mark.parametrize("name", ALL)
def test_slices_follow_the_outline(name):
    tool = ALL[name]
    s = slices_of(tool)
    assert s.z_low_mm[0] == 0
    np.testing.assert_allclose(s.z_high_mm[:-1], s.z_low_mm[1:])
    assert s.z_high_mm[-1] == pytest.approx(tool.flute_length_mm)
    np.testing.assert_allclose(s.sin_kappa**2 + s.cos_kappa**2, 1)
    np.testing.assert_allclose(s.db_mm * s.sin_kappa, s.z_high_mm - s.z_low_mm)
    bottom = bottom_of(tool)
    reach = np.sum(bottom.db_mm) + np.sum(s.db_mm * s.cos_kappa)
    assert reach == pytest.approx(shape_of(tool).radius_mm)
    assert (bottom.z_high_mm == 0).all()
    assert (bottom.cos_kappa == 1).all()


def test_number_of_slices():
    assert len(slices_of(FLAT)) == 1
    assert len(slices_of(BULL)) == len(slices_of(BALL)) == len(slices_of(DRILL)) == 13
    assert len(slices_of(TAPERED)) == 12
    assert len(slices_of(TAPERED_BALL)) == 24
    assert len(slices_of(BALL, 5)) == 6
    assert len(bottom_of(BALL)) == len(bottom_of(DRILL)) == 0
    assert len(bottom_of(FLAT, 4)) == 4


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("gamma", [0.0, 0.1, math.pi / 2])
def test_sum_over_slices_is_the_mean(name, gamma):
    """Twelve slices on a corner, a part of the cylinder: within 0.2 %, at the rear of a ramp 0.5 %."""
    tool = ALL[name]
    depth, total = 10.0, np.zeros(4)
    tolerance = 5e-3 if gamma == 0.1 else 2e-3
    for s in (bottom_of(tool), slices_of(tool)):
        for i in range(len(s)):
            thickness = s.z_high_mm[i] - s.z_low_mm[i]
            share = np.clip((depth - s.z_low_mm[i]) / thickness, 0, 1) if thickness > 0 else 1.0
            part = np.zeros(4)
            kappa = s.sin_kappa[i], s.cos_kappa[i]
            arc_force(0.0, 2 * math.pi, *kappa, 0.1, math.sin(gamma), math.cos(gamma), LAW, part)
            part[3] *= s.radius_mm[i]
            total += part * s.db_mm[i] * share * tool.teeth / (2 * math.pi)
    load = cutting_load(tool, LAW, [[0, 2 * math.pi]], depth, 0.1, gamma)
    assert np.linalg.norm(total[:3] - load.force_N[0]) < tolerance * np.linalg.norm(load.force_N)
    if name.startswith("tapered"):
        assert total[3] == pytest.approx(load.torque_Nmm[0], rel=2e-2)  # the last slice is cut in its middle
    else:
        assert total[3] == pytest.approx(load.torque_Nmm[0], rel=2e-3)


def test_shapes_by_their_numbers_whatever_the_kind_says():
    assert shape_of(Tool(diameter_mm=10, corner_radius_mm=5, teeth=2)).bottom_mm == 0
    assert shape_of(Tool(kind="ball", diameter_mm=10, teeth=2)).corner_mm == 5
    assert shape_of(Tool(kind="drill", diameter_mm=10, teeth=2)).side_mm == pytest.approx(3.0043, abs=1e-4)
    assert shape_of(Tool(diameter_mm=10, teeth=2)).flute_mm == 100
    assert shape_of(Tool(diameter_mm=10, teeth=2, length_mm=60)).flute_mm == 60
    assert shape_of(TAPERED).radius_mm == pytest.approx(1.5 + 20 * math.tan(math.radians(5)))


@pytest.mark.parametrize("model", names("tools"))
def test_every_tool_of_the_library_has_a_shape(model):
    tool = Tool.model_validate(read_model("tools", model))
    r, _ = outline(tool)
    assert r[-1] >= tool.diameter_mm / 2 - 1e-9
    assert len(slices_of(tool)) >= 1
    if tool.kind == "ball":
        assert tool.corner_radius_mm == tool.diameter_mm / 2
