"""Predictions: saving and loading, slowed and lost time, the command."""

import io
import json
import tomllib

import numpy as np
import polars as pl
import pytest

from gcode2krl import Gcode2KrlError, Prediction, load_cell, plan_motion, predict, set_targets, solve_joints
from gcode2krl.gcode import read_stream
from gcode2krl.prediction import column_names
from gcode2krl.tables import Table
from tests.conftest import ROOT

TEST_PIECE = ROOT / "examples" / "test_piece.nc"


def _toolpath(text, cell):
    return read_stream(io.BytesIO(text.encode("ascii")), "part.nc", cell)


def _columns(table: Table):
    return {name: value for name, value in vars(table).items() if isinstance(value, np.ndarray)}


@pytest.fixture(scope="module")
def prediction():
    return predict(TEST_PIECE)


def test_everything_comes_back(prediction, tmp_path):
    prediction.save(tmp_path / "p")
    loaded = Prediction.load(tmp_path / "p")
    for name in ("toolpath", "targets", "motion", "joints", "forces", "deflection"):
        before, after = _columns(getattr(prediction, name)), _columns(getattr(loaded, name))
        assert set(before) == set(after)
        for column in before:
            np.testing.assert_array_equal(before[column], after[column], err_msg=f"{name}.{column}")
    assert loaded.cell == prediction.cell
    assert loaded.toolpath.events == prediction.toolpath.events
    assert loaded.targets.events == prediction.targets.events
    assert set(loaded.issues) == set(prediction.issues)
    assert loaded.forces.relative_band == prediction.forces.relative_band > 0
    assert loaded.deflection.relative_band == prediction.deflection.relative_band > 0


def test_names_on_disk(prediction, tmp_path):
    prediction.save(tmp_path / "p", csv=True)
    motion = pl.read_csv(tmp_path / "p" / "motion.csv")
    wanted = {
        "time_s",
        "position_x_mm",
        "rotation_w",
        "path_mm",
        "move",
        "corner",
        "q1_rad",
        "qd6_rad_s",
        "sigma_min",
    }
    assert wanted <= set(motion.columns)
    assert {"position_z_mm", "axis_x", "feed_mm_s", "source_line"} <= set(
        pl.read_parquet(tmp_path / "p" / "toolpath.parquet").columns
    )
    record = tomllib.loads((tmp_path / "p" / "prediction.toml").read_text(encoding="utf-8"))
    assert record["cell"]["frames"]["base"]["x_mm"] == 1500.0
    assert len(record["inputs"]["program_sha256"]) == 64


@pytest.mark.parametrize(
    ("name", "width", "names"),
    [
        ("time_s", 0, ["time_s"]),
        ("position_mm", 3, ["position_x_mm", "position_y_mm", "position_z_mm"]),
        ("rotation", 4, ["rotation_x", "rotation_y", "rotation_z", "rotation_w"]),
        ("q_rad", 6, [f"q{n}_rad" for n in range(1, 7)]),
        ("force_base_N", 3, ["force_base_x_N", "force_base_y_N", "force_base_z_N"]),
    ],
)
def test_column_names(name, width, names):
    assert column_names(name, width) == names


@pytest.mark.parametrize("damage", ["missing", "toml", "schema", "columns"])
def test_a_damaged_folder_is_one_clear_line(prediction, tmp_path, damage):
    folder = tmp_path / "p"
    if damage != "missing":
        prediction.save(folder)
    if damage == "toml":
        (folder / "prediction.toml").write_text("[", encoding="ascii")
    if damage == "schema":
        (folder / "prediction.toml").write_text('schema = "else"', encoding="ascii")
    if damage == "columns":
        pl.DataFrame({"a": [1]}).write_parquet(folder / "targets.parquet")
    with pytest.raises(Gcode2KrlError) as caught:
        Prediction.load(folder)
    assert len(str(caught.value).splitlines()) == 1
    assert caught.value.exit_code == 2


def test_the_motion_starts_at_rest_at_the_first_position_and_ends_with_the_last_move(prediction):
    motion, toolpath = prediction.motion, prediction.toolpath
    first = int(np.flatnonzero(toolpath.is_position())[0])
    assert motion.move[0] == first
    np.testing.assert_array_equal(motion.position_mm[0], toolpath.position_mm[first])
    np.testing.assert_allclose(motion.position_mm[-1], toolpath.position_mm[-1], atol=1e-6)
    assert motion.speed_mm_s[0] == 0
    assert motion.speed_mm_s[-1] == pytest.approx(0, abs=1e-6)
    assert (np.diff(motion.move) >= 0).all()
    np.testing.assert_allclose(np.diff(motion.time_s), 0.012, atol=1e-9)


def test_joint_speeds_agree_with_the_jacobian(prediction):
    from gcode2krl.robot import jacobian

    joints, motion = prediction.joints, prediction.motion
    rows = np.arange(50, len(motion) - 50, 97)
    twist = np.einsum("nij,nj->ni", jacobian(joints.q_rad[rows], prediction.cell), joints.qd_rad_s[rows])
    smooth = ~motion.corner[rows] & (motion.jerk_mm_s3[rows] == 0)
    np.testing.assert_allclose(
        np.linalg.norm(twist[smooth, :3], axis=1), motion.speed_mm_s[rows][smooth], rtol=0.02, atol=0.5
    )


