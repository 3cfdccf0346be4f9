"""The cell file: partial files, errors that name the key, tool frames, the library."""

import json
import tomllib

import numpy as np
import pytest
import tomli_w

from gcode2krl import Gcode2KrlError, frames, load_cell
from gcode2krl.cell import Cell, as_toml, cell_from_resolved, cell_schema, controller_axes, library
from gcode2krl.cell.descriptions import NOT_OF_A_FILE


def _write(tmp_path, text):
    path = tmp_path / "cell.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_file_keeps_what_it_is_based_on(tmp_path, cell):
    own = load_cell(
        _write(tmp_path, "based_on = 'demonstration'\n[controller]\nk_s = 0.12\n[frames]\nspin = 30\n")
    )
    assert own.controller.k_s == 0.12
    assert own.frames.spin == 30
    assert own.controller.advance == cell.controller.advance == 3
    assert own.frames.base == cell.frames.base
    assert own.robot == cell.robot


def test_defaults_of_the_krc4(cell):
    c = cell.controller
    assert (c.k_s, c.advance, c.cycle_s, c.cdis_mm, c.acc_cp_m_s2, c.rapid_m_s, c.law) == (
        0.168,
        3,
        0.012,
        0.1,
        2.0,
        0.2,
        "averages",
    )


def test_the_default_cell_is_not_verified_and_knows_t1_to_t20(cell):
    assert cell.verified is None
    assert sorted(cell.tool) == list(range(1, 21))
    t1 = cell.tool[1]
    assert (t1.diameter_mm, t1.teeth, t1.corner_radius_mm) == (16.0, 3, 0.0)
    assert {tool.kind for tool in cell.tool.values()} == {"flat", "ball", "bull-nose"}
    assert {f"M{n}" for n in (0, 1, 2, 3, 4, 5, 7, 8, 9, 30)} <= set(cell.m_code)


def test_a_byte_order_mark_is_accepted(tmp_path):
    path = tmp_path / "cell.toml"
    path.write_bytes(b"\xef\xbb\xbf[home]\nq_deg = [0, -80, 80, 0, 10, 0]\n")
    assert load_cell(path).home.q_deg[4] == 10


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[controller]\nk_s = -1", ("controller.k_s", "-1", "greater than or equal to 0")),
        ("[controller]\nadvance = 7", ("controller.advance", "7")),
        ("[frames]\nbase = { x_m = 1 }", ("frames.base", "x_mm", "missing")),
        ("[robot]\nmodel = 'KR 9000'", ("robot.model", "KR 9000", "KR 300 R2500 ultra")),
        ("[tool.30]\nteeth = 3", ("tool.30.diameter_mm", "missing")),
        ("[tool.1]\ndiameter_mm = -4", ("tool.1.diameter_mm", "-4", "greater than 0")),
        ("[tool.1]\ndiameter_mm = 9\nteeth = 2\ntool_data = 3", ("tool.1", "axis is required")),
        ("based_on = 'demonstration'\n[tool.1]\ncorner_radius_mm = 9", ("tool.1", "half the diameter")),
        ("[frames]\nbase_data = 40", ("frames.base_data", "40", "32")),
        ("[home]\nq_deg = [0, 0]", ("home.q_deg",)),
        ("[robot.limits]\nq_deg = [[1,0],[0,1],[0,1],[0,1],[0,1],[0,1]]", ("robot.limits.q_deg", "A1")),
        ("verified = { by = '', date = 'today' }", ("verified.by", "verified.date")),
        ("[nonsense]\na = 1", ("nonsense", "no such key")),
        ("[frames\n", (":1: error:",)),
    ],
)
def test_an_error_names_file_key_found_and_allowed(tmp_path, text, words):
    path = _write(tmp_path, text)
    with pytest.raises(Gcode2KrlError) as caught:
        load_cell(path)
    assert caught.value.exit_code == 2
    assert str(path) in str(caught.value)
    for word in words:
        assert word in str(caught.value)


def test_a_missing_file_is_one_line():
    with pytest.raises(Gcode2KrlError, match="cannot read"):
        load_cell("nowhere.toml")


def test_a_longer_tool_moves_the_tip_along_its_axis(tmp_path, cell):
    own = load_cell(_write(tmp_path, "based_on = 'demonstration'\n[tool.1]\nlength_mm = 130.0\n"))
    shift = np.linalg.inv(cell.tool_matrix(1)) @ own.tool_matrix(1)
    np.testing.assert_allclose(shift[:3, 3], [0, 0, -30.0], atol=1e-9)
    np.testing.assert_allclose(shift[:3, :3], np.eye(3), atol=1e-12)


