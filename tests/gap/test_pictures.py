"""The pictures: what is drawn, from numbers that are known."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from gcode2krl.errors import NotUnderstoodError
from gcode2krl.gap.answer.drawing import (
    draw_dependence,
    draw_path,
    draw_time,
    has_causes,
    largest_size,
    picture_bytes,
    run_figure,
    views_of,
    write_pictures,
)
from gcode2krl.gap.answer.evidence import Against
from gcode2krl.gap.answer.result import Where
from tests.gap.answered import GAP, STRETCH, TIME_S, evidence, run_evidence

DRAWN = replace(GAP, evidence=evidence(), where=Where(intervals=(STRETCH,)))
PNG = b"\x89PNG\r\n\x1a\n"


def axes():
    return Figure().add_subplot()


def lines_of(drawn):
    """Return the lines that have a name in the legend."""
    return {line.get_label(): line for line in drawn.lines if not line.get_label().startswith("_")}


def test_over_time_before_after_noise_stretches_and_lines_are_drawn():
    drawn = axes()
    draw_time(drawn, evidence(), run_evidence(), (STRETCH, replace(STRETCH, run="run-2", t_start_s=7.0)))
    lines = lines_of(drawn)
    assert set(lines) == {"before", "with the causes"}
    time_s, values = lines["before"].get_data()
    inside = (time_s > 2.1) & (time_s < 3.9)
    np.testing.assert_allclose(values[inside], 0.3)
    np.testing.assert_allclose(values[(time_s < 1.9) | (time_s > 4.1)], 0.0, atol=1e-12)
    spans = {patch.get_label(): patch.get_window_extent() for patch in drawn.patches}
    assert set(spans) == {"larger than the noise", "noise, ±1 σ"}  # that of run-2 is not in it
    (top,) = drawn.child_axes
    assert top.get_xlabel() == "G-code line"
    assert [text.get_text() for text in top.get_xticklabels()][:3] == ["1", "2", "3"]


def test_without_a_named_cause_there_is_no_line_after_and_without_lines_no_second_axis():
    run = run_evidence(after=run_evidence().before, line=np.zeros(1000, dtype=np.int64))
    assert not has_causes(run)
    drawn = axes()
    draw_time(drawn, evidence(), run)
    assert set(lines_of(drawn)) == {"before"}
    assert drawn.child_axes == []


def test_a_line_is_not_drawn_across_a_gap_of_the_record():
    keep = (TIME_S < 5.0) | (TIME_S > 6.0)
    names = ("time_s", "line", "before", "after", "size_before", "size_after")
    run = run_evidence(**{name: getattr(run_evidence(), name)[keep] for name in names})
    drawn = axes()
    draw_time(drawn, evidence(), run)
    _, values = lines_of(drawn)["before"].get_data()
    assert np.count_nonzero(np.isnan(values)) == 1


def test_the_path_is_coloured_by_the_size_and_the_worst_is_marked():
    drawn = axes()
    draw_path(drawn, evidence(), run_evidence(), (0, 1))
    (lines,) = [each for each in drawn.collections if isinstance(each, LineCollection)]
    sizes = lines.get_array()
    assert set(np.unique(sizes)) == {0.0, 0.3}
    # 2 s to 4 s of an ellipse in 10 s: a point there is at angles of 72 to 144 degrees
    worst = np.concatenate([s for s, size in zip(lines.get_segments(), sizes, strict=True) if size > 0.0])
    angle = np.degrees(np.arctan2(worst[:, 1] / 50.0, worst[:, 0] / 100.0))
    assert angle.min() == pytest.approx(72.0, abs=0.5)
    assert angle.max() == pytest.approx(144.0, abs=0.5)
    x, y = drawn.lines[0].get_data()
    assert np.degrees(np.arctan2(y[0] / 50.0, x[0] / 100.0)) == pytest.approx(72.0, abs=0.5)


def test_views_from_above_and_from_the_longer_side():
    run = run_evidence()
    assert views_of(run) == [(0, 1), (0, 2)]
    assert views_of(replace(run, position_mm=run.position_mm[:, [1, 0, 2]])) == [(0, 1), (1, 2)]
    assert views_of(replace(run, position_mm=run.position_mm * [1.0, 1.0, 0.0])) == [(0, 1)]
    drawn = axes()
    draw_path(drawn, evidence(), replace(run, position_mm=None), (0, 1))
    assert "the robot is not known" in drawn.texts[0].get_text()


def test_the_dependence_is_drawn_against_its_input_both_ways_apart():
    drawn = axes()
    draw_dependence(drawn, evidence(), run_evidence())
    assert drawn.get_xlabel() == "speed of A2 (deg/s)"
    assert set(lines_of(drawn)) == {"before", "with the causes"}
    turning = Against("time since A2 reversed (s)", TIME_S, np.where(TIME_S < 5.0, 1.0, -1.0))
    drawn = axes()
    draw_dependence(drawn, evidence(), run_evidence(against=turning))
    lines = lines_of(drawn)
    assert lines["before, joint moving up"].get_xdata().max() < 5.0
    assert lines["before, moving down"].get_xdata().min() >= 5.0
    nothing = axes()
    draw_dependence(nothing, evidence(), run_evidence(against=None))
    assert "no input is known" in nothing.texts[0].get_text()


def test_of_an_input_that_changes_from_run_to_run_the_other_runs_are_shown_too():
    first = run_evidence(against=Against("time (h)", 0.0 * TIME_S, across_runs=True))
    second = run_evidence("run-2", against=Against("time (h)", 0.0 * TIME_S + 1.0, across_runs=True))
    drawn = axes()
    draw_dependence(drawn, evidence(first, second), first)
    assert set(lines_of(drawn)["other runs, before"].get_xdata()) == {1.0}


def test_the_colour_scale_is_that_of_all_runs():
    louder = run_evidence("run-2", size_before=np.full(1000, 2.0))
    assert largest_size(evidence(run_evidence(), louder)) == 2.0


def test_a_picture_a_run_is_written(tmp_path):
    odd = evidence(run_evidence(), run_evidence("run 2/b"))
    files = write_pictures(replace(DRAWN, evidence=odd), tmp_path / "pictures")
    assert [file.name for file in files] == ["gap_run-1.png", "gap_run_2_b.png"]
    assert all(file.read_bytes().startswith(PNG) and file.stat().st_size > 20_000 for file in files)
    assert write_pictures(replace(GAP, evidence=None), tmp_path / "none") == []


def test_pictures_that_cannot_be_written_are_an_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(NotUnderstoodError):
        write_pictures(DRAWN, tmp_path / "file")
    with pytest.raises(NotUnderstoodError):
        write_pictures(DRAWN, tmp_path / "no" / "folder")


def test_the_whole_figure_has_its_panels_and_is_a_png():
    figure = run_figure(DRAWN, DRAWN.evidence.runs[0])
    assert len([each for each in figure.axes if each.get_xlabel()]) == 4
    assert picture_bytes(figure).startswith(PNG)
    alone = run_figure(DRAWN, run_evidence(position_mm=None, against=None))
    assert len([each for each in alone.axes if each.get_xlabel()]) == 1
    with pytest.raises(ValueError, match="nothing to draw"):
        run_figure(GAP, run_evidence())
