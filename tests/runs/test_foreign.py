"""Logs of other programs: read back to the right quantities, or asked about; never silently wrong."""

import io
import zipfile

import numpy as np
import polars as pl
import pytest
import scipy.io

from gcode2krl.errors import NotUnderstoodError
from gcode2krl.runs.foreign import guess_of, run_from
from gcode2krl.runs.foreign.names import meanings
from tests.runs.foreign_layouts import ABC_DEG, LAYOUTS, PREDICTION, QUATERNION, TIME_S, F, P, Q

WANTED = {
    "q_act": lambda run: (np.degrees(run.controller.q_act_rad), Q, 1e-4),
    "q_cmd": lambda run: (np.degrees(run.controller.q_cmd_rad), Q, 1e-4),
    "xyz_act": lambda run: (run.controller.position_act_mm, P, 1e-3),
    "xyz": lambda run: (run.tracker.position_mm, P, 1e-3),
    "force": lambda run: (run.force.force_N, F, 1e-3),
    "abc_act": lambda run: (np.degrees(run.controller.abc_act_rad), ABC_DEG, 1e-4),
}
NAMES = [layout.name for layout in LAYOUTS]


def written(layout, folder):
    file = folder / f"log{layout.ending}"
    file.write_bytes(layout.make())
    return file


def assert_right(run, layout):
    for signal in (*layout.holds, *filter(None, [layout.orientation])):
        values, truth, tolerance = WANTED[signal](run)
        np.testing.assert_allclose(values, truth, atol=tolerance)


@pytest.mark.parametrize("layout", LAYOUTS, ids=NAMES)
def test_a_log_alone_is_right_or_asked_about(layout, tmp_path):
    file = written(layout, tmp_path)
    if layout.answers:
        with pytest.raises(NotUnderstoodError) as caught:
            run_from(file)
        assert [issue.code for issue in caught.value.issues] == ["run-layout"]
    run = run_from(file, **layout.answers)
    assert_right(run, layout)
    tables = [t for t in (run.controller, run.tracker, run.force) if t is not None]
    assert all(
        0.9 < np.median(np.diff(t.time_s)) / (0.0005 if "kHz" in layout.name else 0.012) < 1.1 for t in tables
    )


@pytest.mark.parametrize("layout", LAYOUTS, ids=NAMES)
def test_a_prediction_answers_what_names_leave_open(layout, tmp_path):
    file = written(layout, tmp_path)
    if layout.open_beside_prediction:
        with pytest.raises(NotUnderstoodError):
            run_from(file, prediction=PREDICTION)
    else:
        assert_right(run_from(file, prediction=PREDICTION), layout)


COMMAS = [f"0,0{k:02d},1,5,2,5,3,5,4,5,5,5,6,5" for k in range(30)]


def table(rows, header="Time,Axis1,Axis2,Axis3,Axis4,Axis5,Axis6"):
    return "\n".join([header, *rows, ""]).encode()


