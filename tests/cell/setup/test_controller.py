"""A controller's archive: what its data lists mean, and that nothing hostile gets further than one line."""

import contextlib
import io
import tomllib
import zipfile

import pytest

from gcode2krl import load_cell
from gcode2krl.cell.setup import controller
from gcode2krl.cell.setup.answers import completed
from gcode2krl.cell.setup.cell_text import text_of_cell
from gcode2krl.cell.setup.controller import (
    ArchivedController,
    ExternalData,
    controller_of,
    krl_values,
    read_controller,
)
from gcode2krl.errors import NotUnderstoodError
from tests.cell.setup.synthetic_archive import config_dat, machine_dat, write_folder, write_zip
from tests.conftest import ROOT

CELLS = ROOT / "examples" / "cells"


@pytest.fixture
def hanging():
    return load_cell(CELLS / "upside_down.toml")


def test_a_data_list_is_read_as_krl_writes_it():
    text = (
        "&REL 11\r\nDEFDAT  $CONFIG\r\nE6AXIS XHOME={E6AXIS: A1 -70.0000,A2 -115.000} ; old form\r\n"
        'TOOL_NAME[1,]="Spindle ; not a comment"\r\nBASE_TYPE[ 1 ]=#BASE\r\n'
        "LOAD_DATA[1]={M 40.3,CM {X -20.2,Y 6.4,Z 1.0E+2},J {X 5.25}}\r\n"
        "$seq_cal[1]='B0001'\r\nBOOL STOPM=FALSE\r\nINT I[20]\r\n;TOOL_DATA[9]={X 1.0}\r\nBROKEN={X 1.0\r\n"
    )
    assert krl_values(text) == {
        "XHOME": {"A1": -70.0, "A2": -115.0},
        "TOOL_NAME[1,]": "Spindle ; not a comment",
        "BASE_TYPE[1]": "#BASE",
        "LOAD_DATA[1]": {"M": 40.3, "CM": {"X": -20.2, "Y": 6.4, "Z": 100.0}, "J": {"X": 5.25}},
        "$SEQ_CAL[1]": "'B0001'",
        "STOPM": False,
    }


@pytest.mark.parametrize("write", [write_folder, write_zip])
def test_robot_frames_load_home_and_mounting_are_read(tmp_path, hanging, write):
    tools = [(2, "Spindle", [250.0, 0.0, 250.0, 0.0, -90.0, 0.0])]
    bases = [(1, "Tisch", hanging.frames.base), (7, "Ständer", [10.5, 0, 0, 0, 0, 0])]
    config = config_dat(hanging, tools, bases, [(2, hanging.load)])
    found = read_controller(write(tmp_path / "archive", config, machine_dat(hanging, external_axes=1)))
    assert (found.model, found.trafo_name) == ("KR 60 HA", "KR60 C4 FLR ZH02")
    assert found.kss == ("8.3" if write is write_zip else "")  # the folder has no am.ini
    geometry = hanging.robot.geometry
    assert found.lengths_mm == tuple(geometry.array())
    assert found.limits_deg == hanging.robot.limits.q_deg
    assert found.speeds_deg_s == pytest.approx(hanging.robot.speeds.qd_deg_s, abs=0.05)
    assert found.gear_ratio == pytest.approx([1798 / 7] * 6)
    assert found.robroot == (0.0, 0.0, 2600.0, 0.0, 0.0, 180.0)
    assert found.home_deg == hanging.home.q_deg
    assert [(one.number, one.name, one.frame) for one in found.tools] == [
        (2, "Spindle", (250.0, 0.0, 250.0, 0.0, -90.0, 0.0))
    ]
    assert [(one.number, one.name, one.frame[0]) for one in found.bases] == [
        (1, "Tisch", 1400.0),
        (7, "Ständer", 10.5),
    ]
    assert (found.loads[2].mass_kg, found.loads[2].centre_mm) == (24.0, (0.0, 0.0, 140.0))
    assert [(one.number, one.is_linear, one.limits, one.home) for one in found.externals] == [
        (1, None, None, 0.0)
    ]


