"""The capsules of the robots in the library: complete, with a source, and no false alarm on the floor."""

import numpy as np
import pytest

from gcode2krl.cell import library, resolve_cell
from gcode2krl.collision import scene
from gcode2krl.collision.along import Way
from gcode2krl.collision.bodies import FOOT, capsules_of, parts_of
from gcode2krl.collision.surroundings import pairs_of

ROBOTS = library.names("robots")
HOME = np.radians([[0, -90, 90, 0, 0, 0], [0, -90, 90, 0, 90, 0]])


def watched(cell, obstacle, pairs, q):
    parts, geometry = parts_of(cell, 1), cell.robot.geometry.array()
    way = Way(
        capsules_of(parts, geometry), obstacle, pairs, geometry, near_mm=5, horizon_mm=2000, is_sampled=False
    )
    return way.take(q).gap_mm


@pytest.mark.parametrize("name", ROBOTS)
def test_each_link_has_capsules_with_source_and_how_sure(name):
    body = resolve_cell({"robot": {"model": name}}).robot.body
    links = [capsule.link for capsule in body.capsules]
    assert sorted(set(links)) == ["A1", "A2", "A3", "A4", "A5", "A6", "foot"]
    assert max(links.count(link) for link in links) <= 3
    assert body.sure == ("assumption" if body.source.startswith("estimated") else "checked")
    assert "kuka_experimental@" in body.source


@pytest.mark.parametrize("name", ROBOTS)
def test_an_arm_on_the_floor_hits_neither_the_floor_nor_itself_at_home(name):
    cell = resolve_cell({"robot": {"model": name}})
    parts = parts_of(cell, 1)
    floor = scene.plane([0, 0, 0], [0, 0, 1])
    moving = [(number, 0, 0) for number, part in enumerate(parts) if part.link != FOOT]
    assert (watched(cell, floor, moving, HOME) > 5).all()
    assert (watched(cell, floor, pairs_of(parts, ()), HOME) > 50).all()


@pytest.mark.parametrize("name", ROBOTS)
def test_capsules_reach_from_axis_to_axis(name):
    """Seen from the side, axis A2, the forearm and the wrist's centre lie within their links' capsules."""
    cell = resolve_cell({"robot": {"model": name}})
    arm = cell.robot.geometry
    ends = {"A2": [0.0, 0, 0], "A3": [arm.c3_mm * 0.2, 0, -arm.a2_mm], "A5": [0.0, 0, 0]}
    for link, point in ends.items():
        sizes = [
            _distance(np.array(point)[::2], np.array([c.from_mm, c.to_mm])[:, ::2]) - c.radius_mm
            for c in cell.robot.body.capsules
            if c.link == link
        ]
        assert min(sizes) < 0, link


def _distance(point, ends):
    way = ends[1] - ends[0]
    t = np.clip((point - ends[0]) @ way / max(way @ way, 1e-9), 0, 1)
    return np.linalg.norm(point - ends[0] - t * way)
