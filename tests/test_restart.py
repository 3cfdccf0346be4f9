"""A restart in the material: the stock as cut so far, the way down, the same path from there on."""

import io
from dataclasses import replace

import numpy as np
import pytest

from gcode2krl import read_gcode, set_targets, write_krl
from gcode2krl.errors import RefusedError
from gcode2krl.gcode import read_stream
from gcode2krl.pipeline import predict_toolpath
from gcode2krl.prediction import Prediction
from gcode2krl.restart.material import ABOVE_STOCK_MM, ENTRY_MM, restarted
from gcode2krl.restart.rows import begun_row
from tests import restart_trials as trials
from tests.cells import over_demonstration
from tests.conftest import EXAMPLES

BOX = [[0.0, -40.0, -20.0], [200.0, 40.0, 0.0]]
HEAD = "G21 G90 G17\nT1 M6\nS12000 M3\nG0 X-20 Y0\nG0 G43 H1 Z50\nG0 Z5\n"
SLOT = HEAD + "G1 Z-5 F600\nG1 X100 F1500\nG1 X180\nG0 Z50\nM30\n"
SECOND_HALF = 9


def stated(**more):
    return over_demonstration({"stock": {"box_mm": BOX}, **more})


def read(text, cell):
    return read_stream(io.BytesIO(text.encode("ascii")), "slot.nc", cell)


def test_the_forces_are_those_of_the_part_as_it_stands():
    cell = stated()
    path = read(SLOT, cell)
    whole, rest = predict_toolpath(path, cell), predict_toolpath(restarted(path, SECOND_HALF, cell), cell)
    full, left = (p.forces.force_base_N[p.motion.position_mm[:, 0] > 130.0] for p in (whole, rest))
    assert np.linalg.norm(left, axis=1).max() == pytest.approx(np.linalg.norm(full, axis=1).max(), rel=1e-3)
    down = rest.motion.position_mm[:, 0] < 99.0
    assert np.linalg.norm(rest.forces.force_base_N[down], axis=1).max(initial=0.0) < 1.0  # in its own slot


def test_from_the_raw_part_the_same_way_down_would_cut():
    """What the material as cut so far is for: without it the plunge meets the full block."""
    cell = stated()
    rest = restarted(read(SLOT, cell), SECOND_HALF, cell)
    raw = predict_toolpath(replace(rest, restart=replace(rest.restart, material=None)), cell)
    x_mm, z_mm = raw.motion.position_mm[:, 0], raw.motion.position_mm[:, 2]
    down = (abs(x_mm - 100.0) < 1e-6) & (z_mm < -1.0)
    assert np.linalg.norm(raw.forces.force_base_N[down], axis=1).max() > 50.0


def test_the_tool_comes_from_the_highest_safe_height_and_enters_at_feed():
    cell = stated(clearance={"z_mm": 40.0})
    rest = restarted(read(SLOT, cell), SECOND_HALF, cell)
    assert rest.position_mm[1:4].tolist() == [[100.0, 0.0, 50.0], [100.0, 0.0, ENTRY_MM], [100.0, 0.0, -5.0]]
    high = stated(stock={"box_mm": [BOX[0], [200.0, 40.0, 70.0]]})
    path = read(SLOT.replace("Z5\n", "Z75\n"), over_demonstration())
    assert restarted(path, 10, high).position_mm[1, 2] == pytest.approx(max(100.0, 70.0 + ABOVE_STOCK_MM))


def test_the_first_motion_is_a_ptp_above_and_the_guard_stands():
    cell = stated()
    path = read(SLOT, cell)
    whole, rest = predict_toolpath(path, cell), predict_toolpath(restarted(path, SECOND_HALF, cell), cell)
    texts = [trials.text_of(p) for p in (whole, rest)]
    assert trials.guard_of(texts[0]) == trials.guard_of(texts[1])
    assert trials.has_pose_guard(texts[1])
    assert texts[1].ptp.tolist()[:3] == [True, True, False]
    assert texts[1].position_mm[1].tolist() == [100.0, 0.0, 100.0]
    own = next(k for k, s in enumerate(texts[1].statements) if "Restart at line 9" in s.text)
    assert texts[1].statements[own + 2].text == "HALT"
    assert texts[1].statements[own].motion == 0


def test_a_corner_that_leaves_material_begins_at_the_line_before():
    cell = stated()
    corner = HEAD + "G64 P3\nG1 Z-5 F600\nG1 X100 F1500\nG1 Y20\nG1 X20\nG0 Z50\nM30\n"
    rest = restarted(read(corner, cell), 10, cell)
    assert (rest.restart.line, rest.restart.begins_line) == (10, 9)
    (issue,) = [i for i in rest.issues if i.code == "restart-line-before"]
    assert "begins at line 9" in issue.message
    assert rest.position_mm[rest.restart.way_rows].tolist() == [-20.0, 0.0, -5.0]


def test_where_the_line_before_begins_in_material_too_the_last_rapid_is_named():
    cell = stated()
    corners = HEAD + "G64 P3\nG1 Z-5 F600\nG1 X100 F1500\nG1 Y20\nG1 X20\nG0 Z50\nM30\n"
    with pytest.raises(RefusedError) as caught:
        restarted(read(corners, cell), 11, cell)
    (issue,) = caught.value.issues
    assert issue.code == "restart-in-stock"
    assert "--from-line 6, the last rapid before it" in issue.remedy


