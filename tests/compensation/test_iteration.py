"""Offline compensation on stand-in forces: exact where the answer is known, refused where it is uncertain."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcode2krl import compliance, write_krl
from gcode2krl.compensation.intended_path import MOST_SLOPE
from gcode2krl.compensation.iteration import compensate, refuse_twice
from gcode2krl.errors import NotUnderstoodError, RefusedError
from gcode2krl.krl.read import read_krl
from gcode2krl.krl.verify import compare
from gcode2krl.pipeline import plan_motion, solve_joints
from tests.compensation import below, corrected, read, stages

LINE = "G1 Z-2 F600\nG1 X100 F1500\n"
RECTANGLE = LINE + "G1 Y60\nG1 X0\nG1 Y0\n"
CIRCLE = "G1 Z-2 F600\nG3 X0 Y0 I30 J0 F1500\n"
CONSTANT = np.array([300.0, 400.0, -100.0])


def constant(motion):
    return np.where(below(motion), CONSTANT, 0.0)


def everywhere(motion):
    return np.tile(CONSTANT, (len(motion), 1))


def linear(motion):
    return np.where(
        below(motion), np.array([0.0, 400.0, 0.0]) * (1.0 + motion.position_mm[:, :1] / 50.0), 0.0
    )


def quadratic(motion):
    return np.where(
        below(motion), np.array([0.0, 800.0, 100.0]) * (motion.position_mm[:, :1] / 100.0) ** 2, 0.0
    )


def jump(motion):
    return np.where(below(motion) & (motion.position_mm[:, :1] > 40.0), [0.0, 600.0, 0.0], 0.0)


@pytest.mark.parametrize("law", [constant, everywhere, linear, quadratic, jump])
@pytest.mark.parametrize("body", [LINE, RECTANGLE, CIRCLE])
def test_bent_tool_runs_on_the_intended_path(cell, body, law):
    done = corrected(body, cell, law)
    assert done.before.max_mm > 0.4
    assert done.after.steady_max_mm < 0.005
    assert np.count_nonzero(done.after.steady) > 0.5 * np.count_nonzero(done.after.cuts)
    assert done.after.rms_mm < 0.4 * done.before.rms_mm
    assert done.figures["change_mm"] <= 1e-3


def test_shift_is_minus_the_deflection_normal_to_the_feed(cell):
    """At the end of a line under a constant force, against eq. 10 computed here at the moved pose."""
    done = corrected(LINE, cell, everywhere)
    row = int(np.flatnonzero(np.abs(done.intended.position_mm[:, 0] - 100.0) < 1e-9)[0])
    q = solve_joints(done.targets, cell).q_rad[row]
    base = cell.base_matrix()[:3, :3]
    bent = compliance.displace(q[None, :], base @ CONSTANT, np.zeros(3), cell, 1)[0][0] @ base
    expected = -bent * [0.0, 1.0, 1.0]  # the line runs along X
    assert done.targets.position_mm[row] - done.intended.position_mm[row] == pytest.approx(expected, abs=2e-3)


def test_result_stays_when_it_is_evaluated_again(cell):
    done = corrected(RECTANGLE, cell, linear)
    motion, _, deflection = stages(done.targets, cell, linear)
    side = np.flatnonzero(
        (motion.position_mm[:, 0] > 20.0) & (motion.position_mm[:, 0] < 80.0) & below(motion)[:, 0]
    )
    bent = motion.position_mm[side] + deflection.deflection_base_mm[side]
    y_mm = np.where(bent[:, 1] > 30.0, 60.0, 0.0)
    assert np.abs(bent[:, 1] - y_mm).max() < 0.005
    assert np.abs(bent[:, 2] + 2.0).max() < 0.005


def test_sharp_corner_keeps_both_lines(cell):
    done = corrected(RECTANGLE, cell, everywhere)
    bent = done.evaluated[0].position_mm + done.evaluated[3].deflection_base_mm
    near = np.linalg.norm(bent[:, :2] - [100.0, 60.0], axis=1) < 5.0
    near &= bent[:, 2] < 0.0
    along_x, along_y = np.abs(bent[near, 1] - 60.0), np.abs(bent[near, 0] - 100.0)
    assert np.minimum(along_x, along_y).max() < 0.01 + 0.1 / 4.0  # the approximation itself: CDIS 0.1


def test_air_and_rapids_are_not_touched(cell):
    toolpath, _ = read(RECTANGLE, cell)
    done = corrected(RECTANGLE, cell, constant)
    shift = np.linalg.norm(done.targets.position_mm - done.intended.position_mm, axis=1)
    rapid = done.targets.ptp | (done.targets.move < 0) | toolpath.rapid[np.maximum(done.targets.move, 0)]
    assert shift[rapid].max() == 0.0
    beside = np.linalg.norm((done.targets.position_mm - done.intended.position_mm)[:, :2], axis=1)
    above = done.intended.position_mm[:, 2] >= 0.0
    assert beside[above].max() == 0.0  # along the plunge, where nothing changes, the pieces may move
    assert shift.max() > 1.0


def test_nothing_to_correct_changes_nothing(cell):
    _, targets = read(RECTANGLE, cell)
    done = corrected(RECTANGLE, cell, lambda motion: 0.0 * motion.position_mm)
    assert np.array_equal(done.targets.position_mm, targets.position_mm)
    assert done.figures["rows_added"] == 0


def test_lines_are_divided_within_tolerance_and_keep_speed(cell):
    _, targets = read(LINE, cell)
    counts = {}
    for tolerance_mm in (0.05, 0.01, 0.002):
        done = corrected(LINE, cell, quadratic, tolerance_mm=tolerance_mm)
        counts[tolerance_mm] = done.figures["rows_added"]
        assert done.after.steady_max_mm <= tolerance_mm
    assert 0 < counts[0.05] < counts[0.01] < counts[0.002]
    added_s = done.evaluated[0].time_s[-1] - plan_motion(targets, cell).time_s[-1]
    assert abs(added_s) <= 0.012 + 1e-9
    speed = done.evaluated[0].speed_mm_s[
        (done.evaluated[0].position_mm[:, 0] > 5.0) & (done.evaluated[0].position_mm[:, 0] < 95.0)
    ]
    assert speed.min() > 0.98 * 25.0


def test_straight_correction_divides_nothing(cell):
    done = corrected(LINE, cell, everywhere)
    row = int(np.flatnonzero(np.abs(done.intended.position_mm[:, 0] - 100.0) < 1e-9)[0])
    on_line = done.intended.move == done.intended.move[row]
    assert np.count_nonzero(on_line) <= 3  # the end of the ramp after contact


def test_pieces_carry_their_line(cell):
    _, targets = read(RECTANGLE, cell)
    done = corrected(RECTANGLE, cell, quadratic)
    moved, intended = done.targets, done.intended
    new = np.flatnonzero((moved.move[:-1] == moved.move[1:]) & (moved.move[:-1] >= 0) & ~moved.ptp[1:])
    assert len(new) == done.figures["rows_added"] > 10
    for name in ("move", "source_line", "speed_mm_s", "tool"):
        assert np.array_equal(getattr(moved, name)[new], getattr(moved, name)[new + 1])
    assert (moved.cdis_mm[new] > 0).all()
    assert (moved.wait_s[new] == 0).all()
    old = np.setdiff1d(np.arange(len(moved)), new)
    for name in ("cdis_mm", "wait_s", "move", "rotation", "speed_mm_s"):
        assert np.array_equal(getattr(moved, name)[old], getattr(targets, name), equal_nan=True)
    assert np.array_equal(intended.position_mm[old], targets.position_mm)
    ends = targets.position_mm[np.searchsorted(old, new)]
    starts = targets.position_mm[np.searchsorted(old, new) - 1]
    way = (ends - starts) / np.linalg.norm(ends - starts, axis=1)[:, None]
    assert np.linalg.norm(np.cross(intended.position_mm[new] - starts, way), axis=1).max() < 1e-9


def test_events_stay_where_they_were(cell):
    body = "G1 Z-2 F600\nG1 X60 F1500\nM8\nG1 X100\nM9\nG1 Y40\n"
    _, targets = read(body, cell)
    done = corrected(body, cell, quadratic)
    assert done.figures["rows_added"] > 0
    assert len(done.targets.events) == len(targets.events)
    for before, after in zip(targets.events, done.targets.events, strict=True):
        assert (before.kind, before.values) == (after.kind, after.values)
        assert np.array_equal(targets.position_mm[before.row], done.intended.position_mm[after.row])
    assert any(b.row != a.row for b, a in zip(targets.events, done.targets.events, strict=True))


def test_jump_of_the_force_is_ramped(cell):
    done = corrected(LINE, cell, jump)
    shift = done.targets.position_mm - done.intended.position_mm
    on_line = np.flatnonzero(done.intended.position_mm[:, 2] == -2.0)
    step = np.linalg.norm(np.diff(shift[on_line], axis=0), axis=1)
    way = np.linalg.norm(np.diff(done.intended.position_mm[on_line], axis=0), axis=1)
    assert (step / way).max() <= MOST_SLOPE * (1.0 + 1e-6)
    before = done.intended.position_mm[on_line, 0] <= 40.0
    assert np.linalg.norm(shift[on_line][before], axis=1).max() == 0.0
    assert any(issue.code == "compensation-rest" for issue in done.issues)


def test_force_that_rises_over_the_cutters_radius_is_followed(cell):

    def entering(motion):
        x = motion.position_mm[:, :1]
        engaged = np.clip((x + 8.0) / 16.0, 0.0, 1.0)
        return np.where(below(motion) & (x > -8.0), engaged * np.array([150.0, 450.0, -50.0]), 0.0)

    done = corrected("G0 X-20\nG1 Z-2 F600\nG1 X100 F1500\nG1 Y60\nG1 X-20\n", cell, entering)
    assert done.before.max_mm > 1.0
    assert done.after.max_mm < 0.02
    assert done.after.rms_mm < 0.002


@pytest.mark.parametrize("tolerance_mm", [0.0, -1.0, np.nan, np.inf])
def test_tolerance_must_be_positive(cell, tolerance_mm):
    with pytest.raises(NotUnderstoodError, match="tolerance"):
        corrected(LINE, cell, constant, tolerance_mm=tolerance_mm)


def test_forces_stay_at_their_places(cell):
    toolpath, targets = read(RECTANGLE, cell)
    motion, forces, _ = stages(targets, cell, linear)
    done = compensate(toolpath, targets, cell, motion, forces)
    moved, _, kept, _ = done.evaluated
    side = below(moved)[:, 0] & ~toolpath.rapid[moved.move] & ~moved.corner
    assert kept.force_base_N[side] == pytest.approx(linear(moved)[side], rel=0.03)
    assert not kept.force_base_N[moved.position_mm[:, 2] > 0.3].any()
    assert kept.relative_band == forces.relative_band


@pytest.mark.parametrize("later_mm", np.arange(0.0, 0.3, 0.05))
def test_a_step_of_the_force_at_a_corner_settles_at_once(cell, later_mm):
    """Wherever the samples of the moved path happen to be, two of which lie 0.3 mm apart."""

    def leaving(motion):
        at = motion.position_mm
        return np.where(below(motion) & ((at[:, :1] < 99.9) | (at[:, 1:2] < later_mm)), CONSTANT, -CONSTANT)

    assert corrected(RECTANGLE, cell, leaving).figures["rounds"] <= 2


def test_a_correction_larger_than_any_robot_bends_is_refused(cell):
    with pytest.raises(RefusedError, match="compensation-large"):
        corrected(LINE, cell, lambda motion: 20.0 * constant(motion))


def test_a_line_that_would_run_backwards_is_refused(cell):
    """Corners of 6° are moved along the polygon, the collinear points half way are not."""
    corner = [30.0 * np.array([np.sin(a), 1.0 - np.cos(a)]) for a in np.radians(6.0 * np.arange(25))]
    half = [(a + b) / 2.0 for a, b in pairwise(corner)]
    points = [point for pair in zip(half, corner[1:], strict=True) for point in pair]
    body = "G1 Z-2 F600\n" + "".join(f"G1 X{x:.4f} Y{y:.4f} F1200\n" for x, y in points)
    with pytest.raises(RefusedError, match="run backwards") as caught:
        corrected(body, cell, lambda motion: 2.5 * constant(motion))
    assert caught.value.issues[0].code == "compensation-large"


def test_unsure_deflection_is_refused_wherever_its_numbers_come_from(cell):
    measured = cell.material.model_copy(update={"sure": "checked", "source": "identified from slots.csv"})
    sure = cell.compliance.model_copy(update={"sure": "checked", "robot_sure": "verified"})
    known = cell.model_copy(update={"material": measured, "compliance": sure})
    with pytest.raises(RefusedError, match="compensation-unsure") as caught:
        corrected(LINE, known, constant, band=0.6)
    assert "identify force" in caught.value.issues[0].remedy


def test_not_together_with_online():
    refuse_twice(online=False, both=False)
    refuse_twice(online=True, both=True)
    with pytest.raises(RefusedError, match="twice"):
        refuse_twice(online=True, both=False)


def test_findings_of_the_moved_targets_are_added_once(cell):
    _, targets = read(LINE, cell)
    done = corrected(LINE, cell, everywhere)
    assert done.targets.issues[: len(targets.issues)] == targets.issues
    assert len(set(done.targets.issues)) == len(done.targets.issues)


def test_compensated_program_verifies(cell, tmp_path):
    done = corrected(RECTANGLE, cell, linear)
    written = write_krl(done.targets, tmp_path / "part.src", cell)
    assert written.report.ok
    assert written.report.max_deviation_mm < 0.002
    read_back = read_krl(tmp_path / "part.src")
    report = compare(read_back, done.targets, solve_joints(done.targets, cell), cell)
    assert report.ok
    assert report.max_deviation_mm < 0.002
    assert not compare(read_back, done.intended, solve_joints(done.intended, cell), cell).ok


def test_no_lines_are_divided_where_every_target_is_a_stop(cell):
    controller = cell.controller.model_copy(update={"advance": 0})
    stopping = cell.model_copy(update={"controller": controller})
    done = corrected(LINE, stopping, quadratic)
    assert done.figures["rows_added"] == 0
    assert done.figures["after_rms_mm"] < done.figures["before_rms_mm"]


@settings(max_examples=10, deadline=None)
@given(st.tuples(*[st.floats(-500.0, 500.0)] * 3), st.floats(-np.pi, np.pi))
def test_any_constant_force_in_any_direction(force, angle):
    from gcode2krl import load_cell

    cell = load_cell()
    x, y = 80.0 * np.cos(angle), 80.0 * np.sin(angle)
    law = lambda motion: np.tile(np.array(force), (len(motion), 1))  # noqa: E731
    done = corrected(f"G1 Z-2 F600\nG1 X{x:.3f} Y{y:.3f} F1500\n", cell, law)
    assert done.after.steady_max_mm < 0.005
    end = int(np.flatnonzero(np.hypot(*(done.intended.position_mm[:, :2] - [x, y]).T) < 1e-3)[0])
    shift = done.targets.position_mm[end] - done.intended.position_mm[end]
    assert abs(shift @ [np.cos(angle), np.sin(angle), 0.0]) < 1e-4
    assert replace(done.targets, issues=()).events == done.targets.events
