"""Stiffness maps and the figure of the compensation: right numbers, blank where there are none."""

import json

import numpy as np
import polars as pl
import pytest
from matplotlib.figure import Figure

from gcode2krl import robot
from gcode2krl.cell import resolve_cell
from gcode2krl.cli.stiffness_map import LATERAL_N, Case, command, plane_map, pose_cost, spin_map
from gcode2krl.compliance import deflection_of
from gcode2krl.errors import NotUnderstoodError, RefusedError
from gcode2krl.pipeline import set_targets, solve_joints
from gcode2krl.report.compensation_figures import compensation_figure, exaggeration
from gcode2krl.report.stiffness_figures import joint_cost_figure, spin_figure, workspace_figure
from tests.krl.conftest import read

AT = (40.0, 20.0, -5.0)


@pytest.fixture(scope="module")
def case():
    return Case.of(resolve_cell({"based_on": "demonstration"}), None, None, None)


def test_pose_is_that_of_a_program_there(case):
    text = "G21 G90 G17 G40 G49 G80 G94\nG54\nT1 M6\nS8000 M3\nG0 G43 H1 Z20\nG0 X40 Y20\nG1 Z-5 F600\nM30\n"
    targets = set_targets(read(text, case.cell), case.cell)
    row = int(np.flatnonzero(targets.position_mm[:, 2] == -5.0)[0])
    q, margin = case.poses(np.array([AT]), np.zeros(1))
    assert q[0] == pytest.approx(solve_joints(targets, case.cell).q_rad[row], abs=1e-9)
    assert robot.forward(q, case.cell, 1)[0][0] == pytest.approx(AT, abs=1e-6)
    assert margin[0] > 0


def test_worst_load_is_the_worst_of_all_directions(case):
    q, _ = case.poses(np.array([AT]), np.zeros(1))
    load, size = case.worst_load(q)
    turns = np.radians(np.arange(0.0, 180.0, 1.0))
    loads = LATERAL_N * np.column_stack([np.cos(turns), np.sin(turns), 0.0 * turns])
    bent, _ = deflection_of(np.repeat(q, len(turns), axis=0), loads, np.zeros(3), np.zeros(3), case.cell, 1)
    every = np.linalg.norm(bent, axis=1)
    assert size[0] == pytest.approx(every.max(), rel=1e-3)
    assert every.min() < 0.9 * size[0]
    assert np.linalg.norm(load[0]) == pytest.approx(LATERAL_N)
    own, _ = deflection_of(q, load, np.zeros(3), np.zeros(3), case.cell, 1)
    assert np.linalg.norm(own) == pytest.approx(size[0], rel=1e-3)


def test_feed_leaves_what_is_normal_to_it():
    cell = resolve_cell({"based_on": "demonstration"})
    along = Case.of(cell, (0.0, 500.0, 0.0), (0.0, 1.0, 0.0), None)
    whole = Case.of(cell, (0.0, 500.0, 0.0), None, None)
    q, _ = whole.poses(np.array([AT]), np.zeros(1))
    bent, normal = deflection_of(q, [0.0, 500.0, 0.0], np.zeros(3), [0.0, 1.0, 0.0], cell, 1)
    assert along.worst_load(q)[1][0] == pytest.approx(np.linalg.norm(normal))
    assert whole.worst_load(q)[1][0] == pytest.approx(np.linalg.norm(bent))


def test_plane_is_blank_where_the_robot_cannot_be(case):
    found = plane_map(case, 0.0, 400.0)
    assert np.isnan(found.deflection_mm).any()
    there = np.isfinite(found.deflection_mm)
    assert 10 < np.count_nonzero(there) < found.deflection_mm.size
    x, y = np.meshgrid(found.x_mm, found.y_mm)
    foot = np.linalg.inv(case.cell.base_matrix())[:2, 3]
    far = np.hypot(x - foot[0], y - foot[1]) > 3200.0
    assert far.any()
    assert not there[far].any()
    row = int(np.flatnonzero(there.ravel())[0])
    place = [x.ravel()[row], y.ravel()[row], 0.0]
    q = found.q_rad[row : row + 1]
    assert robot.forward(q, case.cell, 1)[0][0] == pytest.approx(place, abs=1e-6)
    assert case.worst_load(q)[1][0] == pytest.approx(found.deflection_mm.ravel()[row])


