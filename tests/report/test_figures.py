"""Figures: labelled, with all peaks and gaps, for any motion, the same bytes each time."""

import subprocess
import sys

import numpy as np
import pytest
from matplotlib.figure import Figure

from gcode2krl import read_gcode, set_targets
from gcode2krl.report.drawing import MOST_POINTS, intervals, line_ticks, smooth, thin, thin_path, worst_corner
from gcode2krl.report.figures import joints_figure, kinematics_figure, path_figure, save_figures
from gcode2krl.tables import Joints, Motion, Targets, Toolpath
from tests.conftest import ROOT

LIMITS_DEG = np.array([[-147, 147], [-140, -5], [-112, 153], [-350, 350], [-122.5, 122.5], [-350, 350.0]])
SPEEDS_DEG_S = np.array([84, 85, 83, 115, 110, 184.0])
DOG_LEG = np.array([[0, 0, 5], [0, 0, 0], [100, 0, 0], [100, 60, 0], [100, 60, 30.0]])


def toolpath_of(points, feed=50.0):
    rows = len(points)
    return Toolpath(
        position_mm=points,
        axis=np.tile([0.0, 0.0, 1.0], (rows, 1)),
        rapid=np.arange(rows) == rows - 1,
        feed_mm_s=np.where(np.arange(rows) == rows - 1, np.inf, feed),
        spindle_rad_s=np.zeros(rows),
        tool=np.ones(rows),
        exact_stop=np.zeros(rows),
        tolerance_mm=np.full(rows, np.nan),
        dwell_s=np.zeros(rows),
        source_line=10 + np.arange(rows),
        arc=np.full(rows, -1),
        machine=np.zeros(rows),
        known=np.ones((rows, 3)),
        length_offset_mm=np.full(rows, np.nan),
        length_offset_tool=np.full(rows, -1),
        source="dir/part.nc",
    )


def targets_of(points, cdis=10.0):
    """HOME, the points, HOME."""
    points = np.vstack([[500, 0, 500], points, [500, 0, 500]])
    rows = len(points)
    added = np.isin(np.arange(rows), [0, rows - 1])
    return Targets(
        position_mm=points,
        rotation=np.tile([0.0, 0.0, 0.0, 1.0], (rows, 1)),
        ptp=added | (np.arange(rows) == 1),
        home=added,
        speed_mm_s=np.where(added, np.nan, 50.0),
        cdis_mm=np.where(added, 0.0, cdis),
        wait_s=np.zeros(rows),
        move=np.where(added, -1, np.arange(rows) - 1),
        source_line=np.where(added, 0, 9 + np.arange(rows)),
        tool=np.ones(rows),
    )


def motion_of(targets, speed=50.0, dt=0.012):
    """A fake: the blended path of the programmed targets at constant speed, corners as parabolas."""
    rows = np.flatnonzero(targets.move >= 0)
    corners, pieces = targets.position_mm[rows], []
    for at in range(1, len(rows)):
        start, end = corners[at - 1], corners[at]
        half = np.linalg.norm(end - start) / 2
        if half == 0:
            continue
        along = (end - start) / (2 * half)
        reach = [0.0, 0.0]
        for side, row in enumerate((at - 1, at)):
            if 0 < row < len(rows) - 1:
                other = np.linalg.norm(corners[row + 1 if side else row - 1] - corners[row]) / 2
                reach[side] = min(targets.cdis_mm[rows[row]], half, other)
        pieces.append(
            (start + along * reach[0], end - along * reach[1], end, reach[1], targets.move[rows[at]])
        )
    position, move, corner = [corners[:1]], [[pieces[0][4]]], [[False]]
    for number, (start, end, vertex, reach, row) in enumerate(pieces):
        count = max(int(np.linalg.norm(end - start) / (speed * dt)), 1)
        s = np.linspace(0, 1, count + 1)[1:, None]
        position.append(start + s * (end - start))
        move.append([row] * count)
        corner.append([False] * count)
        if reach > 0 and number + 1 < len(pieces):
            count = int(2 * reach / (speed * dt))
            s = (np.arange(count)[:, None] + 0.5) / max(count, 1)
            after = pieces[number + 1][0]
            position.append((1 - s) ** 2 * end + 2 * s * (1 - s) * vertex + s**2 * after)
            move.append(np.where(s[:, 0] < 0.5, row, pieces[number + 1][4]))
            corner.append([True] * count)
    return motion_from(np.vstack(position), np.concatenate(move), np.concatenate(corner), speed, dt)


def motion_from(position, move, corner, speed=50.0, dt=0.012):
    rows = len(position)
    length = np.linalg.norm(np.diff(position, axis=0), axis=1)
    return Motion(
        time_s=np.arange(rows) * dt,
        position_mm=position,
        rotation=np.tile([0.0, 0.0, 0.0, 1.0], (rows, 1)),
        speed_mm_s=np.full(rows, speed),
        acceleration_mm_s2=np.where(corner, 200.0, 0.0),
        jerk_mm_s3=np.zeros(rows),
        path_mm=np.append(0.0, np.cumsum(length)),
        move=move,
        corner=corner,
        tool=np.ones(rows),
    )


def joints_of(motion, scale=1.0):
    wave = np.sin(motion.time_s[:, None] + np.arange(6))
    return Joints(
        q_rad=np.radians(np.array([0, -90, 90, 0, 45, 0]) + 20 * scale * wave),
        qd_rad_s=np.radians(20 * scale * np.cos(motion.time_s[:, None] + np.arange(6))),
        limit_margin_rad=np.radians(40 + 10 * wave[:, 0]),
        sigma_min=0.2 + 0.05 * wave[:, 1],
        status=np.zeros(len(motion)),
        turn=np.zeros(len(motion)),
    )


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


def longest_line(figure):
    return max(len(line.get_xdata()) for axes in figure.axes for line in axes.lines)


def texts(figure):
    return [text.get_text() for axes in figure.axes for text in (*axes.texts, axes.title, axes._right_title)]


def draw(figure):
    assert isinstance(figure, Figure)
    figure.draw_without_rendering()


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

    def test_long(self, long):
        figure = path_figure(*long)
        draw(figure)
        assert longest_line(figure) <= MOST_POINTS
        path = figure.axes[0].lines[1]
        assert np.nanmin(path.get_xdata()) == 0.0
        assert np.nanmax(path.get_xdata()) == 200.0

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
        assert np.isnan(speed.lines[0].get_ydata()[-1])  # no feed on a rapid

    def test_long_keeps_the_peak(self, long):
        toolpath, _, motion = long
        figure = kinematics_figure(toolpath, motion)
        draw(figure)
        assert longest_line(figure) <= MOST_POINTS
        assert figure.axes[0].lines[1].get_ydata().max() == 777.0
        assert "largest 777 mm/s at 1481.48 s, line 11" in texts(figure)

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
        thinned = thin_path(points)
        assert len(thinned) <= MOST_POINTS
        assert (thinned.max(axis=0) == points.max(axis=0)).all()

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
