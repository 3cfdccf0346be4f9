"""RSI logs: telegrams one a line, concatenated and broken, and the CSV of their elements."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcode2krl.errors import NotUnderstoodError
from gcode2krl.runs import load_run, read_rsi_log
from gcode2krl.runs.rsi_log import is_rsi_log
from tests.runs import maker

START = 4208163634


def attributes(values, names):
    return " ".join(f'{name}="{value:.4f}"' for name, value in zip(names, values, strict=True))


def robot(ipoc, position, command, actual, delay=0):
    position = position[:3]
    pose, joints = ("X", "Y", "Z", "A", "B", "C"), [f"A{n}" for n in range(1, 7)]
    return (
        f'<Rob Type="KUKA"><RIst {attributes([*(position + 0.5), 1, 2, 3], pose)}/>'
        f"<RSol {attributes([*position, 1, 2, 3], pose)} /><AIPos {attributes(actual, joints)}/>"
        f'<ASPos {attributes(command, joints)}/><Delay D="{delay}"/>'
        f"<MACur {attributes(np.arange(6) + 0.5, joints)}/><DiL>0</DiL><IPOC>{ipoc}</IPOC></Rob>"
    )


def answer(ipoc, x, y=0.0):
    return (
        f'<Sen Type="ImFree"><EStr>ok</EStr><RKorr X="{x:.4f}" Y="{y:.4f}" Z="0" A="0" B="0" C="0.01"/>'
        + (f"<IPOC>{ipoc}</IPOC></Sen>")
    )


def log(cycle_ms=4, count=600):
    t = np.arange(count) * cycle_ms / 1000.0
    position, command = maker.path(t), maker.joints_deg(maker.path(t))
    actual = maker.joints_deg(maker.path(t - 0.02))
    ipoc = START + cycle_ms * np.arange(count)
    lines = [robot(*row) for row in zip(ipoc.tolist(), position, command, actual, strict=True)]
    return t, position, command, actual, ipoc.tolist(), lines


def refused(file):
    with pytest.raises(NotUnderstoodError) as caught:
        read_rsi_log(file)
    assert str(file) in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize(
    ("cycle_ms", "joiner"), [(4, "\n"), (12, "\r\n"), (4, ""), (12, "\n2024-05-06 07:08:09 < ")]
)
def test_a_log_becomes_a_controller_table(tmp_path, cycle_ms, joiner):
    folder = maker.run_folder(tmp_path / "run-1")
    t, position, command, actual, _, lines = log(cycle_ms)
    (folder / "rsi.log").write_text(joiner.join(lines), encoding="utf-8", newline="")
    run = load_run(folder)
    table = run.controller
    assert np.allclose(table.time_s, t, atol=1e-12)
    assert np.abs(table.position_cmd_mm - position).max() < 6e-5
    assert np.abs(table.position_act_mm - position - 0.5).max() < 6e-5
    assert np.abs(np.degrees(table.q_cmd_rad) - command).max() < 6e-5
    assert np.abs(np.degrees(table.q_act_rad) - actual).max() < 6e-5
    assert np.allclose(np.degrees(table.abc_cmd_rad), [1, 2, 3])
    assert np.allclose(table.current_A, np.arange(6) + 0.5)
    assert table.correction_mm is None


def test_corrections_stay_beside_the_commands(tmp_path):
    folder = maker.run_folder(tmp_path / "run-1")
    _, _, _, _, ipoc, lines = log()
    text = [
        part for i, line in zip(ipoc, lines, strict=True) for part in (line, answer(i, 1e-3 * (i - START)))
    ]
    del text[201]  # an answer that came too late
    (folder / "rsi.log").write_text("\n".join(text), encoding="utf-8")
    run = load_run(folder)
    assert any("a correction was on (up to 2.4 mm" in issue.message for issue in run.issues)
    table = run.controller
    wanted = 1e-3 * (np.array(ipoc) - START)
    late = np.arange(len(ipoc)) == 100
    assert np.allclose(table.correction_mm[~late, 0], wanted[~late])
    assert np.isnan(table.correction_mm[late]).all()
    assert np.allclose(np.degrees(table.correction_rad[~late, 2]), 0.01)
    assert table.dropped_rows == 0
    assert len(table) == len(ipoc)


def test_a_controller_table_goes_before_a_log(tmp_path):
    folder = maker.run_folder(tmp_path / "run-1", "", controller=maker.controller())
    (folder / "rsi.log").write_text("\n".join(log()[-1]), encoding="utf-8")
    run = load_run(folder)
    assert run.controller.source.endswith("controller.csv")
    assert [i.message for i in run.issues if i.code == "run-files"] == [
        "rsi.log: not read, controller.csv is"
    ]


def test_broken_telegrams_are_dropped_and_counted(tmp_path):
    _, _, _, _, _, lines = log()
    lines[10] = lines[10][:120]
    lines[20] = lines[20].replace('X="', 'X="?', 1)
    lines[30] = lines[30].replace("<IPOC>", "<IPO>")
    lines[40] = lines[39]
    lines[50] = '<Rob Type="KUKA"><garbage/></Rob>'
    file = tmp_path / "rsi.log"
    file.write_text("\n".join(lines), encoding="utf-8")
    sheet = read_rsi_log(file)
    assert sheet.rows() == len(lines) - 5
    assert "4 telegrams malformed, 1 duplicated" in sheet.issues[0].message
    folder = maker.run_folder(tmp_path / "run-1")
    (folder / "rsi.log").write_text("\n".join(lines), encoding="utf-8")
    assert load_run(folder).controller.segments[:, 0].tolist() == [0, 10, 19, 28, 37, 46]


def test_late_answers_are_said(tmp_path):
    _, position, command, actual, ipoc, lines = log()
    lines[-1] = robot(ipoc[-1], position[-1], command[-1], actual[-1], delay=3)
    (tmp_path / "rsi.log").write_text("\n".join(lines), encoding="utf-8")
    assert any("Delay rises to 3" in issue.message for issue in read_rsi_log(tmp_path / "rsi.log").issues)


def test_entities_and_nesting_are_not_looked_at(tmp_path):
    _, _, _, _, _, lines = log(count=20)
    bomb = '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;">]>'
    file = tmp_path / "rsi.log"
    file.write_text(bomb + "\n".join(lines), encoding="utf-8")
    assert read_rsi_log(file).rows() == 20
    file.write_text(lines[0] + "<Rob " + 'a="1" ' * 400000 + "/>", encoding="utf-8")
    assert read_rsi_log(file).rows() == 1
    file.write_text("<Rob >" * 200000, encoding="utf-8")
    assert "no telegram can be read (200000 malformed)" in refused(file)


def test_sessions_in_one_log(tmp_path):
    _, _, _, _, _, lines = log()
    file = tmp_path / "rsi.log"
    file.write_text("\n".join(lines[300:] + lines[:300]), encoding="utf-8")
    assert "telegram 301: IPOC goes from" in refused(file)
    file.write_text("\n".join([*lines[:300], robot(START + 10**7, *np.zeros((3, 6)))]), "utf-8")
    assert "several sessions" in refused(file)


@pytest.mark.parametrize("style", ["{}_{}", "Receive.{}.{}", "rob/{}/{}", "{} {}"])
def test_the_csv_form(tmp_path, style):
    t, position, command, actual, ipoc, _ = log(12)
    columns = {"Timestamp": [f"{second:.3f} o'clock" for second in t], style.format("Rob", "IPOC"): ipoc}
    for i, axis in enumerate("XYZ"):
        columns[style.format("RSol", axis)] = position[:, i]
        columns[style.format("RKorr", axis)] = np.full(len(t), 0.25)
    for n in range(6):
        columns[style.format("AIPos", f"A{n + 1}")] = actual[:, n]
        columns[style.format("ASPos", f"A{n + 1}")] = command[:, n]
    folder = maker.run_folder(tmp_path / "run-1")
    maker.write(folder, "rsi.csv", columns)
    table = load_run(folder).controller
    assert np.allclose(table.time_s, t, atol=1e-9)
    assert np.array_equal(table.position_cmd_mm, position)
    assert np.allclose(np.degrees(table.q_act_rad), actual)
    assert np.allclose(table.correction_mm, 0.25)
    assert table.ignored == ("Timestamp",)


def test_a_controller_table_is_no_rsi_log(tmp_path):
    assert not is_rsi_log(maker.write(tmp_path, "controller.csv", maker.controller()))
    assert not is_rsi_log(tmp_path / "nothing.csv")


def test_no_telegrams(tmp_path):
    file = tmp_path / "rsi.log"
    file.write_text("nothing here\n", encoding="utf-8")
    assert "no IPOC with RIst" in refused(file)
    assert "cannot read" in refused(tmp_path / "none.log")


@settings(max_examples=80, deadline=None)
@given(st.lists(st.floats(-1e5, 1e5), min_size=6, max_size=6), st.integers(0, 10**15), st.booleans())
def test_any_telegram_comes_back(tmp_path_factory, values, ipoc, spaced):
    names = [f"A{n}" for n in range(1, 7)]
    gap = "\n  " if spaced else " "
    inner = gap.join(
        f'{name} = "{value!r}"' if spaced else f'{name}="{value!r}"'
        for name, value in zip(names, values, strict=True)
    )
    file = tmp_path_factory.mktemp("rsi") / "rsi.log"
    file.write_text(
        f'<Rob TYPE="KUKA">{gap}<AIPos{gap}{inner}/>{gap}<IPOC>{ipoc}</IPOC></Rob>', encoding="utf-8"
    )
    columns = read_rsi_log(file).columns
    assert [columns[f"q{n}_act_deg"][0] for n in range(1, 7)] == values
    assert columns["t_s"].tolist() == [0.0]
