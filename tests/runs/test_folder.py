"""A run's folder: what is read, and the error each wrong file gets, with file, row and column."""

import dataclasses
import math
from datetime import UTC, datetime

import numpy as np
import pytest

from gcode2krl.errors import NotUnderstoodError
from gcode2krl.runs import load_run
from tests.runs import maker


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "run-1"


def refused(folder, head="", partial=False, **tables):
    maker.run_folder(folder, head, **tables)
    with pytest.raises(NotUnderstoodError) as caught:
        load_run(folder, partial=partial)
    return caught.value


def codes(run):
    return [issue.code for issue in run.issues]


def test_everything_is_read_with_its_units(folder):
    columns = maker.controller()
    columns |= {f"q{n}_load_deg": columns[f"q{n}_act_deg"] + 0.01 for n in range(1, 7)}
    columns |= {f"i{n}_A": np.full(len(columns["t_s"]), n + 0.5) for n in range(1, 7)}
    columns |= {f"tau{n}_Nm": columns[f"i{n}_A"] * 2.0 for n in range(1, 7)}
    force = maker.force() | {f"m{axis}_Nm": np.full(len(maker.force()["t_s"]), 1.5) for axis in "xyz"}
    tracker = maker.tracker() | {f"{angle}_deg": np.full(len(maker.tracker()["t_s"]), 9.0) for angle in "abc"}
    head = """
        cell = "cell.toml"
        program = "part.nc"
        prediction = "../prediction"
        started = 2024-05-06T07:08:09Z
        angles = "absolute"
        mode = "AUT"
        [frames]
        tracker = "base"
        force = "sensor"
        [noise]
        tcp_mm = 0.03
        force_N = 3
        q_act_deg = 0.0002
        [channels]
        q_cmd = "interpolator"
        rsi = false
        [notes]
        operator = "night shift"
    """
    run = load_run(maker.run_folder(folder, head, controller=columns, tracker=tracker, force=force))
    assert run.name == "run-1"
    assert run.controller.q_load_rad[5, 2] == pytest.approx(
        math.radians(columns["q3_load_deg"][5]), rel=1e-12
    )
    assert np.allclose(run.controller.torque_Nmm[:, 3], 9000.0)
    assert np.allclose(run.controller.current_A[:, 5], 6.5)
    assert np.allclose(run.controller.abc_cmd_rad[:, 1], math.radians(10.0))
    assert np.allclose(run.force.moment_Nmm, 1500.0)
    assert np.allclose(run.tracker.abc_rad, math.radians(9.0))
    assert run.controller.joints_measured == (1, 2, 3, 4, 5, 6)
    assert run.controller.joints_with_load_encoder == (1, 2, 3, 4, 5, 6)
    assert run.head.started == datetime(2024, 5, 6, 7, 8, 9, tzinfo=UTC)
    assert (run.head.frames.force, run.head.noise.force_N, run.head.noise.q_load_deg) == ("sensor", 3.0, None)
    assert run.head.notes == {"operator": "night shift"}
    assert run.path("prediction") == folder / "../prediction"
    assert [i.code for i in run.issues if i.severity == "warning"] == ["run-path"] * 3
    assert not [i for i in run.issues if i.severity == "error"]


def test_nothing_but_run_toml_is_needed(folder):
    run = load_run(maker.run_folder(folder))
    assert (run.controller, run.tracker, run.force, run.scan, run.issues) == (None, None, None, None, ())
    assert (run.head.angles, run.head.frames.tracker, run.path("program")) == ("absolute", "base", None)


def test_parquet_gives_the_same(folder, tmp_path):
    maker.run_folder(folder, "", controller=maker.controller(), tracker=maker.tracker())
    other = maker.run_folder(tmp_path / "run-2")
    maker.write(other, "controller.parquet", maker.controller())
    maker.write(other, "tracker.parquet", maker.tracker())
    csv, parquet = load_run(folder), load_run(other)
    assert np.array_equal(csv.controller.q_act_rad, parquet.controller.q_act_rad)
    assert np.array_equal(csv.tracker.position_mm, parquet.tracker.position_mm)
    assert (csv.tracker.row[0], parquet.tracker.row[0]) == (2, 1)


