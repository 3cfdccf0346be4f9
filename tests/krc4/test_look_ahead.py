"""$ADVANCE: the controller must be able to stop at the end of the moves that it sees."""

import numpy as np
import pytest

from gcode2krl.compiled.core import FLOATS, OUT_FLOATS, core_function
from tests.krc4 import oracle
from tests.krc4.conftest import HEAD, K_S, polyline, straight

A_MM_S2 = 2000.0
V_MM_S = 75.0  # F4500
FINE_S = 0.002
STRAIGHT = straight([0.5] * 300, [V_MM_S] * 300)


def bow(count=300, chord_mm=0.5, radius_mm=60.0):
    """Return a program of short chords of a circle."""
    angle = (np.arange(count + 1) - count / 2) * chord_mm / radius_mm
    places = [(radius_mm * np.cos(t), radius_mm * np.sin(t), 0.0) for t in angle]
    return polyline(places, [V_MM_S] * count)


def stopping_mm(speed):
    return 0.5 * speed * (speed / A_MM_S2 + K_S)


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        (straight([20, 5, 0.5, 30], [50] * 4), [(20, 50, 0), (5, 50, 0), (0.5, 50, 0), (30, 50, 0)]),
        (bow(6, 8.0), [(2 * 60 * np.sin(8 / 60 / 2), V_MM_S, 0)] * 6),
    ],
    ids=["line", "bow"],
)
def test_without_advance_every_vertex_is_an_exact_stop(run_program, text, lines):
    motion = run_program(text, dt_s=FINE_S, advance=0, cdis_mm=0.1)
    wanted = oracle.with_stops(lines, A_MM_S2, K_S)
    assert motion.time_s[-1] == pytest.approx(wanted.duration_s, abs=0.012)
    assert np.abs(motion.path_mm - wanted.position(motion.time_s)).max() < 1e-3
    assert not motion.corner.any()


@pytest.mark.parametrize("text", [STRAIGHT, bow()], ids=["line", "bow"])
def test_more_look_ahead_is_never_slower(run_program, text):
    duration = {
        advance: run_program(text, advance=advance).time_s[-1] for advance in (0, 1, 2, 3, 5, "unlimited")
    }
    assert duration[0] > duration[1] > duration[2] > duration[3] > duration[5] > duration["unlimited"]
    assert duration[0] == pytest.approx(300 * (0.5 / V_MM_S + V_MM_S / A_MM_S2 + K_S), rel=0.01)
    assert duration["unlimited"] == pytest.approx(150 / V_MM_S + V_MM_S / A_MM_S2 + K_S, rel=0.01)


@pytest.mark.parametrize("advance", [1, 2, 3, 4, 5])
def test_can_stop_at_the_end_of_what_it_sees(run_program, advance):
    motion = run_program(STRAIGHT, dt_s=FINE_S, advance=advance)
    vertices = 0.5 * np.arange(1, 301 - advance)  # beyond these the final stop is under way
    speed = np.interp(vertices, motion.path_mm, motion.speed_mm_s)
    assert stopping_mm(speed).max() <= 1.05 * advance * 0.5
    assert motion.path_mm[-1] == pytest.approx(150, abs=1e-6)
    assert motion.speed_mm_s.max() < V_MM_S


def test_mixed_lengths_keep_the_bound(run_program):
    lengths = np.round(np.random.default_rng(3).choice([0.2, 0.5, 1.0, 3.0, 12.0], 120), 3)
    motion = run_program(straight(lengths, [V_MM_S] * 120, start_mm=-150), dt_s=FINE_S, advance=3)
    ends = np.cumsum(lengths)
    speed = np.interp(ends[:-1], motion.path_mm, motion.speed_mm_s)
    later = np.interp(ends[:-1] + 0.02, motion.path_mm, motion.speed_mm_s)
    seen = np.array([lengths[m + 1 : m + 4].sum() for m in range(119)])
    steady = later >= speed * (
        1 - 1e-3
    )  # while it slows down, the way to stop is shorter than at a steady speed
    assert steady[:-3].sum() > 30
    assert (stopping_mm(speed) <= 1.05 * seen)[steady].all()
    assert motion.path_mm[-1] == pytest.approx(ends[-1], abs=1e-6)
    assert np.isfinite(motion.acceleration_mm_s2).all()
    assert motion.acceleration_mm_s2.max() <= V_MM_S / K_S * (1 + 1e-6)


def test_long_moves_are_not_slowed(run_program):
    """Where every move is longer than the way to stop, look-ahead does nothing."""
    text = straight([30, 25, 40, 30], [V_MM_S] * 4)
    seeing, unlimited = (run_program(text, advance=advance) for advance in (3, "unlimited"))
    assert len(seeing) == len(unlimited)
    assert np.abs(seeing.position_mm - unlimited.position_mm).max() < 1e-6


def test_cost_is_reported_as_unverified(run_program):
    motion = run_program(STRAIGHT, advance=3)
    found = [issue for issue in motion.issues if "unverified" in issue.message]
    assert found
    first = HEAD.count("\n") + 3
    assert any(first <= issue.line <= first + 300 for issue in found)
    assert any(" s" in issue.message for issue in found)
    assert any(issue.remedy for issue in found)


def test_nothing_is_reported_without_a_cost(run_program):
    for text, advance in ((STRAIGHT, "unlimited"), (straight([100, 80], [V_MM_S] * 2), 3)):
        issues = run_program(text, advance=advance).issues
        assert not any("unverified" in issue.message and "look" in issue.message for issue in issues)


@pytest.mark.parametrize("seed", range(5))
def test_the_speed_at_a_vertex_is_the_largest_from_which_all_others_can_be_met(seed):
    """Closed form beside the two passes: u_i² = min over j of v_j² + 2·Σ a·L of the runs between i and j."""
    draw = np.random.default_rng(seed)
    length = draw.uniform(0.0, 3.0, 40) * (draw.uniform(size=40) > 0.1)
    acceleration = draw.uniform(500.0, 4000.0, 40)
    bound = draw.uniform(0.0, 200.0, 41)
    work = np.concatenate([[0.0], np.cumsum(2.0 * acceleration * length)])
    wanted = np.sqrt(np.min(bound**2 + np.abs(work[:, None] - work), axis=1))
    reached = bound.copy()
    core_function("krc4_reachable", FLOATS, OUT_FLOATS, FLOATS)(length, reached, acceleration)
    assert reached == pytest.approx(wanted, rel=1e-12)
