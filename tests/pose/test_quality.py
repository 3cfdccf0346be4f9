"""How good poses are, beside the distances of all capsules; the turn keeps clear of obstacles."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gcode2krl import predict, set_targets
from gcode2krl.collision import HORIZON_MM, scene
from gcode2krl.collision.bodies import capsules_of, parts_of
from gcode2krl.collision.gaps import obstacle_gaps, placed, segment_distances
from gcode2krl.collision.surroundings import pairs_of
from gcode2krl.figures import figure_of
from gcode2krl.gcode import read_gcode
from gcode2krl.pose import spin_map, tool_rotation
from gcode2krl.pose.quality import Poses, Quality, quality_of
from gcode2krl.robot import inverse, pose_margins
from gcode2krl.tables import rows_of
from tests.test_clearance import PART, box, cell_with

POST = box("post", [-260.0, -60, 60], [-190, 60, 500])
"""Where the wrist is at a spin of 0."""


def searching(*obstacles, **more):
    cell = cell_with(*obstacles, **more)
    return cell.model_copy(update={"frames": cell.frames.model_copy(update={"spin": "auto"})})


@pytest.fixture
def part(tmp_path):
    file = tmp_path / "part.nc"
    file.write_text(PART)
    return file


def spins_deg(targets):
    turns = Rotation.from_quat(targets.rotation[2:-2]).as_euler("ZYX", degrees=True)[:, 0]
    return np.unique(turns.round(6))


def least_distance(cell, q_rad):
    """Return the least of all distances (n,) that the turn of the tool may change."""
    parts, post = parts_of(cell, 1), scene.box(*map(np.array, POST["box_mm"]), cell.base_matrix())
    ends = placed(q_rad, cell.robot.geometry.array(), capsules_of(parts, cell.robot.geometry.array()))
    gaps = []
    for body, obstacle, other in pairs_of(parts, ("post",)):
        if obstacle < 0:
            radii = parts[body].radius_mm + parts[other].radius_mm
            gaps.append(segment_distances(ends[:, body], ends[:, other]) - radii)
        elif parts[body].kind in ("arm", "spindle"):
            gaps.append(obstacle_gaps(ends[:, body], parts[body].radius_mm, post)[0])
    return np.min(gaps, axis=0)


def hits_on_the_cut(part, cell):
    issues = predict(part, cell, forces=False).issues
    return [each for each in issues if each.code == "collision" and " on the " not in each.message]


def test_a_post_behind_the_tool_turns_it(part):
    assert spins_deg(set_targets(read_gcode(part, searching()), searching())).tolist() == [0.0]
    assert hits_on_the_cut(part, cell_with(POST))
    (spin,) = spins_deg(set_targets(read_gcode(part, searching(POST)), searching(POST)))
    assert abs(spin) > 20
    assert hits_on_the_cut(part, searching(POST)) == []


def test_a_post_beside_a_long_move_turns_it(tmp_path):
    """At both ends of the move, which are its targets, the wrist is far from the post in any turn."""
    lines = ["G0 X0 Y-400 Z20", "G43 H1 Z20", "G1 Z-1 F500", "G1 Y400 F2000", "G0 Z50", "M30"]
    file = tmp_path / "long.nc"
    file.write_text("\n".join(["G21 G90 G17", "T1 M6", "S8000 M3", *lines]) + "\n")
    low = box("post", [-260.0, -60, 60], [-190, 60, 225])
    assert hits_on_the_cut(file, cell_with(low))
    assert spins_deg(set_targets(read_gcode(file, searching()), searching())).tolist() == [0.0]
    assert hits_on_the_cut(file, searching(low)) == []


def test_what_stands_between_two_cuts_does_not_turn_it_where_home_is_between(tmp_path):
    """The tool never goes along the line from one cut to the other."""
    lines = ["G21 G90 G17", "T1 M6", "S8000 M3", "G0 X0 Y-400 Z20", "G43 H1 Z20", "G1 Z-1 F500"]
    lines += ["G1 X10 F2000", "G0 Z20", "G28 Z0", "G28 X0 Y0", "G0 X0 Y400 Z20", "G1 Z-1 F500"]
    lines += ["G1 X10 F2000", "G0 Z20", "M30"]
    file = tmp_path / "two.nc"
    file.write_text("\n".join(lines) + "\n")
    low = box("post", [-260.0, -60, 60], [-190, 60, 330])
    assert hits_on_the_cut(file, cell_with(low)) == []
    assert spins_deg(set_targets(read_gcode(file, searching(low)), searching(low))).tolist() == [0.0]


def test_where_every_turn_hits_the_collision_is_told(part):
    room = box("room", [-2000.0, -2000, 200], [2000, 2000, 2000])
    assert hits_on_the_cut(part, searching(room))


def test_the_cutter_in_an_obstacle_does_not_spoil_the_choice(part):
    """What is round about the axis hits at every turn: the others still decide."""
    clamp = box("clamp", [60.0, -20, -10], [70, 20, 20])
    (spin,) = spins_deg(set_targets(read_gcode(part, searching(POST, clamp)), searching(POST, clamp)))
    assert abs(spin) > 20


def test_the_map_is_what_single_poses_are(part):
    cell = searching(POST)
    prediction = predict(part, cell, forces=False)
    seen = spin_map(prediction.motion, prediction.joints, cell)
    margin = seen.quality.free_margin()
    assert margin.shape == (72, len(seen.path_mm))
    chosen = np.rad2deg(seen.chosen_rad)
    assert chosen == pytest.approx(spins_deg(prediction.targets)[0], abs=1e-6)
    near = np.abs(seen.spin_rad[:, None] - seen.chosen_rad).argmin(axis=0)
    assert (margin[near, np.arange(len(near))] >= 0.3).all()
    at_zero = np.abs(seen.spin_rad).argmin()
    assert seen.quality.collides[at_zero].any()


def test_quality_is_the_least_distance_from_limits_singularities_and_obstacles():
    """Poses beside a box, against the distances of all capsules one by one."""
    cell = searching(POST)
    draw = np.random.default_rng(2)
    position = draw.uniform([-50, -100, 0], [200, 150, 100], (60, 3))
    rotation = tool_rotation(np.tile([0.0, 0.0, 1.0], (60, 1)), draw.uniform(-2.5, 2.5, 60))
    quality = quality_of(Poses(position, rotation, np.ones(60, dtype=np.int32)), cell)
    q_rad = inverse(position, rotation, cell, 1)
    limit_rad, sine = (each.reshape(60, 8) for each in pose_margins(q_rad.reshape(-1, 6), cell))
    assert (quality.reachable == (limit_rad >= 0.0)).all()
    rows = quality.reachable & (sine > 0.0)
    gap_mm, enough_mm = least_distance(cell, q_rad[rows]), 3.0 * cell.collision.clearance_mm
    assert (quality.collides[rows] == (gap_mm <= 0.0)).all()
    plain = np.minimum(np.minimum(np.degrees(limit_rad[rows]) / 30.0, 1.0), 2.0 * sine[rows])
    free = gap_mm > 0.0
    np.testing.assert_allclose(
        quality.margin[rows][free], np.minimum(plain, gap_mm / enough_mm)[free], atol=1e-6
    )
    np.testing.assert_allclose(quality.margin[rows][~free], 0.5 * plain[~free], atol=1e-9)
    assert 5 < np.count_nonzero(free) < len(free) - 5
    assert enough_mm < HORIZON_MM


@pytest.mark.parametrize("turns", [-1, 1])
def test_a_joint_counts_in_its_best_whole_turn(turns):
    """A6 of the demonstration's arm turns by 350 degrees each way: 340 of them are 20 in the other turn."""
    cell = searching()
    q_rad = np.radians([[0.0, -90.0, 90.0, 0.0, 45.0, 0.0]])
    q_rad[0, 5] = np.radians(turns * 340.0)
    plain = np.array(q_rad)
    plain[0, 5] -= turns * 2.0 * np.pi
    assert pose_margins(q_rad, cell)[0] == pytest.approx(pose_margins(plain, cell)[0])


QUALITIES = [
    (False, False, 0.0),
    (True, True, 0.1),
    (True, True, 0.4),
    (True, False, 0.0),
    (True, False, 0.9),
]
"""From the worst to the best."""


@pytest.mark.parametrize("first", range(5))
@pytest.mark.parametrize("second", range(5))
def test_a_hit_is_better_than_out_of_reach_and_worse_than_any_free_pose(first, second):
    both = Quality(*(np.array([[QUALITIES[first][k], QUALITIES[second][k]]]) for k in range(3)))
    for extreme, place in ((both.worst(axis=1), min(first, second)), (both.best(axis=1), max(first, second))):
        assert tuple(column[0] for column in extreme) == QUALITIES[place]


def test_a_prediction_of_one_sample_has_a_map(part, tmp_path):
    cell = searching(POST)
    prediction = predict(part, cell, forces=False)
    one = rows_of(prediction.motion, 0, 1)
    assert len(spin_map(one, prediction.joints, cell).path_mm) == 1
    figure_of(replace(prediction, motion=one), "spin").savefig(tmp_path / "spin.png")
