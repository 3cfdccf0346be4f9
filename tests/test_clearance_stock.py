"""Arm and spindle against the stock as it stands at that moment, and against the raw part on the way in."""

import numpy as np
import pytest

from gcode2krl import predict, write_krl
from gcode2krl.clearance import ArmInStock
from gcode2krl.cutting import Milling, outlook_of
from gcode2krl.errors import RefusedError
from gcode2krl.gcode import read_gcode
from gcode2krl.pipeline import plan_motion
from tests.cells import over_demonstration
from tests.test_clearance import box, cell_with

HEAD = "G21 G90 G94 G17\nT1 M6\nS10000 M3\nG0 G43 H1 X-30 Y0 Z200\n"
END = "G0 Z200\nM5\nM30\n"
NOSE_MM = 100.0
"""The spindle of these cells begins so far above the tip, with a round end of 75 mm."""
BESIDE = "G0 X12 Y-40\nG0 Z5\nG1 Z0 F2000\nG1 Y60\n"
POST = [[0.0, -5, -10], [20, 13, 120]]
CAPSULES = 60
PASSES = "G0 X-30 Y-25\nG0 Z0\nG1 X60 F3000\nG0 Z200\n"
"""Beside the post: the cutter clears it by 12 mm, the spindle does not."""


def layers(top, bottom, step=10):
    """Cut the post away from above."""
    return "".join(
        f"G0 X-20 Y0\nG0 Z{z}\nG1 X40 F3000\nG0 Y8\nG1 X-20\nG0 Z{z + 15}\n"
        for z in range(top, bottom - 1, -step)
    )


@pytest.fixture
def found(tmp_path):
    def found(text, height=200, **cell):
        file = tmp_path / "part.nc"
        file.write_text((HEAD + text + END).replace("Z200", f"Z{height}"))
        prediction = predict(file, cell_with(**cell))
        return prediction, [issue for issue in prediction.issues if issue.code == "collision"]

    return found


@pytest.mark.parametrize(("top", "lines"), [(90, []), (100.3, []), (101, [8]), (150, [6, 7, 8, 9])])
def test_the_spindle_beside_a_wall(found, top, lines):
    _, issues = found(BESIDE, stock={"box_mm": [[20.0, -20, -60], [60, 40, top]]})
    assert [issue.line for issue in issues] == lines
    assert all(issue.message.startswith("spindle hits the stock, ") for issue in issues)
    assert all(issue.severity == "error" for issue in issues)


def test_how_deep_is_that_of_a_sphere_over_an_edge(found):
    """The tip passes 8 mm beside the wall: the nose's sphere is there at 175 - sqrt(75² - 8²) mm."""
    _, (issue,) = found(BESIDE, stock={"box_mm": [[20.0, -20, -60], [60, 40, 101]]})
    below = 175.0 - np.sqrt(75.0**2 - 8.0**2)
    # the deepest point is along the radius, not straight down
    deep = 75.0 - np.hypot(8.0, 175.0 - 101.0)
    assert below < 101.0
    assert f"by {deep:.1f} mm" in issue.message


def test_a_post_that_is_gone_hits_nothing_one_that_stands_does(found):
    stock = {"box_mm": POST, "resolution_mm": 0.5}
    _, issues = found(layers(110, 0) + PASSES, stock=stock)
    assert issues == []
    _, issues = found(PASSES + layers(110, 0), stock=stock)
    assert {issue.line for issue in issues} == {6, 7, 8}
    _, issues = found(layers(110, 100) + PASSES, stock=stock)  # its upper 20 mm gone: just enough
    assert issues == []


def test_a_rapid_passes_a_thin_wall_between_two_samples(found):
    """0.1 mm of wall that the nose meets for less than a sample at 2 m/s."""
    _, issues = found("G0 X0 Y-70\nG0 Z1\nG0 Y300\n", stock={"box_mm": [[40.0, 100, -9], [41, 100.4, 130]]})
    assert {issue.line for issue in issues} == {7}


