"""Distances of capsules against an independent library, python-fcl, and against sums by hand."""

import numpy as np
import pytest

from gcode2krl.collision import scene
from gcode2krl.collision.gaps import obstacle_gaps, segment_distances

POSES = 10_000
OFF_MM = 0.01


def torus(rings=40, sides=20):
    """Return the triangles of a closed ring of 300 mm with a section of 80 mm."""
    u, v = np.meshgrid(np.arange(rings), np.arange(sides), indexing="ij")

    def point(u, v):
        around, across = 2 * np.pi * u / rings, 2 * np.pi * v / sides
        far = 300 + 80 * np.cos(across)
        return np.stack([far * np.cos(around), far * np.sin(around), 80 * np.sin(across)], axis=-1)

    a, b, c, d = (point(u + i, v + j) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)))
    return np.concatenate([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)]).reshape(-1, 3, 3)


def random_capsules(seed, count=POSES, span_mm=700.0):
    rng = np.random.default_rng(seed)
    middle = rng.uniform(-span_mm, span_mm, (count, 3))
    way = rng.normal(size=(count, 3))
    way *= rng.uniform(1.0, 400.0, (count, 1)) / np.linalg.norm(way, axis=1, keepdims=True)
    return np.concatenate([middle - way / 2, middle + way / 2], axis=1)


def fcl_capsules(fcl, ends_mm, radius_mm):
    """Yield the oracle's capsules: their axis is z, and their middle the origin."""
    for ends in ends_mm:
        a, b = ends[:3], ends[3:]
        length = np.linalg.norm(b - a)
        z = (b - a) / length
        x = np.cross(z, [1.0, 0.0, 0.0] if abs(z[0]) < 0.9 else [0.0, 1.0, 0.0])
        x /= np.linalg.norm(x)
        place = fcl.Transform(np.stack([x, np.cross(z, x), z], axis=1), (a + b) / 2)
        yield fcl.CollisionObject(fcl.Capsule(radius_mm, length), place)


def answers(fcl, capsules, other):
    """Return the oracle's distances, negative where there is a contact."""
    far = []
    for capsule in capsules:
        if fcl.collide(capsule, other, fcl.CollisionRequest(), fcl.CollisionResult()):
            far.append(-1.0)
        else:
            request = fcl.DistanceRequest()
            far.append(fcl.distance(capsule, other, request, fcl.DistanceResult()))
    return np.array(far)


def agrees(gap_mm, far_mm):
    """Check that no contact is missed and distances are the same; return how many contacts there are."""
    hit = far_mm < 0
    unsure = np.abs(gap_mm) < 1e-3  # touching: either answer is right
    assert (hit == (gap_mm <= 0))[~unsure].all()
    apart = ~hit & (gap_mm > 0)
    assert np.abs(gap_mm - far_mm)[apart].max() < OFF_MM
    return int(hit.sum())


def test_capsule_and_mesh_against_the_oracle():
    fcl = pytest.importorskip("fcl", reason="python-fcl has no wheel for this platform")
    triangles = torus()
    model = fcl.BVHModel()
    model.beginModel(3 * len(triangles), len(triangles))
    model.addSubModel(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))
    model.endModel()
    ends = random_capsules(1)
    gap, _ = obstacle_gaps(ends, 30.0, scene.mesh(triangles))
    far = answers(fcl, fcl_capsules(fcl, ends, 30.0), fcl.CollisionObject(model))
    inside = gap < -30.0  # without a contact of the surface: the oracle's mesh is hollow
    assert 5 < inside.sum() < 500
    assert agrees(gap[~inside], far[~inside]) > 300


