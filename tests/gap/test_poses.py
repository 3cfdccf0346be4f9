"""Static poses as a run: offsets of joints from poses of a robot that are computed another way."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl import load_cell, robot
from gcode2krl.errors import NotUnderstoodError, RefusedError
from gcode2krl.gap import diagnose_log
from gcode2krl.gap.answer.words import headline
from gcode2krl.gap.compare.links import MECHANICS
from gcode2krl.gap.compare.pair import is_of_poses, log_pairs
from gcode2krl.gap.noise.source import noise_of_poses, revisits
from gcode2krl.runs import load_run
from tests.plant import pose_arms

pytestmark = pytest.mark.slow

CELL = load_cell()
POSES = 60
SIGMA_MM = 0.02


def written(
    folder,
    offset_deg=(0.0,) * 6,
    seed=1,
    head="[noise]\ntcp_mm = 0.02\n",
    time="t_s",
    extra="",
    poses=POSES,
    visits=1,
):
    """Write a run of poses of a robot whose joints are off by some degrees; return it as read."""
    generator = np.random.default_rng(seed)
    middle = np.array([0.0, -90.0, 100.0, 20.0, 40.0, 10.0])
    q_deg = np.tile(middle + generator.uniform(-35.0, 35.0, (poses, 6)), (visits, 1))
    tip, _ = robot.forward(np.radians(q_deg + offset_deg), CELL, 1)
    tip = tip + SIGMA_MM * generator.standard_normal(tip.shape)
    names = [time, *(f"q{n}_deg" for n in range(1, 7)), "x_mm", "y_mm", "z_mm", "temp1_C", "ambient_C"]
    lines = [",".join(names)]
    for n in range(len(q_deg)):
        when = f"2024-05-06T07:{n:02d}:30" if time == "time" else f"{30.0 * n:g}"
        warm = "" if n == 3 else f"{20.0 + 0.1 * n:.2f}"
        lines.append(
            ",".join([when, *(f"{v:.6f}" for v in q_deg[n]), *(f"{v:.5f}" for v in tip[n]), warm, "21.5"])
        )
    folder.mkdir()
    (folder / "poses.csv").write_text("\n".join(lines) + "\n" + extra, encoding="utf-8")
    (folder / "run.toml").write_text(head, encoding="utf-8")
    return load_run(folder)


def test_columns_are_read_with_temperatures_and_without_gaps(tmp_path):
    run = written(tmp_path / "run")
    table = run.poses
    assert len(table) == POSES  # a missing temperature does not cost its row
    assert table.temperature_C.shape == (POSES, 8)
    assert np.isnan(table.temperature_C[3, 0])
    assert table.temperature_C[10, 0] == pytest.approx(21.0)
    assert np.isnan(table.temperature_C[:, 1:]).all()
    assert (table.ambient_C == 21.5).all()
    assert (table.segments == [[0, POSES]]).all()
    assert is_of_poses(run)
    assert not any("temp2_C" in issue.message for issue in run.issues)


def test_dates_become_seconds_from_the_first_pose(tmp_path):
    run = written(tmp_path / "run", time="time")
    np.testing.assert_allclose(run.poses.time_s, 60.0 * np.arange(POSES))


@pytest.mark.parametrize(
    ("change", "code", "words"),
    [
        (lambda text: text.replace("q3_deg", "q3"), "trace-column", "q3_deg"),
        (lambda text: text.replace("x_mm", "x"), "trace-column", "x_mm"),
        (lambda text: text.replace("\n60,", "\n10,"), "trace-time", "10 s does not come after 30 s"),
        (lambda text: text.replace("\n60,", "\nsixty,"), "trace-number", "row 4"),
        (lambda text: text.replace("t_s", "when"), "trace-column", "t_s"),
    ],
)
def test_a_wrong_table_is_an_error_that_names_row_and_column(tmp_path, change, code, words):
    written(tmp_path / "run")
    file = tmp_path / "run" / "poses.csv"
    file.write_text(change(file.read_text("utf-8")), encoding="utf-8")
    with pytest.raises(NotUnderstoodError) as error:
        load_run(tmp_path / "run")
    assert error.value.issues[0].code == code
    assert words in error.value.issues[0].message


def test_a_date_that_is_none_is_an_error(tmp_path):
    written(tmp_path / "run", time="time")
    file = tmp_path / "run" / "poses.csv"
    file.write_text(file.read_text("utf-8").replace("2024-05-06T07:02:30", "yesterday"), encoding="utf-8")
    with pytest.raises(NotUnderstoodError, match="'yesterday' is no date"):
        load_run(tmp_path / "run")


def test_each_pose_is_one_sample_of_the_mechanics_without_a_clock(tmp_path):
    run = written(tmp_path / "run")
    (pair,) = log_pairs([run], CELL)
    (trace,) = MECHANICS.traces([pair])
    assert trace.shape == (POSES, 3)
    assert not trace.rate.any()
    assert np.std(trace.residual) == pytest.approx(SIGMA_MM, rel=0.15)


def test_noise_is_white_and_as_stated_or_what_nothing_explains(tmp_path):
    run = written(tmp_path / "run", head="")
    (trace,) = MECHANICS.traces(log_pairs([run], CELL))
    form = np.random.default_rng(3).standard_normal((3, POSES, 20))
    pushed = replace(trace, measured=trace.measured + form.sum(axis=2).T)
    for noise in noise_of_poses([pushed], [form], [[]]):
        assert len(noise.a) == 0
        assert noise.sigma == pytest.approx(SIGMA_MM, rel=0.15)
    many = np.random.default_rng(4).standard_normal((3, POSES, 150))
    assert noise_of_poses([pushed], [many], [[]])[0].sigma > 1.0  # too few poses, and no one form fits
    assert noise_of_poses([replace(pushed, declared_sigma=0.5)], [form], [[]])[0].sigma == 0.5


def test_few_poses_without_stated_noise_do_not_make_the_gap_noise(tmp_path):
    """A dozen of poses beside a hundred forms and all of normal mismatch."""
    off = written(tmp_path / "off", offset_deg=(0.0, 0.05, 0.0, 0.0, 0.0, 0.0), head="", poses=12)
    gap = diagnose_log([off], CELL)
    assert [(cause.effect, cause.target) for cause in gap.named_causes] == [("mastering", "A2")]
    (link,) = [each for each in gap.links if each.link == "mechanics"]
    assert link.noise.learnt == pytest.approx(SIGMA_MM, rel=0.35)
    assert link.noise.source == "what no effect explains"
    for seed in range(2):
        sound = diagnose_log([written(tmp_path / f"{seed}", seed=seed, head="", poses=12)], CELL)
        assert sound.verdict == "no_gap"
        assert not [issue.code for issue in sound.issues]
        assert any("neither stated nor repeated" in note and "would be a gap" in note for note in sound.notes)


def test_poses_visited_again_tell_the_noise(tmp_path):
    off = written(tmp_path / "off", offset_deg=(0.0, 0.05, 0.0, 0.0, 0.0, 0.0), head="", poses=20, visits=3)
    (link,) = [each for each in diagnose_log([off], CELL).links if each.link == "mechanics"]
    assert link.noise.learnt == pytest.approx(SIGMA_MM, rel=0.15)
    assert link.noise.source == "repeats"
    (trace,) = MECHANICS.traces(log_pairs([off], CELL))
    assert len(revisits([trace])) == 60
    # readings in a row, at which it stands, are one visit
    stood = replace(trace.inputs, q_cmd_rad=np.repeat(trace.inputs.q_cmd_rad[:20], 3, axis=0))
    assert len(revisits([replace(trace, inputs=stood)])) == 0


def test_a_wrong_mastering_is_found_from_poses(tmp_path):
    run = written(tmp_path / "run", offset_deg=(0.0, 0.03, 0.0, 0.0, 0.0, 0.0))
    gap = diagnose_log([run], CELL)
    (cause,) = gap.named_causes
    assert (cause.effect, cause.target, cause.link) == ("mastering", "A2", "mechanics")
    value, low, high = cause.parameters["offset_deg"]
    assert low <= 0.03 <= high
    assert value == pytest.approx(0.03, abs=0.002)


@pytest.mark.parametrize("seed", [1, 2])
def test_sound_poses_are_no_gap(tmp_path, seed):
    assert diagnose_log([written(tmp_path / "run", seed=seed)], CELL).verdict == "no_gap"


def test_without_a_known_robot_poses_say_nothing(tmp_path):
    with pytest.raises(RefusedError, match="nothing that can be compared") as caught:
        diagnose_log([written(tmp_path / "run")])
    assert "a known robot" in caught.value.issues[0].remedy


@pytest.mark.parametrize(("poses", "least_told", "most_left_mm"), [(120, 8, 0.06), (24, 0, 0.25)])
def test_many_small_errors_are_the_arms_own_geometry(tmp_path, poses, least_told, most_left_mm):
    """17 errors at once; of one alone its own name is said (above)."""
    base, tool = CELL.frames.base, CELL.frames.tool
    arm = pose_arms.clean(pose_arms.KR300, 0)
    placed = {
        "tool_mm": (tool.x_mm, tool.y_mm, tool.z_mm),
        "place_mm": (-base.x_mm, -base.y_mm, -base.z_mm),
        "turn_deg": (0.0, 0.0, 0.0),
    }
    table = pose_arms.measured(pose_arms.MadeUp(**{**arm.__dict__, **placed}), poses, 3)
    rows = np.column_stack([30.0 * np.arange(poses), table.q_deg, table.seen_mm])
    names = ["t_s", *(f"q{n}_deg" for n in range(1, 7)), "x_mm", "y_mm", "z_mm"]
    folder = tmp_path / "run"
    folder.mkdir()
    np.savetxt(folder / "poses.csv", rows, delimiter=",", header=",".join(names), comments="", fmt="%.6f")
    (folder / "run.toml").write_text("", encoding="utf-8")
    gap = diagnose_log([load_run(folder)], CELL)
    assert gap.verdict in ("explained", "partly_explained")
    first = gap.causes[0]
    assert (first.effect, first.target) == ("geometry", None)
    assert first.is_named
    assert len(first.parameters) >= least_told
    assert gap.gap.rms_before > 0.3
    assert gap.gap.rms_after < most_left_mm
    assert any("neither stated nor repeated" in note for note in gap.notes)
    assert "own geometry" in headline(gap)
