"""The next run: test programs as plain data, and the same machine on them."""

import json

import numpy as np
import polars as pl
import pytest

from tests.plant import kinds, next_run, programs
from tests.plant.robot import simulate
from tests.plant.scene import DEGREE, GRAVITY_m_s2, World, euler

WORLD = World()


def turned(a: float, b: float, c: float, hold_s: float = 1.0) -> list[dict]:
    """Out, a turn in place, and back."""
    start, there = {"x_mm": 0, "y_mm": 0, "z_mm": 60}, {"x_mm": 80, "y_mm": 20, "z_mm": 60}
    return [
        start,
        there,
        {**there, "a_deg": a, "b_deg": b, "c_deg": c, "hold_s": hold_s},
        {**there, "hold_s": hold_s},
        start,
    ]


def drive(data: dict):
    program = programs.program_of(data)
    return simulate(program.way, WORLD, [], pauses=program.pauses, spindle=program.spindle)


def test_a_turn_in_place_turns_the_tool_and_leaves_the_tip():
    run = drive({"name": "orientation", "rows": turned(20, 0, 10)})
    still = np.linalg.norm(run.place_mm - [80, 20, 60], axis=1) < 1e-9
    angle = np.degrees(np.arccos(np.clip((np.trace(run.axes, axis1=1, axis2=2) - 1) / 2, -1, 1)))
    end = np.degrees(np.arccos((np.trace(euler(20, 0, 10)) - 1) / 2))
    assert angle[still].max() == pytest.approx(end, rel=1e-6)
    assert angle[~still].max() < 1e-4
    assert np.linalg.norm(run.tip_mm - run.place_mm, axis=1).max() < 1e-8


def test_a_track_is_followed_joint_by_joint():
    t = np.arange(0.0, 4.0, 0.012)
    q = np.tile([0.0, -90.0, 90.0, 0.0, 60.0, 0.0], (len(t), 1))
    q[:, 3] += 15.0 * np.sin(t)
    run = drive({"name": "single-joint", "track": {"t_s": t.tolist(), "q_deg": q.tolist()}})
    inside = run.t_s < t[-1]
    np.testing.assert_allclose(run.q_act[inside, 3] / DEGREE, 15.0 * np.sin(run.t_s[inside]), atol=2e-3)
    assert np.abs(np.delete(run.q_cmd, 3, axis=1) - np.delete(run.q_cmd, 3, axis=1)[0]).max() < 1e-12
    assert np.abs(run.force_N).max() == 0.0


def test_the_middle_of_a_long_dwell_is_not_simulated_but_goes_by():
    t = np.array([0.0, 1.0, 1801.0, 1802.0])
    q = np.tile([0.0, -90.0, 90.0, 0.0, 60.0, 0.0], (4, 1))
    q[3, 0] = 5.0
    run = drive({"name": "dwell", "track": {"t_s": t.tolist(), "q_deg": q.tolist()}})
    assert len(run.t_s) < 15000
    assert run.elapsed_s[-1] == pytest.approx(1802.25, abs=0.002)
    assert run.q_cmd[run.elapsed_s > 1802.0, 0] == pytest.approx(5.0 * DEGREE)


def test_a_long_hold_of_a_row_goes_by_as_well():
    there = {"x_mm": 80, "y_mm": 20, "z_mm": 60}
    rows = [
        {"x_mm": 0, "y_mm": 0, "z_mm": 60},
        {**there, "hold_s": 600.0},
        {"x_mm": 0, "y_mm": 0, "z_mm": 60},
    ]
    run = drive({"name": "dwell", "rows": rows})
    short = drive({"name": "dwell", "rows": [rows[0], {**there, "hold_s": 10.0}, rows[2]]})
    np.testing.assert_allclose(run.place_mm, short.place_mm)
    assert run.elapsed_s[-1] - short.elapsed_s[-1] == pytest.approx(590.0)
    waits = np.linalg.norm(run.place_mm - [80, 20, 60], axis=1) < 1e-6
    jump = int(np.argmax(np.diff(run.elapsed_s)))
    assert waits[jump]
    assert waits[jump + 1]


def stationary(tmp_path, effect: str, data: dict, kind: str = "single", after_s: float = 600.0):
    label = kinds.draw_case(kind, 7, tmp_path / "case", effect, "same")
    done = next_run.drive_next(label, data, tmp_path / "next" / "run-4", "../prediction", after_s)
    return label, done, tmp_path / "next" / "run-4"


def table(folder, name: str) -> pl.DataFrame:
    file = next(folder.glob(f"{name}.*"))
    return pl.read_csv(file) if file.suffix == ".csv" else pl.read_parquet(file)