def test_arrays_and_run_do_not_change(folder):
    run = load_run(maker.run_folder(folder, "", tracker=maker.tracker()))
    with pytest.raises(ValueError, match="read-only"):
        run.tracker.position_mm[0, 0] = 1.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        run.tracker = None
    with pytest.raises(TypeError):
        run.tracker.dropped["x_mm"] = 1


def test_a_clock_that_is_stated_is_taken_off(folder):
    tracker = maker.tracker(offset=2.5)
    run = load_run(maker.run_folder(folder, "[clocks]\ntracker_s = 2.5", tracker=tracker))
    assert run.tracker.time_s[0] == 0.0


def test_a_table_of_another_name(folder):
    maker.run_folder(folder, '[files]\ntracker = "leica export.csv"')
    maker.write(folder, "leica export.csv", maker.tracker())
    assert load_run(folder).tracker is not None
    error = refused(folder, '[files]\ntracker = "gone.csv"')
    assert "files.tracker: no file 'gone.csv'" in str(error)


# --- what is dropped ------------------------------------------------------------------------------------


def test_missing_values_are_dropped_counted_and_mark_a_gap(folder):
    columns = maker.controller()
    columns["q3_act_deg"][100:140] = np.nan
    columns["x_cmd_mm"][500] = np.nan
    run = load_run(maker.run_folder(folder, "", controller=columns))
    assert dict(run.controller.dropped) == {"x_cmd_mm": 1, "q3_act_deg": 40}
    assert run.controller.dropped_rows == 41
    assert len(run.controller) == len(columns["t_s"]) - 41
    assert run.controller.segments.tolist() == [[0, 100], [100, 460], [460, len(run.controller)]]
    assert 102 not in run.controller.row
    dropped = next(i for i in run.issues if i.code == "trace-dropped")
    assert (dropped.line, dropped.severity) == (102, "warning")
    assert "q3_act_deg 40" in dropped.message
    assert any(i.code == "trace-gap" and "0.492 s" in i.message for i in run.issues)


def test_a_pause_of_the_recorder_is_a_gap(folder):
    columns = maker.tracker()
    keep = (columns["t_s"] < 3.0) | (columns["t_s"] > 3.5)
    run = load_run(maker.run_folder(folder, "", tracker={k: v[keep] for k, v in columns.items()}))
    assert run.tracker.segments[0].tolist() == [0, 300]
    assert run.tracker.dropped_rows == 0


def test_a_clock_that_jitters_has_no_gaps(folder):
    columns = maker.tracker()
    columns["t_s"] += np.random.default_rng(9).uniform(-0.004, 0.004, len(columns["t_s"]))
    columns = {name: np.delete(values, range(600, 620)) for name, values in columns.items()}
    run = load_run(maker.run_folder(folder, "", tracker=columns))
    assert run.tracker.segments.tolist() == [[0, 600], [600, len(run.tracker)]]


def test_unknown_missing_and_constant_columns_are_said(folder):
    columns = maker.controller() | {"temperature": maker.controller()["t_s"]}
    for axis in "xyz":
        del columns[f"{axis}_cmd_mm"]
    run = load_run(maker.run_folder(folder, "", controller=columns))
    assert run.controller.position_cmd_mm is None
    assert run.controller.ignored == ("temperature",)
    assert run.controller.missing == ("x_cmd_mm", "y_cmd_mm", "z_cmd_mm")
    assert run.controller.constant == ("a_cmd_deg", "b_cmd_deg", "c_cmd_deg")
    assert {"trace-ignored", "trace-missing", "trace-constant"} <= set(codes(run))


def test_a_joint_without_load_encoder_is_left_out(folder):
    columns = maker.controller()
    columns |= {"q1_load_deg": columns["q1_act_deg"], "q4_load_deg": columns["q4_act_deg"]}
    columns |= {"q5_load_deg": np.full(len(columns["t_s"]), np.nan)}
    run = load_run(maker.run_folder(folder, "", controller=columns))
    assert run.controller.joints_with_load_encoder == (1, 4)
    assert run.controller.missing == ("q2_load_deg", "q3_load_deg", "q5_load_deg", "q6_load_deg")
    assert run.controller.dropped_rows == 0