def test_capsule_and_box_against_the_oracle():
    fcl = pytest.importorskip("fcl", reason="python-fcl has no wheel for this platform")
    low, high = np.array([-200.0, -100.0, -50.0]), np.array([100.0, 400.0, 150.0])
    frame = turned_frame()
    ends = random_capsules(2)
    gap, _ = obstacle_gaps(ends, 40.0, scene.box(low, high, frame))
    place = fcl.Transform(frame[:3, :3], frame[:3, :3] @ (low + high) / 2 + frame[:3, 3])
    other = fcl.CollisionObject(fcl.Box(*(high - low)), place)
    assert agrees(gap, answers(fcl, fcl_capsules(fcl, ends, 40.0), other)) > 300


def test_capsule_and_capsule_against_the_oracle():
    fcl = pytest.importorskip("fcl", reason="python-fcl has no wheel for this platform")
    own, other = random_capsules(3, span_mm=300.0), random_capsules(4, span_mm=300.0)
    gap = segment_distances(own, other) - 80.0
    pairs = zip(fcl_capsules(fcl, own, 50.0), fcl_capsules(fcl, other, 30.0), strict=True)
    far = np.array([answers(fcl, [one], two)[0] for one, two in pairs])
    assert agrees(gap, far) > 500


def turned_frame():
    from gcode2krl import frames as fr

    return fr.transform([100.0, -50.0, 30.0], fr.rotation_from_abc(np.array([0.5, -0.8, 1.2])))


def test_a_plane_is_solid_behind_it():
    ends = np.array([[0, 0, 10, 0, 0, 30.0], [5, 5, -100, 5, 5, 40], [0, 0, 3, 9, 9, 3]])
    gap, place = obstacle_gaps(ends, 4.0, scene.plane([7, 7, 1], [0, 0, 2]))
    np.testing.assert_allclose(gap, [5.0, -105.0, -2.0])
    np.testing.assert_allclose(place[:2], [[0, 0, 1], [5, 5, 1]], atol=1e-12)


def test_the_inside_of_a_box_is_a_hit_and_distances_from_corner_edge_and_side_are_exact():
    cube = scene.box([0, 0, 0], [100, 100, 100], np.eye(4))
    ends = np.array(
        [
            [40, 40, 40, 60, 60, 60],
            [103, 104, 50, 103, 104, 90],
            [103, 104, 112, 200, 200, 200],
            [50, 50, 107, 50, 90, 107],
        ],
        dtype=float,
    )
    gap, place = obstacle_gaps(ends, 1.0, cube)
    np.testing.assert_allclose(gap, [-1.0, 4.0, 12.0, 6.0])
    np.testing.assert_allclose(place[2], [100, 100, 100])


def test_inside_a_closed_mesh_is_a_hit():
    gap, _ = obstacle_gaps(np.array([[300.0, 0, 0, 310, 0, 0]]), 5.0, scene.mesh(torus()))
    assert gap[0] < -60
    gap, _ = obstacle_gaps(np.array([[0.0, 0, -10, 0, 0, 10]]), 5.0, scene.mesh(torus()))
    assert gap[0] > 200  # the hole of the ring


def test_degenerate_segments_and_triangles_have_distances():
    point = np.array([[0.0, 0, 5, 0, 0, 5]])
    flat = np.array([[[0, 0, 0], [10, 0, 0], [20, 0, 0]], [[1, 1, 1], [1, 1, 1], [1, 1, 1]]], dtype=float)
    gap, _ = obstacle_gaps(point, 0.0, scene.mesh(flat))
    assert gap[0] == pytest.approx(np.sqrt(18))
    assert segment_distances(point, point + 3.0)[0] == pytest.approx(3 * np.sqrt(3))


@pytest.mark.parametrize("count", [1, 3, 4, 5, 17, 1600])
def test_the_tree_finds_what_all_triangles_find(count):
    triangles = torus()[:count]
    ends = random_capsules(5, 300)
    gap, place = obstacle_gaps(ends, 0.0, scene.mesh(triangles))
    every = [obstacle_gaps(ends, 0.0, scene.mesh(one[None]))[0] for one in triangles]
    if count < 1600:
        np.testing.assert_array_equal(gap, np.min(every, axis=0))
    assert np.isfinite(place).all()