def test_orientation_parts_mastering_of_a6_from_a_moved_base(tmp_path):
    """At one orientation the tip moves by one vector; when the tool turns, A6's error turns with it."""
    label, done, folder = stationary(
        tmp_path, "a6_or_frames", {"name": "o", "rows": turned(40, 0, 0)}, "confounded"
    )
    assert {a["effect"] for a in label["answers"]} == {"mastering", "tool_frame", "base_frame"}
    assert done["effects"][0]["signals"]["tcp"]["constant_share"] < 0.999
    assert label["effects"][0]["signals"]["tcp"]["constant_share"] > 0.95
    assert (folder / "run.toml").read_text(encoding="utf-8").count("../prediction") == 1


def test_the_next_run_has_the_same_fault_later(tmp_path):
    label, done, _ = stationary(
        tmp_path, "thermal", {"name": "repeat", "rows": turned(0, 0, 0)}, after_s=7200.0
    )
    values, age_h = label["effects"][0]["parameters"], (label["runs"][-1]["age_s"] + 7200.0) / 3600.0
    grown = values["mm_per_h"] * values["time_constant_h"] * -np.expm1(-age_h / values["time_constant_h"])
    assert done["effects"][0]["signals"]["tcp"]["rms"] * np.sqrt(3.0) == pytest.approx(grown, rel=0.01)


def test_weights_hang_on_the_sensor_while_they_hang(tmp_path):
    data = {"name": "weights", "rows": turned(0, 0, 0), "weights": [{"from_s": 1.0, "to_s": 2.0, "kg": 50.0}]}
    _, _, folder = stationary(tmp_path, "none", data, "null")
    force = table(folder, "force")
    size = np.linalg.norm(force.select("fx_N", "fy_N", "fz_N").to_numpy(), axis=1)
    t = force["t_s"].to_numpy()
    assert np.nanmedian(size[(t > 1.1) & (t < 1.9)]) == pytest.approx(50.0 * GRAVITY_m_s2, rel=0.05)
    assert np.nanmedian(size[(t > 2.1) | (t < 0.9)]) < 30.0


def test_a_rope_pulls_along_the_base():
    pull = [{"from_s": 0.0, "to_s": 9.0, "pull_N": [0.0, 300.0, 0.0]}]
    data = {"name": "weights", "rows": turned(0, 0, 0), "weights": pull}
    program = programs.program_of(data)
    run = simulate(program.way, WORLD, [{"load": next_run.hang(program)}])
    np.testing.assert_allclose(run.force_N, np.tile([0.0, 300.0, 0.0], (len(run.force_N), 1)))
    assert (run.tip_mm - run.place_mm)[:, 1].min() > 0.05


def test_what_is_no_program_is_refused():
    with pytest.raises(ValueError, match="needs one of"):
        programs.program_of({"name": "x"})
    with pytest.raises(ValueError, match="rising times"):
        programs.program_of({"name": "x", "track": {"t_s": [0, 0], "q_deg": [[0] * 6] * 2}})
    rows = turned(10, 0, 0)
    rows[1] = {**rows[1], "cdis_mm": 1.0}
    with pytest.raises(ValueError, match="exact stop"):
        programs.program_of({"name": "x", "rows": rows})
    with pytest.raises(ValueError, match="needs a hold_s"):
        drive({"name": "x", "rows": turned(10, 0, 0, hold_s=0.0)})


def test_the_command_line_writes_a_run_beside_its_label(tmp_path, capsys):
    kinds.draw_case("single", 3, tmp_path / "case", "base_frame", "same")
    (tmp_path / "p.json").write_text(
        json.dumps({"name": "repeat", "rows": turned(0, 0, 0)}), encoding="utf-8"
    )
    arguments = [str(tmp_path / "case.label.json"), str(tmp_path / "p.json"), "--prediction", "../p"]
    assert next_run.main([*arguments, "-o", str(tmp_path / "n" / "run-4")]) == 0
    assert "base_frame" in capsys.readouterr().out
    assert (tmp_path / "n" / "run-4.label.json").exists()
    assert next_run.main([*arguments, "-o", str(tmp_path / "n" / "run-4")]) == 2
    assert "not empty" in capsys.readouterr().err


def test_a_repeat_is_the_same_program_another_day(tmp_path):
    label, done, folder = stationary(tmp_path, "none", {"name": "repeat", "repeats": "slots"}, "null")
    assert done["duration_s"] == pytest.approx(17.85, abs=0.1)
    assert done["effects"] == []
    assert done["number"] == len(label["runs"])
    assert len(table(folder, "tracker")) > 1000