def test_spin_map_marks_limits(case):
    found = spin_map(case, AT)
    assert found.spin_deg[0] == -180.0
    assert found.spin_deg[-1] == 180.0
    assert found.beyond.any()
    assert not found.beyond[found.spin_deg == 0.0].any()
    assert np.array_equal(found.beyond, ~(found.margin_rad >= 0.0))
    figures, _ = pose_cost(case, AT)
    assert found.deflection_mm[found.spin_deg == 0.0][0] == pytest.approx(figures["deflection_mm"])


def test_shares_add_up(case):
    figures, shares = pose_cost(case, AT)
    assert sum(shares.values()) == pytest.approx(figures["deflection_mm"], rel=2e-3)
    assert max(shares, key=lambda name: shares[name]) == "spindle"


def test_out_of_reach_and_wrong_options_are_named(case):
    with pytest.raises(RefusedError, match="--at"):
        pose_cost(case, (5000.0, 0.0, 0.0))
    with pytest.raises(NotUnderstoodError, match="T99"):
        Case.of(case.cell, None, None, 99)
    with pytest.raises(NotUnderstoodError, match="--load"):
        Case.of(case.cell, (0.0, 0.0, 0.0), None, None)
    with pytest.raises(NotUnderstoodError, match="--step"):
        plane_map(case, 0.0, 0.1)


def test_command_writes_figures_and_tables(tmp_path, capsys):
    folder = tmp_path / "map"
    arguments = ["--at", "40", "20", "-5", "--step", "400", "--json", "-o", str(folder)]
    assert command.main(args=arguments, standalone_mode=False) == 0
    result = json.loads(capsys.readouterr().out)
    names = {"workspace.png", "spin.png", "joints.png", "workspace.csv", "spin.csv", "joints.csv"}
    assert {file.name for file in folder.iterdir()} == names
    assert len(result["files"]) == len(names)
    spins = pl.read_csv(folder / "spin.csv")
    assert spins.filter(pl.col("usable"))["deflection_mm"].min() == pytest.approx(result["stiffest_spin_mm"])
    assert pl.read_csv(folder / "joints.csv")["share_mm"].sum() == pytest.approx(
        result["deflection_mm"], rel=2e-3
    )
    assert (
        command.main(args=[*arguments[:-2], "-o", str(tmp_path / "no" / "map")], standalone_mode=False) == 2
    )
    assert json.loads(capsys.readouterr().out)["issues"][0]["code"] == "output-unwritable"


@pytest.mark.slow
def test_figures_of_nothing_and_of_little(tmp_path):
    from gcode2krl.report.figures import save_figures

    nothing = np.full((3, 4), np.nan)
    line = np.arange(4.0)
    one = nothing.copy()
    one[1, 1] = 0.3
    spins = np.arange(-180.0, 181.0, 10.0)
    some = np.where(np.abs(spins) < 90.0, 0.2, np.nan)
    drawn = {
        "nothing": workspace_figure(line, line[:3], nothing, "t"),
        "one": workspace_figure(line, line[:3], one, "t"),
        "spin": spin_figure(spins, some, np.isnan(some), np.abs(spins) < 20.0, None, "t"),
        "no_spin": spin_figure(spins, np.nan * spins, spins < 400.0, spins > 400.0, 0.0, "t"),
        "joints": joint_cost_figure(["A1", "A2"], np.array([0.2, -0.1]), "t"),
        "no_joints": joint_cost_figure(["A1"], np.zeros(1), "t"),
    }
    assert all(isinstance(figure, Figure) for figure in drawn.values())
    files = save_figures(drawn, tmp_path / "figures")
    assert all(file.stat().st_size > 1000 for file in files)


def test_compensation_figure_states_its_factor():
    way = np.linspace(0.0, 100.0, 200)
    path = np.column_stack([way, 0.0 * way, 0.0 * way - 1.0])
    off = np.column_stack([0.0 * way, 0.02 + 0.0 * way, 0.0 * way])
    cuts = (way > 20.0) & (way < 80.0)
    figure = compensation_figure((path, off, cuts), (path, 0.01 * off, cuts), path - off)
    factor = exaggeration(path[cuts], 0.02)
    assert factor == 100.0
    assert f"{factor:g} times" in figure.get_suptitle()
    bent = figure.axes[0].get_lines()[1].get_xydata()
    inside = np.isfinite(bent[:, 1])
    assert bent[inside, 1] == pytest.approx(factor * 0.02)
    assert bent[inside, 0].min() > 20.0
    assert exaggeration(path, 50.0) == 1.0
    assert exaggeration(path[:0], 0.0) >= 1.0
    empty = compensation_figure((path, off, cuts & False), (path, off, cuts & False), path)
    assert isinstance(empty, Figure)
