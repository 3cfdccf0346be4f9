"""Figures: labelled, with all peaks and gaps, for any motion, the same bytes each time."""

import subprocess
import sys

import numpy as np
import pytest

from gcode2krl import read_gcode, set_targets
from gcode2krl.report.corner_marks import corners_apart
from gcode2krl.report.drawing import MOST_POINTS, intervals, line_ticks, thin, thin_path
from gcode2krl.report.figures import save_figures
from gcode2krl.report.joints import joints_figure
from gcode2krl.report.kinematics import kinematics_figure
from gcode2krl.report.path import path_figure, smooth, speed_share, worst_corner
from gcode2krl.tables import Joints, Motion
from tests.conftest import ROOT
from tests.report.scenes import (
    DOG_LEG,
    LIMITS_DEG,
    SPEEDS_DEG_S,
    draw,
    joints_of,
    labels,
    longest_line,
    motion_from,
    motion_of,
    targets_of,
    texts,
    toolpath_of,
)

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def dog_leg():
    targets = targets_of(DOG_LEG)
    return toolpath_of(DOG_LEG), targets, motion_of(targets)


@pytest.fixture(scope="module")
def test_piece(cell):
    toolpath = read_gcode(ROOT / "examples" / "test_piece.nc")
    targets = set_targets(toolpath, cell)
    return toolpath, targets, motion_of(targets)


