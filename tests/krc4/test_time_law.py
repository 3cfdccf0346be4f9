"""The controller's speed along the path: plan_motion and the closed forms against brute force."""

import itertools
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gcode2krl import plan_motion, set_targets
from gcode2krl.krc4 import effective_acceleration, jerk, speed_step
from tests.krc4 import oracle
from tests.krc4.conftest import HEAD, K_S, polyline, straight

CYCLE_S = 0.012
few = settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def numeric_columns(table):
    return {spec.name: getattr(table, spec.name) for spec in fields(table) if "tail" in spec.metadata}


def assert_finite(motion):
    for name, values in numeric_columns(motion).items():
        assert np.isfinite(values).all(), name


def travelled(motion):
    """Return the distance along a straight program, from the positions."""
    return np.linalg.norm(motion.position_mm - motion.position_mm[0], axis=1)


def assert_follows(motion, wanted, dt_s=CYCLE_S, position=None):
    """Position 1e-3 mm, acceleration 1 % of the peak, total time one cycle."""
    assert_finite(motion)
    time = motion.time_s
    assert time[0] == 0
    assert time[-1] == pytest.approx(wanted.duration_s, abs=dt_s)
    path = travelled(motion) if position is None else position
    assert np.abs(motion.path_mm - wanted.position(time)).max() < 1e-3
    assert np.abs(path - wanted.position(time)).max() < 1e-3
    peak = np.abs(wanted.acceleration_mm_s2).max()
    assert np.abs(motion.acceleration_mm_s2 - np.abs(wanted.acceleration(time))).max() < 0.01 * peak
    assert np.abs(motion.speed_mm_s - wanted.speed(time)).max() < 1e-3 * wanted.speed_mm_s.max()


# --- one line -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("a_m_s2", [0.5, 2.0, 4.0])
@pytest.mark.parametrize("speed", [10, 75, 300, 1000])
@pytest.mark.parametrize("length", [1, 7, 40, 500])
def test_one_line(run_program, length, speed, a_m_s2):
    motion = run_program(straight([length], [speed]), acc_cp_m_s2=a_m_s2)
    wanted = oracle.line(length, speed, a_m_s2 * 1000, K_S)
    assert wanted.duration_s == pytest.approx(length / speed + speed / (a_m_s2 * 1000) + K_S)
    assert_follows(motion, wanted)


@pytest.mark.parametrize("k_s", [0.0, 0.012, 0.084, 0.24])
def test_other_filter_lengths(run_program, k_s):
    motion = run_program(straight([120], [250]), acc_cp_m_s2=2.0, k_s=k_s)
    wanted = oracle.line(120, 250, 2000, k_s)
    assert np.isfinite(motion.position_mm).all()
    assert motion.time_s[-1] == pytest.approx(120 / 250 + 0.125 + k_s, abs=CYCLE_S)
    assert np.abs(motion.path_mm - wanted.position(motion.time_s)).max() < 1e-3


@pytest.mark.parametrize(
    ("length", "speed", "a_m_s2"), [(10, 1000, 2), (60, 1000, 4), (1, 25, 2), (300, 400, 2)]
)
def test_trapezoid(run_program, length, speed, a_m_s2):
    motion = run_program(straight([length], [speed]), acc_cp_m_s2=float(a_m_s2), law="trapezoid")
    assert_follows(motion, oracle.line(length, speed, a_m_s2 * 1000, K_S, "trapezoid"))


def test_the_two_laws_differ_on_short_fast_moves_only(run_program):
    def duration(length, speed, law):
        motion = run_program(straight([length], [speed]), dt_s=0.001, acc_cp_m_s2=2.0, law=law)
        return motion.time_s[-1]

    assert duration(10, 1000, "averages") == pytest.approx(0.678, abs=0.0015)
    assert duration(10, 1000, "trapezoid") == pytest.approx(2 * np.sqrt(10 / 2000) + K_S, abs=0.0015)
    assert duration(10, 1000, "trapezoid") == pytest.approx(0.31, abs=0.005)
    assert duration(1, 25, "averages") == duration(1, 25, "trapezoid")


def test_undecided_law_is_a_finding_where_it_matters(run_program):
    short = run_program(straight([10], [1000]), acc_cp_m_s2=2.0)
    long = run_program(straight([200], [50]), acc_cp_m_s2=2.0)
    assert "law-undecided" in [issue.code for issue in short.issues]
    assert "law-undecided" not in [issue.code for issue in long.issues]