def test_a_guessed_stock_gives_warnings(found):
    text = "G0 X-60\nG0 Z-130\nG1 X300 F3000\n"
    _, issues = found(f"G0 Z0\nG1 X300 F3000\nG0 Z50\n{text}")
    assert {issue.severity for issue in issues} <= {"warning"}


def test_the_program_is_refused_and_its_header_says_what_is_checked(found, tmp_path):
    prediction, issues = found(BESIDE, stock={"box_mm": [[20.0, -20, -60], [60, 40, 150]]})
    with pytest.raises(RefusedError, match="spindle hits the stock"):
        write_krl(prediction, tmp_path / "OUT.src")
    assert issues
    cuts = BESIDE.replace("X12", "X13")
    prediction, _ = found(cuts, stock={"box_mm": [[20.0, -20, -60], [60, 40, 20]]})
    text = write_krl(prediction, None).texts["PART.src"].decode()
    head = " ".join(text[:8000].replace("\r\n;", " ").split())
    assert "stock as it stands (by arm and spindle)" in head
    assert "NOT CHECKED for collisions: " in head
    assert "stock on the ways" not in head


def test_the_ptp_from_home_goes_through_the_raw_part(found):
    """A tower where the straight way of the joints from HOME passes."""
    _, free = found(BESIDE, stock={"box_mm": [[20.0, -20, -60], [60, 40, 90]]})
    assert free == []
    _, issues = found(BESIDE, stock={"box_mm": [[-400.0, -100, -60], [-60, 100, 900]], "resolution_mm": 2.0})
    ways = {issue.message.split(",")[0] for issue in issues if "PTP from HOME" in issue.message}
    assert ways
    assert all("hits the stock on the PTP from HOME" in way for way in ways)


def test_the_ptp_to_home_goes_through_what_still_stands(found):
    tower = [[-400.0, -100, -60], [-60, 100, 900]]
    _, issues = found(BESIDE, stock={"box_mm": tower, "resolution_mm": 2.0})
    ways = {issue.message.split(",")[0] for issue in issues if issue.message.count("PTP to HOME")}
    assert ways
    assert all("hits the stock on the PTP to HOME" in way for way in ways)
    assert all(issue.remedy.startswith("choose a higher") for issue in issues if "to HOME" in issue.message)


def on_ptp(issues):
    return {issue.message.split(",")[0] for issue in issues if " PTP " in issue.message}


def test_a_ptp_beside_a_post_that_is_gone_or_stands(found):
    more = {"stock": {"box_mm": POST, "resolution_mm": 0.5}, "clearance": {"z_mm": "none"}, "height": 125}
    low = "G0 X-30 Y-25\nG28 X-30 Y-25\nG0 X-30 Y-25 Z0\n"
    _, issues = found(low, **{**more, "height": 0})
    assert any(name.startswith("spindle hits the stock on the PTP to HOME") for name in on_ptp(issues))
    _, issues = found(layers(110, 0).replace("Z15", "Z0") + low, **more)
    assert on_ptp(issues) == set()


def test_holder_and_cutter_in_the_stock_on_a_ptp(found):
    """From within a slot the tip leaves sideways."""
    tool = over_demonstration().tool[1].model_dump(exclude_none=True)
    tool |= {"stick_out_mm": 40.0, "holder_diameter_mm": 50.0, "length_mm": 100.0}
    stock = {"box_mm": [[-60.0, -60, -60], [60, 60, 0]]}
    more = {"stock": stock, "tool": {"1": tool}, "clearance": {"z_mm": "none"}, "height": -30}
    _, issues = found("G0 X0 Y-80\nG1 Y80 F3000\n", **more)
    assert not any("to HOME" in name for name in on_ptp(issues))
    _, issues = found("G0 X0 Y-80\nG1 Y0 F3000\nG28 X0 Y0\n", **more)
    assert any(
        name.startswith("the cutter of T1 hits the stock on the PTP to HOME") for name in on_ptp(issues)
    )


def test_a_guessed_stock_gives_warnings_on_the_ways_too(found):
    _, issues = found("G0 X-250\nG0 Z20\nG1 Z0 F3000\nG1 X100\nG0 Z5\nG28 X100 Y0\n")
    assert {issue.severity for issue in issues} <= {"warning"}


