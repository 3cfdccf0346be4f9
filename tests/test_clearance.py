"""Collisions of whole programs: refused at the right line, with what hits what, on every way of the robot."""

import re

import numpy as np
import pytest

from gcode2krl import plan_motion, predict, robot, set_targets, solve_joints, write_krl
from gcode2krl.cell.checked_parts import collision_scope
from gcode2krl.chain import prepare
from gcode2krl.clearance import (
    collisions_beside,
    moves_watched_at_targets,
    shown_otherwise,
    watch_of,
    ways_beside,
)
from gcode2krl.clearance.proposals import ptp_way
from gcode2krl.collision import scene
from gcode2krl.collision.bodies import capsules_of, parts_of
from gcode2krl.collision.gaps import obstacle_gaps, placed
from gcode2krl.collision.surroundings import surroundings_of
from gcode2krl.errors import NotUnderstoodError, RefusedError
from gcode2krl.gcode import read_gcode
from gcode2krl.krl.release import released
from tests.cells import over_demonstration

PART = """G21 G90 G94
T1 M6
S10000 M3
G0 G43 H1 X0 Y0 Z50
G0 Z5
G1 Z-2 F1000
G1 X100
G1 Y60
G0 Z50
G0 X0 Y0
M5
M30
"""
SPINDLE = {
    "capsules": [
        {"from_mm": [0.0, 0.0, 40.0], "to_mm": [50.0, 0.0, 250.0], "radius_mm": 70.0},
        {"from_mm": [75.0, 0.0, 250.0], "to_mm": [-150.0, 0.0, 250.0], "radius_mm": 75.0},
    ]
}


def box(name, low, high, frame="base"):
    return {"name": name, "box_mm": [low, high], "frame": frame}


def cell_with(*obstacles, **more):
    spindle = {**over_demonstration().spindle.model_dump(exclude_none=True), "body": SPINDLE}
    return over_demonstration({"obstacle": list(obstacles), "spindle": spindle, **more})


def contacts(part, cell, code="collision"):
    issues = predict(part, cell, forces=False).issues
    return [issue for issue in issues if issue.code == code]


def test_a_free_cell_has_no_finding(part):
    cell = cell_with(box("vice", [-200.0, -200, -60], [-150, -150, 20]))
    assert contacts(part, cell) == []
    assert contacts(part, cell, "near") == []


def test_the_cutter_hits_a_box_in_its_way_at_the_line_where_it_begins(part):
    found = contacts(part, cell_with(box("clamp", [60.0, -20, -10], [70, 20, 20])))
    assert found[0].line == 7
    assert found[0].message.startswith("the cutter of T1 hits clamp, ")
    assert found[0].severity == "error"


def test_the_spindle_hits_what_the_cutter_passes_below(part):
    """Its nose is 100 mm above the tip and 75 mm wide: a beam over the end of the way, at Z 110 to 150."""
    found = contacts(part, cell_with(box("beam", [105.0, -200, 110], [120, 40, 150])))
    assert [issue.line for issue in found if issue.message.startswith("spindle hits beam, ")][:2] == [7, 8]
    assert not any("cutter" in issue.message for issue in found)


def test_what_a_plate_of_1_mm_in_a_rapid_is_found(part):
    cell = cell_with(box("plate", [50.0, 10, -100], [51, 100, 2]))
    assert [issue.line for issue in contacts(part, cell)] == []
    found = contacts(part, cell_with(box("plate", [50.0, -10, -100], [51, 100, 4])))
    assert [issue.line for issue in found] == [7]


def test_near_is_one_warning_for_each_pair(part):
    found = contacts(part, cell_with(box("clamp", [40.0, -20, -10], [60, -11, 20])), "near")
    assert [(issue.severity, issue.line) for issue in found] == [("warning", 7)]
    assert "the cutter of T1 comes within 2.3 mm of clamp" in found[0].message  # 11 - 8 · 1.082
    assert contacts(part, cell_with(box("clamp", [40.0, -20, -10], [60, -14, 20])), "near") == []
    wide = cell_with(box("clamp", [40.0, -20, -10], [60, -14, 20]), collision={"clearance_mm": 8.0})
    assert len(contacts(part, wide, "near")) == 1


def test_near_says_between_which_lines(part):
    found = contacts(part, cell_with(box("rail", [-20.0, -30, -10], [120, -11, 20])), "near")
    assert len(found) == 1
    assert found[0].line in (5, 6, 7)
    assert found[0].message.endswith("less than 5 mm; near from line 5 to 8")