def test_a_joint_too_slow_for_the_feed_slows_the_robot_down(tmp_path):
    path = tmp_path / "cell.toml"
    path.write_text(
        "based_on = 'demonstration'\n[robot.speeds]\nqd_deg_s = [5.0, 101, 107, 122, 113, 175]\n",
        encoding="ascii",
    )
    cell = load_cell(path)
    toolpath = _toolpath("G21 T1 M6\nS9000 M3\nG0 G43 H1 Z50\nX0 Y-200\nG1 Y200 F6000\nM30\n", cell)
    targets = set_targets(toolpath, cell)
    assert "joint-speed" in [issue.code for issue in targets.issues]
    motion = plan_motion(targets, cell)
    speed_deg_s = np.degrees(np.abs(solve_joints(motion, cell).qd_rad_s[:, 0])).max()
    assert speed_deg_s <= 5.0 * 1.01
    assert speed_deg_s > 1.5 * 0.9
    (found,) = [issue for issue in motion.issues if issue.code == "joint-speed"]
    assert found.line == 5
    assert "s more" in found.message


def test_a_way_to_home_within_the_program_slows_nothing_down(cell):
    """At HOME the wrist is stretched: on a straight line through it A4 would turn at once."""
    part = "G0 X0 Y{0} Z50\nG1 Z20 F1000\nG1 X50\nG0 Z50\n"
    text = f"G21 T1 M6\nS9000 M3\nG43 H1\n{part.format(-400)}G28 Z0\nG28 X0 Y0\n{part.format(400)}M30\n"
    motion = plan_motion(set_targets(_toolpath(text, cell), cell), cell)
    assert "joint-speed" not in [issue.code for issue in motion.issues]
    assert motion.time_s[-1] < 30.0


def test_what_costs_time_is_said_with_line_and_seconds(cell):
    short = "".join(f"X{k * 0.4:.2f} Y{(k % 2) * 0.05:.2f}\n" for k in range(1, 300))
    text = f"G21 T1 M6\nS9000 M3\nG0 G43 H1 Z50\nX0 Y0\nG1 Z0 F600\nF4500\n{short}G4 P3\nG0 Z50\nM30\n"
    found = {issue.code: issue for issue in plan_motion(_toolpath(text, cell), cell).issues}
    assert {"short-moves", "exact-stops"} <= set(found)
    assert "unverified" in found["short-moves"].message
    assert 6 < found["short-moves"].line < 306
    assert found["exact-stops"].line == 305


def test_a_tolerance_asked_for_is_kept(cell):
    from gcode2krl.chain import corner_errors

    moves = "G1 Z0 F900\nX10\nY10\nX30 Y15\nX31\nX30.5 Y30\nG0 Z50\nM30\n"
    text = f"G21 T1 M6\nS9000 M3\nG0 G43 H1 Z50\nX0 Y0\n{moves}"
    toolpath = _toolpath(text, cell)
    for tolerance in (0.5, 0.05, 0.003):
        targets = set_targets(toolpath, cell, tolerance)
        error_mm, findings = corner_errors(toolpath, targets, cell, tolerance)
        assert findings == ()
        assert 0.2 * tolerance < error_mm.max() <= tolerance
        motion = plan_motion(targets, cell, 0.0005)
        vertices = toolpath.position_mm[toolpath.is_position()]
        for vertex in vertices[2:-2]:
            assert np.linalg.norm(motion.position_mm - vertex, axis=1).min() <= tolerance + 1e-3
    coarse = set_targets(toolpath, cell, 0.5)
    _, findings = corner_errors(toolpath, coarse, cell, 0.05)
    assert {issue.code for issue in findings} == {"corner-tolerance"}


def test_an_added_approach_is_not_held_to_the_tolerance_of_the_part(cell):
    from gcode2krl.chain import corner_errors

    head = "G21 T1 M6\nS9000 M3\nG64 P0.01\nG0 G43 H1 Z50\nX0 Y0\n"
    toolpath = _toolpath(
        f"{head}G1 Z0 F900\nX40\nG28 G91 Z0\nG90\nG0 X80 Y50 Z5\nG1 Z0\nX99\nG0 Z50\nM30\n", cell
    )
    targets = set_targets(toolpath, cell)
    error_mm, findings = corner_errors(toolpath, targets, cell)
    assert findings == ()
    assert error_mm.max() > 0.01  # over the plane, by the cell's own CDIS


@pytest.mark.slow
def test_the_command_writes_tables_and_pictures(run, tmp_path):
    done = run("predict", TEST_PIECE, "-o", "out", "--csv", "--plot", "--json", "--dt", "0.004", code=0)
    result = json.loads(done.out)
    assert result["time_s"] > 60
    assert 0 < result["corner_error_mm"] <= 0.02
    corners = pl.read_csv(tmp_path / "out" / "corners.csv")
    assert corners["error_mm"].max() == pytest.approx(result["corner_error_mm"])
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert {
        "prediction.toml",
        "motion.parquet",
        "motion.csv",
        "path.png",
        "kinematics.png",
        "joints.png",
    } <= names


@pytest.mark.parametrize(
    ("arguments", "words"),
    [(["-o", "nowhere/out"], "cannot write"), (["--dt", "-1"], "not positive"), (["-o", "-"], "folder")],
)
def test_wrong_options_of_the_command(run, arguments, words):
    done = run("predict", TEST_PIECE, *arguments, code=2)
    assert words in done.err
    assert len(done.err.strip().splitlines()) == 1