# --- changes of speed, stops ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "lines",
    [
        [(200, 20), (200, 80)],
        [(200, 80), (200, 20)],
        [(150, 100), (100, 10), (250, 300)],
        [(160, 300), (60, 40), (30, 40), (200, 200), (90, 25)],
        [(60, 50), (60, 50.5), (60, 50)],
    ],
)
@pytest.mark.parametrize("a_m_s2", [1.0, 4.0])
def test_speed_changes(run_program, lines, a_m_s2):
    lengths, speeds = zip(*lines, strict=True)
    motion = run_program(straight(lengths, speeds), acc_cp_m_s2=a_m_s2)
    assert_follows(motion, oracle.chain(lines, a_m_s2 * 1000, K_S))
    assert not motion.corner.any()


@pytest.mark.parametrize(("first", "second"), [(100, 30), (30, 100)])
def test_slowing_ends_and_speeding_up_begins_at_the_vertex(run_program, first, second):
    motion = run_program(straight([100, 100], [first, second]), dt_s=0.001, acc_cp_m_s2=2.0)
    slow = min(first, second)
    speed_at = np.interp([99.9, 100.0, 100.1], motion.path_mm, motion.speed_mm_s)
    assert speed_at[1] == pytest.approx(slow, rel=1e-5)
    slow_side, fast_side = (speed_at[0], speed_at[2]) if first < second else (speed_at[2], speed_at[0])
    assert slow_side == pytest.approx(slow, rel=1e-9)
    assert slow + 0.01 < fast_side < slow + 0.5


STOPS = [(50, 40, 0.0), (3, 75, 0.25), (0.4, 75, 0.0), (120, 400, 1.0), (20, 10, 0.0)]


@pytest.mark.parametrize("law", ["averages", "trapezoid"])
def test_exact_stops_and_dwell(run_program, law):
    text, y = HEAD + "G61\nG0 X0 Y-100 Z0\n", -100.0
    for length, speed, dwell_s in STOPS:
        y += length
        text += f"G1 Y{y:.6f} F{60 * speed}\n" + (f"G4 P{dwell_s}\n" if dwell_s else "")
    motion = run_program(text + "M30\n", acc_cp_m_s2=2.0, law=law)
    assert_follows(motion, oracle.with_stops(STOPS, 2000, K_S, law))


def test_dwell_in_a_blended_program_is_a_stop(run_program):
    text = HEAD + "G64\nG0 X0 Y0 Z0\nG1 Y50 F3000\nG4 P0.5\nG1 Y90\nM30\n"
    motion = run_program(text, acc_cp_m_s2=2.0)
    assert_follows(motion, oracle.with_stops([(50, 50, 0.5), (40, 50, 0)], 2000, K_S))


def test_stop_between_feed_and_rapid(run_program):
    text = HEAD + "G64\nG0 X0 Y0 Z0\nG1 Y50 F3000\nG0 Y130\nG1 Y150 F1200\nM30\n"
    motion = run_program(text, acc_cp_m_s2=2.0, rapid_m_s=0.25)
    assert_follows(motion, oracle.with_stops([(50, 50, 0), (80, 250, 0), (20, 20, 0)], 2000, K_S))


def test_reversal_is_an_exact_stop(run_program):
    text = HEAD + "G64\nG0 X0 Y0 Z0\nG1 Y60 F3000\nG1 Y20\nG1 Y70\nM30\n"
    motion = run_program(text, acc_cp_m_s2=2.0, cdis_mm=10.0)
    wanted = oracle.with_stops([(60, 50, 0), (40, 50, 0), (50, 50, 0)], 2000, K_S)
    assert_follows(motion, wanted, position=motion.path_mm)
    assert motion.position_mm[:, 1].max() == pytest.approx(70, abs=1e-9)
    turn = np.abs(motion.path_mm - 60).argmin()
    assert motion.position_mm[turn, 1] == pytest.approx(60, abs=0.05)
    assert motion.speed_mm_s[turn] < 2.0


# --- degenerate targets ---------------------------------------------------------------------------------


def repeated(targets, rows):
    """Return Targets in which some rows stand twice: moves of length zero."""
    index = np.sort(np.concatenate([np.arange(len(targets)), rows]))
    return replace(targets, **{name: values[index] for name, values in numeric_columns(targets).items()})


