"""No value comes silently from another cell; half pairs and double meanings are errors."""

import json

import pytest

from gcode2krl import load_cell
from gcode2krl.cell import Cell, as_toml, cell_from_resolved, resolve_cell
from gcode2krl.cell.sections import Controller
from gcode2krl.errors import NotUnderstoodError, RefusedError
from tests.cells import OWN_CELL, over_demonstration, signed
from tests.krl.conftest import Made

PART = "G21 G90 G54\nT1 M6\nG43 H1\nS8000 M3\nG0 X0 Y0\nG0 Z20\nG1 Z-1 F600\nG1 X20\nG0 Z50\nM5\nM30\n"


def own(**changes) -> dict:
    return OWN_CELL | changes


def text_of(made: Made) -> str:
    return made.src.read_text("ascii")


def write(path, text):
    path.write_text(text, encoding="utf-8")
    return path


def codes(error) -> set[str]:
    return {issue.code for issue in error.value.issues}


# --- what is missing -----------------------------------------------------------------------------------


def test_a_cell_without_a_base_takes_nothing(tmp_path):
    cell = load_cell(write(tmp_path / "cell.toml", "[tool.1]\ndiameter_mm = 10.0\nteeth = 2\n"))
    assert cell.taken_over == ()
    assert list(cell.tool) == [1]
    assert (cell.frames.base, cell.frames.tool, cell.home.q_deg, cell.load.mass_kg) == (None,) * 4
    assert cell.spindle.run_cw_output is None
    assert cell.material is None
    assert cell.robot.model == ""
    assert set(cell.m_code) == {"M0", "M1", "M2", "M30"}
    assert cell.compliance.virtual_joints == {}


@pytest.mark.parametrize(
    ("dropped", "key"),
    [
        ("robot", "robot.model"),
        ("home", "home.q_deg"),
        ("load", "load.mass_kg"),
        ("spindle", "spindle.max_rpm"),
    ],
)
def test_what_the_program_needs_and_the_cell_lacks_is_named(tmp_path, dropped, key):
    data = {name: value for name, value in own().items() if name != dropped}
    with pytest.raises(RefusedError) as error:
        Made(tmp_path, PART, data=data)
    assert "cell-missing" in codes(error)
    assert any(key in issue.message and key in issue.remedy for issue in error.value.issues)
    assert not list(tmp_path.glob("*.src"))


@pytest.mark.parametrize("key", ["base", "tool", "tool_length_mm"])
def test_a_missing_frame_is_named(tmp_path, key):
    frames = {name: value for name, value in OWN_CELL["frames"].items() if name != key}
    with pytest.raises(RefusedError, match=rf"frames\.{key}"):
        Made(tmp_path, PART, data=own(frames=frames))


def test_a_missing_output_of_a_used_template_is_named(tmp_path):
    spindle = {name: value for name, value in OWN_CELL["spindle"].items() if name != "run_cw_output"}
    with pytest.raises(RefusedError, match=r"spindle\.run_cw_output"):
        Made(tmp_path, PART, data=own(spindle=spindle))


def test_no_tool_of_another_cell(tmp_path):
    """T5 of the demonstration was 20 mm too long in a cell that names only T1."""
    data = own(tool={"1": OWN_CELL["tool"]["1"]})
    with pytest.raises(RefusedError, match="T5 is not in the cell"):
        Made(tmp_path, PART.replace("T1 M6\nG43 H1", "T5 M6\nG43 H5"), data=data)


def test_a_complete_cell_is_enough_and_verified_covers_it(tmp_path):
    made = Made(tmp_path, PART, data=signed(own()))
    text = text_of(made)
    assert "cell verified by A. Person" in text
    assert "HAS NOT BEEN VERIFIED" not in text
    assert "taken over" not in text


# --- values taken over by name -------------------------------------------------------------------------


def test_every_value_taken_over_is_in_the_header(tmp_path):
    made = Made(tmp_path, PART, data={"controller": {"cdis_mm": 0.2}})
    text = " ".join(line.lstrip("; ") for line in text_of(made).replace("\r", "").split("\n"))
    assert made.cell.taken_over
    for taken in made.cell.taken_over:
        assert f"{taken.key} = " in text, taken.key
        assert taken.source == "demonstration"
    assert "load.mass_kg = 120" in text
    assert "controller.cdis_mm = " not in text


def test_verified_does_not_cover_what_is_taken_over(tmp_path):
    text = text_of(Made(tmp_path, PART, data=signed({"based_on": "demonstration"})))
    assert "HAS NOT BEEN VERIFIED" in text
    assert "\nHALT" in text.replace("\r", "")


