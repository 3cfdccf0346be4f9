"""KRC traces: data sets written here, key by key, as the controller's recorder does."""

import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcode2krl.errors import NotUnderstoodError
from gcode2krl.runs import load_run, read_krc_trace
from gcode2krl.runs.diadem import read_data_set
from gcode2krl.runs.krc_trace import column_of
from tests.runs import maker

GEAR = np.array([254.0, -257.3, 264.1, 194.9, -179.9, 125.3])
ZERO = np.array([3000.0, -17000.0, 25000.0, 100.0, -7.0, 512.0])
COUPLING = np.zeros((6, 6))
COUPLING[4, 3], COUPLING[5, 3], COUPLING[5, 4] = 1.7, -1.1, -0.9


def block(**keys):
    lines = [f"{name.removeprefix('k')},{value}" for name, value in keys.items()]
    return "\n".join(["#BEGINCHANNELHEADER", *lines, "#ENDCHANNELHEADER", ""])


def data_set(folder, stem, step_s, channels, start_s=0.0, **change):
    """Write a ``.dat`` and a ``.r64``; channels: (name, unit, values, factor, offset)."""
    count = len(channels[0][2])
    raw = np.stack([(np.asarray(v) - offset) / factor for _, _, v, factor, offset in channels], axis=1)
    head = [
        "DIAEXTENDED  {@:ENGLISH",
        "#BEGINGLOBALHEADER",
        "1,WINDOWS NT",
        "101,Trace",
        "102,KR 300 R2500 ultra #1",
        "104,06.05.2024",
        "105,07:08:09",
        "112,High -> Low",
        "#ENDGLOBALHEADER",
        block(k200="Zeit", k202="s", k210="IMPLIZIT", k220=count, k240=f"{start_s:g}", k241=f"{step_s:g}"),
    ]
    for number, (name, unit, _, factor, offset) in enumerate(channels, start=1):
        keys = {
            "k200": name,
            "k202": unit,
            "k210": "EXPLIZIT",
            "k211": f"C:\\TRACE\\{stem}.r64",
            "k213": "BLOCK",
            "k214": "REAL64",
            "k220": count,
            "k221": number,
            "k240": f"{offset!r}",
            "k241": f"{factor!r}",
        }
        head.append(block(**(keys | change)))
    (folder / f"{stem}.dat").write_bytes("\r\n".join("\n".join(head).splitlines()).encode("latin-1"))
    values = b"".join(struct.pack("<d", value) for value in raw.ravel().tolist())
    (folder / f"{stem}.r64").write_bytes(values)
    return folder / f"{stem}.dat"


def recording(folder, lag_s=0.06, servo_s=0.02, motor=True, name="240506"):
    """Write a whole recording: interpolator every 12 ms, drives every 4 ms and ``lag_s`` behind it."""
    slow, fast = np.arange(0.0, 12.6, 0.012), np.arange(0.0, 12.6, 0.004)
    position, axes = maker.path(slow), maker.joints_deg(maker.path(slow))
    ipo = [(f"{axis}_CmdIpo", "mm", position[:, i], 1.0, 0.0) for i, axis in enumerate("XYZ")]
    ipo += [(f"{angle}_CmdIpo", "°", np.full(len(slow), 5.0), 1.0, 0.0) for angle in "ABC"]
    ipo += [(f"AxisPos_CmdIpo{n + 1}", "°", axes[:, n], 1.0, 0.0) for n in range(6)]
    ipo += [("AnalogOut1", "", np.zeros(len(slow)), 1.0, 0.0)]
    data_set(folder, f"{name}_KRCIpo", 0.012, ipo)
    command = maker.joints_deg(maker.path(fast - lag_s))
    actual = maker.joints_deg(maker.path(fast - lag_s - servo_s))
    for n in range(6):
        soll, ist = (motor_deg(q)[:, n] if motor else q[:, n] for q in (command, actual))
        channels = [
            ("Sollposition", "µ°", soll * 1e6, 1.0, 0.0),
            ("Istposition", "µ°", ist * 1e6, 1.0, 0.0),
            ("Iststrom", "A", np.full(len(fast), n + 0.25), 1e-3, 0.5),
            ("Istmoment", "Nm", np.full(len(fast), n + 0.5), 1.0, 0.0),
            ("Motortemperatur", "K", np.full(len(fast), 310.0), 1.0, 0.0),
        ]
        data_set(folder, f"{name}_NextGenDrive#{n + 1}", 0.004, channels)
    return slow, position, command[::3], actual[::3]


