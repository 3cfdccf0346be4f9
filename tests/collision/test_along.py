"""Ways of the arm: nothing is missed between two rows, and the figures are those of a dense sampling."""

import numpy as np
import pytest

from gcode2krl import frames as fr
from gcode2krl.collision import scene
from gcode2krl.collision.along import EXACT_MM, EXACT_SHARE, SHORT_MM, Way
from gcode2krl.collision.gaps import obstacle_gaps, placed, segment_distances
from gcode2krl.robot.kinematics import flange_pose
from tests.collision.test_gaps import torus

GEOMETRY = np.array([350.0, 41.0, 675.0, 1150.0, 1000.0, 240.0])
LOW = np.radians([-120, -120, 0, -180, -110, -180])
HIGH = np.radians([120, -20, 140, 180, 110, 180])
BODIES = scene.bodies_of(
    [0, 1, 2, 3, 4, 5, 6, 6],
    [
        [0, 0, 0, 0, 0, 300],
        [0, 0, 400, 350, 0, 675],
        [0, 0, 0, 1150, 0, 0],
        [-150, 0, 0, 150, 0, 0],
        [-600, 0, 0, 0, 0, 0],
        [-50, 0, 0, 100, 0, 0],
        [0, 0, 0, 0, 0, 150],
        [150, 0, 100, 250, 0, 250],
    ],
    [300, 250, 180, 200, 150, 120, 90, 60],
    GEOMETRY,
)


def random_way(rng, rows, step_rad):
    """Return angles (rows, 6) along a straight way of the joints."""
    way = rng.normal(size=6)
    start = rng.uniform(LOW, HIGH)
    return start + np.arange(rows)[:, None] * step_rad * way / np.abs(way).max()


def watch(obstacles, pairs, near_mm=5.0, horizon_mm=50.0, is_sampled=False):
    return Way(
        BODIES, obstacles, pairs, GEOMETRY, near_mm=near_mm, horizon_mm=horizon_mm, is_sampled=is_sampled
    )


def test_the_frames_of_the_links_are_those_of_the_kinematics():
    rng = np.random.default_rng(0)
    q = rng.uniform(-np.pi, np.pi, (200, 6))
    position, rotation = flange_pose(q, GEOMETRY)
    ends = placed(q, GEOMETRY, BODIES)
    body = ends[:, 7]
    for end, local in ((0, [150, 0, 100]), (3, [250, 0, 250])):
        np.testing.assert_allclose(body[:, end : end + 3], position + rotation @ local, atol=1e-9)
    wrist = position - 240.0 * rotation[:, :, 2]
    np.testing.assert_allclose(ends[:, 4, 3:], wrist, atol=1e-9)  # link 4 ends in the wrist's centre
    elbow = ends[:, 2, 3:]
    np.testing.assert_allclose(np.linalg.norm(elbow - wrist, axis=1), np.hypot(1000, 41), atol=1e-9)


def test_levers_and_sagittas_hold_on_random_ways():
    """No end is farther from its chord than the bound, and the bound is not vacuous."""
    rng = np.random.default_rng(1)
    largest = np.zeros(len(BODIES.link))
    for _ in range(300):
        q0 = rng.uniform(LOW, HIGH)
        dq = rng.uniform(-0.3, 0.3, 6) * (rng.random(6) < 0.5)
        u = np.linspace(0, 1, 41)[:, None]
        ends = placed(q0 + u * dq, GEOMETRY, BODIES).reshape(41, -1, 2, 3)
        off = np.linalg.norm(ends - (ends[0] + u[:, :, None, None] * (ends[-1] - ends[0])), axis=-1).max(
            axis=(0, 2)
        )
        both = np.abs(dq)[:, None] * np.abs(dq)[None, :]
        outer = np.maximum(*np.indices((6, 6)))
        bound = np.array([(both * lever[outer]).sum() / 8 for lever in BODIES.lever_mm])
        assert (off <= bound + 1e-9).all()
        largest = np.maximum(largest, off / np.maximum(bound, 1e-12))
    assert (largest[1:] > 0.5).all()