def test_moves_of_length_zero_change_nothing(make_cell, read):
    cell = make_cell(acc_cp_m_s2=2.0, cdis_mm=2.0)
    points = HEAD + "G64\nG0 X0 Y0 Z0\nG1 Y40 F3000\nG1 X30\nG1 X30 Y70\nM30\n"
    targets = set_targets(read(points, cell), cell)
    plain = plan_motion(targets, cell)
    inner = np.flatnonzero((targets.move >= 0) & ~targets.ptp)[:-1]
    twice = plan_motion(repeated(targets, inner), cell)
    assert_finite(twice)
    # a repeated target breaks no line and adds no length; a corner of length zero in between may stop
    assert twice.path_mm[-1] >= plain.path_mm[-1] - 1e-6
    assert twice.position_mm[-1] == pytest.approx(plain.position_mm[-1], abs=1e-9)


def test_length_zero_in_the_text(run_program):
    text = HEAD + "G64\nG0 X0 Y0 Z0\nG1 Y40 F3000\nG1 Y40\nG1 Y40 F600\nG1 Y40 F3000\nG1 Y80\nM30\n"
    assert_follows(run_program(text, acc_cp_m_s2=2.0), oracle.line(80, 50, 2000, K_S))


def test_pure_reorientation_has_no_nan(make_cell, read):
    cell = make_cell(acc_cp_m_s2=2.0, cdis_mm=2.0)
    targets = set_targets(read(HEAD + "G64\nG0 X0 Y0 Z0\nG1 Y40 F3000\nG1 Y80\nM30\n", cell), cell)
    turned = np.flatnonzero((targets.move >= 0) & ~targets.ptp)[1]
    twice = repeated(targets, [turned])
    half = np.deg2rad(20) / 2
    rotation = twice.rotation.copy()
    rotation[turned + 1 :] = [np.sin(half), 0, 0, np.cos(half)]
    motion = plan_motion(replace(twice, rotation=rotation), cell)
    assert_finite(motion)
    assert np.linalg.norm(motion.rotation, axis=1) == pytest.approx(np.ones(len(motion)), abs=1e-9)
    assert motion.path_mm[-1] == pytest.approx(80, abs=1e-6)


def test_a_single_position_is_no_motion(run_program):
    motion = run_program(HEAD + "G0 X0 Y0 Z0\nM30\n")
    assert_finite(motion)
    assert motion.time_s[-1] <= CYCLE_S
    assert np.ptp(motion.position_mm, axis=0) == pytest.approx(np.zeros(3), abs=1e-12)


# --- the paper's table ------------------------------------------------------------------------------------


@pytest.mark.parametrize("speed", [200.0, 400.0, 600.0])
@pytest.mark.parametrize("a_m_s2", [2.0, 2.5, 3.0, 3.5, 4.0])
def test_effective_acceleration_and_jerk_of_the_paper(run_program, speed, a_m_s2):
    a = a_m_s2 * 1000
    wanted = a if speed / a > K_S else speed / K_S
    assert effective_acceleration(speed, a, K_S) == pytest.approx(wanted, rel=1e-12)
    assert jerk(a, K_S) == pytest.approx(a / K_S, rel=1e-12)
    motion = run_program(straight([460], [speed]), dt_s=0.001, acc_cp_m_s2=a_m_s2)
    assert motion.speed_mm_s.max() == pytest.approx(speed, rel=1e-9)
    assert motion.acceleration_mm_s2.max() == pytest.approx(wanted, rel=0.01)
    assert motion.jerk_mm_s3.max() == pytest.approx(a / K_S, rel=1e-6)


def test_effective_acceleration_takes_arrays():
    speed = np.array([0.0, 10.0, 600.0])
    values = effective_acceleration(speed, 2000.0, K_S)
    assert values == pytest.approx([0.0, 10 / K_S, 2000.0])
    assert effective_acceleration(600.0, 2000.0, 0.0) == pytest.approx(2000.0)


@given(
    length=st.floats(0.5, 200),
    speed=st.floats(10, 1000),
    a_m_s2=st.sampled_from([0.5, 2.0, 4.0]),
)
@few
def test_bounds_on_one_line(run_program, length, speed, a_m_s2):
    motion = run_program(straight([length], [speed]), dt_s=0.002, acc_cp_m_s2=a_m_s2)
    a = a_m_s2 * 1000
    reaches = length >= speed * (speed / a + K_S)
    assert motion.speed_mm_s.max() <= speed * (1 + 1e-9)
    assert motion.acceleration_mm_s2.max() <= speed / max(speed / a, K_S) * (1 + 1e-9)
    assert motion.jerk_mm_s3.max() <= (1 if reaches else 2) * a / K_S * (1 + 1e-9)
    changes = np.abs(np.diff(motion.acceleration_mm_s2))
    assert changes.max() <= 2 * a / K_S * np.diff(motion.time_s).max() * (1 + 1e-6)