def motor_deg(q_deg):
    """Motor angles: m_n = gear_n·(q_n - sum of coupling_nk·q_k) + zero_n, the wrist being coupled."""
    return (q_deg - q_deg @ COUPLING.T) * GEAR + ZERO


def test_a_recording_becomes_a_controller_table(tmp_path):
    folder = maker.run_folder(tmp_path / "run-1")
    slow, position, command, actual = recording(folder, motor=False)
    run = load_run(folder)
    table = run.controller
    assert np.allclose(table.time_s, slow)
    assert np.abs(table.position_cmd_mm - position).max() < 1e-9
    assert np.abs(np.degrees(table.q_cmd_rad) - command).max() < 1e-9
    assert np.abs(np.degrees(table.q_act_rad) - actual).max() < 1e-9
    assert np.allclose(table.current_A, np.arange(6) + 0.25)
    assert np.allclose(table.torque_Nmm, 1000.0 * (np.arange(6) + 0.5))
    assert "AnalogOut1" in table.ignored
    assert "Motortemperatur" in table.ignored


def test_motor_angles_become_axis_angles_wrist_coupling_and_all(tmp_path):
    folder = maker.run_folder(tmp_path / "run-1")
    _, _, command, actual = recording(folder, motor=True)
    run = load_run(folder)
    servo = np.degrees(run.controller.q_act_rad - run.controller.q_cmd_rad)
    assert np.abs(servo - (actual - command)).max() < 2e-4
    assert np.abs(np.degrees(run.controller.q_cmd_rad) - command).max() < 5e-3
    words = [issue.message for issue in run.issues if issue.code == "krc-trace"]
    ratios = [float(text.split("gear ratio ")[1].split()[0]) for text in words]
    assert ratios == pytest.approx(GEAR, rel=1e-4)


def test_an_axis_that_a_wrong_drive_file_replaces_is_left_out(tmp_path):
    folder = maker.run_folder(tmp_path / "run-1")
    recording(folder)
    rng = np.random.default_rng(4)
    wrong = np.cumsum(rng.normal(size=3150))
    channels = [(name, "°", wrong * 90.0, 1.0, 0.0) for name in ("Sollposition", "Istposition")]
    data_set(folder, "240506_NextGenDrive#2", 0.004, channels)
    sheet = read_krc_trace(folder / "240506_KRCIpo.dat")
    assert "q2_act_deg" not in sheet.columns
    assert any("A2: the drive does not follow" in issue.message for issue in sheet.issues)
    assert load_run(folder).controller.joints_measured == (1, 3, 4, 5, 6)


def test_drives_alone_need_a_gear_ratio(tmp_path):
    recording(tmp_path)
    (tmp_path / "240506_KRCIpo.dat").unlink()
    path = tmp_path / "240506_NextGenDrive#1.dat"
    without = read_krc_trace(path)
    assert "q1_cmd_deg" not in without.columns
    assert any("unknown gear ratio" in issue.message for issue in without.issues)
    sheet = read_krc_trace(path, np.abs(GEAR))
    soll = motor_deg(maker.joints_deg(maker.path(sheet.columns["t_s"] - 0.06)))[:, 1]
    assert np.allclose(sheet.columns["q2_cmd_deg"], soll / abs(GEAR[1]))
    assert any("sign and zero unknown" in issue.message for issue in sheet.issues)


def test_the_lag_error_gives_the_actual_position(tmp_path):
    t = np.arange(100) * 0.004
    soll, fehler = 10.0 * np.sin(t), 0.1 * np.cos(t)
    channels = [
        ("Sollposition", "Grad", soll, 1.0, 0.0),
        ("Positionsschleppfehler", "Grad", fehler, 1.0, 0.0),
    ]
    file = data_set(tmp_path, "a_NextGenDrive#3", 0.004, channels)
    assert np.allclose(read_krc_trace(file).columns["q3_act_deg"], soll - fehler)


