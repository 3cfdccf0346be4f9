"""A program solved in parts is the program solved in one piece, wherever the borders lie."""

import io
import itertools
from dataclasses import fields, replace

import numpy as np
import pytest

from gcode2krl import set_targets
from gcode2krl.compiled import chunks
from gcode2krl.gcode import read_stream
from gcode2krl.robot import findings, follow, follow_motion, forward, joints, lines, motion_angles
from gcode2krl.robot.joints import target_angles
from gcode2krl.robot.standing import limit_margin
from gcode2krl.tables import Motion
from tests.cells import over_demonstration

HEAD = "G21 G90 G54\nT1 M6\nS8000 M3\nG43 H1\nG0 X0 Y0\nG0 Z5\nG1 Z0 F3000\n"
TAIL = "G0 Z50\nM30\n"


def program(points, **data):
    cell = over_demonstration(data)
    text = HEAD + "".join(f"G1 X{x:.3f} Y{y:.3f} Z{z:.3f}\n" for x, y, z in points) + TAIL
    toolpath = read_stream(io.BytesIO(text.encode()), "part.nc", cell)
    return set_targets(toolpath, cell), cell


@pytest.fixture
def rows_in_a_part(monkeypatch):
    """Return a function that sets how many rows a part has."""

    def rows_in_a_part(rows):
        for module in (joints, lines):
            monkeypatch.setattr(module, "chunk_borders", lambda count, _=0: chunks.chunk_borders(count, rows))

    return rows_in_a_part


def same(table, other):
    for spec in fields(table):
        if "tail" in spec.metadata:
            left, right = getattr(table, spec.name), getattr(other, spec.name)
            np.testing.assert_allclose(left, right, rtol=0, atol=1e-9, err_msg=spec.name)


def wave(count=60, size=300.0):
    phase = np.linspace(0, 9, count)
    return np.column_stack([150 + size * np.sin(phase), size * np.cos(1.7 * phase), 20 * np.sin(3 * phase)])


@pytest.mark.parametrize("rows", [1, 2, 7, 64])
@pytest.mark.parametrize("x_mm", [1500.0, 2600.0], ids=["in reach", "partly out of reach"])
def test_targets(rows_in_a_part, rows, x_mm):
    targets, cell = program(
        wave(),
        frames={"base": {"x_mm": x_mm, "y_mm": 0.0, "z_mm": 900.0, "a_deg": 0.0, "b_deg": 0.0, "c_deg": 0.0}},
    )
    rows_in_a_part(10**6)
    whole, whole_findings = follow(targets, cell)
    assert np.isnan(whole.q_rad).any() == (x_mm > 2000)
    rows_in_a_part(rows)
    in_parts, found = follow(targets, cell)
    same(in_parts, whole)
    assert found == whole_findings


def moving(q_rad, cell):
    """Return a Motion whose samples are the poses of given joints."""
    position, rotation = forward(q_rad, cell)
    count = len(q_rad)
    zero, none = np.zeros(count), np.zeros(count, dtype=int)
    return Motion(
        time_s=0.012 * np.arange(count),
        position_mm=position,
        rotation=rotation,
        speed_mm_s=zero,
        acceleration_mm_s2=zero,
        jerk_mm_s3=zero,
        path_mm=zero,
        move=none,
        corner=none,
        tool=none + 1,
    )


def turning_wrist(count=200, turns=2.0):
    """Joints whose A6 winds up and whose A5 passes 0 exactly in the middle of a stretch that stays there."""
    q = np.tile(np.radians([0.0, -90.0, 90.0, 0.0, 30.0, 0.0]), (count, 1))
    q[:, 5] = np.linspace(-0.9, 0.9, count) * np.pi * turns / 2
    q[:, 0] = 0.2 * np.sin(np.linspace(0, 3, count))
    q[80:120, 4] = 0.0
    return q


@pytest.mark.parametrize("rows", [1, 3, 30, 41, 90])
def test_motion_with_winding_and_singular_wrist(rows_in_a_part, rows):
    cell = over_demonstration()
    motion = moving(turning_wrist(), cell)
    rows_in_a_part(10**6)
    whole = follow_motion(motion, cell)
    rows_in_a_part(rows)
    same(follow_motion(motion, cell), whole)


def test_the_angles_are_those_that_moved(rows_in_a_part):
    rows_in_a_part(16)
    cell = over_demonstration()
    q = turning_wrist(turns=1.9)
    q[:, 4] = np.radians(30)
    found, speeds = motion_angles(moving(q, cell), cell)
    np.testing.assert_allclose(found, q, rtol=0, atol=1e-9)
    np.testing.assert_allclose(speeds[1:-1], (q[2:] - q[:-2]) / 0.024, rtol=0, atol=1e-6)
    assert not speeds[[0, -1]].any()


