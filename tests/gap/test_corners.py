"""Another rounding of corners is a sum of columns, beside them and in time; moments alone are a gap."""

import io
from dataclasses import replace

import numpy as np
import pytest

from gcode2krl import load_cell
from gcode2krl.effects import Applied, library
from gcode2krl.effects.inputs import gradient
from gcode2krl.gap.compare.inputs import Corners
from gcode2krl.gap.compare.pair import Simulator, _shared, with_corners
from gcode2krl.gap.posterior.examination import moments_off
from gcode2krl.gcode import read_stream
from gcode2krl.pipeline import predict_toolpath
from tests.gap.constructed import trace

SAME_SPEED = "G1 X80 F3000\nG1 Y60\nG1 X10 Y20\nG1 Y0\n"
OTHER_SPEEDS = "G1 X80 F9000\nG1 Y60 F3000\nG1 X10 Y20 F9000\nG1 Y0 F3000\n"


def _inputs(moves):
    text = f"G21 G90 G17\nG54\nT1 M6\nS9000 M3\nG0 X0 Y0 Z30\n{moves}M30\n"
    cell = load_cell()
    prediction = predict_toolpath(read_stream(io.BytesIO(text.encode()), "p.nc", cell), cell, dt_s=0.012)
    return _shared(prediction)[0]


def _left(inputs, cdis_mm):
    """Return the share of what another approximation distance does that no sum of the columns takes."""
    corner = library()["corner"]
    there = corner.replan(inputs, Applied(corner, None, {"cdis_mm": cdis_mm}))
    moved = [np.interp(inputs.time_s, there.time_s, q) for q in there.q_cmd_rad.T]
    change = np.stack(moved, axis=1) - inputs.q_cmd_rad
    corners, rate = Corners(inputs), gradient(inputs.q_cmd_rad, inputs.time_s)
    late = rate[:, :, None] * corners.late_by_rounding[:, None, :]
    columns = np.concatenate([corners.roundings.transpose(0, 2, 1), late], axis=2).reshape(change.size, -1)
    rest = change.ravel() - columns @ np.linalg.lstsq(columns, change.ravel(), rcond=None)[0]
    return float(np.sum(rest**2) / np.sum(change**2))


@pytest.mark.parametrize("moves", [SAME_SPEED, OTHER_SPEEDS])
def test_another_approximation_distance_is_a_sum_of_the_columns(moves):
    inputs = _inputs(moves)
    assert _left(inputs, 3.0 * float(inputs.targets.cdis_mm.max())) < 0.15


def test_corners_are_passed_in_order_and_change_nothing_on_straight_lines():
    corners = Corners(_inputs(SAME_SPEED))
    assert np.all(np.diff(corners.passed(np.arange(len(corners.inputs))), axis=0) >= 0.0)
    assert np.mean(np.any(corners.roundings != 0.0, axis=(1, 2))) < 0.5


def test_without_targets_there_are_none():
    corners = Corners(replace(_inputs(SAME_SPEED), targets=None))
    assert corners.passed(np.arange(3)).shape[1] == 0
    assert not corners.roundings.any()
    assert not corners.late_by_rounding.any()


def test_commanded_paths_are_sampled_every_millisecond_but_not_where_they_were_moved():
    inputs = _inputs(SAME_SPEED)
    assert np.median(np.diff(Simulator().commanded(inputs, []).time_s)) == pytest.approx(1e-3)
    moved = replace(inputs, time_s=1.01 * inputs.time_s)
    assert with_corners(moved) is moved


def test_a_path_that_is_off_for_a_moment_alone_is_a_gap():
    """Four rows of five hundred, at ten times the accuracy: a mean over the run does not see them."""
    path = trace(np.zeros((500, 6)), "path")
    off = np.zeros((500, 6))
    off[[100, 200, 300, 400], 2] = 10.0 * path.link.model_rms
    assert moments_off([path], [off], []) == 4
    assert moments_off([path], [0.1 * off], []) == 0
    servo = trace(np.zeros((500, 6)), "servo")
    assert moments_off([servo], [off], []) == 0