def test_a_base_that_is_verified_does_not_confirm_another_cell(tmp_path):
    import tomli_w

    base = {key: value for key, value in signed(own()).items() if key != "based_on"}
    write(tmp_path / "base.toml", tomli_w.dumps(base))
    assert load_cell(tmp_path / "base.toml").is_confirmed
    child = signed({"based_on": "base.toml", "clearance": {"z_mm": 120}}, beside=tmp_path)
    cell = load_cell(write(tmp_path / "cell.toml", tomli_w.dumps(child)))
    assert all(taken.verified and taken.source == "base.toml" for taken in cell.taken_over)
    assert cell.unconfirmed == ()
    assert not cell.is_confirmed
    write(tmp_path / "base.toml", tomli_w.dumps(base | {"home": {"q_deg": [0, -90, 90, 0, 1, 0]}}))
    cell = load_cell(tmp_path / "cell.toml")
    assert [one.key for one in cell.unconfirmed] == ["home.q_deg"]
    assert not any(taken.verified for taken in cell.taken_over)


def test_a_base_of_a_base_keeps_its_name(tmp_path):
    write(tmp_path / "middle.toml", 'based_on = "demonstration"\n[load]\nmass_kg = 90\n')
    cell = load_cell(
        write(tmp_path / "cell.toml", 'based_on = "middle.toml"\n[home]\nq_deg=[0,-80,80,0,9,0]\n')
    )
    sources = {taken.key: taken.source for taken in cell.taken_over}
    assert sources["load.mass_kg"] == "middle.toml"
    assert sources["frames.base"] == "demonstration"
    assert "home.q_deg" not in sources


@pytest.mark.parametrize("name", ["cell.toml", "nowhere.toml", "somebody", "."])
def test_a_base_that_is_none_is_one_line(tmp_path, name):
    path = write(tmp_path / "cell.toml", f'based_on = "{name}"\n')
    with pytest.raises(NotUnderstoodError) as error:
        load_cell(path)
    assert codes(error) == {"cell-base"}
    assert len(error.value.issues) == 1


def test_two_cells_based_on_each_other(tmp_path):
    write(tmp_path / "a.toml", 'based_on = "b.toml"\n')
    write(tmp_path / "b.toml", 'based_on = "a.toml"\n')
    with pytest.raises(NotUnderstoodError, match="is based on itself"):
        load_cell(tmp_path / "a.toml")


def test_a_tool_with_a_cutter_of_its_own_keeps_nothing_of_the_base():
    tool = over_demonstration({"tool": {"1": {"diameter_mm": 10.0, "teeth": 2}}}).tool[1]
    assert (tool.model, tool.length_mm, tool.flute_length_mm) == ("", None, None)


def test_a_changed_model_says_so():
    cell = resolve_cell({"tool": {"1": {"model": "flat 16 z3", "diameter_mm": 10.0}}})
    assert cell.tool[1].model == "flat 16 z3 (changed)"
    assert (
        resolve_cell({"tool": {"1": {"model": "flat 16 z3", "length_mm": 90.0}}}).tool[1].model
        == "flat 16 z3"
    )


def test_another_robot_keeps_nothing_of_the_base_arm():
    base = {"robot": {"model": "KR 300 R2500 ultra", "limits": {"q_deg": [[-100, 100]] * 6}}}
    cell = over_demonstration({"robot": {"model": "KR 120 R2500 pro"}})
    assert cell.robot.limits.q_deg != over_demonstration(base).robot.limits.q_deg
    assert set(cell.compliance.virtual_joints) == {"sensor", "spindle"}


def test_a_resolved_cell_comes_back_with_what_it_took_over():
    import tomllib

    import tomli_w

    cell = over_demonstration({"clearance": {"z_mm": 50}})
    again = cell_from_resolved(tomllib.loads(tomli_w.dumps(as_toml(cell))), "cell")
    assert again.taken_over == cell.taken_over
    assert again.defaults == cell.defaults


@pytest.mark.parametrize("key", ["taken_over", "defaults"])
def test_a_file_cannot_state_what_the_reader_writes(key):
    with pytest.raises(NotUnderstoodError, match=f"{key}: there is no such key"):
        resolve_cell({key: []})


# --- halves and double meanings ------------------------------------------------------------------------

WHOLE = {"x_mm": 1.0, "y_mm": 2.0, "z_mm": 3.0, "a_deg": 0.0, "b_deg": 0.0, "c_deg": 0.0}