@pytest.mark.parametrize(
    ("stated", "answer", "written"),
    [("8.6", None, "8.6"), ("", None, ""), ("8.6", "8.7", "8.7"), ("8.6", "unknown", ""), ("", "8.5", "8.5")],
)
def test_the_system_software_is_that_of_the_archive_unless_it_is_answered(stated, answer, written):
    controller = ArchivedController(source="", kss=stated)
    text = text_of_cell(
        completed({} if answer is None else {"kss": answer}, controller), controller, "s.json"
    )
    assert tomllib.loads(text).get("controller", {}).get("kss", "") == written


def test_external_axes_are_those_behind_the_sixth(hanging):
    values = krl_values(machine_dat(hanging, external_axes=2)) | {
        **{"$AXIS_TYPE[7]": 1.0, "$SOFTN_END[7]": -200.0, "$SOFTP_END[7]": 5200.0},
        **{"$AXIS_TYPE[8]": 5.0, "$VEL_AXIS_MA[8]": 3000.0, "$RAT_MOT_AX[8]": {"N": 450.0, "D": 1.0}},
        "XHOME": {"A1": 0.0, "E1": 150.0, "E2": -90.0},
    }
    rail, table = controller_of(values, "").externals
    assert rail == ExternalData(1, True, (-200.0, 5200.0), None, 150.0)
    assert table == ExternalData(2, False, None, 40.0, -90.0)
    text = text_of_cell({"robot": "KR 60 HA"}, controller_of(values, ""), "s.json")
    loaded = tomllib.loads(text)
    assert "external" not in loaded
    block = "\n".join(line[2:] for line in text.splitlines() if line.startswith("# "))
    start = block.index("[external.E1]")
    described = tomllib.loads(block[start : block.index("acceleration", start)].replace("speed =", "#"))
    assert described["external"]["E1"]["limits"] == [-200.0, 5200.0]


def test_a_robot_is_named_only_where_its_lengths_agree(hanging):
    values = krl_values(machine_dat(hanging))
    assert controller_of(values, "").model == "KR 60 HA"
    longer = values | {"$LENGTH_B": values["$LENGTH_B"] + 200.0}  # KR 60 L30 HA, say
    assert controller_of(longer, "").model == ""
    twisted = values | {"$DH_4": {"DHART_A": 10.0, "DHART_D": 0.0}}
    assert controller_of(twisted, "").lengths_mm is None


def test_robots_of_one_name_are_told_apart_by_the_name_of_the_machine():
    """``KR210R2700`` is in the name of three robots of the library, two of which have equal lengths."""
    cell = load_cell(CELLS / "change_by_hand.toml")
    values = krl_values(machine_dat(cell)) | krl_values(config_dat(cell, machine_name="KR 210 R2700-2"))
    assert controller_of(values, "").model == "KR 210 R2700-2"


def test_what_moves_or_stands_in_the_room_is_no_tool_and_no_base(hanging):
    six = [1.0, 2.0, 3.0, 0.0, 0.0, 0.0]
    values = krl_values(config_dat(hanging, [(1, "fixed", six)], [(1, "table", six), (2, "positioner", six)]))
    values |= {"TOOL_TYPE[1]": "#TCP", "MACHINE_FRAME_DAT[2]": {"PARENT": "DKP400"}}
    found = controller_of(values, "")
    assert found.tools == ()
    assert [one.number for one in found.bases] == [1]


def test_an_inertia_about_turned_axes_is_left_out():
    entry = {"M": 40.0, "CM": dict(zip("XYZABC", [1.0, 2.0, 3.0, 90.0, 0.0, 0.0], strict=True))}
    equal, other = {"X": 5.0, "Y": 5.0, "Z": 5.0}, {"X": 5.0, "Y": 4.0, "Z": 5.0}
    found = [
        controller_of({"LOAD_DATA[1]": entry | {"J": j}}, "").loads[1].inertia_kgm2 for j in (equal, other)
    ]
    assert found == [(5.0, 5.0, 5.0), None]