def test_the_ptp_from_home_and_to_home_are_ways_of_the_joints(part):
    """A beam half-way between HOME and the part is above everything that the cut goes through."""
    cell = cell_with()
    plan = prepare(read_gcode(part, cell), cell)
    targets, joints = plan.targets, plan.joints
    home, above = joints.q_rad[0], joints.q_rad[1]
    assert targets.home[0]
    assert targets.ptp[1]
    middle, _ = robot.forward((home + above) / 2, cell)
    ends = robot.forward(np.stack([home, above]), cell)[0]
    straight = ends.mean(axis=0)
    assert np.linalg.norm(middle[0] - straight) > 20  # not the straight line between the poses
    cell = cell_with(box("beam", (middle[0] - 10).tolist(), (middle[0] + 10).tolist()))
    found = contacts(part, cell)
    ways = {issue.message.partition(" hits ")[2].partition(",")[0] for issue in found}
    assert ways == {"beam on the PTP from HOME", "beam on the PTP to HOME"}
    assert {issue.line for issue in found} == {4, 10}
    assert all("is free" in issue.remedy for issue in found)


def ptp_hits(part, cell):
    return [issue for issue in contacts(part, cell) if " on the PTP " in issue.message]


def test_a_higher_clearance_plane_is_proposed_and_is_free(part):
    block = box("block", [180.0, -100, 80], [260, 100, 420])
    found = ptp_hits(part, cell_with(block))
    assert {issue.line for issue in found} == {4, 10}
    (remedy,) = {issue.remedy for issue in found}
    z_mm = float(re.match(r"\[clearance\] z_mm = (\d+): ", remedy)[1])
    assert ptp_hits(part, cell_with(block, clearance={"z_mm": z_mm})) == []


def test_a_point_on_the_way_is_proposed_and_is_free(part, monkeypatch):
    """Where no higher plane helps: A1 first, or the other axes first."""
    monkeypatch.setattr("gcode2krl.clearance.proposals._HIGHER_MM", ())
    home = {"q_deg": [60.0, -90, 90, 0, 60, 0]}
    cell = cell_with(home=home)
    joints = prepare(read_gcode(part, cell), cell).joints
    from_home, above = joints.q_rad[0], joints.q_rad[1]
    middle = robot.forward((from_home + above)[None] / 2, cell)[0][0]
    cell = cell_with(box("post", (middle - 10).tolist(), (middle + 10).tolist()), home=home)
    found = ptp_hits(part, cell)
    assert {issue.line for issue in found} == {4, 10}
    for line, ends in ((4, (from_home, above)), (10, (above, from_home))):
        (remedy,) = {issue.remedy for issue in found if issue.line == line}
        axes = [float(angle) for angle in re.findall(r"A\d (-?[\d.]+)", remedy)]
        via = np.deg2rad(axes)
        assert np.isclose(via, ends[0], atol=2e-3).any()
        for one, other in ((ends[0], via), (via, ends[1])):
            assert not watch_of(cell).way(ptp_way(one, other), 1, 0, "", is_ptp=True).hits


def test_where_nothing_is_free_the_remedy_says_so(part):
    found = ptp_hits(part, cell_with(box("wall", [-700.0, -300, -60], [-500, 300, 1200])))
    assert all(issue.remedy.startswith("put HOME elsewhere, or move what is hit: ") for issue in found)


def test_the_approach_is_watched(part):
    found = contacts(part, cell_with(box("beam", [-30.0, -30, 60], [30, 30, 90])))
    assert any(" on the approach" in issue.message and issue.line == 4 for issue in found)


def test_a_way_to_home_within_the_program_is_one_of_the_joints(tmp_path):
    file = tmp_path / "part.nc"
    file.write_text(PART.replace("G0 X0 Y0\n", "G28 X0 Y0\nG0 X20 Y20 Z50\nG0 Z5\nG1 Z-1\nG0 Z50\n"))
    cell = cell_with(box("clamp", [15.0, 15, -5], [25, 25, 2]))
    plan = prepare(read_gcode(file, cell), cell)
    targets, joints = plan.targets, plan.joints
    inside = np.flatnonzero(targets.home)[1]
    assert shown_otherwise(targets)[inside]
    moves = moves_watched_at_targets(targets)
    assert targets.move[inside] in moves
    assert not shown_otherwise(targets)[targets.move == 7].any()
    found = contacts(file, cell)
    assert next(issue.line for issue in found if "cutter" in issue.message) in (12, 13)
    assert collisions_beside(ways_beside(targets, joints.q_rad, cell), targets, cell) == ()


