"""The path and the residual as SVG, with the points of the slider."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.gap.answer.drawing import points, rows_of, scale_colours, strip, views
from tests.gap.answered import STRETCH, evidence, run_evidence


def coordinates(data):
    """Return the points (n, 2) of path data ``M0 0L1 1``."""
    return np.array([[float(value) for value in point.split()] for point in data[1:].split("L")])


def test_the_path_is_whole_and_its_worst_part_is_drawn_last():
    above, side = views(evidence(), run_evidence())
    assert (above.title, side.title) == ("from above", "from the side, Z drawn 2 times as high")
    drawn = np.concatenate([coordinates(data) for _, data in above.lines])
    assert [drawn[:, 0].min(), drawn[:, 0].max()] == pytest.approx([-100.0, 100.0], abs=0.2)
    colours = [colour for colour, _ in above.lines]
    assert colours[0] == scale_colours()[0]
    assert colours[-1] == scale_colours()[-1]
    worst = coordinates(above.lines[-1][1])
    angle = np.degrees(np.arctan2(-worst[:, 1] / 50.0, worst[:, 0] / 100.0))  # y downwards
    assert [angle.min(), angle.max()] == pytest.approx([72.0, 144.0], abs=1.0)
    left, top, width, height = map(float, above.box.split())
    assert left < -100.0 < 100.0 < left + width
    assert top < -50.0 < 50.0 < top + height


def test_without_a_path_there_is_no_view_and_no_place_of_a_mark():
    run = run_evidence(position_mm=None)
    assert views(evidence(), run) == []
    assert points(run)["at"] == []


def test_the_residual_over_time_in_its_box():
    drawn = strip(evidence(), run_evidence(), (STRETCH, replace(STRETCH, run="run-2")))
    assert (drawn.top, drawn.bottom) == pytest.approx((0.3, -0.03))
    assert (drawn.first_s, drawn.last_s) == pytest.approx((0.0, 9.99))
    assert drawn.stretches == (pytest.approx((200.2, 200.2), abs=0.1),)
    before, after = coordinates(drawn.before), coordinates(drawn.after)
    inside = (before[:, 0] > 215.0) & (before[:, 0] < 385.0)
    np.testing.assert_allclose(before[inside, 1], 0.0, atol=0.1)
    np.testing.assert_allclose(after[:, 1], 200.0 * 0.3 / 0.33, atol=0.1)
    assert drawn.noise == pytest.approx((200.0 * 0.27 / 0.33, 200.0 * 0.06 / 0.33), abs=0.1)
    assert strip(evidence(), run_evidence(after=run_evidence().before), ()).after is None


def test_the_slider_has_time_line_size_and_the_same_points_as_the_path():
    run = run_evidence()
    found, rows = points(run), rows_of(run)
    assert len(rows) == 500 <= 900
    assert found["t"] == pytest.approx(run.time_s[rows])
    assert found["line"] == run.line[rows].tolist()
    assert found["before"] == pytest.approx(run.size_before[rows])
    above = np.array(found["at"][0])
    np.testing.assert_allclose(above[:, 0], run.position_mm[rows, 0], atol=0.01)
    np.testing.assert_allclose(above[:, 1], -run.position_mm[rows, 1], atol=0.01)