# --- hostile and damaged archives ------------------------------------------------------------------------


def refusal(path):
    with pytest.raises(NotUnderstoodError) as caught:
        read_controller(path)
    assert [issue.code for issue in caught.value.issues] == ["archive"]
    return str(caught.value)


def zipped(path, **members):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in members.items():
            file.writestr(name, content)
    return path


def test_what_is_no_archive_is_one_line(tmp_path):
    assert "cannot read" in refusal(tmp_path / "missing.zip")
    (tmp_path / "text.zip").write_text("hello", encoding="ascii")
    assert "neither a folder nor a zip" in refusal(tmp_path / "text.zip")
    (tmp_path / "empty").mkdir()
    assert "no $config.dat" in refusal(tmp_path / "empty")
    assert "no $config.dat" in refusal(zipped(tmp_path / "other.zip", **{"a.dat": "X=1"}))


def test_a_damaged_zip_is_one_line(tmp_path, hanging):
    whole = write_zip(tmp_path / "a.zip", config_dat(hanging), machine_dat(hanging)).read_bytes()
    for at in range(0, len(whole), 97):
        damaged = whole[:at] + bytes([whole[at] ^ 0x55]) + whole[at + 1 :]
        (tmp_path / "b.zip").write_bytes(damaged)
        with contextlib.suppress(NotUnderstoodError):  # nothing else may come out
            read_controller(tmp_path / "b.zip")
    (tmp_path / "b.zip").write_bytes(whole[: len(whole) // 2])
    refusal(tmp_path / "b.zip")


@pytest.mark.slow
def test_a_bomb_is_read_no_further_than_the_limit(tmp_path):
    bomb = zipped(
        tmp_path / "bomb.zip", **{"KRC/R1/System/$config.dat": b" " * (200 * controller.MOST_BYTES)}
    )
    assert bomb.stat().st_size < controller.MOST_BYTES
    assert "not a data list" in refusal(bomb)


def test_too_many_files_are_refused_before_they_are_listed(tmp_path, monkeypatch):
    monkeypatch.setattr(controller, "MOST_DIRECTORY_BYTES", 1000)
    many = zipped(tmp_path / "many.zip", **{f"file_{k}.dat": "" for k in range(100)})
    monkeypatch.setattr(controller.zipfile, "ZipFile", None)
    assert "more than" in refusal(many)


def test_a_path_that_leads_out_writes_nothing(tmp_path, hanging):
    inside = tmp_path / "inside"
    inside.mkdir()
    path = zipped(inside / "a.zip", **{"../../KRC/R1/System/$config.dat": config_dat(hanging)})
    assert read_controller(path).home_deg == hanging.home.q_deg
    assert [file.name for file in tmp_path.rglob("*")] == ["inside", "a.zip"]


def test_two_robots_in_one_archive_are_refused(tmp_path, hanging):
    for robot in ("one", "two"):
        text = config_dat(hanging, [(1, robot, [1.0] * 6)])
        write_folder(tmp_path / robot, text, machine_dat(hanging))
    assert "several $config.dat that differ" in refusal(tmp_path)
    assert read_controller(tmp_path / "two").tools[0].name == "two"


def test_an_encrypted_member_is_one_line(tmp_path):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as file:
        file.writestr("$config.dat", "XHOME={A1 0.0}")
    data = bytearray(buffer.getvalue())
    data[6] |= 1  # the flag in the local header and in the directory
    data[data.index(b"PK\x01\x02") + 8] |= 1
    (tmp_path / "locked.zip").write_bytes(bytes(data))
    assert "password" in refusal(tmp_path / "locked.zip")