def test_the_table_is_held_against_spindle_and_holder_not_against_the_cutter(part):
    tool = over_demonstration().tool[1].model_dump(exclude_none=True)
    tool |= {"stick_out_mm": 40.0, "holder_diameter_mm": 50.0, "length_mm": 100.0}
    deep = part.read_text().replace("G1 Z-2", "G1 Z-42")
    part.write_text(deep)
    cell = cell_with(table={"z_mm": 0.0}, tool={"1": tool})
    found = contacts(part, cell)
    assert {issue.message.partition(" hits ")[0] for issue in found} == {"the holder of T1"}
    assert [issue.line for issue in found] == [6, 7, 8, 9]


def test_the_arm_hits_a_wall_behind_the_work(part):
    wall = {"name": "wall", "frame": "robroot", "plane": {"point_mm": [0.0, -300.0, 0], "normal": [0, 1, 0]}}
    found = contacts(part, cell_with(wall))
    assert {"A2"} <= {issue.message.partition(" hits ")[0] for issue in found}
    lower = {**wall, "plane": {"point_mm": [0.0, 0, 0], "normal": [0, 0, 1]}}
    assert contacts(part, cell_with(lower)) == []


def test_the_arm_itself_is_hit_by_a_long_spindle(part):
    long = {"capsules": [{"from_mm": [0.0, 0, 40], "to_mm": [200.0, 0, -950], "radius_mm": 60.0}]}
    spindle = {**over_demonstration().spindle.model_dump(exclude_none=True), "body": long}
    found = contacts(part, over_demonstration({"spindle": spindle}))
    assert any("spindle hits A2 of the arm itself" in issue.message for issue in found)


def test_a_mesh_is_hit_like_the_box_that_it_is_and_a_bad_one_is_named(part, tmp_path):
    import trimesh

    mesh = trimesh.creation.box(bounds=[[60, -20, -10], [70, 20, 20]])
    mesh.export(tmp_path / "clamp.stl")
    cell = cell_with({"name": "clamp", "mesh": str(tmp_path / "clamp.stl")})
    as_box = cell_with(box("clamp", [60.0, -20, -10], [70, 20, 20]))
    assert [i.line for i in contacts(part, cell)] == [i.line for i in contacts(part, as_box)] != []
    (tmp_path / "empty.stl").write_text("solid s\nendsolid s\n")
    with pytest.raises(NotUnderstoodError, match="the mesh has no faces") as caught:
        predict(part, cell_with({"name": "clamp", "mesh": str(tmp_path / "empty.stl")}), forces=False)
    assert caught.value.source.endswith("empty.stl")


def test_a_collision_is_never_released_and_near_is_no_error(part):
    cell = cell_with(box("clamp", [60.0, -20, -10], [70, 20, 20]))
    issues = predict(part, cell, forces=False).issues
    with pytest.raises(NotUnderstoodError, match="collision cannot be released"):
        released(issues, ["collision"])
    with pytest.raises(RefusedError):
        write_krl(predict(part, cell, forces=False), None)


def test_the_header_says_part_by_part_what_was_checked(part):
    cell = cell_with(box("vice", [-200.0, -200, -60], [-150, -150, 20]), table={"z_mm": -60.0})
    text = write_krl(predict(part, cell, forces=False), None).texts["PART.src"].decode()
    plain = " ".join(text.replace("\n;", " ").split())
    assert "COLLISIONS CHECKED, from HOME to HOME: arm (12 capsules, ESTIMATED); spindle (2 capsules" in plain
    assert "against: table at z = -60 (by wrist, spindle, holder); vice; arm itself" in plain
    assert "NOT CHECKED for collisions: holder of T1" in plain
    assert "collision of arm, spindle and cables" not in plain


def test_without_a_motion_nothing_is_claimed(part):
    cell = cell_with(box("vice", [-200.0, -200, -60], [-150, -150, 20]))
    text = write_krl(set_targets(read_gcode(part, cell), cell), None, cell).texts["PART.src"].decode()
    assert "NOT CHECKED: collision of arm, spindle and cables with fixtures" in text
    assert "COLLISIONS CHECKED" not in text


