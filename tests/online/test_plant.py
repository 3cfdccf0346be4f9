"""The robot's reaction and its drives."""

import numpy as np
import pytest

from gcode2krl import robot
from gcode2krl.online.plant import reaction, tip_shift_mm, with_backlash
from gcode2krl.units import RAD_PER_DEG
from tests.conftest import draws
from tests.online import faults

TIME_S = 0.004 * np.arange(500)


def test_a_ramp_comes_late_by_dead_time_and_lag():
    sent = np.column_stack([TIME_S, 2 * TIME_S])
    moved = reaction(sent, TIME_S, 0.012, 0.020)
    np.testing.assert_allclose(moved[-1], sent[-1] - [0.032, 0.064], atol=1e-9)


def test_nothing_moves_before_the_dead_time():
    sent = np.zeros((500, 1))
    sent[100:] = 1.0
    moved = reaction(sent, TIME_S, 0.040, 0.001)
    assert np.abs(moved[:109]).max() == 0.0
    assert moved[120, 0] == pytest.approx(1.0, abs=1e-3)


def brute_backlash(program, shift, gap):
    """Follow the drive's flank step by step."""
    direction, flank, out = 0.0, program[0] + shift[0], []
    for k, (p, s) in enumerate(zip(program, shift, strict=True)):
        if k and abs(p - program[k - 1]) > 1e-12:
            direction = np.sign(p - program[k - 1])
        drive = p + s + 0.5 * gap * direction
        flank = min(max(flank, drive - 0.5 * gap), drive + 0.5 * gap)
        out.append(flank)
    return np.array(out)


def test_backlash_is_taken_up_while_the_correction_goes_with_the_program():
    program = np.zeros((500, 6))
    program[:, 1] = 0.02 * TIME_S
    shift = np.zeros((500, 6))
    shift[:, 1] = 0.001 * np.sin(3.0 * TIME_S)  # slower than the program at any time
    gap = np.full(6, 0.01 * RAD_PER_DEG)
    behind = with_backlash(program + shift, program, TIME_S, gap)
    np.testing.assert_allclose(behind[20:, 1], (program + shift)[20:, 1], atol=1e-12)


def test_it_is_lost_where_the_correction_turns_the_axis_back():
    program = np.zeros((500, 6))
    program[:, 1] = 0.001 * TIME_S
    shift = np.zeros((500, 6))
    shift[250:, 1] = -0.004
    gap = np.full(6, 0.01 * RAD_PER_DEG)
    behind = with_backlash(program + shift, program, TIME_S, gap)
    np.testing.assert_allclose(behind[250, 1] - (program + shift)[250, 1], gap[1], rtol=1e-6)
    brute = brute_backlash(program[:, 1], shift[:, 1], gap[1])
    np.testing.assert_allclose(behind[60:, 1], brute[60:], atol=1e-9)


def test_the_tip_shifts_by_what_forward_kinematics_says(cell):
    q = cell.home_q_rad()[None] + np.zeros((3, 6))
    moved = q + np.array([[1e-3, 0, 0, 0, 0, 0], [0, 1e-3, 0, 0, 0, 0], [0, 0, 0, 2e-3, 0, 1e-3]])
    exact = robot.forward(moved, cell, 1)[0] - robot.forward(q, cell, 1)[0]
    np.testing.assert_allclose(tip_shift_mm(moved, q, cell, 1), exact, atol=1e-9)


def check(report):
    assert report.violations == []
    assert 0.99 < report.largest_step <= 1.0 + faults.ROUNDING  # the limit is reached, or nothing is tested
    assert report.largest_rate <= 1.0 + faults.ROUNDING
    assert report.answers > 0.5 * report.cycles


@pytest.mark.slow
def test_no_fault_in_any_state_makes_a_step():
    report = faults.drive(draws(40_000), seed=11)
    check(report)
    ends = set(report.ended)
    assert {"held too-far", "closed adds-up", "closed restarted", "held sensor", "zero adds-up"} <= ends
    met = {(phase.value, name) for phase in faults.PHASES for name in faults.FAULTS}
    assert len(met & report.met) > 0.95 * len(met)