def test_joints_may_be_missing_only_where_asked(folder):
    columns = {k: v for k, v in maker.controller().items() if not k.startswith(("q3", "q5"))}
    error = refused(folder, controller=columns)
    assert error.issues[0].code == "trace-column"
    assert "q3_cmd_deg, q5_cmd_deg: missing" in str(error)
    run = load_run(folder, partial=True)
    assert run.controller.joints_measured == (1, 2, 4, 6)
    assert np.isnan(run.controller.q_act_rad[:, 2]).all()


# --- errors ---------------------------------------------------------------------------------------------


def test_no_folder_and_no_run_toml(tmp_path, folder):
    with pytest.raises(NotUnderstoodError, match="is not a folder"):
        load_run(tmp_path / "nowhere")
    folder.mkdir()
    with pytest.raises(NotUnderstoodError, match=r"run\.toml: error: cannot read.*an empty one will do"):
        load_run(folder)


@pytest.mark.parametrize(
    ("head", "words"),
    [
        ('angles = "both"', "angles: found 'both', allowed: 'absolute' or 'relative'"),
        ('[frames]\ntracker = "world"', "frames.tracker: found 'world', allowed: 'base', 'tcp' or 'sensor'"),
        ("[noise]\ntcp_mm = -1", "noise.tcp_mm: found -1"),
        ('started = "yesterday"', "started: found 'yesterday'"),
        ("override_percent = 0", "override_percent: found 0"),
        ('mode = "T3"', "mode: found 'T3'"),
        ("cell = 5", "cell: found 5"),
        ("notes = 3", "notes: found 3"),
        ("a = = 3", "run.toml: error"),
        ("a = " + "[" * 5000, "run.toml: error"),
    ],
)
def test_a_wrong_key_of_run_toml(folder, head, words):
    error = refused(folder, head)
    assert words in str(error)
    assert "run.toml" in str(error)


def test_an_unknown_key_is_a_warning_with_a_guess(folder):
    run = load_run(maker.run_folder(folder, 'angels = "relative"\n[frames]\ntraker = "tcp"'))
    assert [i.code for i in run.issues] == ["run-key", "run-key"]
    assert "did you mean angles?" in run.issues[0].remedy
    assert "did you mean frames.tracker?" in run.issues[1].remedy


def test_a_missing_column_names_what_belongs_to_it(folder):
    columns = maker.tracker()
    del columns["y_mm"]
    error = refused(folder, tracker=columns)
    assert (error.issues[0].code, error.issues[0].line) == ("trace-column", 1)
    assert "tracker.csv" in error.source
    assert "column y_mm: missing" in str(error)
    assert "x_mm, z_mm" in str(error)


def test_missing_time_and_a_table_without_signals(folder):
    columns = maker.force()
    del columns["t_s"]
    assert "column t_s: missing" in str(refused(folder, force=columns))
    maker.write(folder, "force.csv", maker.force())
    only_time = {"t_s": maker.controller()["t_s"], "speed": maker.controller()["t_s"]}
    assert "x_cmd_mm" in str(refused(folder, controller=only_time))


def test_an_empty_column(folder):
    columns = maker.tracker()
    columns["z_mm"][:] = np.nan
    assert "column z_mm: has no value in any row" in str(refused(folder, tracker=columns))


def test_time_that_falls(folder):
    columns = maker.tracker()
    columns["t_s"][40] = columns["t_s"][38]
    issue = refused(folder, tracker=columns).issues[0]
    assert (issue.code, issue.line) == ("trace-time", 42)
    assert "row 42, column t_s: 0.38 s does not come after 0.39 s" in issue.message


@pytest.mark.parametrize("factor", [1000.0, 1e6])
def test_time_not_in_seconds(folder, factor):
    columns = maker.tracker()
    issue = refused(folder, tracker=columns | {"t_s": columns["t_s"] * factor}).issues[0]
    assert issue.code == "trace-unit"
    assert "column t_s" in issue.message


def test_time_of_a_fast_sensor_in_ms_shows_beside_the_others(folder):
    t = np.arange(0.0, 12.7, 0.0002)
    force = {"t_s": t * 1000.0} | {f"f{axis}_N": np.sin(t) for axis in "xyz"}
    issue = refused(folder, controller=maker.controller(), force=force).issues[0]
    assert issue.code == "trace-unit"
    assert "about 1000 times more, so ms" in issue.message


def test_time_as_a_date(folder):
    columns = maker.tracker()
    error = refused(folder, tracker=columns | {"t_s": columns["t_s"] + 1.7e9})
    assert "a date" in str(error)