def test_a_thousand_thin_plates_are_hit_at_speed():
    """Plates of 2 mm anywhere between two rows that are up to 250 mm apart, as boxes and as meshes."""
    rng = np.random.default_rng(2)
    missed = 0
    for number in range(1000):
        q = random_way(rng, 8, np.radians(rng.uniform(0.5, 5.0)))
        body = int(rng.integers(3, 8))
        row, u = int(rng.integers(1, 7)), rng.uniform(0.2, 0.8)
        pose = q[row] + u * (q[row + 1] - q[row])
        ends = placed(np.stack([pose - 1e-4 * (q[1] - q[0]), pose]), GEOMETRY, BODIES)[:, body]
        share = rng.uniform(0, 1)
        before, at = (e[:3] + share * (e[3:] - e[:3]) for e in ends)
        way = at - before
        if np.linalg.norm(way) < 1e-6:
            continue
        frame = frame_along(way, at)
        size = np.array([30.0, 30.0, 1.0])
        plate = scene.box(-size, size, frame)
        if number % 2:
            plate = scene.mesh(box_triangles(-size, size) @ frame[:3, :3].T + frame[:3, 3])
        found = watch(plate, [(body, 0, 0)]).take(q)
        missed += not (found.gap_mm[: row + 2] <= 0).any()
    assert missed == 0


@pytest.mark.parametrize("step_deg", [0.3, 2.0, 25.0])
def test_the_least_gap_is_that_of_a_dense_sampling(step_deg):
    rng = np.random.default_rng(3)
    seen_near = 0
    for _ in range(60):
        q = random_way(rng, 12, np.radians(step_deg))
        u = np.linspace(0, 1, 201)
        dense = (q[:-1, None] + u[:, None] * np.diff(q, axis=0)[:, None]).reshape(-1, 6)
        ends = placed(dense, GEOMETRY, BODIES)
        body = int(rng.integers(3, 8))
        middle = ends[rng.integers(len(ends)), body, :3] + rng.normal(size=3) * 150.0
        ball = scene.mesh(torus(12, 8) * rng.uniform(0.1, 0.6) + middle)
        for pair, gaps in (
            ((body, 0, 0), obstacle_gaps(ends[:, body], float(BODIES.radius_mm[body]), ball)[0]),
            (
                (body, -1, 1),
                segment_distances(ends[:, body], ends[:, 1]) - BODIES.radius_mm[body] - BODIES.radius_mm[1],
            ),
        ):
            if pair[1] >= 0 and gaps[0] < 0:
                continue
            found = watch(ball, [pair]).take(q)
            true = np.minimum(gaps.reshape(11, 201).min(axis=1), 50.0)
            gap = found.gap_mm[1:]
            hit, near = true <= 0, (true > 0) & (true < 5.0)
            assert (gap[hit] <= 0).all()
            allowed = np.maximum(EXACT_MM, EXACT_SHARE * true) + 0.05
            assert (gap <= np.where(hit, 0.0, np.where(near, true + allowed, 50.0)) + 1e-9).all()
            assert (gap[near] >= true[near] - SHORT_MM - 0.05).all()
            at_rows = np.minimum(gaps.reshape(11, 201)[:, -1], 50.0)
            far = true > 5.2
            assert (gap[far] >= true[far] - 0.05).all()
            assert (gap[far] <= at_rows[far] + 1e-9).all()  # not near: no more than the row's own
            seen_near += int(near.sum() + hit.sum())
    assert seen_near > 10


def test_blocks_and_full_notes_change_nothing():
    rng = np.random.default_rng(4)
    q = random_way(rng, 9000, 1e-4)
    ends = placed(q, GEOMETRY, BODIES)
    wall = scene.plane(ends[4000, 7, 3:] + 30.0, [1.0, 0.0, 0.0])
    pairs = [(7, 0, 0), (6, 0, 0), (7, -1, 1)]
    whole = watch(wall, pairs, near_mm=2000.0).take(q)
    assert len(whole.row) > 4096
    parts = watch(wall, pairs, near_mm=2000.0)
    pieces = [parts.take(each) for each in np.array_split(q, [1, 2, 700, 5000])]
    np.testing.assert_array_equal(whole.gap_mm, np.concatenate([piece.gap_mm for piece in pieces]))
    np.testing.assert_array_equal(whole.note_gap_mm, np.concatenate([piece.note_gap_mm for piece in pieces]))