def test_only_one_recording_of_a_folder_is_read(tmp_path):
    folder = maker.run_folder(tmp_path / "run-1")
    recording(folder, motor=False)
    recording(folder, motor=False, name="240507")
    with pytest.raises(NotUnderstoodError, match="several files"):
        load_run(folder)
    maker.run_folder(folder, '[files]\ncontroller = "240507_KRCIpo.dat"')
    assert "240507" in load_run(folder).controller.source


@pytest.mark.parametrize(
    ("channel", "axis", "column"),
    [
        ("Sollposition", "3", "q3_cmd_deg"),
        ("Istposition A4", "", "q4_act_deg"),
        ("Istposition_5", "", "q5_act_deg"),
        ("AxisPos_CmdIpo1", "", "q1_cmd_deg"),
        ("AxisPos_Act6", "", "q6_act_deg"),
        ("X_CmdIpo", "", "x_cmd_mm"),
        ("A_CmdIpo", "", "a_cmd_deg"),
        ("Z_Act", "", "z_act_mm"),
        ("Iststrom", "2", "i2_A"),
        ("Istmoment 6", "", "tau6_Nm"),
        ("Istposition", "", ""),
        ("Motortemperatur", "1", ""),
        ("AxisVel_CmdIpo1", "", ""),
        ("DriveMotorTorq_CmdIpo1", "", ""),
        ("Sollgeschwindigkeit", "2", ""),
    ],
)
def test_channel_names(channel, axis, column):
    assert column_of(channel, axis) == column


values_of = st.lists(
    st.lists(st.floats(-1e9, 1e9), min_size=3, max_size=3), min_size=1, max_size=30
)  # rows of three channels


@settings(max_examples=60, deadline=None)
@given(
    values_of,
    st.tuples(st.floats(1e-6, 1e3), st.floats(1e-6, 1e3), st.floats(1e-6, 1e3)),
    st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(-1e3, 1e3)),
    st.floats(1e-3, 1.0),
    st.booleans(),
    st.sampled_from(["IMPLIZIT", "IMPLICIT"]),
)
def test_any_data_set_comes_back(tmp_path_factory, rows, factors, offsets, step, contiguous, word):
    folder = tmp_path_factory.mktemp("trace")
    raw = np.array(rows)
    data = raw.T if contiguous else raw
    (folder / "x.r64").write_bytes(data.astype("<f8").tobytes())
    text = ["DIAEXTENDED", "#BEGINGLOBALHEADER", "102,robot, with a comma", "#ENDGLOBALHEADER"]
    text.append(block(k200="Zeit", k202="ms", k210=word, k220=len(raw), k240="20", k241=repr(step * 1000)))
    for n in range(3):
        first = n * len(raw) + 1 if contiguous else n + 1
        text.append(
            block(
                k200=f"Größe {n}",
                k202="[mm]",
                k210="EXPLIZIT",
                k211="x.r64",
                k213="CHANNEL" if contiguous else "BLOCK",
                k214="REAL64",
                k220=len(raw),
                k221=first,
                k240=repr(offsets[n]),
                k241=repr(factors[n]),
            )
        )
    (folder / "x.dat").write_bytes("\n".join(text).encode("latin-1"))
    found = read_data_set(folder / "x.dat")
    assert found.comment == "robot, with a comma"
    assert [channel.name for channel in found.channels] == ["Größe 0", "Größe 1", "Größe 2"]
    assert {channel.unit for channel in found.channels} == {"mm"}
    assert np.allclose(found.time_s, 0.02 + step * np.arange(len(raw)), rtol=1e-12, atol=1e-15)
    for n, channel in enumerate(found.channels):
        assert np.array_equal(channel.values, raw[:, n] * factors[n] + offsets[n])


def test_a_name_that_no_file_can_have_is_refused(tmp_path):
    t = np.arange(50) * 0.004
    file = data_set(tmp_path, "c_KRCIpo", 0.004, [("X_Act", "mm", t, 1.0, 0.0)])
    file.write_text(file.read_text("latin-1").replace("C:\\TRACE\\c_KRCIpo.r64", "9" * 400), "latin-1")
    with pytest.raises(NotUnderstoodError, match="cannot read 999"):
        read_data_set(file)


