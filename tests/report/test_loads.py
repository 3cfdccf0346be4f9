"""Figures of forces and deflection: lines as long as they can be seen, else bands with every extreme."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from gcode2krl.report.coloured_path import coloured_path_figure
from gcode2krl.report.columns import TimeColumns
from gcode2krl.report.deflections import deflection_figure, share_figure
from gcode2krl.report.forces import engaged_share, force_figure
from gcode2krl.report.loads import draw_confidence
from tests.report.scenes import (
    DOG_LEG,
    deflection_of,
    draw,
    forces_of,
    labels,
    motion_from,
    motion_of,
    targets_of,
    texts,
    toolpath_of,
)

PEAK = 123_456


@pytest.fixture(scope="module")
def circles():
    """200,000 samples of circles at three depths, the force once around in each, and one peak."""
    rows = 200_000
    angle = np.arange(rows) % 125 * 2 * np.pi / 125
    z_mm = -5.0 * (1 + np.arange(rows) * 3 // rows)
    position = np.stack([50 + 20 * np.cos(angle), 20 * np.sin(angle), z_mm], axis=1)
    motion = motion_from(position, np.minimum(1 + np.arange(rows) * 3 // rows, 3), np.zeros(rows, dtype=bool))
    force = 100.0 * np.stack([np.cos(angle), np.sin(angle), 0.1 + 0 * angle], axis=1)
    force *= np.where(np.arange(rows) % 100 < 50, 1.0, 0.2)[:, None]
    force[PEAK] = [0.0, 450.0, 0.0]
    return toolpath_of(DOG_LEG[:4]), motion, force


def test_short_forces_are_lines():
    motion = motion_of(targets_of(DOG_LEG))
    force = np.tile([30.0, 40.0, 0.0], (len(motion), 1))
    figure = force_figure(toolpath_of(DOG_LEG), motion, forces_of(motion, force))
    draw(figure)
    assert {"mean of a revolution", "x in $BASE", "90 %: ± 40%"} <= labels(figure)
    assert any(words.startswith("largest 50 N at 0.00 s, line 1") for words in texts(figure))


def test_a_band_wider_than_the_force_is_drawn():
    axes = Figure().add_subplot()
    time_s = np.arange(4000) * 0.012
    draw_confidence(axes, time_s, 100.0 + np.sin(9.0 * time_s), 1.2)
    assert axes.collections[0].get_paths()[0].vertices[:, 1].min() == 0.0


@pytest.mark.slow
def test_long_forces_are_bands_and_the_worst_is_enlarged(circles):
    toolpath, motion, force = circles
    figure = force_figure(toolpath, motion, forces_of(motion, force))
    draw(figure)
    first = figure.axes[0]
    (band,) = [
        each for each in first.collections if each.get_label() == "mean of a revolution, lowest to highest"
    ]
    assert band.get_paths()[0].vertices[:, 1].max() == 450.0
    assert first.get_ylim()[1] > 450.0, "the largest force is never beyond the frame"
    (peaks,) = [line for line in first.lines if line.get_label() == "highest peak of a revolution"]
    assert np.nanmax(peaks.get_ydata()) == pytest.approx(675.0)
    assert "1: 450 N\nat 1481.47 s, line 12" in texts(figure)
    enlarged = next(axes for axes in figure.axes if axes.get_title(loc="left").startswith("1: "))
    assert max(line.get_ydata().max() for line in enlarged.lines if len(line.get_xdata()) > 2) == 675.0


def test_engagement_is_the_share_of_samples():
    time_s = np.arange(1000) * 0.01
    phi_rad = np.full((1000, 4), np.nan)
    phi_rad[::2, :2] = np.radians([30.0, 90.0])
    phi_rad[500:, 2:] = np.radians([120.0, 180.0])
    share = engaged_share(TimeColumns.of(time_s, 10), phi_rad)
    assert share.shape == (180, 10)
    assert (share[30:90] == 0.5).all()
    assert (share[:30] == 0.0).all()
    assert (share[90:120] == 0.0).all()
    assert (share[120:, :5] == 0.0).all()
    assert (share[120:, 5:] == 1.0).all()


@pytest.mark.slow
def test_long_deflection_is_a_band_and_the_worst_is_enlarged(circles):
    toolpath, motion, force = circles
    figure = deflection_figure(toolpath, motion, deflection_of(force / 300.0))
    draw(figure)
    assert "deflection, lowest to highest" in labels(figure)
    assert "1: 1.5 mm\nat 1481.47 s, line 12" in texts(figure)


def test_shares_are_those_of_the_worst_sample_of_each_stretch(circles):
    toolpath, motion, _ = circles
    share = np.tile([0.1, 0.2], (len(motion), 1))
    share[PEAK] = [1.5, 0.5]
    figure = share_figure(toolpath, motion, ("A1", "A2"), share)
    draw(figure)
    heights = [each.get_paths()[0].vertices[:, 1].max() for each in figure.axes[0].collections]
    assert heights == pytest.approx([1.5, 2.0])
    assert "where it bends most, 1481.47 s, line 12, A1 is 75% of it" in texts(figure)


@pytest.mark.slow
def test_no_pass_hides_a_worse_one(circles):
    """Three depths over one another, the first with 1.7 mm, the last with next to nothing."""
    toolpath, motion, _ = circles
    bent_mm = np.choose(np.arange(len(motion)) * 3 // len(motion), [1.7, 0.4, 0.01])
    figure = coloured_path_figure(toolpath, motion, bent_mm, "deflection (mm)", "Deflection on the path")
    draw(figure)
    seen = figure.axes[0].images[-1].get_array().compressed()
    assert np.mean(seen == 1.7) > 0.97
    passes = [axes for axes in figure.axes if axes.get_title(loc="left").startswith("T1")]
    assert [axes.get_title(loc="left") for axes in passes] == ["T1, Z -5", "T1, Z -10", "T1, Z -15"]
    assert [axes.get_title(loc="right") for axes in passes] == ["worst 1.7", "worst 0.4", "worst 0.01"]
    for axes, worst in zip(passes, (1.7, 0.4, 0.01), strict=True):
        assert np.allclose(axes.images[-1].get_array().compressed(), worst)


@pytest.mark.slow
def test_passes_beside_each_other_are_one_picture():
    motion = motion_of(targets_of(DOG_LEG))
    figure = coloured_path_figure(toolpath_of(DOG_LEG), motion, np.ones(len(motion)), "force (N)", "Force")
    draw(figure)
    assert not [axes for axes in figure.axes if axes.get_title(loc="left").startswith("T1")]
    assert "worst force (N)  1: 1 at line 11,  2: 1 at line 12,  3: 1 at line 13" in texts(figure)


@pytest.mark.slow
def test_an_outlier_does_not_darken_the_path(circles):
    toolpath, motion, _ = circles
    values = np.full(len(motion), 1.0)
    values[PEAK] = 100.0
    figure = coloured_path_figure(toolpath, motion, values, "force (N)", "Force")
    assert figure.axes[0].images[-1].norm.vmax < 2.0
    assert any("1: 100 at line 12" in words for words in texts(figure))


@pytest.mark.slow
def test_a_move_to_the_tool_changer_does_not_shrink_the_part(circles):
    toolpath, motion, _ = circles
    position = motion.position_mm.copy()
    position[-5:] = [5000.0, 0.0, 800.0]
    values = np.ones(len(motion))
    values[-5:] = 0.0
    far = type(motion)(**{**vars(motion), "position_mm": position})
    figure = coloured_path_figure(toolpath, far, values, "force (N)", "Force")
    left, right, _, _ = figure.axes[0].images[-1].get_extent()
    assert (left, right) == pytest.approx((30.0, 70.0), abs=1.0)


def test_drawing_a_map_warns_of_nothing(caplog):
    motion = motion_of(targets_of(DOG_LEG))
    draw(coloured_path_figure(toolpath_of(DOG_LEG), motion, np.ones(len(motion)), "force (N)", "Force"))
    assert not caplog.records, "limits that are fixed fight the aspect"


@pytest.mark.slow
def test_all_in_air_is_pale():
    motion = motion_of(targets_of(DOG_LEG))
    draw(coloured_path_figure(toolpath_of(DOG_LEG), motion, np.zeros(len(motion)), "force (N)", "Force"))
    figure = force_figure(toolpath_of(DOG_LEG), motion, forces_of(motion, np.zeros((len(motion), 3))))
    draw(figure)