def test_a_cell_that_describes_nothing_keeps_the_sentence(part):
    assert collision_scope(over_demonstration(), [1], is_cut=True) is None
    text = write_krl(predict(part, over_demonstration(), forces=False), None).texts["PART.src"].decode()
    assert "NOT CHECKED: collision of arm, spindle and cables with fixtures" in text


def test_a_robot_without_capsules_is_said_to_be_unchecked(part):
    cell = cell_with(box("vice", [-200.0, -200, -60], [-150, -150, 20]))
    bare = cell.model_copy(update={"robot": cell.robot.model_copy(update={"body": type(cell.robot.body)()})})
    scope = collision_scope(bare, [1], is_cut=True)
    assert any(word.startswith("arm (") for word in scope.unchecked)
    assert not any(word.startswith("arm") for word in scope.movers)


def test_a_prediction_tells_the_clearance_of_each_sample_and_keeps_it(part, tmp_path):
    cell = cell_with(box("clamp", [60.0, -40, -10], [70, -30, 20]))
    prediction = predict(part, cell, forces=False)
    samples = prediction.samples().to_pandas()
    near = samples[samples.clearance_obstacle == "clamp"]
    assert set(near.clearance_link) == {"the cutter of T1"}
    assert near.clearance_mm.min() == pytest.approx(30 - 8.66, abs=0.5)
    far = samples[samples.clearance_link == ""]
    assert (far.clearance_mm == 50.0).all()
    assert (samples.clearance_mm <= 50.0).all()
    prediction.save(tmp_path / "saved", csv=True)
    again = type(prediction).load(tmp_path / "saved")
    assert again.clearance.links == prediction.clearance.links
    np.testing.assert_array_equal(again.clearance.clearance_mm, prediction.clearance.clearance_mm)
    np.testing.assert_array_equal(again.samples().to_pandas().clearance_obstacle, samples.clearance_obstacle)


def test_a_prediction_without_obstacles_has_no_such_column(part):
    prediction = predict(part, over_demonstration(), forces=False)
    assert prediction.clearance is None
    assert "clearance_mm" not in prediction.samples().to_polars().columns


def test_a_motion_that_is_planned_only_for_its_times_reads_no_mesh(part, tmp_path):
    missing = cell_with(box("clamp", [60.0, -40, -10], [70, -30, 20]))
    targets = set_targets(read_gcode(part, missing), missing)
    gone = missing.obstacle[0].model_copy(update={"box_mm": None, "mesh": str(tmp_path / "gone.stl")})
    cell = missing.model_copy(update={"obstacle": (gone,)})
    assert len(plan_motion(targets, cell, watches=False)) > 100
    with pytest.raises(NotUnderstoodError, match="cannot read the obstacle: no such file"):
        plan_motion(targets, cell)


def test_an_effect_keeps_the_clearance_with_its_motion(part):
    cell = cell_with(box("clamp", [60.0, -40, -10], [70, -30, 20]))
    prediction = predict(part, cell, forces=False, effects=["backlash:target=A2,gap_deg=0.02"])
    assert len(prediction.clearance) == len(prediction.motion)
    other = predict(part, cell, forces=False, effects=["velocity_rule:k_s=0.2"])
    assert other.clearance is None or len(other.clearance) == len(other.motion)


