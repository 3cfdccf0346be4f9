"""A recorded run through the same stages as the twin."""

import numpy as np
import pytest

from gcode2krl import load_cell, robot
from gcode2krl.cell.sections.online import Online
from gcode2krl.compliance import deflection_of
from gcode2krl.errors import NotUnderstoodError
from gcode2krl.online.log_replay import as_json, columns, replay
from gcode2krl.runs import load_run
from gcode2krl.units import DEG_PER_RAD
from tests.online import pilot_of

HEAD = 'override_percent = 100.0\nmode = "AUT"\n[frames]\ntracker = "base"\nforce = "base"\n'


def write_run(folder, cell, *, force_step_s=0.002, joints=True, head=HEAD, gap=False):
    """Write a run at 25 mm/s along x under a force that rises and falls; its tracker sees the deflection."""
    folder.mkdir()
    (folder / "run.toml").write_text(head)
    time_s = np.arange(0.0, 6.0, 0.012)
    position = np.column_stack([25.0 * time_s, 0 * time_s, 0 * time_s])
    level = np.tile([0.0, 0.0, 0.0, 1.0], (len(time_s), 1))
    q = robot.inverse(position, level, cell, 1)[:, 2]
    size = np.interp(time_s, [1.0, 1.3, 4.0, 4.3], [0.0, 1.0, 1.0, 0.0])
    force = size[:, None] * np.array([-100.0, 400.0, -60.0])
    bent, _ = deflection_of(q, force, np.zeros(3), [1.0, 0, 0], cell, 1)
    columns = {"t_s": time_s}
    columns |= {f"{n}_cmd_mm": position[:, k] for k, n in enumerate("xyz")}
    columns |= {f"{n}_cmd_deg": 0.0 * time_s for n in "abc"}
    if joints:
        columns |= {f"q{k}_cmd_deg": q[:, k - 1] * DEG_PER_RAD for k in range(1, 7)}
        columns |= {f"q{k}_act_deg": q[:, k - 1] * DEG_PER_RAD for k in range(1, 7)}
    save(folder / "controller.csv", columns)
    save(
        folder / "tracker.csv",
        {"t_s": time_s} | {f"{n}_mm": (position + bent)[:, k] for k, n in enumerate("xyz")},
    )
    quick = np.arange(0.0, 6.0, force_step_s)
    if gap:
        quick = quick[(quick < 2.0) | (quick > 2.3)]
    values = np.stack([np.interp(quick, time_s, c) for c in force.T], axis=1)
    save(folder / "force.csv", {"t_s": quick} | {f"f{n}_N": values[:, k] for k, n in enumerate("xyz")})
    return bent


def save(file, columns):
    rows = np.column_stack(list(columns.values()))
    np.savetxt(file, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.9f")


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("replay") / "run"
    bent = write_run(folder, load_cell())
    return load_run(folder), bent


def test_most_of_a_measured_deviation_would_have_gone(cell, run):
    result = replay(run[0], cell, Online())
    found = as_json(result)
    assert found["before_mm"] == pytest.approx(np.linalg.norm(run[1][:, 1:], axis=1).max(), rel=1e-2)
    assert found["after_mm"] < 0.6 * found["before_mm"]
    steady = (result.time_s > 2.5) & (result.time_s < 3.9)
    assert result.after_mm[steady].max() < 0.01
    assert found["pilot_cycles"] == 0


def test_with_pilot_the_ends_are_better(cell, run):
    share = np.array([0.0, 0.0, 1.0, 1.0, 1.0, 0.0])
    knots, header = pilot_of([0.6, 1.0, 1.3, 2.6, 4.0, 4.3], share[:, None] * [-100.0, 400.0, -60.0])
    plain = as_json(replay(run[0], cell, Online(threshold_N=60.0)))
    piloted = as_json(replay(run[0], cell, Online(threshold_N=60.0), knots=knots, header=header))
    assert piloted["pilot_cycles"] > 0
    assert piloted["after_mm"] < plain["after_mm"]


@pytest.mark.parametrize("head", [HEAD.replace("100.0", "50.0"), HEAD.replace("AUT", "T1")])
def test_a_run_at_another_override_or_in_t1_has_no_pilot(cell, tmp_path, head):
    write_run(tmp_path / "run", cell, head=head)
    knots, header = pilot_of([0.6, 1.0, 1.3, 2.6, 4.0, 4.3], np.ones((6, 3)))
    found = as_json(replay(load_run(tmp_path / "run"), cell, Online(), knots=knots, header=header))
    assert "open" not in found["gate_cycles"]


def test_axis_corrections_would_have_done_the_same(cell, run):
    cartesian = replay(run[0], cell, Online())
    axis = replay(run[0], cell, Online(mode="axis"))
    np.testing.assert_allclose(axis.shift_mm, cartesian.shift_mm, atol=0.02)


def test_a_silent_sensor_is_said(cell, tmp_path):
    write_run(tmp_path / "run", cell, gap=True)
    result = replay(load_run(tmp_path / "run"), cell, Online())
    assert result.corrections.sensor_lost.any()
    assert "replay-sensor" in [issue.code for issue in result.issues]
    assert np.isfinite(result.shift_mm).all()


def test_columns_are_of_one_length(cell, run):
    found = columns(replay(run[0], cell, Online()))
    assert {len(values) for values in found.values()} == {len(found["t_s"])}


def test_a_run_without_force_or_joints_is_refused(cell, tmp_path):
    write_run(tmp_path / "a", cell)
    (tmp_path / "a" / "force.csv").unlink()
    with pytest.raises(NotUnderstoodError, match="no force"):
        replay(load_run(tmp_path / "a"), cell, Online())
    write_run(tmp_path / "b", cell, joints=False)
    with pytest.raises(NotUnderstoodError, match="no joints"):
        replay(load_run(tmp_path / "b"), cell, Online())