def test_tables_that_do_not_overlap(folder):
    error = refused(folder, controller=maker.controller(), tracker=maker.tracker(offset=60.0))
    assert (error.issues[0].code, error.issues[0].line) == ("trace-overlap", 2)
    assert "tracker.csv" in error.source
    assert "column t_s runs from 60 to 72." in str(error)
    assert "controller.csv" in str(error)


@pytest.mark.parametrize("rows", [0, 1, 9])
def test_too_few_rows(folder, rows):
    columns = {name: values[:rows] for name, values in maker.force().items()}
    issue = refused(folder, force=columns).issues[0]
    assert issue.code == "trace-short"
    assert f"{rows} usable rows" in issue.message


def test_text_in_a_number_column(folder):
    maker.run_folder(folder, "", tracker=maker.tracker())
    lines = (folder / "tracker.csv").read_text(encoding="utf-8").splitlines()
    lines[7] = lines[7].rpartition(",")[0] + ",OVERFLOW"
    (folder / "tracker.csv").write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(NotUnderstoodError, match="row 8, column z_mm: 'OVERFLOW' is not a number") as caught:
        load_run(folder)
    assert caught.value.issues[0].line == 8


def test_a_row_with_too_many_values(folder):
    maker.run_folder(folder, "", tracker=maker.tracker())
    lines = (folder / "tracker.csv").read_text(encoding="utf-8").splitlines()
    lines[5] += ",1.0"
    (folder / "tracker.csv").write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(NotUnderstoodError, match="row 6: 5 values under 4 column names"):
        load_run(folder)


def test_a_column_twice_and_columns_of_the_wrong_separator(folder):
    maker.run_folder(folder)
    file = folder / "tracker.csv"
    file.write_text("t_s,x_mm,x_mm,z_mm\n" + "0,1,2,3\n" * 20, encoding="utf-8")
    with pytest.raises(NotUnderstoodError, match="column x_mm: is present twice"):
        load_run(folder)
    file.write_text("t_s;x_mm;y_mm;z_mm\n" + "0;1;2;3\n" * 20, encoding="utf-8")
    with pytest.raises(NotUnderstoodError, match="separate columns by commas"):
        load_run(folder)


def test_csv_and_parquet_of_one_table(folder):
    maker.run_folder(folder, "", tracker=maker.tracker())
    maker.write(folder, "tracker.parquet", maker.tracker())
    with pytest.raises(NotUnderstoodError, match=r"several files: tracker\.csv, tracker\.parquet"):
        load_run(folder)


def test_a_byte_order_mark_blank_lines_at_the_end_and_spaces_are_no_matter(folder):
    maker.run_folder(folder, "", tracker=maker.tracker())
    text = (folder / "tracker.csv").read_text(encoding="utf-8").replace(",", " , ")
    (folder / "tracker.csv").write_text("\ufeff" + text + "\n\n", encoding="utf-8", newline="\r\n")
    run = load_run(folder)
    assert len(run.tracker) == len(maker.tracker()["t_s"])
    assert run.tracker.dropped_rows == 0


# --- columns against each other -------------------------------------------------------------------------


def test_swapped_actual_angles(folder):
    columns = maker.controller()
    columns["q2_act_deg"], columns["q3_act_deg"] = columns["q3_act_deg"], columns["q2_act_deg"]
    error = refused(folder, controller=columns)
    assert error.issues[0].code == "trace-columns"
    assert "column q2_act_deg follows q3_cmd_deg and not q2_cmd_deg" in str(error)


def test_a_reversed_angle(folder):
    columns = maker.controller()
    columns["q4_act_deg"] = -columns["q4_act_deg"]
    assert "column q4_act_deg runs against q4_cmd_deg" in str(refused(folder, controller=columns))


@pytest.mark.parametrize(("radians", "other"), [("q5_act_deg", "q5_cmd_deg"), ("q5_cmd_deg", "q5_act_deg")])
def test_one_angle_in_radians(folder, radians, other):
    columns = maker.controller()
    columns[radians] = np.radians(columns[radians])
    error = refused(folder, controller=columns)
    assert f"column {radians} moves 57.3 times less than {other}, so radians" in str(error)


def test_load_side_in_radians(folder):
    columns = maker.controller()
    columns |= {f"q{n}_load_deg": np.radians(columns[f"q{n}_act_deg"]) for n in range(1, 7)}
    assert "column q1_load_deg moves 57.3 times less" in str(refused(folder, controller=columns))


