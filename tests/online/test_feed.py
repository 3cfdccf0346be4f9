"""The direction of the feed from commanded positions."""

import numpy as np

from gcode2krl.cell.sections.online import Online
from gcode2krl.online.feed import feed_of, feed_start

SETTINGS = Online()


def test_a_line_has_its_direction_within_a_degree_though_rounded_to_hundredths():
    along = np.array([0.6, 0.8, 0.0])
    position = np.round(0.1 * np.arange(100)[:, None] * along, 2)
    _, feed = feed_of(feed_start(SETTINGS), position)
    unit = feed[10:] / np.linalg.norm(feed[10:], axis=1, keepdims=True)
    assert np.degrees(np.arccos(np.clip(unit @ along, -1, 1))).max() < 1.5


def test_a_robot_that_stands_keeps_its_direction_and_has_none_before_it_moved():
    position = np.zeros((60, 3))
    position[20:40, 1] = 0.1 * np.arange(20)
    position[40:, 1] = 1.9
    _, feed = feed_of(feed_start(SETTINGS), position)
    assert not feed[:20].any()
    assert (feed[30:, 1] > 0.0).all()
    assert not feed[:, [0, 2]].any()


def test_samples_one_by_one_give_the_same():
    position = np.cumsum(np.random.default_rng(2).normal(size=(50, 3)), axis=0)
    _, whole = feed_of(feed_start(SETTINGS), position)
    state, parts = feed_start(SETTINGS), []
    for row in position:
        state, feed = feed_of(state, row[None])
        parts.append(feed)
    assert np.array_equal(np.concatenate(parts), whole)