# --- speed_step -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("v0", "v1", "a", "k_s"),
    [
        (0, 600, 2000, K_S),
        (0, 200, 4000, K_S),
        (100, 30, 2000, K_S),
        (30, 100, 500, K_S),
        (500, 0, 4000, K_S),
        (50, 50.01, 2000, K_S),
        (0, 336, 2000, K_S),
        (20, 300, 2000, 0.012),
    ],
)
def test_speed_step_is_the_double_average(v0, v1, a, k_s):
    length = abs(v1 - v0) / a
    wanted = oracle.pulses([(0.0, v1 - v0, length)], k_s, length + k_s + 0.1, v0)
    time = wanted.time_s
    position, speed, acceleration, third = speed_step(time, v0, v1, a, k_s)
    assert np.abs(position - wanted.position_mm).max() < 1e-4
    assert np.abs(speed - wanted.speed_mm_s).max() < 1e-4 * max(v0, v1)
    peak = abs(v1 - v0) / max(length, k_s)
    assert np.abs(acceleration - wanted.acceleration_mm_s2).max() < 1e-6 * peak + 1e-9
    edges = np.array([0, length, k_s, length + k_s])
    away = np.abs(time[:, None] - edges).min(axis=1) > 2 * oracle.STEP_S
    assert np.abs(third - wanted.jerk_mm_s3)[away].max() < 1e-6 * a / k_s
    assert speed[-1] == pytest.approx(v1, abs=1e-9)


@pytest.mark.parametrize(("v0", "v1", "k_s"), [(50, 50, K_S), (0, 0, K_S), (0, 100, 0.0), (7, 7, 0.0)])
def test_speed_step_without_a_step_or_a_filter(v0, v1, k_s):
    time = np.linspace(0, 1, 101)
    position, speed, acceleration, _ = speed_step(time, v0, v1, 2000, k_s)
    wanted = oracle.pulses([(0.0, v1 - v0, abs(v1 - v0) / 2000)], k_s, 1.0, v0)
    assert position == pytest.approx(wanted.position(time), abs=1e-3)
    assert speed == pytest.approx(wanted.speed(time), abs=1e-6)
    assert np.isfinite(acceleration).all()


# --- properties -------------------------------------------------------------------------------------------

lengths_and_speeds = st.lists(
    st.tuples(st.floats(0.05, 60), st.sampled_from([10.0, 25.0, 75.0, 200.0, 500.0])), min_size=1, max_size=8
)


@given(lines=lengths_and_speeds, advance=st.sampled_from(["unlimited", 3]))
@few
def test_covers_exactly_the_path_and_is_continuous(run_program, lines, advance):
    lengths, speeds = zip(*[(round(length, 6), speed) for length, speed in lines], strict=True)
    motion = run_program(straight(lengths, speeds, start_mm=-200.0), dt_s=0.004, advance=advance)
    assert_finite(motion)
    assert motion.path_mm[0] == 0
    assert motion.path_mm[-1] == pytest.approx(sum(lengths), abs=1e-6)
    assert motion.speed_mm_s[0] == 0
    assert motion.speed_mm_s[-1] == pytest.approx(0, abs=1e-6)
    steps, spans = np.diff(motion.path_mm), np.diff(motion.time_s)
    assert steps.min() >= -1e-9
    fastest = np.maximum(motion.speed_mm_s[1:], motion.speed_mm_s[:-1])
    assert (steps <= (fastest + 2000 * spans) * spans + 1e-9).all()
    assert motion.speed_mm_s.max() <= max(speeds) * (1 + 1e-9)
    assert np.abs(np.diff(motion.speed_mm_s)).max() <= 2000 * spans.max() * (1 + 1e-6)
    assert np.abs(travelled(motion) - motion.path_mm).max() < 1e-6
    assert (np.diff(motion.move) >= 0).all()


@given(lines=lengths_and_speeds)
@few
def test_feed_of_each_move_is_kept(run_program, lines):
    """Slow moves are never overrun: the speed on a move stays below its own feed."""
    lengths, speeds = zip(*[(round(length, 6), speed) for length, speed in lines], strict=True)
    motion = run_program(straight(lengths, speeds, start_mm=-200.0), dt_s=0.004)
    ends = np.cumsum(lengths)
    on = np.minimum(np.searchsorted(ends, motion.path_mm), len(lengths) - 1)
    inside = np.abs(motion.path_mm[:, None] - ends).min(axis=1) > 1e-6
    assert (motion.speed_mm_s <= np.array(speeds)[on] * (1 + 1e-6))[inside].all()