def test_all_angles_in_radians(folder):
    columns = maker.controller()
    columns = {name: np.radians(values) if name[0] == "q" else values for name, values in columns.items()}
    error = refused(folder, controller=columns)
    assert "so radians" in str(error)
    run = load_run(maker.run_folder(folder, 'angles = "relative"', controller=columns))
    assert run.controller is not None


@pytest.mark.parametrize("amplitude_deg", [2.0, 0.5])
def test_small_angles_about_zero_are_no_radians(folder, amplitude_deg):
    columns = maker.controller()
    t = columns["t_s"]
    for n in range(1, 7):
        columns[f"q{n}_cmd_deg"] = amplitude_deg * np.sin(t * n / 3)
        columns[f"q{n}_act_deg"] = amplitude_deg * np.sin((t - 0.02) * n / 3)
    assert load_run(maker.run_folder(folder, "", controller=columns)).controller is not None


@pytest.mark.parametrize(("axis", "table"), [("x", "tracker"), ("z", "tracker"), ("y", "controller")])
def test_metres_show_against_the_other_table(folder, axis, table):
    tables = {"controller": maker.controller(), "tracker": maker.tracker(offset=0.8)}
    name = f"{axis}_mm" if table == "tracker" else f"{axis}_cmd_mm"
    tables[table][name] /= 1000.0
    error = refused(folder, **tables)
    assert f"{table}.csv" in error.source
    assert f"column {name} moves 1000 times less" in str(error)
    assert "so metres" in str(error)


def test_swapped_axes_show_against_the_controller(folder):
    tracker = maker.tracker()
    tracker["x_mm"], tracker["z_mm"] = tracker["z_mm"], tracker["x_mm"]
    error = refused(folder, controller=maker.controller(), tracker=tracker)
    assert "column x_mm follows z_cmd_mm and not x_cmd_mm" in str(error)
    declared = '[frames]\ntracker = "sensor"'
    assert load_run(maker.run_folder(folder, declared)).tracker is not None


@pytest.mark.parametrize(("name", "factor"), [("x_mm", 1000.0), ("z_mm", 1e5)])
def test_values_that_no_robot_reaches(folder, name, factor):
    columns = maker.tracker()
    columns[name] = columns[name] * factor
    issue = refused(folder, tracker=columns).issues[0]
    assert issue.code == "trace-unit"
    assert f"column {name}" in issue.message
    assert issue.line > 1


def test_motor_angles_are_no_axis_angles(folder):
    columns = maker.controller()
    columns = {n: v * 250.0 if n.startswith("q") else v for n, v in columns.items()}
    assert "no joint turns that far" in str(refused(folder, controller=columns))


def test_real_gaps_are_no_errors(folder):
    columns = maker.controller(lag=0.08)
    load = {
        f"q{n}_load_deg": columns[f"q{n}_act_deg"] + 0.05 * np.sign(np.gradient(columns[f"q{n}_act_deg"]))
        for n in range(1, 7)
    }
    tracker = maker.tracker(offset=0.2)
    tracker["x_mm"] += 3.0 + 0.8 * np.sin(tracker["t_s"])
    run = load_run(maker.run_folder(folder, "", controller=columns | load, tracker=tracker))
    assert not [issue for issue in run.issues if issue.severity != "note"]


def test_coarse_decimals_are_a_finding(folder):
    tracker = {
        name: np.round(values, 1) if name != "t_s" else values for name, values in maker.tracker().items()
    }
    run = load_run(maker.run_folder(folder, "", tracker=tracker))
    assert any(i.code == "trace-decimals" and "in steps of 0.1 mm" in i.message for i in run.issues)
    maker.run_folder(folder, "[channels]\ndecimals = 1")
    assert "trace-decimals" not in codes(load_run(folder))
    fine = {n: np.round(v, 3) if n != "t_s" else v for n, v in maker.tracker().items()}
    maker.run_folder(folder, "[noise]\ntcp_mm = 0.0005", tracker=fine)
    assert "trace-decimals" in codes(load_run(folder))
    maker.run_folder(folder, "[noise]\ntcp_mm = 0.03", tracker=fine)
    assert "trace-decimals" not in codes(load_run(folder))