def test_joints_rest_beside_a_change_of_the_tool():
    cell = over_demonstration()
    q = turning_wrist(turns=1.9)
    q[:, 4] = np.radians(30)
    motion = moving(q, cell)
    _, speeds = motion_angles(replace(motion, tool=np.repeat([1, 2], 100)), cell)
    rests = np.isin(np.arange(200), [0, 99, 100, 199])
    np.testing.assert_array_equal(speeds.any(axis=1), ~rests)


def test_a_wrong_start_of_a_part_is_put_right(rows_in_a_part, monkeypatch):
    """The trial's joints are only a guess: parts that start a turn off are solved again."""
    cell = over_demonstration()
    motion = moving(turning_wrist(), cell)
    rows_in_a_part(10**6)
    whole = follow_motion(motion, cell)
    rows_in_a_part(23)
    guess = joints.Branch.guess
    monkeypatch.setattr(
        joints.Branch, "guess", lambda self, sample: guess(self, sample) + 2 * np.pi * (sample > 0)
    )
    same(follow_motion(motion, cell), whole)


def test_only_a_home_position():
    targets, cell = program(wave(3))
    rows = np.flatnonzero(targets.home)[:1]
    columns = {f.name: getattr(targets, f.name)[rows] for f in fields(targets) if "tail" in f.metadata}
    found, issues = follow(replace(targets, events=(), **columns), cell)
    np.testing.assert_allclose(found.q_rad, cell.home_q_rad()[None, :])
    assert not issues


# --- findings --------------------------------------------------------------------------------------------


SLOW = [5.0, 6.0, 6.0, 8.0, 10.0, 10.0]
FAR, HIGH = (
    {"x_mm": 2700.0, "y_mm": 0.0, "z_mm": 900.0, "a_deg": 0.0, "b_deg": 0.0, "c_deg": 0.0},
    {"x_mm": 1150.0, "y_mm": 0.0, "z_mm": 1400.0, "a_deg": 0.0, "b_deg": 0.0, "c_deg": 0.0},
)
LONG_MOVES = wave(120, 200.0)
SHORT_MOVES = np.delete(wave(900, 200.0), [*range(200, 210), *range(400, 410), 600, *range(700, 715)], axis=0)


@pytest.mark.parametrize("speeds", [SLOW, None], ids=["slow joints", "speeds unknown"])
@pytest.mark.parametrize("base", [FAR, HIGH], ids=["far", "high"])
@pytest.mark.parametrize("points", [LONG_MOVES, SHORT_MOVES], ids=["long moves", "short moves"])
def test_findings_of_stretches_are_those_of_the_whole_program(monkeypatch, speeds, base, points):
    """Only the beginnings of stretches are sampled again; sampling everything finds the same."""
    data = {"robot": {"speeds": {"qd_deg_s": speeds}}, "frames": {"base": base}}
    targets, cell = program(points, **data)
    _, found = target_angles(targets, cell)
    assert {issue.code for issue in found} & {"joint-limit", "out-of-reach", "singularity", "joint-speed"}
    monkeypatch.setattr(findings, "_GAP", 0)
    assert target_angles(targets, cell)[1] == found
    monkeypatch.setattr(findings, "_spans", lambda wrong, samples: [(0, len(wrong))])
    assert target_angles(targets, cell)[1] == found


@pytest.mark.parametrize(("gap", "most_rows"), [(0, 20 * 5 + 5 + 6), (100, 392 + 5 + 6)])
def test_spans_hold_the_beginnings_of_the_first_runs_of_each_kind(monkeypatch, gap, most_rows):
    monkeypatch.setattr(findings, "_GAP", gap)
    monkeypatch.setattr(findings, "MOST_PLACES", 20)
    wrong, samples = np.zeros(3000, dtype=np.uint16), np.ones(3000, dtype=np.int64)
    wrong[10::20] |= 1
    wrong[2000:2910] |= findings.FAST
    samples[2500] = 3  # its samples, or the one behind them, may begin a stretch
    spans = findings._spans(wrong, samples)
    rows = {row for start, end in spans for row in range(start, end)}
    assert {10 + 20 * k for k in range(20)} | {1998, 2000, 2002, 2498, 2500, 2501, 2503} <= rows
    assert len(rows) <= most_rows
    assert all(end < start for (_, end), (start, _) in itertools.pairwise(spans))


def test_margin_by_hand():
    cell = over_demonstration()
    low, high = np.radians(np.array(cell.robot.limits.q_deg)).T
    q = np.random.default_rng(3).uniform(low - 0.3, high + 0.3, (500, 6))
    expected = np.minimum(q - low, high - q).min(axis=1)
    np.testing.assert_allclose(limit_margin(q, cell), expected, rtol=0, atol=1e-15)
    assert np.isnan(limit_margin(np.full((1, 6), np.nan), cell)).all()