def test_a_time_channel_with_values(tmp_path):
    t = np.arange(50) * 0.004
    file = data_set(
        tmp_path, "b_KRCIpo", 0.004, [("Zeit", "ms", t * 1000, 1.0, 0.0), ("X_Act", "mm", t, 1.0, 0.0)]
    )
    text = file.read_bytes().decode("latin-1")
    start = text.index("#BEGINCHANNELHEADER")
    end = text.index("#ENDCHANNELHEADER") + len("#ENDCHANNELHEADER")
    file.write_bytes((text[:start] + text[end:]).encode("latin-1"))  # without the implicit channel
    found = read_data_set(file)
    assert np.allclose(found.time_s, t)
    assert [channel.name for channel in found.channels] == ["X_Act"]


def test_a_recording_that_was_cut_off_says_so(tmp_path):
    t = np.arange(50) * 0.004
    file = data_set(tmp_path, "b_KRCIpo", 0.004, [("X_Act", "mm", t, 1.0, 0.0), ("Y_Act", "mm", t, 1.0, 0.0)])
    raw = file.with_suffix(".r64")
    raw.write_bytes(raw.read_bytes()[: 8 * 2 * 30 + 5])
    found = read_data_set(file)
    assert (len(found.time_s), len(found.channels[1].values)) == (30, 30)
    assert "50 values announced, 30 there" in found.issues[0].message


def test_an_unknown_unit_is_said(tmp_path):
    t = np.arange(50) * 0.004
    sheet = read_krc_trace(data_set(tmp_path, "b_KRCIpo", 0.004, [("X_Act", "furlong", t, 1.0, 0.0)]))
    assert "unit 'furlong', taken as mm" in sheet.issues[0].message


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"k220": "many"}, "key 220: 'many' is not a number"),
        ({"k220": "0"}, "key 220: found 0"),
        ({"k220": "1e18"}, "key 220: found 1e18"),
        ({"k220": "2.5"}, "key 220: found 2.5"),
        ({"k214": "INT16"}, "found BLOCK of INT16"),
        ({"k213": "SOMEHOW"}, "found SOMEHOW of REAL64"),
        ({"k221": "7"}, "column 7, but b_KRCIpo.r64 has 1"),
        ({"k241": "factor"}, "key 241: 'factor'"),
        ({"k240": "nan"}, "key 240: 'nan'"),
        ({"k210": "IMPLIZIT"}, "no channel with values"),
    ],
)
def test_a_broken_header_names_channel_key_and_line(tmp_path, change, words):
    t = np.arange(50) * 0.004
    file = data_set(tmp_path, "b_KRCIpo", 0.004, [("X_Act", "mm", t, 1.0, 0.0)], **change)
    with pytest.raises(NotUnderstoodError) as caught:
        read_data_set(file)
    assert words in str(caught.value)
    assert str(file) in str(caught.value)


def test_other_broken_traces(tmp_path):
    t = np.arange(50) * 0.004
    file = data_set(tmp_path, "b_KRCIpo", 0.0, [("X_Act", "mm", t, 1.0, 0.0)])
    with pytest.raises(NotUnderstoodError, match="a step of 0 s"):
        read_data_set(file)
    file = data_set(tmp_path, "b_KRCIpo", 0.004, [("AnalogOut1", "", t, 1.0, 0.0)])
    with pytest.raises(NotUnderstoodError, match="no channel is known; the trace has AnalogOut1"):
        read_krc_trace(file)
    file.with_suffix(".r64").write_bytes(np.linspace(1.0, 2.0, 50).astype(">f8").tobytes())
    with pytest.raises(NotUnderstoodError, match="no float64 in little-endian order"):
        read_data_set(file)
    file.with_suffix(".r64").unlink()
    with pytest.raises(NotUnderstoodError, match=r"cannot read b_KRCIpo\.r64 of channel AnalogOut1"):
        read_data_set(file)
    file.write_text("DIADEM", encoding="latin-1")
    with pytest.raises(NotUnderstoodError, match="the first line is not DIAEXTENDED"):
        read_data_set(file)


def test_a_file_name_in_the_header_never_leaves_the_folder(tmp_path):
    t = np.arange(50) * 0.004
    (tmp_path / "inner").mkdir()
    (tmp_path / "secret.r64").write_bytes((t + 1.0).tobytes())
    file = data_set(
        tmp_path / "inner", "b_KRCIpo", 0.004, [("X_Act", "mm", t, 1.0, 0.0)], k211="../secret.r64"
    )
    assert np.array_equal(read_data_set(file).channels[0].values, t)