def test_depths_are_those_of_every_cell_tried_by_hand(found, tmp_path):
    """Random capsules in a part that is half cut, against all columns of the field one by one."""
    (tmp_path / "part.nc").write_text(HEAD + layers(110, 60) + END)
    cell = cell_with(stock={"box_mm": POST, "resolution_mm": 0.7})
    toolpath = read_gcode(tmp_path / "part.nc", cell)
    motion = plan_motion(toolpath, cell)
    milling = Milling(toolpath, cell, outlook_of([motion]), 0.012, threads=2)
    milling.take(motion, ends=True)
    draw = np.random.default_rng(5)
    ends = np.concatenate([draw.uniform([-40, -40, -40], [60, 60, 200], (CAPSULES, 3)) for _ in "ab"], axis=1)
    radius = draw.uniform(3.0, 60.0, CAPSULES)
    depth, place = milling.bodies_in(ends, radius)
    part = milling.part()
    by_hand = np.array([deepest(part, *pair) for pair in zip(ends, radius, strict=True)])
    assert (depth >= by_hand - 1e-6).all()
    np.testing.assert_allclose(depth, by_hand, atol=0.05)  # the steps by hand are up to 0.2 mm wide
    assert 0.2 * CAPSULES < np.count_nonzero(depth > 0) < 0.95 * CAPSULES
    assert np.isfinite(place[depth > 0]).all()


def deepest(part, ends, radius):
    rows, columns = np.nonzero(part.height_mm > part.bottom_mm)
    top = part.height_mm[rows, columns].astype(float)
    x = part.origin_mm[0] + (columns + 0.5) * part.cell_mm[0]
    y = part.origin_mm[1] + (rows + 0.5) * part.cell_mm[1]
    steps = np.linspace(0.0, 1.0, 1001)[:, None]
    way = ends[:3] + steps * (ends[3:] - ends[:3])
    least = np.inf
    for at in way:
        above = np.maximum(0.0, np.maximum(at[2] - top, part.bottom_mm - at[2]))
        least = min(least, np.sqrt((x - at[0]) ** 2 + (y - at[1]) ** 2 + above**2).min())
    return max(0.0, radius - least)


def test_a_cell_without_arm_and_spindle_is_not_watched(tmp_path):
    (tmp_path / "part.nc").write_text(HEAD + BESIDE + END)
    cell = cell_with(stock={"box_mm": POST})
    bare = cell.model_copy(
        update={
            "robot": cell.robot.model_copy(update={"body": type(cell.robot.body)()}),
            "spindle": cell.spindle.model_copy(update={"body": None}),
        }
    )
    toolpath = read_gcode(tmp_path / "part.nc", bare)
    milling = Milling(toolpath, bare, outlook_of([plan_motion(toolpath, bare)]), 0.012)
    assert ArmInStock.of(toolpath, bare, milling) is None


def test_cables_that_touch_are_a_warning(found):
    """Cables on an outrigger beside the arm, where nothing else comes, through a wall."""
    cables = {"capsules": [{"from_mm": [0.0, 900, 0], "to_mm": [0.0, 900, 0], "radius_mm": 50}]}
    beam = box("beam", [-2000.0, 850, 0], [1000, 880, 2000])
    prediction, issues = found(BESIDE, obstacle=[beam], cables=cables)
    assert issues == []
    near = [issue for issue in prediction.issues if issue.code == "near"]
    assert any(issue.message.startswith("the cables ") for issue in near)
    assert {issue.severity for issue in near} == {"warning"}


def test_cables_in_the_raw_part_are_a_warning(found):
    """On the way in, where nothing else comes."""
    cables = {"capsules": [{"from_mm": [0.0, 900, 0], "to_mm": [0.0, 900, 0], "radius_mm": 50}]}
    wall = [[-2000.0, 850, 0], [1000, 880, 2000]]
    prediction, issues = found(BESIDE, stock={"box_mm": wall, "resolution_mm": 2.0}, cables=cables)
    assert issues == []
    near = [issue.message for issue in prediction.issues if issue.code == "near"]
    assert any(message.startswith("the cables may touch the stock on the PTP from HOME") for message in near)