def test_a_rapid_through_stock_before_the_line_makes_the_material_doubtful():
    cell = stated()
    deep = HEAD + "G0 X100\nG0 Z-5\nG1 X120 F600\nG1 X180\nG0 Z50\nM30\n"
    rest = restarted(read(deep, cell), 9, cell)
    (issue,) = [i for i in rest.issues if i.code == "rapid-in-stock"]
    assert (issue.severity, issue.line) == ("error", 8)


def test_a_rapid_through_what_is_still_there_is_found_in_the_rest():
    cell = stated()
    across = SLOT.replace("G0 Z50\nM30", "G0 X100 Y30\nG0 Z50\nM30")
    rest = predict_toolpath(restarted(read(across, cell), SECOND_HALF, cell), cell)
    assert {i.line for i in rest.issues if i.code == "rapid-in-stock"} == {10}


def test_the_end_of_a_program_may_cut_nothing():
    cell = stated()
    rest = predict_toolpath(restarted(read(SLOT, cell), 10, cell), cell)
    assert not [i for i in rest.issues if i.severity == "error"]


def test_without_material_the_start_cannot_be_judged():
    cell = stated()
    rest = restarted(read(SLOT, cell), SECOND_HALF, cell.model_copy(update={"material": None}))
    (issue,) = [i for i in rest.issues if i.code == "restart-stock-unknown"]
    assert issue.severity == "error"


def test_a_line_that_leads_nowhere_and_names_no_tool_may_be_the_start():
    cell = stated(mounted_tool=1)
    twice = SLOT.replace("T1 M6\n", "").replace("G43 H1 ", "").replace("G1 X180", "G1 X100\nG1 X180")
    rest = restarted(read(twice, cell), 8, cell)
    assert rest.position_mm[rest.restart.way_rows].tolist() == [100.0, 0.0, -5.0]


def test_a_missing_tool_before_the_line_is_refused():
    cell = stated()
    two = HEAD.replace("T1 M6", "T77 M6").replace("H1", "H77") + "G1 Z-5 F600\nG0 Z50\n"
    two += "T1 M6\nS12000 M3\nG0 G43 H1 X0 Y0 Z50\nG1 Z1 F500\nG1 X10\nG0 Z50\nM30\n"
    with pytest.raises(RefusedError) as caught:
        restarted(read(two, cell), 13, cell)
    assert {i.code for i in caught.value.issues} == {"tool-unknown"}


def tilted(path, degrees):
    """The same path with a tool that leans along y."""
    axis = np.array([0.0, np.sin(np.radians(degrees)), np.cos(np.radians(degrees))])
    return replace(path, axis=np.broadcast_to(axis, (len(path), 3)))


def test_an_inclined_tool_comes_down_along_its_axis():
    cell = stated(stock={"box_mm": [[0.0, -40.0, -20.0], [200.0, 40.0, -4.0]]})
    path = tilted(read(SLOT, cell), 30.0)
    rest = restarted(path, SECOND_HALF, cell)
    points = rest.position_mm[1 : rest.restart.way_rows + 1]
    along = points[:-1] - points[-1]
    assert np.allclose(np.cross(along, path.axis[0]), 0.0, atol=1e-9)
    assert points[0, 2] == pytest.approx(100.0)
    assert points[-1].tolist() == [100.0, 0.0, -5.0]


def test_no_way_down_for_a_tool_that_lies():
    cell = stated()
    with pytest.raises(RefusedError) as caught:
        restarted(tilted(read(SLOT, cell), 75.0), SECOND_HALF, cell)
    assert [issue.code for issue in caught.value.issues] == ["restart-axis"]


def test_a_saved_restart_stays_one(tmp_path):
    cell = stated()
    prediction = predict_toolpath(restarted(read(SLOT, cell), SECOND_HALF, cell), cell)
    prediction.save(tmp_path / "prediction")
    loaded = Prediction.load(tmp_path / "prediction")
    assert loaded.targets.restart.line == SECOND_HALF
    text = write_krl(loaded, None, name="SLOT").texts["SLOT.src"]
    assert b"RESTART AT G-CODE LINE 9." in text


@pytest.mark.slow
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_random_lines_of_the_examples(example, tmp_path):
    done = trials.trials_of(example, 4, 7, tmp_path / "cell.toml")
    begun = [t for t in done if not t.refused]
    assert len(begun) >= 3
    assert all(t.path and t.rapid and t.guard for t in begun), done
    assert {t.refused for t in done} <= {"", "restart-line"}


def test_the_targets_behind_are_the_last_of_the_whole(cell):
    path = read_gcode(EXAMPLES[0], cell)
    line = int(path.source_line[len(path) // 2])
    rest = restarted(path, line, cell)
    whole, begun = set_targets(path, cell), set_targets(rest, cell)
    row, way = begun_row(path, line), rest.restart.way_rows
    full, part = whole.position_mm[whole.move >= row], begun.position_mm[begun.move > way]
    assert np.array_equal(full, part)