@pytest.mark.parametrize("seed", range(30))
def test_rows_that_are_passed_by_would_have_told_nothing(seed):
    """Row by row, where each is looked at, against all at once, where some are passed by."""
    rng = np.random.default_rng([7, seed])
    rows = np.arange(400)[:, None]
    q = rng.uniform(LOW, HIGH) + 0.2 * np.sin(rng.uniform(0.002, 0.03, 6) * rows + rng.uniform(0, 6, 6))
    shift = rng.uniform(0.0, 300.0, 3) * np.sin(0.01 * rows) * (seed % 2)
    ends = placed(q, GEOMETRY, BODIES)[rng.integers(400), 7, 3:] + rng.normal(size=3) * 150.0
    obstacles = scene.joined(
        [
            scene.plane(np.array([0.0, 0.0, ends[2] - 1500.0]), [0.0, 0.0, 1.0]),
            scene.box(ends - 40.0, ends - 10.0, np.eye(4)),
            scene.mesh(0.2 * torus(20, 9) + ends),
        ]
    )
    pairs = [
        *((body, each, 0) for body in range(4, 8) for each in range(3)),
        (7, -1, 2),
        (6, -1, 0),
        (5, -1, 1),
    ]
    at_once = watch(obstacles, pairs, horizon_mm=0.0, is_sampled=seed % 3 > 0)
    one_by_one = watch(obstacles, pairs, horizon_mm=0.0, is_sampled=seed % 3 > 0)
    whole = at_once.take(q, shift)
    single = [one_by_one.take(q[k : k + 1], shift[k : k + 1]) for k in range(400)]
    np.testing.assert_allclose(whole.gap_mm, np.concatenate([each.gap_mm for each in single]), atol=1e-6)
    np.testing.assert_array_equal(whole.pair, np.concatenate([each.pair for each in single]))
    assert len(whole.row) == sum(len(each.row) for each in single)


def test_a_row_out_of_reach_begins_another_way():
    q = np.tile(np.radians([0, -90, 90, 0, 0, 0.0]), (4, 1))
    q[1] = np.nan
    q[2:, 0] = np.pi / 2
    ends = placed(q[[0, 2]], GEOMETRY, BODIES)[:, 7]
    between = scene.box(ends.mean(axis=0)[:3] - 20, ends.mean(axis=0)[:3] + 20, np.eye(4))
    found = watch(between, [(7, 0, 0)]).take(q)
    assert np.isnan(found.gap_mm[1])
    assert (found.gap_mm[[0, 2, 3]] == 50.0).all()


def test_a_way_that_begins_inside_a_mesh_is_a_hit_until_it_ends():
    q = np.tile(np.radians([0, -90, 90, 0, 0, 0.0]), (50, 1))
    q[:, 0] = np.linspace(0, 1.0, 50)
    tip = placed(q[:1], GEOMETRY, BODIES)[0, 7, 3:]
    ball = scene.mesh(box_triangles(tip - 500, tip + 500))
    gap = watch(ball, [(7, 0, 0)]).take(q).gap_mm
    leaves = int(np.argmax(gap > 0))
    assert (gap[:leaves] < 0).all()
    ends = placed(q, GEOMETRY, BODIES)[:, 7]
    solid = obstacle_gaps(ends, 60.0, scene.box(tip - 500, tip + 500, np.eye(4)))[0]
    assert leaves > 5
    assert leaves == int(np.argmax(solid > 0)) + 1  # the row in which it leaves is a hit too


def test_what_a_controllers_way_may_be_off_is_added():
    """Three rows on an arc: the way between them is off the chords by an eighth of the second difference."""
    angle = np.radians(2.0) * np.arange(30)
    q = np.zeros((30, 6)) + np.radians([0, -90, 90, 0, 0, 0.0])
    q[:, 0] += 0.05 * np.sin(20 * angle)
    ends = placed(q, GEOMETRY, BODIES)[:, 7]
    wall = scene.plane([0, ends[:, [1, 4]].max() + 60.2, 0], [0, -1, 0])
    plain = watch(wall, [(7, 0, 0)]).take(q).gap_mm
    sampled = watch(wall, [(7, 0, 0)], is_sampled=True).take(q).gap_mm
    assert (sampled <= plain).all()
    assert sampled.min() < plain.min()


def frame_along(way, origin):
    z = way / np.linalg.norm(way)
    x = np.cross(z, [1.0, 0, 0] if abs(z[0]) < 0.9 else [0, 1.0, 0])
    x /= np.linalg.norm(x)
    return fr.transform(origin, np.stack([x, np.cross(z, x), z], axis=1))


def box_triangles(low, high):
    """Return the 12 triangles of a box, outwards."""
    x, y, z = np.stack([low, high], axis=1)
    corner = np.array([[x[i], y[j], z[k]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return np.array(
        [corner[[a, b, c]] for q in quads for a, b, c in ((q[0], q[1], q[2]), (q[0], q[2], q[3]))]
    )
