"""The plant shares nothing with the package and, without effects, moves as the package says; its cases.

The only file of this folder that may import the package.
"""

import ast
import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from gcode2krl import load_cell, predict
from tests.plant import arm, cases, path
from tests.plant.effects import LIBRARY
from tests.plant.kinds import main
from tests.plant.robot import Run, joints_for, simulate
from tests.plant.scene import CELL_TOML, World
from tests.plant.waypoints import PROGRAMS

HERE = Path(__file__).parent
WORLD = World()


@pytest.fixture(scope="module")
def plain() -> dict[str, Run]:
    """Every program without effects and mismatch."""
    return {name: simulate(p().waypoints(), WORLD, []) for name, p in PROGRAMS.items()}


# independence -----------------------------------------------------------------------------------------------


def test_no_file_of_the_plant_imports_the_package():
    seen = 0
    for file in HERE.rglob("*.py"):
        if file.name == Path(__file__).name:
            continue
        seen += 1
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            for name in names:
                assert name.split(".")[0] not in {"gcode2krl", "importlib", "subprocess", "runpy"}, file
            assert not (isinstance(node, ast.Name) and node.id in {"__import__", "exec", "eval"}), file
    assert seen > 15


# against the package ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def predicted(tmp_path_factory):
    """What the package predicts for every program."""
    folder = tmp_path_factory.mktemp("programs")
    (folder / "cell.toml").write_text(CELL_TOML, encoding="utf-8")
    cell = load_cell(folder / "cell.toml")
    out = {}
    for name, program in PROGRAMS.items():
        (folder / f"{name}.nc").write_text(program().text(), encoding="utf-8")
        out[name] = predict(folder / f"{name}.nc", cell)
    return out


@pytest.mark.parametrize("name", PROGRAMS)
def test_motion_agrees_to_a_hundredth_of_a_millimetre_and_two_milliseconds(plain, predicted, name):
    run, motion, joints = plain[name], predicted[name].motion, predicted[name].joints
    end_s = run.links[-1].end_s
    assert motion.time_s[-1] - 0.012 - 0.002 <= end_s <= motion.time_s[-1] + 0.002  # a row every 12 ms
    place = path.commanded(run.links, motion.time_s, WORLD)
    assert np.linalg.norm(place - motion.position_mm, axis=1).max() < 0.01
    assert np.abs(joints_for(WORLD, place) - joints.q_rad).max() < 1e-5
    assert 10.0 < end_s < 21.0


@pytest.mark.parametrize("name", PROGRAMS)
def test_forces_agree_with_the_height_field(plain, predicted, name):
    forces = predicted[name].forces
    if forces is None:
        pytest.skip("forces are not predicted")
    run, time_s = plain[name], predicted[name].motion.time_s
    mine = np.stack([np.interp(time_s, run.slow_s, run.cut.force_N[:, k]) for k in range(3)], axis=1)
    off = np.linalg.norm(mine - forces.force_base_N, axis=1)
    peak = max(np.linalg.norm(mine, axis=1).max(), 1.0)
    assert np.median(off) < 0.03 * peak  # steady cuts
    assert np.quantile(off, 0.98) < 0.06 * peak  # entries, exits and rounded corners


@pytest.mark.parametrize("name", PROGRAMS)
def test_deflection_agrees_under_the_predicted_forces(plain, predicted, name):
    prediction = predicted[name]
    if prediction.deflection is None:
        pytest.skip("deflection is not predicted")
    body = arm.reference_pose(WORLD)
    q_rad, forces = np.ascontiguousarray(prediction.joints.q_rad), prediction.forces
    force, moment = (np.ascontiguousarray(v) for v in (forces.force_base_N, forces.moment_base_Nmm))
    angles = arm.torques(body, q_rad, force, moment) / WORLD.stiffness_Nmm_rad
    bending = arm.bent(body, q_rad, angles)[0] - arm.pose(body, q_rad)[0]
    assert np.abs(bending - prediction.deflection.deflection_base_mm).max() < 1e-5


# cases ------------------------------------------------------------------------------------------------------


def test_a_case_is_whole_and_its_label_is_apart(tmp_path):
    label = cases.make_case(7, tmp_path / "case", "backlash@A2", "same")
    assert json.loads((tmp_path / "case.label.json").read_text(encoding="utf-8")) == json.loads(
        json.dumps(label, default=lambda v: v.tolist())
    )
    assert label["effects"][0]["target"] == "A2"
    inside = [p for p in (tmp_path / "case").rglob("*") if p.is_file()]
    assert not [p for p in inside if "label" in p.name]
    for file in inside:
        if file.suffix in {".toml", ".nc"}:
            assert "backlash" not in file.read_text(encoding="utf-8").lower()
    for run in label["runs"]:
        folder = tmp_path / "case" / run["run"]
        assert (folder / "run.toml").exists()
        assert 10.0 < run["duration_s"] < 22.0


