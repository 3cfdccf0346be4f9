"""The distance of a corner to its blended curve, against the curve itself drawn point by point."""

import numpy as np
import pytest

from gcode2krl import load_cell, plan_motion, set_targets
from gcode2krl.chain import corner_errors
from gcode2krl.krc4 import build_chain
from gcode2krl.krc4.laws import parabola_distance
from tests.krl.conftest import read

HEAD = "G21 G90 G17 G54\nT1 M6\nS9000 M3\nG0 G43 H1 Z20\nG0 X0 Y0\nG0 Z2\nG64 P0.05\nG1 Z0 F600\n"
FOOT = "G0 Z20\nM30\n"


def drawn_distance(p_mm, q_mm, turn_rad):
    """Smallest distance to the corner of a Bezier curve (C1, corner, C2), by drawing it ever finer."""
    u, w = np.array([1.0, 0.0]), np.array([np.cos(turn_rad), np.sin(turn_rad)])
    low, high = 0.0, 1.0
    for _ in range(8):
        t = np.linspace(low, high, 2001)[:, None]
        away = np.linalg.norm(t**2 * q_mm * w - (1 - t) ** 2 * p_mm * u, axis=1)
        nearest, step = float(t[np.argmin(away), 0]), (high - low) / 2000
        low, high = max(nearest - 2 * step, 0.0), min(nearest + 2 * step, 1.0)
    return away.min()


def test_any_corner_against_the_drawn_curve():
    chance = np.random.default_rng(7)
    p, q = (10.0 ** chance.uniform(-3, 2, 400) for _ in range(2))
    p[::4] = q[::4]
    turn = np.pi * chance.uniform(0, 1, 400) ** 2 * (1 - 1e-6)
    turn[::10] = 1e-4
    found = parabola_distance(p, q, np.sin(turn / 2))
    for k in range(len(p)):
        assert found[k] == pytest.approx(drawn_distance(p[k], q[k], turn[k]), rel=1e-6, abs=1e-9)


def test_no_distance_no_error():
    zero = np.zeros(3)
    assert parabola_distance(zero, zero, np.array([0.0, 0.5, 1.0])).tolist() == [0.0, 0.0, 0.0]


def test_a_nearly_straight_vertex_where_the_feed_changes_keeps_its_tolerance():
    """1500 to 800 mm/min over 0.05 degrees: the change of speed happens in a corner some µm beside it."""
    cell = load_cell()
    toolpath = read(f"{HEAD}G1 X30 F1500\nG1 X59.99995 Y0.02618 F800\n{FOOT}", cell)
    targets = set_targets(toolpath, cell)
    error_mm, findings = corner_errors(toolpath, targets, cell)
    assert findings == ()
    assert 0.0005 < error_mm[2] < 0.005
    chain = build_chain(targets, cell)
    assert chain.scale[3] != chain.scale[2]
    fine = plan_motion(targets, cell, 1e-4)
    away = np.linalg.norm(fine.position_mm - chain.end_mm[2], axis=1).min()
    assert error_mm[2] == pytest.approx(away, abs=1e-4)  # samples are 2.5 µm apart


def test_a_wide_corner_at_unequal_speeds_is_as_far_off_as_its_motion():
    cell = load_cell()
    text = HEAD.replace("P0.05", "P2") + "G1 X60 F600\nG1 X100 Y40 F900\nG1 X60 Y90 F500\n" + FOOT
    toolpath = read(text, cell)
    targets = set_targets(toolpath, cell)
    error_mm, findings = corner_errors(toolpath, targets, cell)
    assert findings == ()
    chain, fine = build_chain(targets, cell), plan_motion(targets, cell, 5e-4)
    for corner in (2, 3):
        assert chain.scale[corner + 1] != chain.scale[corner]
        away = np.linalg.norm(fine.position_mm - chain.end_mm[corner], axis=1).min()
        assert 0.5 < error_mm[corner] <= 2.0
        assert error_mm[corner] == pytest.approx(away, abs=1e-4)