@pytest.fixture(scope="module")
def long():
    """750,000 samples of a raster with one peak of one sample."""
    rows = 750_000
    points = np.array([[0, 0, 0], [400, 0, 0], [400, 100, 0], [0, 100, 0.0]])
    time = np.arange(rows)
    wave = 200 - np.abs(time % 800 - 400) / 2.0
    position = np.stack([wave, time * 100 / rows, np.sin(time / 1000)], axis=1)
    motion = motion_from(position, np.minimum(1 + time // 250_000, 3), time % 100 < 30)
    speed = motion.speed_mm_s.copy()
    speed[123_457] = 777.0
    motion = Motion(**{**vars(motion), "speed_mm_s": speed})
    return toolpath_of(points), targets_of(points), motion


class TestPath:
    def test_views_and_corner(self, dog_leg):
        figure = path_figure(*dog_leg)
        draw(figure)
        top, side, zoom, _ = figure.axes
        assert (top.get_xlabel(), top.get_ylabel()) == ("X (mm)", "Y (mm)")
        assert (side.get_xlabel(), side.get_ylabel()) == ("X (mm)", "Z (mm)")
        assert top.get_aspect() == 1.0
        assert zoom.get_aspect() == 1.0
        # the right angle at the end of line 12, 10 mm before it: 10·cos(45°)/2
        assert [text.get_text() for text in zoom.texts] == ["end of line 12\n3.536 mm from the path"]

    def test_side_view_is_the_larger(self):
        points = DOG_LEG[:, [1, 0, 2]]
        targets = targets_of(points)
        figure = path_figure(toolpath_of(points), targets, motion_of(targets))
        assert figure.axes[1].get_xlabel() == "Y (mm)"

    def test_flat_part_is_stretched_and_says_so(self, test_piece):
        figure = path_figure(*test_piece)
        draw(figure)
        side = figure.axes[1]
        assert side.get_title(loc="left") == f"From the side, Z drawn {side.get_aspect():.0f} times larger"

    def test_without_a_corner_no_zoom(self):
        targets = targets_of(DOG_LEG, cdis=0.0)
        figure = path_figure(toolpath_of(DOG_LEG), targets, motion_of(targets))
        draw(figure)
        assert len(figure.axes) == 2

    def test_home_is_not_a_programmed_line(self, dog_leg):
        figure = path_figure(*dog_leg)
        programmed = figure.axes[0].lines[0]
        assert np.nanmax(programmed.get_xdata()) == 100.0

    @pytest.mark.slow
    def test_long_is_coloured_by_depth_with_nothing_lost(self, long):
        figure = path_figure(*long)
        draw(figure)
        top, side = figure.axes[:2]
        depth = top.images[-1]
        assert "deepest" in top.get_title(loc="left")
        left, right, _, _ = depth.get_extent()
        assert left < 0.0
        assert right > 200.0
        z_mm = long[2].position_mm[:, 2]
        assert depth.norm.vmin == pytest.approx(z_mm.min())
        assert depth.get_array().min() == pytest.approx(z_mm.min())
        assert side.get_ylabel() == "Z (mm)"

    @pytest.mark.slow
    def test_many_moves_show_speed_pass_by_pass(self):
        levels = [[x, y, z] for z in (-5.0, -10.0) for y in range(30) for x in (0, 40)[:: 1 - 2 * (y % 2)]]
        points = np.repeat(np.array(levels, dtype=float), 40, axis=0)
        points[:, 0] += np.tile(np.linspace(0, 1, 40), len(levels))
        targets = targets_of(points, cdis=0.0)
        motion = motion_of(targets)
        slow = np.where(motion.position_mm[:, 2] < -9.0, 10.0, 50.0)
        motion = Motion(**{**vars(motion), "speed_mm_s": slow})
        toolpath = toolpath_of(points)
        figure = path_figure(toolpath, targets, motion)
        draw(figure)
        passes = [axes for axes in figure.axes if axes.get_title(loc="left").startswith("T1")]
        assert [axes.get_title(loc="left") for axes in passes] == ["T1, Z -5", "T1, Z -10"]
        upper, lower = (axes.images[-1].get_array() for axes in passes)
        assert np.median(lower.compressed()) == pytest.approx(20.0)
        assert np.median(upper.compressed()) == pytest.approx(100.0)
        lost_s = float(passes[1].get_title(loc="right").split()[0])
        step_s = np.diff(motion.time_s, append=motion.time_s[-1:])
        assert lost_s == pytest.approx(0.8 * step_s[motion.position_mm[:, 2] < -9.99].sum(), abs=0.5)
        assert speed_share(toolpath, motion).min() == pytest.approx(20.0)

    def test_corners_too_close_to_tell_apart_are_not_marked(self):
        circle = np.linspace(0, 2 * np.pi, 200)
        points = np.stack([20 * np.cos(circle), 20 * np.sin(circle), 0 * circle], axis=1)
        points = np.vstack([points, [[300, 0, 0], [300, 100, 0]]])
        targets = targets_of(points, cdis=0.2)
        figure = path_figure(toolpath_of(points), targets, motion_of(targets, speed=5.0))
        draw(figure)
        marks = [line for line in figure.axes[0].lines if "told apart" in line.get_label()]
        assert len(marks) == 1
        assert np.allclose(marks[0].get_xdata(), 300.0, atol=0.3), "only the corner far from the circle"

    def test_an_arc_of_blended_chords_is_not_one_corner(self):
        corner = np.zeros(100, dtype=bool)
        corner[[10, 11, *range(40, 60)]] = True
        move = np.repeat(np.arange(20, dtype=np.int32), 5)
        shown = corners_apart(np.arange(100.0), corner, move, 5.0)
        assert np.flatnonzero(shown).tolist() == [10, 11]

    @pytest.mark.slow
    @pytest.mark.parametrize("rows", [1, 2])
    def test_tiny(self, rows):
        motion = motion_from(DOG_LEG[1 : 1 + rows], np.full(rows, 1), np.zeros(rows, dtype=bool))
        toolpath, targets = toolpath_of(DOG_LEG), targets_of(DOG_LEG, cdis=0.0)
        draw(path_figure(toolpath, targets, motion))
        draw(kinematics_figure(toolpath, motion))
        draw(joints_figure(motion, joints_of(motion), LIMITS_DEG, SPEEDS_DEG_S))

    def test_empty_is_refused(self, dog_leg):
        empty = Motion(
            **{k: (v[:0] if isinstance(v, np.ndarray) else v) for k, v in vars(dog_leg[2]).items()}
        )
        with pytest.raises(ValueError, match="no sample"):
            path_figure(dog_leg[0], dog_leg[1], empty)


class TestWorstCorner:
    def test_of_samples_too_far_apart_is_the_parabolas(self):
        targets = targets_of(DOG_LEG, cdis=0.5)
        corner = worst_corner(targets, motion_of(targets))
        assert not corner.sampled
        assert corner.distance_mm == pytest.approx(0.5 * np.cos(np.pi / 4) / 2)

    @pytest.mark.parametrize("angle_deg", [30.0, 75.0, 120.0, 170.0])
    def test_of_samples_is_the_formula(self, angle_deg):
        turn = np.radians(180 - angle_deg)
        points = np.array([[0, 0, 0], [50, 0, 0], [50 + 50 * np.cos(turn), 50 * np.sin(turn), 0]])
        targets = targets_of(points, cdis=80.0)  # truncated to L/2
        corner = worst_corner(targets, motion_of(targets))
        assert corner.sampled
        assert corner.line == 11
        assert corner.reach_mm == pytest.approx(25.0)
        assert corner.distance_mm == pytest.approx(25 * np.cos(np.radians(angle_deg / 2)) / 2, rel=1e-3)

    def test_straight_and_reversal_are_none(self):
        points = np.array([[0, 0, 0], [50, 0, 0], [100, 0, 0], [20, 0, 0.0], [20, 0, 0]])
        targets = targets_of(points)
        assert worst_corner(targets, motion_of(targets)) is None

    def test_curve_through_samples_is_exact_on_a_parabola(self):
        t = np.arange(12.0)
        curve = smooth(np.stack([t, t**2], axis=1))
        inner = curve[(curve[:, 0] > 1) & (curve[:, 0] < 10)]
        assert np.allclose(inner[:, 1], inner[:, 0] ** 2)


class TestKinematics:
    def test_panels(self, dog_leg):
        toolpath, _, motion = dog_leg
        figure = kinematics_figure(toolpath, motion)
        draw(figure)
        speed, acceleration, jerk = figure.axes
        assert speed.get_ylabel() == "Speed (mm/s)"
        assert acceleration.get_ylabel() == "Acceleration (mm/s²)"
        assert jerk.get_ylabel() == "Jerk (mm/s³)"
        assert jerk.get_xlabel() == "Time (s)"
        assert speed.get_shared_x_axes().joined(speed, jerk)
        (upper,) = speed.child_axes
        assert [tick.get_text() for tick in upper.get_xticklabels()] == ["12", "13", "14"]  # 11 lasts 0.1 s
        assert upper.get_xlabel().startswith("G-code line")
        assert [line.get_label() for line in speed.lines] == ["programmed feed", "commanded"]
        assert all(axes.collections for axes in figure.axes)  # the shaded corners
        assert "approximated corner" in labels(figure)
        assert np.isnan(speed.lines[0].get_ydata()[-1])  # no feed on a rapid

    @pytest.mark.slow
    def test_long_names_the_outlier_that_is_beyond_the_frame(self, long):
        toolpath, _, motion = long
        speed = motion.speed_mm_s.copy()
        speed[123_457] = 7770.0
        figure = kinematics_figure(toolpath, Motion(**{**vars(motion), "speed_mm_s": speed}))
        draw(figure)
        assert longest_line(figure) <= MOST_POINTS
        panel = figure.axes[0]
        assert panel.get_ylim()[1] < 100.0, "the peak does not flatten the rest"
        words = "largest 7,770 mm/s at 1481.48 s, line 11"
        (note,) = [text for text in panel.texts if text.get_text() == words]
        assert note.xy == (motion.time_s[123_457], 1.0)
        assert "1 of 750,000 samples beyond the frame" in texts(figure)
        (arrows,) = [line for line in panel.lines if line.get_label() == "beyond the frame"]
        assert arrows.get_xdata().tolist() == [motion.time_s[123_457]]

    def test_long_keeps_the_peak(self, long):
        toolpath, _, motion = long
        speed = motion.speed_mm_s.copy()
        speed[123_457] = 177.0
        figure = kinematics_figure(toolpath, Motion(**{**vars(motion), "speed_mm_s": speed}))
        assert (
            max(line.get_ydata().max() for line in figure.axes[0].lines if line.get_label() == "commanded")
            == 177
        )
        assert "largest 177 mm/s at 1481.48 s, line 11" in texts(figure)

    @pytest.mark.slow
    def test_what_would_be_a_hatch_is_a_band_that_reaches_every_extreme(self, long):
        toolpath, _, motion = long
        rng = np.random.default_rng(3)
        acceleration = rng.uniform(0.0, 100.0, len(motion))
        acceleration[400_000] = 140.0
        figure = kinematics_figure(toolpath, Motion(**{**vars(motion), "acceleration_mm_s2": acceleration}))
        draw(figure)
        panel = figure.axes[1]
        (band,) = [each for each in panel.collections if each.get_label() == "commanded, lowest to highest"]
        assert band.get_paths()[0].vertices[:, 1].max() == 140.0
        assert not [line for line in panel.lines if line.get_label() == "commanded"]
        assert any("largest 140 mm/s²\nat 4800.00 s, line 12" in words for words in texts(figure)), "enlarged"

    def test_corners_that_cannot_be_told_apart_are_a_share_of_the_time(self, long):
        toolpath, _, motion = long
        figure = kinematics_figure(toolpath, motion)
        share = next(axes for axes in figure.axes if axes.get_ylabel().startswith("In corners"))
        height = share.collections[0].get_paths()[0].vertices[:, 1]
        assert np.median(height[height > 0]) == pytest.approx(30.0, abs=2.0)
        assert "approximated corner" not in labels(figure)

    def test_what_is_not_finite_is_a_gap(self, dog_leg):
        toolpath, _, motion = dog_leg
        jerk = np.full(len(motion), np.inf)
        draw(kinematics_figure(toolpath, Motion(**{**vars(motion), "jerk_mm_s3": jerk})))


class TestJoints:
    def test_panels(self, test_piece):
        motion = test_piece[2]
        figure = joints_figure(motion, joints_of(motion), LIMITS_DEG, SPEEDS_DEG_S)
        draw(figure)
        assert len(figure.axes) == 14
        labels = [axes.get_ylabel() for axes in figure.axes]
        assert labels.count("Angle (°)") == 2
        assert labels.count("Speed\n(% of limit)") == 2
        assert "Margin (°)" in labels
        shown = texts(figure)
        assert "limit 127° away" in shown

    @pytest.mark.slow
    def test_near_limit_is_drawn_far_is_noted(self, dog_leg):
        motion = dog_leg[2]
        limits = LIMITS_DEG.copy()
        limits[1] = [-112, -5]
        figure = joints_figure(motion, joints_of(motion), limits)
        draw(figure)
        assert len(figure.axes) == 8
        dashed = [sum(line.get_linestyle() == "--" for line in axes.lines) for axes in figure.axes[:6]]
        assert dashed[0] == 0
        assert dashed[1] == 1

    def test_beyond_the_limit_says_so(self, dog_leg):
        motion = dog_leg[2]
        limits = LIMITS_DEG.copy()
        limits[0] = [-10, 10]
        shown = texts(joints_figure(motion, joints_of(motion), limits))
        assert any(text.startswith("beyond its limit by 10") for text in shown)

    @pytest.mark.slow
    @pytest.mark.parametrize("lost", [slice(10, 50), slice(None)])
    def test_out_of_reach_is_shaded(self, dog_leg, lost):
        motion = dog_leg[2]
        joints = joints_of(motion)
        columns = {key: value.copy() for key, value in vars(joints).items() if key != "issues"}
        for key in ("q_rad", "qd_rad_s", "limit_margin_rad", "sigma_min"):
            columns[key][lost] = np.nan
        figure = joints_figure(motion, Joints(**columns), LIMITS_DEG, SPEEDS_DEG_S)
        draw(figure)
        assert all(axes.collections for axes in figure.axes)

    @pytest.mark.slow
    def test_long(self, long):
        figure = joints_figure(long[2], joints_of(long[2]), None, SPEEDS_DEG_S)
        draw(figure)
        assert longest_line(figure) <= MOST_POINTS

    def test_other_rows_are_refused(self, dog_leg, test_piece):
        with pytest.raises(ValueError, match="rows"):
            joints_figure(dog_leg[2], joints_of(test_piece[2]))


class TestThinning:
    def test_keeps_extremes_ends_and_gaps(self):
        rng = np.random.default_rng(1)
        values = rng.normal(size=100_003)
        values[[5_000, 70_000]] = [50.0, -60.0]
        values[40_000] = np.nan
        time, thinned = thin(np.arange(100_003.0), values, 1000)
        assert len(time) <= 1000
        assert (np.diff(time) > 0).all()
        assert (np.nanmax(thinned), np.nanmin(thinned)) == (50.0, -60.0)
        assert np.isnan(thinned).sum() == 1
        assert (time[0], time[-1]) == (0.0, 100_002.0)

    def test_short_is_as_it_is(self):
        time, values = thin(np.arange(5.0), np.arange(5.0))
        assert len(time) == len(values) == 5

    def test_path_keeps_its_bounds(self):
        points = np.random.default_rng(2).normal(size=(50_000, 2))
        assert (thin_path(points).max(axis=0) == points.max(axis=0)).all()

    def test_path_stays_within_a_pixel_and_keeps_its_gaps(self):
        angle = np.linspace(0, 20 * np.pi, 400_000)
        points = np.stack([100 * np.cos(angle), 100 * np.sin(1.01 * angle)], axis=1)
        points[123_456] = np.nan
        thinned = thin_path(points)
        assert len(thinned) < 0.9 * len(points)
        assert np.isnan(thinned[:, 0]).sum() == 1
        step = np.linalg.norm(np.diff(thinned, axis=0), axis=1)
        assert np.nanmax(step) < 2 * 200 / 3000 + np.nanmax(np.linalg.norm(np.diff(points, axis=0), axis=1))

    def test_intervals_join_only_when_many(self):
        time = np.arange(10_000.0)
        few, gap = intervals(time, (time > 10) & (time < 20))
        assert (few, gap) == ([(10.5, 9.0)], 0.0)
        many, gap = intervals(time, time % 2 == 0)
        assert len(many) <= 1500
        assert gap > 0.0

    def test_ticks_are_few_and_in_order(self):
        times, labels = line_ticks(np.arange(1000.0), np.arange(1000, dtype=np.int32))
        assert len(times) <= 15
        assert labels == sorted(labels, key=int)
        assert "0" not in labels


class TestSaving:
    @pytest.mark.slow
    def test_same_bytes_twice(self, tmp_path, dog_leg):
        toolpath, targets, motion = dog_leg

        def made(folder):
            figures = {
                "path": path_figure(toolpath, targets, motion),
                "kinematics": kinematics_figure(toolpath, motion),
                "joints": joints_figure(motion, joints_of(motion), LIMITS_DEG, SPEEDS_DEG_S),
            }
            return save_figures(figures, tmp_path / folder)

        first, second = made("a"), made("b")
        assert [path.name for path in first] == ["path.png", "kinematics.png", "joints.png"]
        assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]
        assert first[0].read_bytes().startswith(b"\x89PNG")

    def test_no_pyplot_and_no_matplotlib_in_the_room(self):
        code = (
            "import sys, gcode2krl.report; assert 'matplotlib' not in sys.modules;"
            "import gcode2krl.report.figures; assert 'matplotlib.pyplot' not in sys.modules"
        )
        subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)