@pytest.mark.parametrize("axis", ["+x", "-x", "+y", "-y", "+z", "-z"])
def test_controller_axes_point_where_they_say(axis):
    q = controller_axes(axis)
    expected = {"x": [1, 0, 0], "y": [0, 1, 0], "z": [0, 0, 1]}[axis[1]]
    np.testing.assert_allclose(q[:3, 2], np.array(expected) * (1 if axis[0] == "+" else -1), atol=1e-12)
    assert np.linalg.det(q[:3, :3]) == pytest.approx(1.0)


def test_the_default_tool_is_that_of_the_frames_document(cell):
    tool = cell.tool_matrix(1)
    np.testing.assert_allclose(tool[:3, 3], [250, 0, 250], atol=1e-9)
    np.testing.assert_allclose(frames.abc_from_rotation(tool[:3, :3]) * 180 / np.pi, [0, -90, 0], atol=1e-9)


@pytest.mark.parametrize("kind", library.KINDS)
def test_every_model_of_the_library_is_valid_and_says_its_source(kind, tmp_path):
    for name, file in library.names(kind).items():
        data = library.read_toml(file)
        if kind == "robots":
            own = load_cell(_write(tmp_path, f"[robot]\nmodel = {name!r}\n"))
            for section in (own.robot.geometry, own.robot.limits, own.robot.speeds, own.robot.payload):
                assert section.source, (name, section)
        elif kind == "tools":
            own = load_cell(_write(tmp_path, f"[tool.50]\nmodel = {name!r}\n"))
            assert own.tool[50].source
            assert own.tool[50].length_mm
        elif kind == "controllers":
            assert data["source"]


def test_a_robot_of_ones_own_beside_the_cell(tmp_path):
    text = library.names("robots")["KR 6 R900 sixx"].read_text(encoding="utf-8")
    (tmp_path / "mine.toml").write_text(text.replace("KR 6 R900 sixx", "my robot"), encoding="utf-8")
    assert load_cell(_write(tmp_path, '[robot]\nmodel = "mine.toml"')).robot.model == "my robot"


def test_the_schema_knows_every_key_and_requires_none():
    schema = cell_schema()
    assert set(schema["properties"]) == set(Cell.model_fields) - set(NOT_OF_A_FILE)
    assert '"required"' not in json.dumps(schema)


def test_the_online_section_has_defaults_and_takes_values(tmp_path, cell):
    assert cell.online.cycle_s == 0.004
    assert cell.online.link.address == "127.0.0.1"
    text = '[online]\nmost_mm = 1.5\ncalibration = "sensor.toml"\n[online.link]\nport = 50000\n'
    own = load_cell(_write(tmp_path, text))
    assert own.online.most_mm == 1.5
    assert own.online.link.port == 50000
    assert own.online.rate_mm_s == cell.online.rate_mm_s
    assert own.online.calibration == str((tmp_path / "sensor.toml").resolve())
    again = cell_from_resolved(tomllib.loads(tomli_w.dumps(as_toml(own))), "cell")
    assert again.online == own.online


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("cycle_s = 0.005", ("online.cycle_s", "0.005", "0.004 or 0.012")),
        ("mode = 'polar'", ("online.mode", "polar", "cartesian")),
        ("most_mm = 11", ("online.most_mm", "11", "10")),
        ("step_mm = -1", ("online.step_mm", "-1", "greater than 0")),
        ("lead_s = nan", ("online.lead_s", "nan", "finite")),
        ("axis_rate_deg_s = [0, 1, 1, 1, 1, 1]", ("online.axis_rate_deg_s", "0", "above 0")),
        ("axis_most_deg = [1, 1]", ("online.axis_most_deg", "6 items")),
        ("gain = 1", ("online.gain", "no such key")),
        ("gains = { p = 'much' }", ("online.gains.p", "much")),
        ("probe = { amplitude_mm = 0.5 }", ("online.probe.amplitude_mm", "0.5", "0.2")),
        ("link = { address = 'robot' }", ("online.link.address", "robot", "IPv4")),
        ("link = { address = '1.2.3.4</IP_NUMBER>' }", ("online.link.address", "IPv4")),
        ("link = { port = 70000 }", ("online.link.port", "70000", "65535")),
        ("link = { timeout_cycles = 6 }", ("online.link.timeout_cycles", "6", "5")),
        ("link = { sensor_type = 'a b' }", ("online.link.sensor_type", "a b")),
        ("link = { t1_output = 9, ready_output = 9 }", ("online.link", "t1_output", "ready_output")),
    ],
)
def test_a_wrong_online_value_names_its_key_in_one_line(tmp_path, text, words):
    path = _write(tmp_path, f"[online]\n{text}\n")
    with pytest.raises(Gcode2KrlError) as caught:
        load_cell(path)
    assert caught.value.exit_code == 2
    assert len(caught.value.issues) == 1
    for word in (str(path), *words):
        assert word in str(caught.value)