@pytest.mark.parametrize("lacking", WHOLE)
@pytest.mark.parametrize("where", ["base", "tool", "offset", "of a tool"])
@pytest.mark.parametrize("base", ["", "demonstration"])
def test_a_partial_frame_is_an_error(lacking, where, base):
    part = {key: value for key, value in WHOLE.items() if key != lacking}
    data = {
        "base": {"frames": {"base": part}},
        "tool": {"frames": {"tool": part}},
        "offset": {"work_offsets": {"G55": part}},
        "of a tool": {"tool": {"1": {"diameter_mm": 9.0, "teeth": 2, "frame": part}}},
    }[where]
    with pytest.raises(NotUnderstoodError, match=f"{lacking} missing"):
        resolve_cell({"based_on": base, **data})


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ({"frames": {"base_data": 3}}, "base_data without base"),
        (
            {"tool": {"1": {"diameter_mm": 9.0, "teeth": 2, "tool_data": 3, "axis": "+x"}}},
            "tool_data without frame",
        ),
        ({"m_code": {"M3": "$OUT[7]=TRUE"}}, r"m_code\.M3 without m_code\.M5"),
        ({"m_code": {"M4": "$OUT[7]=TRUE"}}, r"m_code\.M4 without m_code\.M5"),
        ({"m_code": {"M7": "$OUT[7]=TRUE"}}, r"m_code\.M7 without m_code\.M9"),
        ({"m_code": {"M8": "$OUT[7]=TRUE"}}, r"m_code\.M8 without m_code\.M9"),
        ({"m_code": {"M3": "$OUT[7]=TRUE", "M5": ""}}, r"m_code\.M5 is empty"),
        ({"m_code": {"M3": "$OUT[7]=TRUE", "M5": "; off"}}, r"m_code\.M5 is empty"),
        ({"m_code": {"M3": "$OUT[7]=TRUE", "M5": "$OUT[8]=FALSE"}}, r"\$OUT\[7\], which m_code\.M5 does not"),
        ({"m_code": {"M3": "SPIN=TRUE", "M5": "$OUT[8]=FALSE"}}, "SPIN, which m_code.M5 does not"),
        ({"m_code": {"M8": "$OUT[7]=TRUE", "M9": "$OUT[7]=FALSE\n$OUT[7]=TRUE"}}, r"m_code\.M9 does not"),
        (
            {"m_code": {"M8": "$OUT[7]=TRUE", "M9": "IF $IN[1] THEN\n$OUT[7]=FALSE\nENDIF"}},
            r"m_code\.M9 does not",
        ),
        ({"spindle": {"run_cw_output": 3, "flood_output": 3}}, r"\$OUT\[3\] has two meanings"),
        ({"spindle": {"run_cw_output": 3, "run_ccw_output": 3}}, r"\$OUT\[3\] has two meanings"),
        (
            {
                "m_code": {
                    "M3": "$OUT[7]=TRUE",
                    "M5": "$OUT[7]=FALSE",
                    "M8": "$OUT[7]=TRUE",
                    "M9": "$OUT[7]=FALSE",
                }
            },
            r"\$OUT\[7\] has two meanings",
        ),
        (
            {"m_code": {"M3": "$OUT[7]=TRUE", "M5": "$OUT[7]=FALSE"}, "tool_change": "$OUT[7]=TRUE"},
            r"\$OUT\[7\] has two meanings",
        ),
        (
            {"spindle": {"run_cw_output": 993}, "online": {"link": {"t1_output": 993}}},
            r"\$OUT\[993\] has two meanings",
        ),
        (
            {"spindle": {"at_speed_input": 5}, "guard_inputs": [{"number": 5, "meaning": "door"}]},
            r"\$IN\[5\] has two meanings",
        ),
        ({"mounted_tool": 4}, r"mounted_tool: found 4"),
        ({"tool": {"01": {"diameter_mm": 9.0, "teeth": 2}}}, r"tool\.01: not a tool number"),
        ({"m_code": {"M08": "$OUT[7]=TRUE"}}, "M08"),
        ({"m_code": {"m8": "$OUT[7]=TRUE"}}, "m8"),
    ],
)
def test_halves_and_double_meanings(data, words):
    with pytest.raises(NotUnderstoodError, match=words) as error:
        resolve_cell(data)
    assert len(error.value.issues) == 1, error.value


def test_own_m8_over_the_demonstrations_m9_is_refused():
    with pytest.raises(NotUnderstoodError, match=r"m_code\.M8 switches on \$OUT\[40\], which m_code\.M9"):
        over_demonstration({"m_code": {"M8": "$OUT[40]=TRUE"}})


def test_one_valve_for_flood_and_mist_is_a_plain_machine():
    resolve_cell({"spindle": {"flood_output": 3, "mist_output": 3}})


@pytest.mark.parametrize("is_signed", [False, True])
def test_a_load_without_a_centre_and_a_length_of_the_library_are_said(tmp_path, is_signed):
    data = own(load={"mass_kg": 60})
    data = signed(data) if is_signed else data
    found = {issue.code for issue in Made(tmp_path, PART, data=data).targets.issues}
    assert "load-centre" in found
    assert ("tool-length-library" in found) == is_signed


