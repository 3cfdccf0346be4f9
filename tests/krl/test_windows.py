"""When the controller reads and starts motions, and how triggers are placed by it."""

from types import SimpleNamespace

import numpy as np
import pytest

from gcode2krl.krl.announce import lasting
from gcode2krl.krl.triggers import place_triggers
from gcode2krl.krl.windows import Windows, _Clock, _straight_parts
from tests.cells import over_demonstration

ACCELERATION_MM_S2, TOP_MM_S, CRUISE_S = 2000.0, 100.0, 1.0
RAMP_S = TOP_MM_S / ACCELERATION_MM_S2
WAY_MM = TOP_MM_S * (RAMP_S + CRUISE_S)


def passed_s(path_mm):
    """Return when a motion from rest to rest, which begins at 0.1 s, is at a path."""
    ramp_mm = TOP_MM_S * RAMP_S / 2.0
    speeding = np.sqrt(2.0 * np.minimum(path_mm, ramp_mm) / ACCELERATION_MM_S2)
    cruising = np.clip(path_mm - ramp_mm, 0.0, TOP_MM_S * CRUISE_S) / TOP_MM_S
    left_mm = np.minimum(WAY_MM - path_mm, ramp_mm)
    return 0.1 + speeding + cruising + RAMP_S - np.sqrt(2.0 * left_mm / ACCELERATION_MM_S2)


@pytest.fixture
def clock():
    """Return the clock of that motion, sampled where its acceleration changes but not where it begins."""
    since_s = np.arange(-0.0875, 1.3, 0.0125)
    speed = np.interp(
        since_s, [0.0, RAMP_S, RAMP_S + CRUISE_S, 2 * RAMP_S + CRUISE_S], [0.0, TOP_MM_S, TOP_MM_S, 0.0]
    )
    up_s, down_s = np.clip(since_s, 0.0, RAMP_S), np.clip(since_s - RAMP_S - CRUISE_S, 0.0, RAMP_S)
    at_top_s = np.clip(since_s - RAMP_S, 0.0, CRUISE_S)
    path_mm = ACCELERATION_MM_S2 * (up_s**2 - down_s**2) / 2.0 + TOP_MM_S * (at_top_s + down_s)
    changes = (since_s > 1e-9) & (since_s < RAMP_S + 1e-9) | (since_s > RAMP_S + CRUISE_S - 1e-9)
    motion = SimpleNamespace(
        time_s=0.1 + since_s,
        path_mm=path_mm,
        speed_mm_s=speed,
        acceleration_mm_s2=np.where(changes & (speed > 0.0), ACCELERATION_MM_S2, 0.0),
    )
    cell = over_demonstration({"controller": {"k_s": 0.0}})
    return _Clock(motion, cell)


def test_a_path_is_passed_when_the_law_says(clock):
    path_mm = np.random.default_rng(3).uniform(0.01, WAY_MM - 0.01, 500)
    moving = np.zeros(500, dtype=np.bool_)
    for instants in (clock.arrival, clock.departure):
        np.testing.assert_allclose(instants(path_mm, moving), passed_s(path_mm), rtol=0, atol=1e-9)
        np.testing.assert_array_equal(instants(np.sort(path_mm), moving), np.sort(instants(path_mm, moving)))


def test_a_rest_ends_and_begins_with_the_motion(clock):
    at_rest = np.ones(1, dtype=np.bool_)
    assert clock.departure(np.zeros(1), at_rest)[0] == pytest.approx(0.1, abs=1e-9)
    end_s = 0.1 + CRUISE_S + 2 * RAMP_S
    assert clock.arrival(np.full(1, WAY_MM), at_rest)[0] == pytest.approx(end_s, abs=1e-9)


def test_corners_take_their_part_of_both_motions():
    chance, count, first = np.random.default_rng(4), 200, 3
    vertex_mm = np.cumsum(chance.normal(size=(count + 1, 3)), axis=0)
    length_mm = np.linalg.norm(np.diff(vertex_mm, axis=0), axis=1)
    kind = chance.integers(0, 3, count)  # of the vertex behind a move: corner, stop, straight on
    blend_mm, scale = (
        np.where(kind == 0, chance.uniform(0.1, 0.3, count), 0.0),
        chance.uniform(0.5, 1.0, count),
    )
    chain = SimpleNamespace(
        first=first,
        length_mm=length_mm,
        start_mm=vertex_mm[:-1],
        end_mm=vertex_mm[1:],
        blend_mm=blend_mm,
        scale=scale,
        stop=kind == 1,
    )
    targets = SimpleNamespace(cdis_mm=chance.uniform(0.1, 0.9, first + count + 5))
    straight_mm, head_mm, tail_mm = _straight_parts(chain, targets)
    heads, tails = [0.0], []
    for i in range(count - 1):
        near_mm = min(targets.cdis_mm[first + 1 + i], length_mm[i] / 2, length_mm[i + 1] / 2)
        beside = {0: blend_mm[i] * scale[i : i + 2], 1: (0.0, 0.0), 2: (near_mm, near_mm)}[int(kind[i])]
        tails.append(beside[0])
        heads.append(beside[1])
    np.testing.assert_allclose(head_mm, heads, rtol=1e-12)
    np.testing.assert_allclose(tail_mm, [*tails, 0.0], rtol=1e-12)
    expected_mm = np.maximum(length_mm - heads - [*tails, 0.0], 0.0)
    np.testing.assert_allclose(straight_mm, expected_mm, rtol=0, atol=1e-12)


CYCLE_S, OFF_S = 0.012, 0.0015
"""A motion's start in the samples may be so far off on either side."""


def windows_of_short_motions(chance, count):
    """Return motions of 5 to 60 ms with corners of up to 4 ms between."""
    length, corner = chance.uniform(0.005, 0.060, count), chance.uniform(0.0, 0.004, count)
    begin = np.concatenate([[0.0], np.cumsum(length + corner)[:-1]])
    row = np.arange(1, count + 1)
    zero = np.zeros(count)
    return Windows(
        row,
        row,
        begin,
        begin + length,
        begin,
        begin + length,
        zero,
        zero,
        np.zeros(1),
        np.zeros(0),
        np.zeros(0),
    )


def test_triggers_of_two_motions_never_act_in_one_cycle():
    chance = np.random.default_rng(1)
    cell = over_demonstration()
    between = 0
    for _ in range(40):
        windows = windows_of_short_motions(chance, 60)
        knot_s = 0.5 + np.cumsum(chance.choice([CYCLE_S, 0.02, 0.1], 20))
        triggers = place_triggers(knot_s - 0.042, np.zeros(20), windows, cell)
        placed = triggers.row >= 0
        fire_s, row = triggers.fire_s[placed], triggers.row[placed]
        gap_s, other = np.diff(fire_s), np.diff(row) > 0
        between += int((gap_s[other] < 0.02).sum())
        assert (gap_s >= CYCLE_S - 1e-9).all()
        assert (gap_s[other] >= CYCLE_S + 2 * OFF_S - 1e-9).all()
    assert between > 50, "the case occurs"


def test_one_end_at_a_standstill_is_no_time_lost():
    assert lasting(np.array([0.0, 0.0, -0.168, 0.0, 0.0])).max() == 0.0


def test_a_delay_that_stays_is_found_where_it_begins():
    assert np.flatnonzero(lasting(np.array([0.0, 0.0, 0.02, 0.02, 0.02])) > 0.006)[0] == 2
    assert lasting(np.array([0.0, 0.02])).max() == 0.02, "the last one counts"