AXES = "Axis1,Axis2,Axis3,Axis4,Axis5,Axis6"
ROWS = [",".join(f"{v:.6g}" for v in (0.012 * k, *Q[k])) for k in range(60)]
HOSTILE = {
    "empty": (b"", "trace-empty"),
    "a picture": (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + bytes(range(256)) * 20, "trace-unreadable"),
    "Excel": (b"PK\x03\x04" + bytes(200), "trace-unreadable"),
    "HDF5": (b"\x89HDF\r\n\x1a\n" + bytes(200), "trace-unreadable"),
    "damaged MATLAB": (b"MATLAB 5.0 MAT-file" + b" " * 109 + b"\xff" * 400, "trace-unreadable"),
    "damaged Parquet": (b"PAR1" + b"\xff" * 300 + b"PAR1", "trace-unreadable"),
    "prose": (b"Dear all,\nplease find the log attached.\nBest\n" * 5, "trace-unreadable"),
    "header alone": (table([]), "trace-unreadable"),
    "decimal comma between commas": (table(COMMAS), "trace-unreadable"),
    "comma and point": (
        table([row.replace(",", ";").replace(".", "," if k % 2 else ".") for k, row in enumerate(ROWS)]),
        "trace-number",
    ),
    "thousands": (table([f"{k},1.234,5,1,1,1,1" for k in range(30)], "Time;Axis1"), "run-layout"),
    "a word": (table([*ROWS[:30], ROWS[30].replace(",", ",ERR", 1), *ROWS[31:]]), "trace-number"),
    "a name twice": (table(ROWS, "Time,Axis1,Axis1,Axis3,Axis4,Axis5,Axis6"), "trace-column"),
    "no header": ("\n".join(ROWS).encode(), "run-layout"),
    "no time": (table([row.partition(",")[2] for row in ROWS], AXES), "run-layout"),
    "speeds and currents only": (table(ROWS, "Time," + AXES.replace("Axis", "Speed A")), "run-layout"),
    "five axes": (table([row.rpartition(",")[0] for row in ROWS], "Time,J1,J2,J3,J4,J5"), ""),
    "time goes back": (table([*ROWS[30:], *ROWS[:30]]), "trace-time"),
    "gradians": (table(ROWS, "Time," + ",".join(f"Axis{k} [rad]" for k in range(1, 7))), "run-layout"),
    "time in s that is ms": (
        table([f"{12 * k},{row.partition(',')[2]}" for k, row in enumerate(ROWS)],
              "Time [s],Axis1,Axis2,Axis3,Axis4,Axis5,Axis6"),
        "run-layout",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", HOSTILE)
def test_a_hostile_log_gives_one_line(case, tmp_path):
    data, code = HOSTILE[case]
    file = tmp_path / "log.csv"
    file.write_bytes(data)
    if not code:  # a log of some joints is a run of some joints
        assert run_from(file).controller.joints_measured == ()
        return
    with pytest.raises(NotUnderstoodError) as caught:
        run_from(file)
    assert [issue.code for issue in caught.value.issues] == [code]
    assert "\n" not in caught.value.issues[0].message


@pytest.mark.parametrize(
    "answers",
    [
        {"columns": {"Axis7": "q1_act"}},
        {"columns": {"Axis1": "elbow"}},
        {"units": {"angle": "parsec"}},
        {"units": {"angle": "mm"}},
        {"order": "yaw first"},
        {"joints": "112345"},
    ],
)
def test_an_answer_that_names_nothing_is_refused(answers, tmp_path):
    file = tmp_path / "log.csv"
    file.write_bytes(table(ROWS))
    with pytest.raises(NotUnderstoodError) as caught:
        run_from(file, **answers)
    assert [issue.code for issue in caught.value.issues] == ["run-layout"]


@pytest.mark.parametrize("kind", ["polars", "pandas", "arrow", "mapping", "structured"])
def test_a_frame_is_a_log(kind):
    columns = {"t": TIME_S, **{f"q{n + 1}": np.radians(Q[:, n]) for n in range(6)}}
    frame = {
        "polars": lambda: pl.DataFrame(columns),
        "pandas": lambda: pl.DataFrame(columns).to_pandas(),
        "arrow": lambda: pl.DataFrame(columns).to_arrow(),
        "mapping": lambda: columns,
        "structured": lambda: pl.DataFrame(columns).to_numpy(structured=True),
    }[kind]()
    run = run_from(frame, columns={"q1": "q1_act_rad"}, units={"angle": "rad"})
    np.testing.assert_allclose(np.degrees(run.controller.q_act_rad), Q, atol=1e-6)


def test_swapped_and_wrongly_united_columns_are_asked_about_beside_a_prediction():
    columns = {"time_s": TIME_S, **{f"J{n + 1}_deg": Q[:, n] for n in range(6)}}
    swapped = columns | {"J2_deg": columns["J3_deg"], "J3_deg": columns["J2_deg"]}
    assert [q.option for q in guess_of(swapped, prediction=PREDICTION).questions] == ["--joints 132456"]
    np.testing.assert_allclose(
        np.degrees(run_from(swapped, joints="132456", prediction=PREDICTION).controller.q_act_rad),
        Q,
        atol=1e-6,
    )
    small = {name: values if name == "time_s" else np.radians(values) for name, values in columns.items()}
    questions = guess_of(small, prediction=PREDICTION).questions
    assert [q.option for q in questions] == ["--unit angle=rad|deg"]


def test_the_clock_of_a_prediction_is_found_behind_a_long_rest():
    rest_s = np.arange(-40.0, 0.0, 0.012)
    time_s = np.concatenate([rest_s, TIME_S]) + 1.7e9
    joints = np.vstack([np.repeat(Q[:1], len(rest_s), axis=0), Q])
    frame = {"stamp": time_s, **{f"Axis{n + 1}": joints[:, n] for n in range(6)}}
    run = run_from(frame, prediction=PREDICTION)
    start = int(np.argmax(run.controller.time_s > -1e-3))
    np.testing.assert_allclose(run.controller.time_s[start : start + 50], TIME_S[:50], atol=0.02)


def test_what_a_run_before_said_is_doubted_by_the_values():
    columns = {"time": TIME_S, **{f"J{n + 1}": np.radians(Q[:, n]) for n in range(6)}}
    kept = guess_of(columns, units={"angle": "rad"}).layout()
    assert not guess_of(columns, like=kept).questions
    in_degrees = {name: values if name == "time" else np.degrees(values) for name, values in columns.items()}
    assert len(guess_of(in_degrees, like=kept).questions) == 1


@pytest.mark.parametrize(
    ("name", "column"),
    [
        ("JT1[deg]", "q1_act"),
        ("JT1_cmd[deg]", "q1_cmd"),
        ("JntCmd[1]", "q1_cmd"),  # [1] is an index, no unit
        ("/arm_controller/state/actual/positions[1]", "q1_act"),
        ("/joint_states/position/joint_1", "q1_act"),
        ("actual_joint_position_1", "q1_act"),
        ("q_des_1", "q1_cmd"),
        ("IRB_1 Joint 1 position (deg)", "q1_act"),
        ("loadJointAngle1", "q1_load"),
        ("data_set_1", ""),
        ("tcp_pos_1", ""),
        ("/joint_states/velocity/joint_1", ""),
        ("torque_joint_1", ""),
        ("target_actual_1", ""),
        ("joint_10", ""),
        ("Axis1_State", ""),
        ("State_Axis1", ""),
        ("output_1", ""),
        ("load_1", ""),
    ],
)
def test_a_joint_is_known_by_the_usual_words_in_any_order(name, column):
    assert meanings([name])[name].target == column


def test_a_count_of_rows_is_asked_for_and_another_time_goes_before_it():
    axes = {f"A{n + 1}": Q[:, n] for n in range(6)}
    count = {"time": np.arange(len(Q), dtype=float)}
    (question,) = guess_of(count | axes).questions
    assert "counts the rows" in question.text
    guess = guess_of(count | {"timestamp": TIME_S + 4000.0} | axes)
    assert [entry.name for entry in guess.entries if entry.target == "t"] == ["timestamp"]
    assert not guess.questions


def test_digits_of_a_date_are_no_milliseconds():
    axes = {f"A{n + 1}": Q[:, n] for n in range(6)}
    (question,) = guess_of({"Timestamp": 20200714163904.0 + 7.0 * np.arange(len(Q))} | axes).questions
    assert question.option == "--unit time=UNIT"


def test_four_numbers_of_length_one_are_no_joints():
    turns = {f"Q{k}": part for k, part in enumerate(QUATERNION[:, [3, 0, 1, 2]].T)}
    guess = guess_of({"t": TIME_S} | {f"{a} [mm]": P[:, k] for k, a in enumerate("XYZ")} | turns)
    assert {entry.target for entry in guess.entries} == {"t", "x", "y", "z"}
    assert set(turns) <= set(guess.left_out)


EXCEL = [f"A{k}" for k in range(1, 7)]


def sheet(rows):
    """A sheet of numbers whose first row refers to shared words, as Excel writes it."""
    words = ["Time [s]", *EXCEL]
    cells = ["".join(f'<c r="{chr(65 + k)}1" t="s"><v>{k}</v></c>' for k in range(7))]
    cells += [
        "".join(f'<c r="{chr(65 + k)}{n}"><v>{v}</v></c>' for k, v in enumerate(row)) for n, row in rows
    ]
    body = "".join(f'<row r="{n}">{row}</row>' for n, row in enumerate(cells, 1))
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as file:
        file.writestr(
            "xl/sharedStrings.xml", "<sst>" + "".join(f"<si><t>{w}</t></si>" for w in words) + "</sst>"
        )
        file.writestr("xl/worksheets/sheet1.xml", "<worksheet><sheetData/></worksheet>")
        file.writestr("xl/worksheets/sheet2.xml", f"<worksheet><sheetData>{body}</sheetData></worksheet>")
    return stream.getvalue()


def test_the_sheet_of_an_excel_file_that_is_a_table_is_read(tmp_path):
    file = tmp_path / "log.xlsx"
    file.write_bytes(sheet([(n, (t, *q)) for n, (t, q) in enumerate(zip(TIME_S, Q, strict=True), 2)]))
    run = run_from(file)
    assert guess_of(file).table.how == "Excel, sheet 2 of 2"
    np.testing.assert_allclose(np.degrees(run.controller.q_act_rad), Q, atol=1e-9)
    np.testing.assert_allclose(run.controller.time_s, TIME_S - TIME_S[0], atol=1e-9)


def test_a_structure_with_time_of_simulink_is_read(tmp_path):
    values = {"values": np.radians(Q), "label": "q", "dimensions": 6}
    file = tmp_path / "log.mat"
    scipy.io.savemat(file, {"q_meas": {"time": TIME_S[:, None], "signals": values, "blockName": "arm"}})
    run = run_from(file, units={"angle": "rad"})
    np.testing.assert_allclose(np.degrees(run.controller.q_act_rad), Q, atol=1e-9)