@pytest.mark.parametrize(
    "text",
    [
        straight([50], [75]),
        straight([1.5], [400]),
        straight([80, 60, 70], [100, 30, 60]),
        straight([10, 0.5, 12], [50, 75, 20], "G61"),
        HEAD + "G64\nG0 X0 Y0 Z0\nG1 Y40 F3000\nG1 X30 Y60\nG1 X30 Y20\nM30\n",
    ],
)
def test_doubling_the_samples_changes_nothing(run_program, text):
    once = run_program(text, dt_s=0.012, cdis_mm=5.0)
    twice = run_program(text, dt_s=0.006, cdis_mm=5.0)
    assert twice.time_s[-1] == pytest.approx(once.time_s[-1], abs=0.012)
    coarse, fine = np.round(once.time_s / 0.006).astype(int), np.round(twice.time_s / 0.006).astype(int)
    _, i, j = np.intersect1d(coarse, fine, return_indices=True)
    same = np.isclose(once.time_s[i], twice.time_s[j], rtol=0, atol=1e-12)
    i, j = i[same], j[same]
    assert len(i) >= len(once) - 1
    for name in ("position_mm", "rotation", "speed_mm_s", "path_mm"):
        assert np.abs(getattr(once, name)[i] - getattr(twice, name)[j]).max() < 1e-9, name
    peak = once.acceleration_mm_s2.max()
    assert np.abs(once.acceleration_mm_s2[i] - twice.acceleration_mm_s2[j]).max() < 1e-9 * peak
    assert (once.move[i] == twice.move[j]).all()


@pytest.mark.parametrize(
    ("points", "speed"),
    [
        ([(0, -60, 0), (0, 60, 0)], 100),
        ([(0, -1, 0), (0, 1, 0)], 300),
        ([(100, -100, 0), (0, 0, 0), (100, 100, 0)], 100),
        ([(0, -90, 0), (40, -60, -10), (40, 60, -10), (0, 90, 0)], 60),
    ],
)
def test_reversed_program_mirrors_the_path(run_program, points, speed):
    speeds = [speed] * (len(points) - 1)
    there = run_program(polyline(points, speeds), dt_s=0.001, cdis_mm=8.0)
    back = run_program(polyline(points[::-1], speeds), dt_s=0.001, cdis_mm=8.0)
    length = sum(np.linalg.norm(np.subtract(b, a)) for a, b in itertools.pairwise(points))
    duration = length / speed + speed / 2000 + K_S
    assert there.time_s[-1] == pytest.approx(duration, abs=0.001)
    assert back.time_s[-1] == pytest.approx(duration, abs=0.001)
    inside = back.time_s <= duration
    for axis in range(3):
        mirrored = np.interp(duration - back.time_s[inside], there.time_s, there.position_mm[:, axis])
        assert np.abs(mirrored - back.position_mm[inside, axis]).max() < 1e-3


@pytest.mark.slow
@given(
    pieces=st.lists(st.floats(0.2, 40), min_size=2, max_size=12),
    speed=st.sampled_from([20.0, 75.0, 400.0]),
    law=st.sampled_from(["averages", "trapezoid"]),
)
@few
def test_collinear_pieces_are_one_line(run_program, pieces, speed, law):
    pieces = [round(piece, 3) for piece in pieces]
    whole = run_program(straight([sum(pieces)], [speed], start_mm=-200.0), cdis_mm=1.0, law=law)
    split = run_program(straight(pieces, [speed] * len(pieces), start_mm=-200.0), cdis_mm=1.0, law=law)
    assert len(split) == len(whole)
    assert np.abs(split.position_mm - whole.position_mm).max() < 1e-5
    peak = whole.acceleration_mm_s2.max()
    assert np.abs(split.acceleration_mm_s2 - whole.acceleration_mm_s2).max() < 1e-3 * peak
    assert not split.corner.any()


@given(
    lines=st.lists(
        st.tuples(st.floats(0.1, 60), st.sampled_from([10.0, 75.0, 400.0]), st.sampled_from([0.0, 0.1])),
        min_size=1,
        max_size=5,
    )
)
@few
def test_random_exact_stops(run_program, lines):
    text, y = HEAD + "G61\nG0 X0 Y-150 Z0\n", -150.0
    lines = [(round(length, 6), speed, dwell_s) for length, speed, dwell_s in lines]
    lines[-1] = (*lines[-1][:2], 0.0)
    for length, speed, dwell_s in lines:
        y += length
        text += f"G1 Y{y:.6f} F{60 * speed}\n" + (f"G4 P{dwell_s}\n" if dwell_s else "")
    assert_follows(run_program(text + "M30\n"), oracle.with_stops(lines, 2000, K_S))