@pytest.mark.parametrize(
    ("section", "key"),
    [
        ("name", None),
        ("robot", "model"),
        ("pilot", "hash_variable"),
        ("robot", "trafo_name"),
        ("program", "externals"),
    ],
)
def test_no_text_of_the_cell_begins_a_line_of_its_own(section, key):
    evil = "x\n$BASE=$NULLFRAME\n"
    value = {key: [evil] if key == "externals" else evil} if key else evil
    if section == "robot" and key == "model":
        value = {"model": "", "geometry": {}, "note": ""} | {"trafo_name": evil}
    with pytest.raises(NotUnderstoodError):
        resolve_cell({section: value})


@pytest.mark.parametrize("variable", ["$BASE", "$OUT[1]", "$VEL.CP", "$OV_PRO", "GK_MSG"])
def test_the_pilot_writes_into_no_variable_of_the_planner(variable):
    with pytest.raises(NotUnderstoodError, match=r"pilot\.index_variable"):
        resolve_cell({"pilot": {"index_variable": variable}})


def test_the_defaults_are_those_of_the_krc4_and_are_listed():
    cell = load_cell()
    krc4 = {key: value for key, value in Controller().model_dump().items() if key not in ("source", "sure")}
    assert krc4 == cell.controller.model_dump(exclude={"source", "sure"})
    empty = resolve_cell({})
    assert {f"controller.{key}" for key, value in krc4.items() if value is not None} - {
        "controller.model"
    } <= set(empty.defaults)


# --- the command ---------------------------------------------------------------------------------------


def test_models_check_lists_what_is_switched_missing_and_taken_over(run, tmp_path):
    write(
        tmp_path / "cell.toml",
        'based_on = "demonstration"\n[m_code]\nM8 = "$OUT[40]=TRUE"\nM9 = "$OUT[40]=FALSE\\n$OUT[4]=FALSE"\n',
    )
    found = json.loads(run("models", "check", "cell.toml", "--json").out)
    rows = {row["what"]: row["value"] for row in found["confirm"]}
    assert rows["M8"] == "switches $OUT[40] on"
    assert rows["M5"] == "switches $OUT[1] off, $OUT[2] off"
    assert not any("$OUT[3]" in value for value in rows.values())
    taken = {row["key"]: row["source"] for row in found["taken_over"]}
    assert taken["load.mass_kg"] == "demonstration"
    assert "m_code.M8" not in taken
    write(tmp_path / "own.toml", "[tool.1]\ndiameter_mm = 10.0\nteeth = 2\n")
    done = run("models", "check", "own.toml", code=0)
    for key in ("robot.model", "frames.base", "home.q_deg", "load.mass_kg", "tool.1.length_mm", "m_code.M5"):
        assert f"MISSING: {key}" in done.out


@pytest.mark.parametrize(("command", "out"), [("translate", "out.src"), ("predict", "out")])
def test_a_cell_that_lacks_values_is_refused_with_code_1(run, tmp_path, command, out):
    write(tmp_path / "part.nc", PART)
    write(tmp_path / "cell.toml", "[tool.1]\ndiameter_mm = 10.0\nteeth = 2\nlength_mm = 80.0\n")
    assert "frames.base" in run(command, "part.nc", "--cell", "cell.toml", "-o", out, code=1).err
    assert not (tmp_path / "out.src").exists()


def test_g_code_is_read_in_a_cell_that_says_nothing_of_the_arm(tmp_path):
    from gcode2krl import read_gcode

    cell = load_cell(
        write(tmp_path / "cell.toml", "[tool.1]\ndiameter_mm = 10.0\nteeth = 2\nlength_mm = 80.0\n")
    )
    assert isinstance(cell, Cell)
    assert len(read_gcode(write(tmp_path / "part.nc", PART), cell)) > 3


def test_a_missing_tool_length_is_told_once_with_its_line(run, tmp_path):
    write(tmp_path / "cell.toml", 'based_on = "demonstration"\n[tool.30]\ndiameter_mm = 12\nteeth = 3\n')
    write(tmp_path / "part.nc", "G21 G90\nT30 M6\nS9000 M3\nG0 G43 H30 X0 Y0 Z30\nG1 X20 F1500\nM30\n")
    done = run("translate", "part.nc", "--cell", "cell.toml", "-o", "part.src")
    (told,) = (line for line in done.err.splitlines() if "length" in line)
    assert told.startswith("part.nc:2: error: T30 has no length and no frame in the cell [tool-unknown] -> ")
    assert done.code == 1
    assert "follows from these: tool-undeclared 1" in done.err