def test_a_seed_makes_the_same_case_twice(tmp_path):
    one = cases.make_case(11, tmp_path / "a")
    two = cases.make_case(11, tmp_path / "b")
    assert json.dumps(one, default=str) == json.dumps(two, default=str)
    for file in sorted((tmp_path / "a").rglob("*")):
        if file.is_file():
            assert file.read_bytes() == (tmp_path / "b" / file.relative_to(tmp_path / "a")).read_bytes()


def test_a_case_without_effect_has_the_normal_mismatch_within_its_bounds(tmp_path):
    b = cases.BOUNDS
    for seed in range(3):
        label = cases.make_case(seed, tmp_path / str(seed), "none")
        assert label["null"]
        assert label["effects"] == []
        robot = label["robot_mismatch"]
        assert 0.0 < np.abs(robot["stiffness"] - 1.0).max() <= b["stiffness"]
        assert 0.0 < np.abs(robot["coefficients"] - 1.0).max() <= b["coefficients"]
        assert 0.0 < np.abs(robot["gain"] - 1.0).max() <= b["gain"]
        assert 0.0 < robot["lag_s"].max() <= b["lag_s"]
        assert 0.0 < robot["play_deg"].max() <= b["play_deg"]
        for run in label["runs"]:
            assert 0.0 < np.linalg.norm(run["shift_mm"]) <= b["shift_mm"]
            assert 0.0 < np.linalg.norm(run["turn_rad"]) <= b["turn_rad"]
            assert max(abs(v) for v in run["clocks_s"].values()) <= b["clock_s"]
            assert np.abs(run["force_zero_N"]).max() <= b["force_zero_N"]


def test_tables_have_the_columns_and_noise_that_they_say(tmp_path):
    label = cases.make_case(3, tmp_path / "case", "none")
    how = label["instruments"]
    for run in label["runs"]:
        folder = tmp_path / "case" / run["run"]
        file = next(folder.glob("controller.*"))
        table = pl.read_csv(file) if file.suffix == ".csv" else pl.read_parquet(file)
        assert table.columns[0] == "t_s"
        assert np.all(np.diff(table["t_s"].to_numpy()) > 0)
        rest = (table["q1_act_deg"] - table["q1_cmd_deg"]).to_numpy()[-12:]  # at rest after the end
        assert rest.std() < 3.0 * how["q_act_deg"] + 10.0 ** -how["q_decimals"]


def test_the_log_of_a_case_lies_on_the_prediction(tmp_path, predicted):
    """Commanded places of a run without effect, by the clock of its label."""
    label = cases.make_case(9, tmp_path / "case", "none")
    for run in label["runs"]:
        file = next((tmp_path / "case" / run["run"]).glob("controller.*"))
        table = pl.read_csv(file) if file.suffix == ".csv" else pl.read_parquet(file)
        motion = predicted[run["program"]].motion
        taken = table["t_s"].to_numpy() - run["clocks_s"]["controller"]
        for k, axis in enumerate("xyz"):
            expected = np.interp(taken, motion.time_s, motion.position_mm[:, k])
            off = np.abs(table[f"{axis}_cmd_mm"].to_numpy() - expected)
            assert np.quantile(off, 0.95) < 0.01  # between rows of 12 ms corners are cut short


def test_effects_reach_the_wanted_size(tmp_path):
    for seed in range(2):
        label = cases.make_case(seed, tmp_path / str(seed), "base_frame", "same")
        low = LIBRARY["base_frame"].sizes[0]
        entry = label["effects"][0]
        size = np.linalg.norm([entry["parameters"][k] for k in ("x_mm", "y_mm", "z_mm")])
        assert entry["ratio"] == pytest.approx(label["wanted_ratio"], rel=0.2) or size < 6.5 * low


def test_mistakes_of_the_user_are_one_line(tmp_path, capsys):
    with pytest.raises(ValueError, match="no effect 'blacklash'"):
        cases.make_case(1, tmp_path / "case", "blacklash")
    with pytest.raises(ValueError, match="one form only"):
        cases.make_case(1, tmp_path / "case", "gravity", "other")
    with pytest.raises(ValueError, match="A9 is not a target"):
        cases.make_case(1, tmp_path / "case", "backlash@A9")
    assert main(["single", "--effect", "nothing_known", "-o", str(tmp_path)]) == 2
    assert capsys.readouterr().err.count("\n") == 1