@pytest.mark.slow
def test_random_boxes_are_hit_by_what_a_dense_sampling_says_at_its_lines(part):
    """30 boxes near any part of the arm, the spindle or the cutter, 10 of them near a PTP."""
    rng = np.random.default_rng(5)
    base = cell_with()
    geometry = base.robot.geometry.array()
    toolpath = read_gcode(part, base)
    plan = prepare(toolpath, base)
    targets, joints = plan.targets, plan.joints
    motion = plan_motion(targets, base, 0.004)
    parts = parts_of(base, 1)
    bodies = capsules_of(parts, geometry)
    cut = placed(solve_joints(motion, base).q_rad, geometry, bodies)
    ways = [np.linspace(*joints.q_rad[rows], 3000) for rows in ([0, 1], [-2, -1])]
    ptp = placed(np.concatenate(ways), geometry, bodies)
    line = toolpath.source_line[motion.move]
    hits = 0
    for number in range(30):
        ends = ptp if number % 3 == 0 else cut
        row, body, u = int(rng.integers(len(ends))), int(rng.integers(1, len(parts))), rng.uniform()
        middle = (1 - u) * ends[row, body, :3] + u * ends[row, body, 3:]
        middle = middle + 0.6 * parts[body].radius_mm * rng.normal(size=3)
        cell = cell_with(box("box", (middle - 10).tolist(), (middle + 10).tolist(), "robroot"))
        shape = scene.box(middle - 10, middle + 10, np.eye(4))
        sure, grazed, sure_ptp, grazed_ptp = set(), set(), set(), set()
        for one, each in enumerate(parts):
            if each.link == 0:
                continue
            gap, gap_ptp = (
                obstacle_gaps(ends[:, one], float(bodies.radius_mm[one]), shape)[0] for ends in (cut, ptp)
            )
            sure |= {(each.name, at) for at in np.unique(line[gap < -0.05]).tolist()}
            near = np.convolve(gap < 0.3, np.ones(4))[: len(gap)] > 0  # up to the next sample at 12 ms
            grazed |= {(each.name, at) for at in np.unique(line[near]).tolist()}
            sure_ptp |= {each.name} if (gap_ptp < -0.05).any() else set()
            grazed_ptp |= {each.name} if (gap_ptp < 0.3).any() else set()
        found = [(issue.message.partition(" hits "), issue.line) for issue in contacts(part, cell)]
        on_ptp = {who for (who, _, rest), _ in found if " PTP " in rest}
        plain = {(who, at) for (who, _, rest), at in found if " on " not in rest.partition(",")[0]}
        assert sure <= plain <= grazed
        assert sure_ptp <= on_ptp <= grazed_ptp
        hits += bool(sure) + bool(sure_ptp)
    assert hits > 20


def test_obstacles_stand_in_their_frames(part):
    """The same box in a turned ``$BASE``, and in the robot root: the same gap."""
    turned = {"x_mm": 1500.0, "y_mm": 0.0, "z_mm": 800.0, "a_deg": 30.0, "b_deg": 0.0, "c_deg": 0.0}
    frames = over_demonstration().frames.model_dump(exclude_none=True) | {"base": turned}
    inside = [60.0, -20, -10], [70, 20, 20]
    assert [i.line for i in contacts(part, cell_with(box("clamp", *inside), frames=frames))][:1] == [7]
    base = cell_with(frames=frames).base_matrix()
    middle = (base @ [65.0, 0, 5, 1])[:3]
    found = contacts(
        part, cell_with(box("clamp", (middle - 5).tolist(), (middle + 5).tolist(), "robroot"), frames=frames)
    )
    assert [i.line for i in found][:1] == [7]
    assert "at X 59.3 Y 0.0 Z 6.7 in $BASE" in found[0].message


def test_the_table_is_that_of_a_robot_that_hangs(part):
    """``$WORLD`` upside down for the robot: the table's free side is up in ``$BASE`` all the same."""
    hanging = {"x_mm": 0.0, "y_mm": 0.0, "z_mm": 2400.0, "a_deg": 0.0, "b_deg": 0.0, "c_deg": 180.0}
    frames = over_demonstration().frames.model_dump(exclude_none=True) | {"robroot": hanging}
    scene_of = surroundings_of(cell_with(table={"z_mm": -60.0}, frames=frames), lambda file: np.empty(0))
    np.testing.assert_allclose(scene_of.shapes.numbers[0, :4], [0, 0, -1, -(2400 - 740)], atol=1e-9)


def test_the_report_and_the_list_of_the_cell_name_the_parts(part):
    from gcode2krl.cli.cell_list import to_confirm
    from gcode2krl.report.page.content import content_of

    cell = cell_with(box("vice", [-200.0, -200, -60], [-150, -150, 20]))
    said = " ".join(content_of(predict(part, cell, forces=False)).not_checked)
    assert "Checked are arm (12 capsules, ESTIMATED); spindle (2 capsules, ESTIMATED); cutter of T1" in said
    assert "against vice; arm itself" in said
    plain = " ".join(content_of(predict(part, over_demonstration(), forces=False)).not_checked)
    assert "Collisions of arm, spindle, holder and cables with anything" in plain
    rows = {what: value for what, value, _ in to_confirm(cell)}
    assert rows["obstacle vice"] == "box -200 -200 -60 to -150 -150 20 mm in $BASE"
    assert rows["spindle body"] == "2 capsules in the flange frame"
