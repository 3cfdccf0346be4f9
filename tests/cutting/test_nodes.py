"""Where the engagement is read, which points of a path are one sweep, what samples between nodes get."""

import math
from itertools import pairwise

import numpy as np
import pytest

from gcode2krl.cell.sections import Tool
from gcode2krl.cutting.engagement import engage
from gcode2krl.cutting.height_field import HeightField
from gcode2krl.cutting.reading import mark_corners, mark_nodes
from gcode2krl.cutting.sweep import Samples
from tests.cutting.scenes import LAW

FLAT = Tool(diameter_mm=16, teeth=3, flute_length_mm=30)
BALL = Tool(kind="ball", diameter_mm=16, corner_radius_mm=8, teeth=2, flute_length_mm=30)


def path_of(corners, step_mm=0.2):
    """Return samples so far apart from corner to corner."""
    pieces = [np.array(corners[:1], float)]
    for a, b in pairwise(corners):
        a, b = np.array(a, float), np.array(b, float)
        count = math.ceil(np.linalg.norm(b - a) / step_mm)
        pieces.append(a + np.arange(1, count + 1)[:, None] / count * (b - a))
    return np.concatenate(pieces)


POCKET = path_of([(-12, 10, -4), (30, 10, -4), (30, 25, -4), (5, 25, -4), (5, 14, -4)])
WAVE = path_of([(x, 5 + 3 * math.sin(x / 6), -3 + math.sin(x / 4)) for x in np.arange(-12.0, 40.0, 0.5)])


def field(cell_mm=0.2):
    ny, nx = round(45 / cell_mm), round(55 / cell_mm)
    return HeightField(np.zeros((ny, nx), np.float32), np.array([-5.0, -10.0]), np.full(2, cell_mm), -20.0)


def run(position, tool, threads=1, f_z_mm=0.1, **options):
    count = len(position)
    feed = np.broadcast_to(np.asarray(f_z_mm, float), count)
    block = field()
    found = engage(
        block,
        position,
        np.zeros(count, np.int32),
        np.zeros(count, bool),
        feed,
        [tool],
        LAW,
        threads,
        **options,
    )
    return found, block


def nodes_of(position, direction, apart_mm, rapid=None, tool=None):
    count = len(position)
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(position, axis=0), axis=1))])
    tool = np.zeros(count, np.int32) if tool is None else tool
    node = np.empty(count, bool)
    samples = Samples(position, direction, way, np.zeros(count), tool, np.zeros(count, np.int64), node)
    rapid = np.zeros(count, bool) if rapid is None else rapid
    apart = np.full(tool.max() + 1, apart_mm)
    mark_nodes(samples, rapid, apart, 2.0 * apart, True, node, np.full(len(node), -np.inf))
    return node, way


def test_nodes_are_as_far_apart_as_asked_for_on_a_straight_way():
    position = np.stack([np.arange(0.0, 40.0, 0.1), np.zeros(400), np.zeros(400)], axis=1)
    node, way = nodes_of(position, np.tile([1.0, 0.0, 0.0], (400, 1)), 0.8)
    apart = np.diff(way[node])
    assert apart.max() <= 0.8 + 1e-9
    assert node.mean() < 0.15


def test_every_sample_behind_a_turn_is_a_node_and_none_is_between_two_sides_of_it():
    position = np.concatenate(
        [path_of([(0, 0, 0), (9.9, 0, 0)], 0.1), path_of([(9.9, 0.1, 0), (9.9, 10, 0)], 0.1)]
    )
    direction = np.repeat([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], 100, axis=0)
    node, _ = nodes_of(position, direction, 0.8)
    assert node[99:114].all()
    assert node[120:].mean() < 0.2


@pytest.mark.parametrize("what", ["rapid", "tool", "standing"])
def test_nothing_is_interpolated_across_a_change(what):
    position = np.stack([np.arange(0.0, 10.0, 0.1), np.zeros(100), np.zeros(100)], axis=1)
    direction = np.tile([1.0, 0.0, 0.0], (100, 1))
    late = np.arange(100) >= 53
    if what == "standing":
        direction[53] = 0.0
    options = {"rapid": {"rapid": late}, "tool": {"tool": late.astype(np.int32)}}.get(what, {})
    node, _ = nodes_of(position, direction, 0.8, **options)
    assert node[52:54].all()


@pytest.mark.parametrize("longest_mm", [0.5, 5.0, 500.0])
def test_sweeps_stay_on_the_path_and_are_no_longer_than_asked_for(longest_mm):
    count = len(WAVE)
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(WAVE, axis=0), axis=1))])
    none, corner = np.zeros(count, bool), np.empty(count, bool)
    first = np.arange(count) == 0
    mark_corners(
        WAVE, way, first, none, np.zeros(count, np.int32), np.array([longest_mm]), np.array([False]), corner
    )
    kept = np.flatnonzero(corner)
    assert corner[[0, -1]].all()
    assert (np.diff(way[kept]) <= longest_mm + 1e-9).all()
    assert len(kept) < count
    for a, b in pairwise(kept):
        chord = (WAVE[b] - WAVE[a]) / np.linalg.norm(WAVE[b] - WAVE[a])
        off = np.linalg.norm(np.cross(WAVE[a : b + 1] - WAVE[a], chord), axis=1)
        assert off.max() <= 5e-4 + 1e-12


@pytest.mark.parametrize("position", [POCKET, WAVE], ids=["pocket", "wave"])
@pytest.mark.parametrize("tool", [FLAT, BALL], ids=["flat", "ball"])
def test_what_lies_between_nodes_is_nearly_what_is_read_there(position, tool):
    every, exact = run(position, tool, nodes_per_diameter=math.inf)
    usual, part = run(position, tool)
    assert every.is_read.all()
    assert usual.is_read.mean() < 0.9
    np.testing.assert_array_equal(part.height_mm, exact.height_mm)
    apart = np.linalg.norm(usual.force_N - every.force_N, axis=1)
    size = np.linalg.norm(every.force_N, axis=1)
    assert np.sqrt(np.mean(apart**2)) < 0.02 * np.sqrt(np.mean(size**2))
    assert (np.isnan(usual.phi_rad[:, 0]) == np.isnan(every.phi_rad[:, 0])).all()


@pytest.mark.parametrize("tool", [FLAT, BALL], ids=["flat", "ball"])
def test_the_number_of_threads_changes_nothing(tool):
    results = [run(WAVE, tool, threads) for threads in (1, 2, 3)]
    for found, block in results[1:]:
        np.testing.assert_array_equal(block.height_mm, results[0][1].height_mm)
        for column, first in zip(found, results[0][0], strict=True):
            np.testing.assert_array_equal(column, first)


def test_the_force_of_a_sample_follows_its_own_feed():
    position = path_of([(-12, 10, -4), (30, 10, -4)])
    feed = 0.05 + 0.05 * np.cos(np.arange(len(position)) / 3.0) ** 2
    usual, every = (
        run(position, FLAT, f_z_mm=feed)[0],
        run(position, FLAT, f_z_mm=feed, nodes_per_diameter=math.inf)[0],
    )
    assert usual.is_read[100:200].mean() < 0.5
    np.testing.assert_allclose(usual.force_N[100:200], every.force_N[100:200], rtol=1e-3, atol=0.1)
