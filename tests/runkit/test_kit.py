"""A run kit: the same path in air, the check list, the trace, and that it is of this cell."""

import re
import tomllib
import xml.etree.ElementTree as ET
from itertools import pairwise

import numpy as np
import polars as pl
import pytest
from markupsafe import escape

from gcode2krl import load_cell, load_run, read_gcode, set_targets, write_krl
from gcode2krl.errors import NotUnderstoodError, RefusedError
from gcode2krl.krl.arcs import in_chords
from gcode2krl.krl.constructs import all_constructs
from gcode2krl.krl.read import read_krl
from gcode2krl.prediction import Prediction
from gcode2krl.runkit import make_kit
from gcode2krl.runkit.accepted import read_program
from gcode2krl.translation import Order, carry_out
from tests.cells import over_demonstration
from tests.cli.test_translate import CLEAN

PART = (
    "G21 G90 G17\nT1 M6\nS12000 M3\nM8\nG0 X0 Y0\nG0 G43 H1 Z50\nG0 Z5\nG1 Z-2 F600\nG1 X50 F1500\n"
    "G1 Y30\nG4 P0.5\nG1 X0\nG0 Z50\nM9\nM5\nT2 M6\nS8000 M3\nG0 G43 H2 X10 Y10 Z50\nG0 Z5\nG1 Z-1 F300\n"
    "G1 X30\nG0 Z50\nM5\nM30\n"
)
LIFT_MM = 100.0
NO_TURN = {"a_deg": 0.0, "b_deg": 0.0, "c_deg": 0.0}
ASSUMED = re.compile(r"^; ASSUMED, look at this in T1: (.*)$", re.MULTILINE)


@pytest.fixture
def program(run, tmp_path):
    (tmp_path / "part.nc").write_text(PART, encoding="ascii")
    run("part.nc", "-o", "PART.src", code=0)
    return tmp_path / "PART.src"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The program, the folder of its kit, and the kit."""
    folder = tmp_path_factory.mktemp("made")
    (folder / "part.nc").write_text(PART, encoding="ascii")
    attempt = carry_out(Order(folder / "part.nc", output=folder / "PART.src"))
    assert attempt.error is None
    return folder / "PART.src", folder / "kit", make_kit(folder / "PART.src", folder / "kit", load_cell())


def text_of(file):
    return file.read_text(encoding="utf-8")


def test_the_variant_in_air_is_the_same_path_100_mm_higher(made):
    program, folder, _ = made
    itself, air = read_krl(program), read_krl(folder / "PART_AIR.src")
    assert len(air.ptp) == len(itself.ptp)
    lift = air.position_mm - itself.position_mm
    home = ~np.isnan(itself.q_deg).any(axis=1)
    assert np.allclose(lift[~home], [0.0, 0.0, LIFT_MM], atol=1e-9)
    for name in ("abc_deg", "speed_mm_s", "cdis_mm", "wait_s", "ptp"):
        assert np.array_equal(getattr(air, name), getattr(itself, name), equal_nan=True), name
    assert np.array_equal(air.q_deg[home], itself.q_deg[home])


def test_it_switches_nothing_but_changes_the_tool_and_keeps_the_guard(made):
    program, folder, _ = made
    itself, air = read_krl(program), read_krl(folder / "PART_AIR.src")
    assert not [s.text for s in air.statements if re.match(r"\$(AN)?OUT\[", s.text)]
    assert [s.text for s in itself.statements if re.match(r"\$(AN)?OUT\[", s.text)]
    assert len(air.triggers.line) == 0
    tools = [[(s.motion, s.text) for s in p.statements if s.text.startswith("$TOOL=")] for p in (itself, air)]
    assert tools[0] == tools[1]
    guards = [[s.text for s in p.statements if "$TRAFONAME" in s.text] for p in (itself, air)]
    assert guards[0] == guards[1] != []
    assert any("$AXIS_ACT" in s.text for s in air.statements if s.motion == 2)


def test_the_prediction_is_that_of_the_program_in_air(made):
    _, folder, kit = made
    prediction = Prediction.load(folder / "prediction")
    air = read_krl(folder / "PART_AIR.src")
    assert prediction.motion.position_mm[:, 2].min() == pytest.approx(-2.0 + LIFT_MM, abs=0.01)
    lin = prediction.targets.position_mm[~prediction.targets.home]
    assert np.allclose(lin, air.position_mm[np.isnan(air.q_deg).all(axis=1)], atol=1e-9)
    assert kit.time_s == pytest.approx(float(prediction.motion.time_s[-1]), rel=1e-6)
    table = pl.read_csv(folder / "prediction" / "motion.csv")
    assert len(table) == len(prediction.motion)


def test_the_recording_has_its_folder(made):
    _, folder, _ = made
    head = tomllib.loads(text_of(folder / "run_air" / "run.toml"))
    assert (head["mode"], head["override_percent"]) == ("AUT", 100)
    prediction = Prediction.load(folder / "prediction")
    motion, joints = prediction.motion, prediction.joints
    columns = {"t_s": motion.time_s}
    columns |= {f"{axis}_cmd_mm": motion.position_mm[:, k] for k, axis in enumerate("xyz")}
    columns |= {f"q{k + 1}_cmd_deg": np.degrees(joints.q_rad[:, k]) for k in range(6)}
    columns |= {f"q{k + 1}_act_deg": np.degrees(joints.q_rad[:, k]) for k in range(6)}
    pl.DataFrame(columns).write_csv(folder / "run_air" / "controller.csv")
    recorded = load_run(folder / "run_air")
    assert not [issue for issue in recorded.issues if issue.severity == "error"]


def test_the_check_list_has_this_programs_values(made):
    program, folder, _ = made
    page = text_of(folder / "checklist.html")
    itself = read_krl(program)
    first = itself.position_mm[1]
    assert f"X {first[0]:.2f} Y {first[1]:.2f} Z {first[2]:.2f} mm in $BASE, a PTP from HOME" in page
    pose = next(s.text for s in itself.statements if s.motion == 2 and "($AXIS_ACT" in s.text)
    a1, a2 = (float(re.search(rf"AXIS_ACT\.A{k}-\(?(-?[\d.]+)", pose)[1]) for k in (1, 2))
    assert f"A1 {a1:.1f}°  A2 {a2:.1f}°" in page
    for statement in itself.statements:
        if statement.text.startswith(("$BASE=", "$TOOL=", "$LOAD=")):
            assert statement.text in page
    assert "M3 S12000" in page
    assert "$ANOUT[1]=0.5000; $OUT[1]=TRUE" in page
    assert "feed up to 1500, rapid 12000 mm/min" in page
    assert "A1 0.0°  A2 -90.0°  A3 90.0°" in page
    assert "http" not in page.replace("http-equiv", "")  # one file, no network


def test_the_check_list_says_what_to_look_at_in_this_program_alone(made):
    program, folder, _ = made
    page = text_of(folder / "checklist.html")
    header = ASSUMED.findall(text_of(program))
    looks = {each.look for each in all_constructs() if each.look}
    assert {look for look in looks if str(escape(look)) in page} == set(header) > set()
    assert "RSI Visual" not in page


@pytest.mark.parametrize(
    ("kss", "some"),
    [
        (
            "8.3",
            {"POSCORR 27": "LowerLimX 1", "MAP2DIGOUT 14": "DataSize 2"},
        ),
        (
            "8.7",
            {"PosCorr 27": "LowerLimX 0", "Map2DigOut 14": "DataType 1"},
        ),
    ],
)
def test_a_program_with_rsi_has_a_table_to_compare_with_rsi_visual(run, tmp_path, kss, some):
    (tmp_path / "part.nc").write_text(CLEAN, encoding="ascii")
    (tmp_path / "cell.toml").write_text(f'based_on = "demonstration"\n[controller]\nkss = "{kss}"\n')
    done = run("part.nc", "-o", "PART.src", "--cell", "cell.toml", "--online", "FLOW", code=0)
    suffix = {"8.3": ".rsi.xml", "8.7": ".rsix"}[kss]
    assert f"FLOW{suffix}" in done.out
    run("runkit", "PART.src", "--cell", "cell.toml", code=0)
    page = text_of(tmp_path / "PART_runkit" / "checklist.html")
    header = re.findall(
        r"^; ASSUMED, look at this in T1: (.*)$", text_of(tmp_path / "PART.src"), re.MULTILINE
    )
    assert len(header) > 4
    assert all(str(escape(look)) in page for look in header)
    flow = ET.fromstring((tmp_path / f"FLOW{suffix}").read_bytes())
    objects = [e for e in flow.iter() if e.tag.endswith("}RsiObject") or e.tag == "RSIObject"]
    for element in objects:
        kind = f"{element.attrib['ObjType']} {element.get('ObjTypeID') or element.get('ObjTypeId')}"
        own = [p for p in element.iter() if p.tag.endswith("Parameter")]
        stated = ", ".join(f"{p.get('Name')} {p.get('ParamID') or p.get('ParamId')}" for p in own)
        assert f"<th>{kind}</th><td>{stated}</td>" in page
    for kind, start in some.items():
        assert re.search(rf"<th>{kind}</th><td>.*\b{start}\b", page)
    assert ("ParamID</code>" in page) == (kss == "8.3")


def test_switches_are_counted_with_their_first_line(program):
    found = {switch.code: switch for switch in read_program(program, load_cell()).switches}
    assert (found["M5"].first_line, found["M5"].count) == (15, 2)
    assert found["M6 T2"].first_line == 16
    assert found["M8"].statements == ("$OUT[3]=TRUE",)


def test_tools_are_those_of_the_motions(program):
    accepted = read_program(program, load_cell())
    whole = read_krl(program)
    assert set(accepted.targets.tool.tolist()) == {1, 2}
    (change,) = [event for event in accepted.targets.events if event.values["tool"] == 2]
    assert accepted.targets.tool[change.row] == 1
    assert accepted.targets.tool[change.row + 1] == 2
    assert len(accepted.targets) == len(whole.ptp)


@pytest.mark.parametrize(
    ("other", "what"),
    [
        (
            {"frames": {"base": {"x_mm": 1501.0, "y_mm": 0.0, "z_mm": 800.0} | NO_TURN}},
            "$BASE",
        ),
        ({"home": {"q_deg": [10.0, -90.0, 90.0, 0.0, 0.0, 0.0]}}, "HOME"),
        ({"tool": {"1": {"diameter_mm": 16.0, "teeth": 3, "length_mm": 130.0}}}, "$TOOL or $LOAD"),
    ],
)
def test_a_program_of_another_cell_is_refused(program, tmp_path, other, what):
    with pytest.raises(RefusedError) as caught:
        make_kit(program, tmp_path / "kit", over_demonstration(other))
    (issue,) = caught.value.issues
    assert issue.code == "runkit-program"
    assert issue.message.startswith(what)
    assert not (tmp_path / "kit").exists()


def test_frames_by_number_are_listed_with_what_must_stand_in_the_table(run, tmp_path):
    frame = "x_mm = 1500.0, y_mm = 100.0, z_mm = 800.0, a_deg = 10.0, b_deg = 0.0, c_deg = 0.0"
    (tmp_path / "cell.toml").write_text(
        f'based_on = "demonstration"\n[frames]\nbase_data = 3\nbase = {{ {frame} }}\n', encoding="ascii"
    )
    (tmp_path / "part.nc").write_text(PART, encoding="ascii")
    assert run("part.nc", "-o", "PART.src", "--cell", "cell.toml").code == 0
    run("runkit", "PART.src", "--cell", "cell.toml", code=0)
    page = text_of(tmp_path / "PART_runkit" / "checklist.html")
    assert "BAS (#BASE,3 )" in page
    assert "BASE_DATA[3]={X 1500.000,Y 100.000,Z 800.000,A 10.0000,B 0.0000,C 0.0000}" in page


def test_a_foreign_program_is_refused(tmp_path):
    foreign = tmp_path / "X.src"
    foreign.write_text("DEF X( )\nPTP {A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}\nEND\n", encoding="ascii")
    with pytest.raises(RefusedError, match="not written by gcode2krl"):
        make_kit(foreign, tmp_path / "kit", load_cell())


def test_a_lift_out_of_reach_is_refused_and_nothing_is_left_of_the_program(program, tmp_path):
    with pytest.raises(RefusedError) as caught:
        make_kit(program, tmp_path / "kit", load_cell(), lift_mm=3000.0)
    assert {"out-of-reach", "joint-limit"} & {issue.code for issue in caught.value.issues}
    assert not (tmp_path / "kit").exists()


def test_no_lift_is_no_air(program, tmp_path):
    for lift_mm in (0.0, -5.0, float("nan")):
        with pytest.raises(NotUnderstoodError):
            make_kit(program, tmp_path / "kit", load_cell(), lift_mm=lift_mm)


def test_a_split_program_is_read_whole(run, tmp_path):
    (tmp_path / "part.nc").write_text(PART, encoding="ascii")
    lines = "".join(f"G1 X{k % 40} Y{k % 7}\n" for k in range(300))
    (tmp_path / "part.nc").write_text(PART.replace("G4 P0.5\n", lines), encoding="ascii")
    assert (
        run("part.nc", "-o", "PART.src", "--split", "files", "--max-lines", "100", "--pilot", "none").code
        == 0
    )
    make_kit(tmp_path / "PART.src", tmp_path / "kit", load_cell())
    itself, air = read_krl(tmp_path / "PART.src"), read_krl(tmp_path / "kit" / "PART_AIR.src")
    assert len(itself.file) > 3
    assert np.allclose((air.position_mm - itself.position_mm)[1:-1, 2], LIFT_MM)


def test_arcs_are_the_same_path_in_chords(tmp_path):
    """Of a program with CIRC: full circles and halves, and what is switched between them is not lost."""
    cell = over_demonstration({"controller": {"circ": True}})
    part = tmp_path / "part.nc"
    arcs = "G1 Z-2 F600\nG2 X40 Y0 I20 J0 F1500\nM8\nG3 X40 Y0 I0 J15\nM9\n"
    part.write_text(f"G21 G90 G17\nT1 M6\nS12000 M3\nG0 X0 Y0\nG0 G43 H1 Z50\nG0 Z5\n{arcs}G0 Z50\nM5\nM30\n")
    file = write_krl(set_targets(read_gcode(part, cell), cell), tmp_path / "PART.src", cell).files[0]
    make_kit(file, tmp_path / "kit", cell)
    assert len(read_krl(file).circ_rows) == 5
    air = in_chords(read_krl(tmp_path / "kit" / "PART_AIR.src"))
    cutting = np.flatnonzero(np.abs(air.position_mm[:, 2] - LIFT_MM + 2.0) < 1e-6)
    path = np.concatenate(
        [
            one + np.linspace(0, 1, 20)[:, None] * (other - one)
            for one, other in pairwise(air.position_mm[cutting, :2])
        ]
    )
    off = np.minimum(
        np.abs(np.hypot(*(path - [20.0, 0.0]).T) - 20.0), np.abs(np.hypot(*(path - [40.0, 15.0]).T) - 15.0)
    )
    assert off.max() < 0.0065
    angle = np.unwrap(np.arctan2(*(path - [40.0, 15.0])[len(path) // 2 :, ::-1].T))
    assert angle[-1] - angle[0] > 1.5 * np.pi  # around, and to the left
    assert {switch.code for switch in read_program(file, cell).switches} >= {"M8", "M9"}
    np.testing.assert_allclose(air.speed_mm_s[cutting[1:]], 25.0)
